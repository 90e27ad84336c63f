"""Time windows of the three pulses at the gauges, from travel times."""

from dataclasses import dataclass
from math import inf, isfinite

from kolsky.bars.records import BarSignal, Windows
from kolsky.bars.reduction.inputs import WavesInput
from kolsky.bars.signals.arrival import Arrival, find_arrival
from kolsky.bars.signals.first_rise import first_rise

TAIL = 0.25
"""Share of the incident pulse's duration by which the windows outlast it."""

OTHER_SIGN = 0.2
"""Share of the incident pulse's level above which an earlier pulse of the other sign is not noise."""


@dataclass(frozen=True)
class Limit:
    """End of the time in which a gauge shows one pulse alone."""

    time: float
    """Time after the arrival of its pulse at the gauge [s]."""
    reason: str
    """The wave that ends it, in words."""


def incident_arrival(incident: BarSignal, *, tension: bool = False) -> Arrival:
    """Arrival of the incident pulse at its gauge.

    Raises
    ------
    ValueError
        If there is none of the declared sign, or one of the other sign comes first.
    """
    sign, average = -1 if tension else 1, averaging_time(incident)
    arrival = find_arrival(incident.strain, sign=sign, average=average)
    try:
        other = find_arrival(incident.strain, sign=-sign, average=average, before=arrival.onset)
    except ValueError:
        return arrival  # nothing of the other sign before it: as it should be
    if abs(other.level) < OTHER_SIGN * abs(arrival.level):
        return arrival
    declared, found = ("tension", "compression") if tension else ("compression", "tension")
    raise ValueError(
        f"{incident.strain.name}: a pulse of {found} comes first, at {other.time:.6g} s ({other.level:.3g}), "
        f"before that of {declared} at {arrival.time:.6g} s, and the shot is declared one of {declared}. "
        "Cure: check the kind of test and the channel's declared sign"
    )


def averaging_time(signal: BarSignal) -> float:
    """Travel time of a wave across the bar's diameter [s]: the resolution of one-dimensional theory."""
    return signal.bar.diameter / signal.bar.wave_speed


def find_windows(
    incident: BarSignal,
    transmission: BarSignal,
    *,
    tension: bool = False,
    transit: float = 0.0,
    tail: float = TAIL,
    manual: Windows | None = None,
    ends: tuple[Limit, ...] | None = None,
) -> Windows:
    """Windows of the incident, reflected and transmitted pulse.

    The incident pulse is found by its arrival t_i. The others follow by travel times from the gauges'
    distances x and the bars' wave speeds c0, Eqs. (R.1) and (R.2) of the theory page:

        t_r = t_i + 2 x_i / c_i,    t_t = t_i + x_i / c_i + x_t / c_t + transit.

    All windows are equally long: from two diameters' travel before the arrival until `tail` times the
    incident pulse's duration after its end, or until the first `usable_limits` of any of them.

    Parameters
    ----------
    incident, transmission
        The strains at the two stations, on one clock.
    tension
        Whether the incident pulse is one of tension, as the shot declares it.
    transit
        Time a wave needs through the specimen [s], >= 0. With 0 the transmitted window starts where a wave
        would arrive without a specimen, which is never too late.
    tail
        Share of the pulse's duration by which the windows outlast it, >= 0.
    manual
        Windows given by hand: they are checked against the records and returned.
    ends
        Ends of the windows in place of `usable_limits`, where echoes are taken off.

    Returns
    -------
    Windows
        With the source "travel times", or "shot file" for `manual`.

    Raises
    ------
    ValueError
        If there is no incident pulse of the declared sign, if it overlaps with the reflected one at the
        gauge, or if a window leaves its record.
    """
    if manual is not None:
        return _checked(manual, incident, transmission)
    if not (transit >= 0.0 and tail >= 0.0):
        raise ValueError(f"transit = {transit} s and tail = {tail} must be >= 0")
    _check_sides(incident, transmission)
    arrival = incident_arrival(incident, tension=tension)
    usable = usable_limits(incident, transmission)
    limits = usable if ends is None else ends
    duration = arrival.end - arrival.time
    apart = usable[0]
    if duration > apart.time:
        found = f"{duration:.4g} s long" if isfinite(duration) else "not over before the record ends"
        raise ValueError(
            f"{incident.strain.name}: the incident pulse is {found}, and the reflected one arrives at the "
            f"gauge {apart.time:.4g} s after it: they overlap. It must be shorter than 2 x / c0. Cure: a "
            "second gauge on the bar and wave separation, a gauge farther from the specimen, or a shorter "
            "striker"
        )
    lead = 2.0 * averaging_time(incident)
    reflected = arrival.time + 2.0 * travel_time(incident)
    transmitted = arrival.time + travel_time(incident) + travel_time(transmission) + transit
    for signal, at in ((incident, reflected), (transmission, transmitted)):
        left = signal.strain.end - at
        if left < duration:
            raise ValueError(
                f"{signal.strain.name}: the record ends {left:.4g} s after its pulse should arrive, at "
                f"{at:.6g} s, and the incident pulse lasts {duration:.4g} s. Cure: a longer record, check "
                "wave speed and distance, or windows by hand"
            )
    longest = min(
        min(limit.time for limit in limits),
        incident.strain.end - reflected,
        transmission.strain.end - transmitted,
    )
    start = min(arrival.time, arrival.onset) - lead - arrival.time
    length = min((1.0 + tail) * duration, longest)

    def window(at: float) -> tuple[float, float]:
        return at + start, at + length

    windows = Windows(window(arrival.time), window(reflected), window(transmitted), source="travel times")
    return _checked(windows, incident, transmission)


def travel_time(signal: BarSignal) -> float:
    """Travel time of a wave between the gauge and the specimen [s]."""
    return signal.position / signal.bar.wave_speed


def usable_limits(incident: BarSignal, transmission: BarSignal) -> tuple[Limit, Limit, Limit]:
    """Times at which another wave reaches a gauge, from the arrival of its pulse there.

    Returns
    -------
    tuple of Limit
        The reflected wave at the incident gauge, the reflected wave's return from the far end of the
        incident bar, and the transmitted wave's return from the far end of the transmission bar, Eq. (R.3).
        Each is early by one diameter's travel, for what runs ahead of a dispersed pulse's foot.
    """
    margin = max(averaging_time(incident), averaging_time(transmission))

    def far_end(signal: BarSignal) -> float:
        return 2.0 * (signal.bar.length - signal.position) / signal.bar.wave_speed - margin

    return (
        Limit(2.0 * travel_time(incident) - margin, "the reflected wave reaches the incident gauge"),
        Limit(far_end(incident), "the reflected wave returns from the far end of the incident bar"),
        Limit(far_end(transmission), "the transmitted wave returns from the far end of the transmission bar"),
    )


def check_baselines(
    given: WavesInput, incident: BarSignal, transmission: BarSignal, *, tension: bool = False
) -> None:
    """Refuse baselines that end after their gauge's first pulse has begun.

    Raises
    ------
    ValueError
        With the baseline's end and the arrival of the pulse.
    """
    average, sign = averaging_time(incident), -1 if tension else 1
    rise = first_rise(incident.strain, sign=sign, average=average)
    begins = incident_arrival(incident, tension=tension).time if rise is None else rise.time
    arrivals = {
        "incident": begins,
        "transmission": begins + travel_time(incident) + travel_time(transmission),
    }
    for side, begin in arrivals.items():
        last = given.stations[side].baseline[1]
        if last > begin:
            raise ValueError(
                f"{side} gauge: the baseline ends at {last:.6g} s, after the pulse arrives there at "
                f"{begin:.6g} s, so that it is no rest. Cure: end the baseline before {begin:.6g} s"
            )


def _check_sides(incident: BarSignal, transmission: BarSignal) -> None:
    for signal, side in ((incident, "incident"), (transmission, "transmission")):
        if signal.side != side:
            raise ValueError(
                f"{signal.strain.name} is of the {signal.side} bar, it must be of the {side} bar"
            )
        if not 0.0 < signal.position < signal.bar.length:
            raise ValueError(
                f"{signal.strain.name}: its distance to the specimen = {signal.position} m must lie between "
                f"0 and the bar's length, {signal.bar.length} m"
            )


def _checked(windows: Windows, incident: BarSignal, transmission: BarSignal) -> Windows:
    """The windows, if each is in order and inside its record."""
    for name, (first, last), record in (
        ("incident", windows.incident, incident.strain),
        ("reflected", windows.reflected, incident.strain),
        ("transmitted", windows.transmitted, transmission.strain),
    ):
        if not -inf < first < last < inf:
            raise ValueError(f"the {name} window [{first}, {last}] s must end after it begins")
        if first < record.start or last > record.end:
            raise ValueError(
                f"the {name} window [{first:.6g}, {last:.6g}] s leaves the record of {record.name}, "
                f"[{record.start:.6g}, {record.end:.6g}] s. Cure: a longer record, or windows by hand"
            )
    if windows.reflected[0] < windows.incident[0]:
        raise ValueError(
            f"the reflected window begins at {windows.reflected[0]:.6g} s, before the incident one "
            f"({windows.incident[0]:.6g} s)"
        )
    return windows
