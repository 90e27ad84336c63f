"""Waves at the specimen: each pulse is windowed and propagated to the bar's face, on one clock.

Opposed gauges that were recorded in separate files are resampled to one clock first.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, pi, sqrt

import numpy as np

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import LARGEST_JITTER, BarSignal, FaceWaves, Signal, Windows, uniform_clock
from kolsky.bars.reduction.windows import travel_time, usable_limits
from kolsky.base.arrays import FloatArray
from kolsky.base.records import Recording

BAND = 2.0
"""omega a / c0 up to which waves are kept under dispersion: a second mode travels above 2.3 or so."""
_GUARD = 256
"""Samples on either side of a window that take part in an interpolation."""


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

    The incident wave is carried forward by its gauge's distance, the others back by theirs, Eq. (R.4), with
    the dispersion and attenuation of the guides. Without guides a wave is only moved in time, by x / c0;
    fractions of a sample are then interpolated as for a band-limited signal, which changes neither its
    energy nor its noise.

    ``incident``, ``transmission``: the strains at the two stations, on one clock, with equal sampling
    intervals. ``windows``: where the waves lie at the gauges. The shortest decides how long the result is.
    ``guides``: the incident and the transmission bar as waveguides; None leaves dispersion out. ``band``:
    frequency up to which the guides carry waves [Hz], inf for all. Without it the lower `BAND` of the bars:
    above, a gauge sees several modes at once, and noise would be carried as if it were a wave of the first.
    ``arrival``: when the incident wave arrives at its gauge [s]; carried to the face this is time 0 of the
    result. The beginning of the incident window if it is left out. ``delays``: times by which the reflected
    and the transmitted wave are later at their gauges than travel times say [s]: for waves that are aligned
    by their arrivals. ``apart``: the incident, reflected and transmitted wave each by itself at its gauge,
    where they were told apart; the windows then only say which stretch is wanted.
    """
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
        raise ValueError(f"the shortest window holds {count} samples; it takes 4 or more")
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
    """Windows extended as long as the gauge shows the same wave alone, or rest before it.

    A wave that is cut off while it still presses has an edge there, and what is fast in an edge is carried
    into the window by dispersion. The fade of a tenth beyond the window must not touch the next wave.
    """
    before = (incident.strain.start, pairs[1][0], transmission.strain.start)
    widened = []
    for (begin, end), start, limit, signal in zip(
        pairs,
        before,
        usable_limits(incident, transmission),
        (incident, incident, transmission),
        strict=True,
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
    """`count` samples of one wave at the face; the first belongs to the time `start` at the gauge."""
    strain = signal.strain
    if guide is None:
        return replace(strain, value=sampled_from(strain, start, count))
    travelled = start + distance / signal.bar.wave_speed
    return propagation(
        strain, guide, distance, window=window, band=band, start=travelled, samples=count
    ).signal


def sampled_from(signal: Signal, start: float, count: int) -> FloatArray:
    """A signal's values at ``start + k * interval``, band-limited between its samples.

    ``start``: time of the first value [s]; a fraction of a sample is a turn of phase in the Fourier transform
    of the samples and `GUARD` more on either side, less the line through their ends. ``count``: number of
    values. Returns: values in the signal's unit, shape [count].
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
"""Fewest samples that two recordings must have in common."""


def on_one_clock(recordings: Sequence[Recording], offsets: Sequence[float]) -> tuple[Recording, ...]:
    """Recordings of one station over the time that all of them cover, at the times of the first.

    Recordings of one time base stay as they are. Another recorder's samples are taken between its own where
    they fall between them, as of a band-limited signal, which changes neither its energy nor its noise.

    ``recordings``: one for each channel, each on its recorder's clock. ``offsets``: shot's clock minus
    recorder's clock of each [s]. Raises ValueError if the intervals differ, or the recordings have hardly a
    sample in common. Returns: all on the first one's recorder's clock.
    """
    first = recordings[0]
    start, interval = uniform_clock(first)
    signals = [_shifted(r, offset - offsets[0]) for r, offset in zip(recordings, offsets, strict=True)]
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


def _shifted(recording: Recording, shift: float) -> Signal:
    start, interval = uniform_clock(recording)
    return Signal(start + shift, interval, recording.value, 0.0, recording.unit, recording.channel)
