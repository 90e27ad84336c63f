"""Overlapping pulses at the incident gauge, separated by a second station on the bar."""

from dataclasses import replace
from math import isfinite

from kolsky.bars.audit import AuditLog
from kolsky.bars.guides.separation import SeparatedWaves, separate
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import BarSignal, FaceWaves, Signal, Windows
from kolsky.bars.reduction.faces import sampled_from
from kolsky.bars.reduction.windows import averaging_time, incident_arrival, travel_time, usable_limits
from kolsky.base.arrays import FloatArray


def overlapping_windows(
    incident: BarSignal, far: BarSignal, transmission: BarSignal, *, tension: bool = False
) -> Windows:
    """Windows that do not end where the reflected wave meets the incident one.

    They last until the reflected wave returns from the far end of the incident bar, the transmitted one from
    that of its bar, or a record ends.

    Parameters
    ----------
    incident, far
        The two stations of the incident bar, the first one nearer to the specimen.
    transmission
        The station of the transmission bar.
    tension
        Whether the incident pulse is one of tension.

    Raises
    ------
    ValueError
        If `far` is not farther from the specimen, there is no pulse, or nothing of the records is left.
    """
    if far.position <= incident.position:
        raise ValueError(
            f"the second station, {far.position:g} m from the specimen, must be farther than the first, "
            f"{incident.position:g} m; exchange them"
        )
    arrival = incident_arrival(incident, tension=tension)
    first = min(arrival.time, arrival.onset) - 2.0 * averaging_time(incident)
    reflected = 2.0 * travel_time(incident)
    transmitted = travel_time(incident) + travel_time(transmission)
    ends = [limit.time for limit in usable_limits(incident, transmission)[1:]]
    ends += [
        incident.strain.end - arrival.time - reflected,
        far.strain.end - arrival.time - travel_time(far) - travel_time(incident),
        transmission.strain.end - arrival.time - transmitted,
    ]
    length = min(end for end in ends if isfinite(end))
    if not length > 0.0:
        raise ValueError("the records end before the reflected wave has passed; cure: longer records")

    def window(shift: float) -> tuple[float, float]:
        return first + shift, arrival.time + length + shift

    return Windows(window(0.0), window(reflected), window(transmitted), source="separation")


def separated(
    faces: FaceWaves, incident: BarSignal, far: BarSignal, guide: Waveguide, log: AuditLog
) -> FaceWaves:
    """The incident and the reflected wave by both stations instead of by windows.

    Parameters
    ----------
    faces
        The waves by windows, which overlap: gives the clock and the transmitted wave.
    incident, far
        The two stations of the incident bar.
    guide
        The bar.
    log
        Takes what changes.

    Raises
    ------
    ValueError
        As `kolsky.bars.guides.separation.separate`.
    """
    start = faces.origin + float(faces.time[0])
    interval, count = incident.strain.interval, faces.time.size
    found: SeparatedWaves = separate([incident, far], guide, end=start + (count + 8) * interval)

    def wave(name: str) -> Signal:
        history = getattr(found, name)
        return Signal(float(found.time[0]), interval, history.value, float(history.sigma.max()), "1", name)

    toward, away = wave("toward"), wave("away")
    apart = found.singular[0] if found.singular.size else float("inf")

    def chosen(name: str, signal: Signal) -> FloatArray:
        return log.choose(
            f"separation, {name} wave",
            "separation",
            getattr(faces, name),
            sampled_from(signal, start, count),
            unit="1",
            reason=(
                f"stations {1e3 * (far.position - incident.position):.4g} mm apart, alike at multiples of "
                f"{1e-3 * apart:.4g} kHz, noise {found.noise_gain:.3g} times that of a gauge at the end"
            ),
        )

    first, second = chosen("incident", toward), chosen("reflected", away)
    if not log.switches["separation"]:
        return faces
    sigma = {**faces.sigma, "incident": toward.sigma, "reflected": away.sigma}
    return replace(faces, incident=first, reflected=second, sigma=sigma, white=sigma)
