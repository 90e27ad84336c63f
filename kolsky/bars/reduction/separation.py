"""Waves at the specimen: propagation of pulses to the bar's face, and separation of overlapping waves.

Opposed gauges that were recorded in separate files are resampled to one clock first. With several gauges on
one bar, a small linear system at each frequency gives the waves in both directions. With one gauge per bar,
the echo from the free end is predicted and subtracted.

The method follows Zhao and Gary (1997) and Bacon (1999). Every gauge is weighted by its noise (Bussac and
others 2002). Numbers of equations are those of docs/theory/bars.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, inf, isfinite, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from dic.basics import check_interval
from kolsky.bars.audit import AuditLog
from kolsky.bars.guides.propagation import edge_filter, fade_ends, propagation
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import LARGEST_JITTER, BarSignal, FaceWaves, History, Signal, Windows, uniform_clock
from kolsky.bars.reduction.windows import Limit, averaging_time, incident_arrival, travel_time, usable_limits
from kolsky.base.arrays import ComplexArray, FloatArray
from kolsky.base.records import Recording

BAND = 2.0
"""omega a / c0 up to which waves are kept under dispersion. A second mode propagates above about 2.3."""
_GUARD = 256
"""Number of samples on either side of a window that an interpolation uses."""


def face_waves(
    incident: BarSignal,
    transmission: BarSignal,
    windows: Windows,
    *,
    guides: tuple[Waveguide, Waveguide] | None = None,
    band: float | None = None,
    arrival: float | None = None,
    delays: tuple[float, float] = (0.0, 0.0),
    apart: tuple[BarSignal, BarSignal, BarSignal] | None = None,
) -> FaceWaves:
    """The three waves at the specimen's faces.

    The incident wave is propagated forward by its gauge's distance, the other waves backward by theirs, Eq.
    (R.4). The guides give dispersion and attenuation. Without guides, a wave is only moved in time, by x /
    c0. Fractions of a sample are then interpolated as for a band-limited signal. This changes neither its
    energy nor its noise.

    ``incident``, ``transmission``: the strains at the two stations, on one clock, with equal sampling
    intervals. ``windows``: time windows of the waves at the gauges. The shortest determines the length of the
    result. ``guides``: the incident and the transmission bar as waveguides; None neglects dispersion.
    ``band``: frequency up to which waves are propagated [Hz], inf for all. Default: the lower `BAND` of the
    bars. Above it, a gauge measures several modes at once, and noise would be propagated like a wave of the
    first mode. ``arrival``: arrival of the incident wave at its gauge [s]. The corresponding time at the face
    is time 0 of the result. Default: the beginning of the incident window. ``delays``: delays of the
    reflected and the transmitted wave at their gauges relative to the travel times [s], for waves aligned by
    their arrivals. ``apart``: the separated incident, reflected and transmitted wave at their gauges, if
    available. The windows then only select the part to use.
    """
    check_interval("(0, inf] Hz", band=inf if band is None else band)
    interval = incident.strain.interval
    if abs(transmission.strain.interval / interval - 1.0) > 1e-9:
        raise ValueError(
            f"the sampling intervals of {incident.strain.name}, {interval:.9g} s, and of "
            f"{transmission.strain.name}, {transmission.strain.interval:.9g} s, must be equal. Cure: "
            "resample one of the recordings"
        )
    pairs = (windows.incident, windows.reflected, windows.transmitted)
    count = int(min(last - first for first, last in pairs) / interval + 1e-6) + 1
    if count < 4:
        raise ValueError(f"the shortest window holds {count} samples; at least 4 are needed")
    first = windows.incident[0]
    reflected = first + 2.0 * travel_time(incident)
    transmitted = first + travel_time(incident) + travel_time(transmission)
    reflected, transmitted = reflected + delays[0], transmitted + delays[1]
    zero = first if arrival is None else arrival
    stations = (incident, incident, transmission) if apart is None else apart
    wide = _widened(pairs, incident, transmission)
    if apart is not None:
        wide = tuple((s.strain.start, s.strain.end) for s in apart)
    pairs_of = zip(
        stations,
        (first, reflected, transmitted),
        wide,
        (incident.position, -incident.position, -transmission.position),
        (None, None, None) if guides is None else (guides[0], guides[0], guides[1]),
        strict=True,
    )
    limit = inf if guides is None else min(largest_band(s) for s in stations) if band is None else band
    waves = [_at_face(s, start, pair, count, way, guide, limit) for s, start, pair, way, guide in pairs_of]
    names = ("incident", "reflected", "transmitted")
    return FaceWaves(
        time=np.asarray(first - zero + interval * np.arange(count), dtype=np.float64),
        incident=waves[0].value,
        reflected=waves[1].value,
        transmitted=waves[2].value,
        sigma={name: wave.sigma for name, wave in zip(names, waves, strict=True)},
        incident_bar=incident.bar,
        transmission_bar=transmission.bar,
        origin=zero + travel_time(incident),
        white={name: s.strain.sigma * sqrt(s.strain.memory) for name, s in zip(names, stations, strict=True)},
        band=limit,
    )


def _widened(
    pairs: tuple[tuple[float, float], ...], incident: BarSignal, transmission: BarSignal
) -> tuple[tuple[float, float], ...]:
    """Windows extended, up to the next wave, so that dispersion spreads no cut edge into them."""
    before = (incident.strain.start, pairs[1][0], transmission.strain.start)
    widened = []
    for (begin, end), start, limit, signal in zip(
        pairs, before, usable_limits(incident, transmission), (incident, incident, transmission), strict=True
    ):
        clean = min(begin + limit.time, signal.strain.end)
        widened.append((start, max(end, (clean + 0.1 * start) / 1.1)))
    return tuple(widened)


def largest_band(signal: BarSignal) -> float:
    """Frequency up to which waves of a bar are kept under dispersion [Hz]."""
    return BAND * signal.bar.wave_speed / (pi * signal.bar.diameter)


def _at_face(
    signal: BarSignal,
    start: float,
    window: tuple[float, float],
    count: int,
    distance: float,
    guide: Waveguide | None,
    band: float,
) -> Signal:
    """`count` samples of one wave at the face. The first belongs to the time `start` at the gauge."""
    strain = signal.strain
    if guide is None:
        return replace(strain, value=sampled_from(strain, start, count))
    travelled = start + distance / signal.bar.wave_speed
    return propagation(
        strain, guide, distance, window=window, band=band, start=travelled, samples=count
    ).signal


def sampled_from(signal: Signal, start: float, count: int) -> FloatArray:
    """A signal's values at ``start + k * interval`` [s], band-limited between its samples, shape [count].

    A fraction of a sample is applied as a phase shift in the Fourier transform of the samples. Before this,
    the line through their ends is subtracted, and `GUARD` samples are added on both sides.
    """
    place = (start - signal.start) / signal.interval
    whole = round(place)
    fraction = place - whole
    if abs(fraction) < 1e-6:
        fraction = 0.0
    if whole < 0 or whole + count > signal.value.size:
        raise ValueError(
            f"{signal.name}: {count} samples from {start:.6g} s leave the record, "
            f"[{signal.start:.6g}, {signal.end:.6g}] s. Cure: a longer record, or shorter windows"
        )
    if fraction == 0.0:
        return signal.value[whole : whole + count].copy()
    low, high = max(0, whole - _GUARD), min(signal.value.size, whole + count + _GUARD)
    part = signal.value[low:high]
    line = np.linspace(part[0], part[-1], part.size)
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(part.size) * fraction)
    slope = (part[-1] - part[0]) / (part.size - 1)
    moved = np.fft.irfft(np.fft.rfft(part - line) * turn, part.size) + line + fraction * slope
    return moved[whole - low : whole - low + count]


LEAST = 50
"""Smallest number of samples that two recordings must have in common."""


def on_one_clock(recordings: Sequence[Recording], offsets: Sequence[float]) -> tuple[Recording, ...]:
    """Recordings of one station at the times of the first.

    They cover the time that all recordings have in common.

    Recordings with the same time base do not change. Those of another recorder are interpolated as
    band-limited signals. This changes neither energy nor noise.

    ``recordings``: one for each channel, each on its recorder's clock. ``offsets``: shot's clock minus
    recorder's clock of each [s]. Raises ValueError if the intervals differ, or if the recordings have too few
    samples in common. Returns: all on the clock of the first recorder.
    """
    first = recordings[0]
    start, interval = uniform_clock(first)
    signals = []
    for r, offset in zip(recordings, offsets, strict=True):
        begin, step = uniform_clock(r)
        signals.append(Signal(begin + (offset - offsets[0]), step, r.value, 0.0, r.unit, r.channel))
    for other, signal in zip(recordings[1:], signals[1:], strict=True):
        if abs(signal.interval / interval - 1.0) * first.time.size > LARGEST_JITTER:
            raise ValueError(
                f"opposed gauges {first.channel} ({first.path.name}) and {other.channel} ({other.path.name}) "
                f"are sampled every {interval:.9g} s and every {signal.interval:.9g} s. Cure: record them "
                "with one rate, or state the interval of the file whose clock is off"
            )
    low = max(int(np.ceil((s.start - start) / interval - 1e-6)) for s in signals)
    high = min(int(np.floor((s.end - start) / interval + 1e-6)) for s in signals)
    count = high - low + 1
    if count < LEAST:
        spans = ", ".join(f"{s.start:.6g} to {s.end:.6g} s" for s in signals)
        raise ValueError(
            f"the opposed gauges' records have {max(count, 0)} samples in common ({spans}), need {LEAST}. "
            "Cure: correct the recorders' clock_offset"
        )
    time: FloatArray = start + interval * np.arange(low, high + 1, dtype=np.float64)
    begin = start + low * interval
    return tuple(
        replace(recording, time=time, value=sampled_from(signal, begin, count))
        for recording, signal in zip(recordings, signals, strict=True)
    )


PADDING = 4
"""Length of the transform divided by that of the record."""
_WRAPPED = 1e-7
"""Part of a wave that wraps around the transform, under the exponential window [-]."""
LARGEST_CONDITION = 1e6
"""Ratio of singular values of the gauges' matrix above which two stations are not independent."""


@dataclass(frozen=True)
class SeparatedWaves:
    """The waves at the specimen's face of one bar."""

    time: FloatArray
    """Times at the face on the shot's clock [s], shape [n]. They end when a wave at the face has not yet
    reached a gauge."""
    toward: History
    """Strain of the wave toward the specimen, compression positive [-]."""
    away: History
    """Strain of the wave from the specimen [-]."""
    singular: FloatArray
    """Frequencies at which the gauges cannot distinguish the two waves [Hz]. They are zero and, with two
    gauges, all frequencies at which half-waves fit between them. Noise at these frequencies grows with the
    square root of time, because only the quiet start separates the waves."""
    noise_gain: float
    """Largest sigma of `toward` and `away`, divided by that of the quietest gauge [-]."""
    misfit: tuple[float, ...]
    """Root mean square of measured minus computed strain at each gauge, over its sigma [-]. With more than
    two gauges, it shows an error of one."""


def separate(
    gauges: Sequence[BarSignal], waveguide: Waveguide, *, band: float | None = None, end: float | None = None
) -> SeparatedWaves:
    """Separate the two waves of a bar by two or more gauges, Eqs. (B.12) to (B.15).

    Both waves must be absent when the records begin. An exponential window makes use of this quiet start. The
    equations are solved at frequencies with a small negative imaginary part, where no frequency is singular.
    The window is removed at the end. For two gauges, the result equals that of the iteration in time: each
    wave follows from the other, one travel time earlier. It depends on no constant.

    ``gauges``: stations of one bar with the same sampling. Their records may start at different times.
    ``waveguide``: the bar. ``band``: frequency at which the waves end [Hz], by a half-cosine edge. ``end``:
    last time at the face [s]. Returns: with sigmas that grow in time. Raises ValueError if there are fewer
    than two stations, if two are at the same place or on different bars, or if records differ in sampling or
    do not overlap.
    """
    check_interval("(0, inf] Hz", band=inf if band is None else band)
    check_interval("(-inf, inf] s", end=inf if end is None else end)
    interval, begin, values, sigma, memory = _common(gauges)
    position = np.array([gauge.position for gauge in gauges])
    n = values.shape[1]
    far, near = float(position.max()), float(position.min())
    # With two gauges, the near gauge gives the returning wave. With more gauges, every record contributes.
    known = begin + interval * (n - 1) - (near if len(gauges) == 2 else far) / waveguide.wave_speed
    last = known if end is None else min(end, known)
    if last <= begin:
        raise ValueError(
            "the records end before a wave at the specimen has reached a gauge. Cure: longer records"
        )

    # Zeros up to the pad represent the quiet start: times before the record, when no wave had arrived.
    lead = int(np.ceil(far / waveguide.wave_speed / interval)) + 64
    length = next_fast_len(PADDING * (n + lead), real=True)
    decay = -log(_WRAPPED) / (length * interval)
    falling = np.exp(-decay * interval * (np.arange(length) - lead))
    frequency = rfftfreq(length, interval)
    limit = np.inf if band is None else band
    kept = frequency <= limit
    omega = 2.0 * pi * frequency[kept] - 1j * decay
    k = waveguide.wavenumber(omega)
    weight = 1.0 / np.where(sigma > 0.0, sigma, 1.0) if (sigma > 0.0).all() else np.ones(sigma.size)
    matrix = np.exp(1j * k[:, None, None] * position[:, None] * np.array([1.0, -1.0]))  # Eq. (B.12)
    inverse = np.linalg.pinv(weight[:, None] * matrix, rcond=1.0 / LARGEST_CONDITION) * weight
    edge = edge_filter(frequency[kept], limit)

    data = np.array([fade_ends(value, lead, length, fade=max(64, n // 4), rising=False) for value in values])
    spectra = rfft(data * falling, axis=1)[:, kept]
    count = int(np.floor((last - begin) / interval)) + 1
    slow = frequency[kept] * memory[:, None] <= 0.5 / interval  # where there is noise: even up to there
    waves = []
    for row in range(2):
        response = edge * inverse[:, row, :].T  # of each gauge, shape [j, f]
        value = _back((response * spectra).sum(axis=0), kept, length) / falling
        noise = _noise(_back(response * slow, kept, length), decay * interval, sigma * memory**0.5, n, count)
        waves.append(History(value[lead : lead + count], noise, "1"))
    there = np.einsum("fjw,wf->jf", matrix, np.einsum("fwj,jf->wf", inverse, spectra) * edge)
    seen = _back(there, kept, length)[:, lead : lead + n] / falling[lead : lead + n]
    misfit = np.sqrt(np.mean((seen - values)[:, :count] ** 2, axis=1)) * weight
    largest = max(float(wave.sigma.max()) for wave in waves)
    return SeparatedWaves(
        time=np.asarray(begin + interval * np.arange(count), dtype=np.float64),
        toward=waves[0],
        away=waves[1],
        singular=_singular(waveguide, far - near, min(limit, 0.5 / interval), len(gauges)),
        noise_gain=largest / float(sigma.min()) if sigma.min() > 0.0 else 0.0,
        misfit=tuple(misfit.tolist()),
    )


def _common(gauges: Sequence[BarSignal]) -> tuple[float, float, FloatArray, FloatArray, FloatArray]:
    """Interval, first time, strains over the common span, sigmas and memories of the gauges' noise."""
    if len(gauges) < 2:
        raise ValueError(f"wave separation needs two gauges or more on a bar, got {len(gauges)}")
    if len({gauge.bar for gauge in gauges}) > 1:
        raise ValueError("gauges of different bars cannot be separated together")
    check_interval("[0, inf) m", position=[gauge.position for gauge in gauges])
    first = gauges[0].strain
    places = sorted(gauge.position for gauge in gauges)
    closest = min(b - a for a, b in pairwise(places))
    if closest * 10.0 < gauges[0].bar.wave_speed * first.interval:
        raise ValueError(
            f"two gauges are {closest:g} m apart; they must be farther apart than a tenth of the way of a "
            "wave between two samples. Cure: correct their positions, or average them as one station"
        )
    for gauge in gauges:
        if abs(gauge.strain.interval / first.interval - 1.0) > 1e-9:
            raise ValueError(
                f"sampling intervals must be equal, got {first.interval:g} and {gauge.strain.interval:g} s"
            )
    begin = max(gauge.strain.start for gauge in gauges)
    finish = min(gauge.strain.end for gauge in gauges)
    n = int(np.floor((finish - begin) / first.interval + 1e-6)) + 1
    if n < 8:
        raise ValueError(f"the gauges' records overlap in {max(n, 0)} samples, need 8 or more")
    values = np.array([_from(gauge, begin, n) for gauge in gauges])
    sigma, memory = ([getattr(g.strain, name) for g in gauges] for name in ("sigma", "memory"))
    return first.interval, begin, values, np.array(sigma), np.maximum(memory, 1.0)


def _from(gauge: BarSignal, begin: float, n: int) -> FloatArray:
    """A gauge's strain from a given time, shifted by a fraction of a sample if its clock requires it."""
    signal = gauge.strain
    offset = (begin - signal.start) / signal.interval
    whole = round(offset)
    if abs(offset - whole) < 1e-6:
        return signal.value[whole : whole + n]
    before = max(64, signal.value.size // 4)
    length = next_fast_len(signal.value.size + 2 * before, real=True)
    spectrum = rfft(fade_ends(signal.value, before, length, fade=before))
    turned = spectrum * np.exp(2j * pi * rfftfreq(length) * (offset - whole))
    return irfft(turned, length)[before + whole : before + whole + n]


def _back(spectrum: ComplexArray, kept: NDArray[np.bool_], length: int) -> FloatArray:
    """Samples of spectra that are known at `kept`. The last axis is that of the frequencies."""
    full = np.zeros((*spectrum.shape[:-1], kept.size), dtype=complex)
    full[..., kept] = spectrum
    return irfft(full, length, axis=-1)


def _noise(response: FloatArray, decay: float, sigma: FloatArray, n: int, count: int) -> FloatArray:
    """Sigma at each time from white noise, Eq. (B.15), by responses [j, length] in the weighted records."""
    length = response.shape[1]
    lag = np.arange(length)
    lag = np.where(lag > length // 2, lag - length, lag)
    used = (lag > -n) & (lag < count)
    order = np.argsort(lag[used])
    variance = np.zeros(count)
    for answer, scatter in zip(response, sigma, strict=True):
        square = ((answer * np.exp(decay * lag)) ** 2)[used][order]  # lags 1 - n to count - 1
        running = np.concatenate([[0.0], np.cumsum(square)])
        # At time i the samples 0 to n - 1 contribute: lags i - n + 1 to i.
        i = np.arange(count)
        variance += scatter**2 * (running[i + n] - running[i])
    return np.sqrt(variance)


def _singular(waveguide: Waveguide, spacing: float, highest: float, n_gauges: int) -> FloatArray:
    """Frequencies at which n half-waves fit between two gauges, Re k * spacing = n pi [Hz]."""
    if n_gauges > 2:
        return np.zeros(1)
    frequency = np.linspace(0.0, highest, 4097)
    halves = waveguide.wavenumber(2.0 * pi * frequency).real * spacing / pi
    return np.asarray(np.interp(np.arange(0, int(halves[-1]) + 1), halves, frequency))


def overlapping_windows(
    incident: BarSignal, far: BarSignal, transmission: BarSignal, *, tension: bool = False
) -> Windows:
    """Windows that continue while the reflected wave overlaps the incident one.

    They last until the reflected wave returns from the far end of the incident bar, or the transmitted one
    from that of its bar. They end earlier if a record ends.

    ``incident``, ``far``: the two stations of the incident bar, the first one nearer to the specimen.
    ``tension``: True for a tensile incident pulse. Raises ValueError if `far` is not farther from the
    specimen, if there is no pulse, or if no part of the records remains.
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
    """The incident and the reflected wave, separated by two stations instead of by windows.

    ``faces``: the waves by windows, which overlap. They give the clock and the transmitted wave. Raises
    ValueError for the reasons of `kolsky.bars.reduction.separation.separate`.
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


KEY = "free end"
"""Key of the switch."""


@dataclass(frozen=True)
class FreeEnds:
    """Subtraction of echoes from the far ends of both bars."""

    reflected: float
    """Time at the incident gauge after the incident pulse and before the reflected one [s]."""

    def apart(
        self, incident: BarSignal, transmission: BarSignal, guides: tuple[Waveguide, Waveguide], band: float
    ) -> tuple[BarSignal, BarSignal, BarSignal]:
        """The incident, reflected and transmitted wave, separated, each at its gauge.

        ``band``: frequency up to which the guides carry waves [Hz].
        """
        wide = averaging_time(incident)
        later = np.clip((incident.strain.time - (self.reflected - wide)) / wide, 0.0, 1.0)
        toward = replace(
            incident, strain=replace(incident.strain, value=incident.strain.value * (1.0 - later))
        )
        back = replace(incident, strain=replace(incident.strain, value=incident.strain.value * later))
        return toward, without_echo(back, guides[0], band), without_echo(transmission, guides[1], band)


def free_ends(incident: BarSignal, arrival: float) -> FreeEnds:
    """Both far ends are free. The incident pulse ends before the reflected one arrives.

    ``arrival``: arrival of the incident pulse at its gauge [s].
    """
    return FreeEnds(arrival + 2.0 * travel_time(incident) - 2.0 * averaging_time(incident))


def without_echo(station: BarSignal, guide: Waveguide, band: float) -> BarSignal:
    """The wave toward the free end, from the strain at a station that also measures its echoes."""
    strain, way = station.strain, 2.0 * (station.bar.length - station.position)
    passes = ceil((strain.end - strain.start) * guide.wave_speed / way)
    out = strain
    for _ in range(passes):
        echo = propagation(out, guide, way, band=band, start=strain.start, samples=strain.value.size).signal
        out = replace(strain, value=strain.value + echo.value)
    seen = 1 + int((strain.end - strain.start) * guide.wave_speed / (2.0 * station.bar.length))
    return replace(station, strain=replace(out, sigma=strain.sigma * sqrt(seen + 1.0)))


def free_end_limits(incident: BarSignal, transmission: BarSignal) -> tuple[Limit, Limit]:
    """Times at which an echo returns to the specimen and loads it again, counted from the arrival of a
    pulse.
    """
    margin = max(averaging_time(incident), averaging_time(transmission))
    limits = [
        Limit(
            2.0 * s.bar.length / s.bar.wave_speed - margin,
            f"the echo from the far end of the {s.side} bar is back at the specimen",
        )
        for s in (incident, transmission)
    ]
    return limits[0], limits[1]


def check_length(windows: Windows, limits: tuple[Limit, Limit]) -> None:
    """Raise ValueError for windows that include an echo at the specimen.

    The message names the wave and the time.
    """
    length = max(last - first for first, last in (windows.incident, windows.reflected, windows.transmitted))
    end = min(limits, key=lambda limit: limit.time)
    if length > end.time:
        raise ValueError(
            f"the windows last {length:.4g} s, and {end.reason} {end.time:.4g} s after a pulse. Cure: "
            "shorter windows"
        )
