"""Arrival of a pulse.

Onset by Akaike's criterion, time by the flank's tangent, first rise over a low level.
"""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from kolsky.bars.records import Signal
from kolsky.base.arrays import FloatArray

THRESHOLD = 6.0
"""A pulse must exceed this multiple of the averaged noise. Gaussian noise exceeds it once in 5e8 averages."""
FLANK = (0.2, 0.6)
"""Shares of the pulse's level. The rising flank between them is fitted by a straight line."""

FLOOR = 0.01
"""Share of the largest average that a pulse must exceed, even with little noise."""


@dataclass(frozen=True)
class Arrival:
    """A pulse that arrives, on the signal's clock."""

    time: float
    """Intersection of the rising flank's tangent with zero [s]."""
    sigma: float
    """Standard deviation of `time` from the signal's noise and sampling [s]."""
    onset: float
    """First sample of the pulse after the noise (Maeda's criterion) [s]."""
    rise_time: float
    """Time from `time` until the same tangent reaches the level [s]."""
    end: float
    """Time at which the pulse falls below a twentieth of its level [s]; inf if it does not."""
    level: float
    """Largest averaged value of the pulse, with its sign, in the signal's unit."""


def find_arrival(
    signal: Signal,
    *,
    sign: int,
    average: float,
    after: float = -inf,
    before: float = inf,
    smallest: float = 0.0,
) -> Arrival:
    """Arrival of the first pulse of one sign.

    The signal is averaged over `average`, m samples. This reduces single counts and spikes to noise with the
    standard deviation sigma sqrt(memory / m). The first average beyond `THRESHOLD` times this, and beyond
    `FLOOR` of the largest, marks the pulse. The largest average up to its end is its level. The onset
    minimises Maeda's form of Akaike's criterion over the samples up to half the level [1]_. The time is the
    intersection of the baseline, 0, with the least-squares line through the flank's samples between `FLANK`
    of the level. Its sigma is that of the intersection. On a straight flank it has no bias. On a rounded foot
    it is late by a fixed share of the rise time, 0.17 for a raised cosine, independent of the noise. The
    onset is later with more noise. Raises ValueError if there is no pulse, or if it began before the first
    sample.

    ``signal``: without its baseline. ``sign``: +1 for a pulse of positive values, -1 for negative ones.
    ``average`` [s]: at most the rise time of the pulse. In a bar this is at least a wave's travel time across
    the diameter. ``after``, ``before``: the pulse is searched between these times [s]. ``smallest``: a pulse
    must also exceed this value, in the signal's unit.

    References
    ----------
    .. [1] N. Maeda, "A method for reading and checking phase time in auto-processing system of seismic wave
       data", Zisin 38, 365-379, 1985.
    """
    if sign not in (-1, 1):
        raise ValueError(f"the sign of a pulse = {sign} must be +1 or -1")
    if not average > 0.0:
        raise ValueError(f"average = {average} s must be greater than 0")
    time = signal.time
    inside = np.flatnonzero((time >= after) & (time <= before))
    width = max(1, round(average / signal.interval))
    if inside.size < 4 * width:
        raise ValueError(
            f"{signal.name}: {inside.size} samples between {max(after, signal.start):.6g} s and "
            f"{min(before, signal.end):.6g} s are too few to find a pulse; at least {4 * width} are "
            "needed. Cure: a longer record"
        )
    unit = "" if signal.unit == "1" else f" {signal.unit}"
    time, value = time[inside], sign * signal.value[inside]
    smooth = moving_mean(value, width)
    noise = signal.sigma * sqrt(min(signal.memory / width, 1.0))
    least = max(THRESHOLD * noise, FLOOR * float(smooth.max()), smallest)
    first = _first_run(smooth > least, width)
    if first is None:
        raise ValueError(
            f"{signal.name}: no {'positive' if sign > 0 else 'negative'} pulse: the largest average over "
            f"{average:.3g} s is {sign * smooth.max():.3g}{unit}, and the threshold is {least:.3g} "
            f"({THRESHOLD:g} standard deviations of its noise, or the given one). Cure: check the "
            "channel, its declared sign and the clock"
        )
    if first < width:
        raise ValueError(
            f"{signal.name}: the pulse is there at the first sample ({sign * smooth[first]:.3g}{unit} "
            f"at {time[first]:.6g} s). Cure: a longer pre-trigger"
        )
    level, end = _extent(smooth, first, least)
    low, half, high = (_last_below(smooth, first, share * level) for share in (FLANK[0], 0.5, FLANK[1]))
    start = max(0, low - 4 * (high - low) - 4 * width)
    count = _undithered_count(value[: max(first // 2, 1)], value[low : high + 2])
    crossing, slope, sigma = _foot(time[low : high + 2], value[low : high + 2], signal, count)
    onset = _onset(value[start : half + 2], signal.sigma, level)
    return Arrival(
        time=crossing,
        sigma=sigma,
        onset=float(time[start + onset]),
        rise_time=level / slope,
        end=inf if end is None else float(time[end]),
        level=sign * level,
    )


def moving_mean(value: FloatArray, width: int) -> FloatArray:
    """Centred mean over `width` samples, over fewer at the ends; shape [n] to shape [n]."""
    total = np.concatenate([[0.0], np.cumsum(value)])
    index = np.arange(value.size)
    low = np.maximum(index - (width - 1) // 2, 0)
    high = np.minimum(index + width // 2 + 1, value.size)
    return (total[high] - total[low]) / (high - low)


def _first_run(flag: np.ndarray, length: int) -> int | None:
    """Index at which `flag` is first true over `length` successive samples."""
    count = np.concatenate([[0], np.cumsum(flag)])
    runs = np.flatnonzero(count[length:] - count[:-length] == length)
    return int(runs[0]) if runs.size else None


def _extent(smooth: FloatArray, first: int, least: float) -> tuple[float, int | None]:
    """Level of the pulse and the index of its end, below a twentieth of the level and the threshold."""
    below = np.flatnonzero(smooth[first:] <= least)
    stop = first + int(below[0]) if below.size else smooth.size
    level = float(smooth[first:stop].max())
    peak = first + int(smooth[first:stop].argmax())
    over = np.flatnonzero(smooth[peak:] < max(0.05 * level, least))
    return level, (peak + int(over[0]) if over.size else None)


def _last_below(smooth: FloatArray, first: int, value: float) -> int:
    """Last index at which the rising flank is below `value`, counted from the pulse's first sample."""
    above = first + int(np.flatnonzero(smooth[first:] >= value)[0])
    before = np.flatnonzero(smooth[: above + 1] < value)
    return int(before[-1]) if before.size else 0


def _undithered_count(quiet: FloatArray, flank: FloatArray) -> float:
    """The recorder's step if the noise (a quarter of it) cannot average it out; otherwise 0."""
    gaps = np.diff(np.unique(np.concatenate([quiet, flank])))
    gaps = gaps[gaps > 1e-6 * np.abs(flank).max()]  # the same count, converted, differs in its last digits
    count = float(np.median(gaps)) if gaps.size else 0.0
    return count if quiet.std() < 0.25 * count else 0.0


def _foot(time: FloatArray, value: FloatArray, signal: Signal, count: float) -> tuple[float, float, float]:
    """Intersection of the flank's least-squares line with 0, its slope, and the intersection's sigma."""
    centre, height = float(time.mean()), float(value.mean())
    spread = float(((time - centre) ** 2).sum())
    slope = float((time - centre) @ value) / spread
    if slope <= 0.0:
        raise ValueError(
            f"{signal.name}: the flank about {centre:.6g} s does not rise. Cure: a longer average, or "
            "windows by hand"
        )
    foot = centre - height / slope
    noise = signal.sigma**2 * min(signal.memory, float(time.size))
    variance = noise * (1.0 / time.size + (centre - foot) ** 2 / spread) + count**2 / 12.0
    return foot, slope, sqrt(variance / slope**2 + signal.interval**2 / (12.0 * time.size))


def _onset(value: FloatArray, sigma: float, level: float) -> int:
    """Index that splits the samples into noise and pulse (Maeda 1985, eq. 1)."""
    n = value.size
    count = np.arange(2, n - 2)
    # A baseline of equal counts has no variance. Its logarithm would dominate.
    floor = max(sigma**2, (1e-6 * level) ** 2)
    s1, s2 = np.cumsum(value), np.cumsum(value**2)
    before = s2[count - 1] / count - (s1[count - 1] / count) ** 2
    rest = n - count
    after = (s2[-1] - s2[count - 1]) / rest - ((s1[-1] - s1[count - 1]) / rest) ** 2
    criterion = count * np.log(np.maximum(before, floor)) + (rest - 1) * np.log(np.maximum(after, floor))
    return int(count[criterion.argmin()])


LOW = 0.05
"""Share of a pulse's level for its first rise, if the noise is lower."""
HALF = 0.5
"""Share of the largest value for the detection of the pulse."""


@dataclass(frozen=True)
class FirstRise:
    """Time at which a pulse passes a low level."""

    time: float
    """Time on the signal's clock [s]."""
    sigma: float
    """Standard deviation of `time` from the signal's noise and sampling [s]."""
    level: float
    """The level, >= 0, in the signal's unit."""


def low_level(signal: Signal, top: float, average: float) -> float:
    """Level of a first rise.

    `LOW` times the pulse's level, or `THRESHOLD` standard deviations of averaged noise.

    ``top``: level of the pulse, >= 0. ``average``: averaging time [s].
    """
    width = max(1, round(average / signal.interval))
    return max(LOW * top, THRESHOLD * signal.sigma * sqrt(min(signal.memory / width, 1.0)))


def first_rise(
    signal: Signal,
    *,
    sign: int,
    average: float,
    after: float = -inf,
    before: float = inf,
    level: float | None = None,
    smallest: float = 0.0,
) -> FirstRise | None:
    """Time at which the rising flank of the largest pulse crosses a low level; None if it does not.

    The averaged signal first exceeds `HALF` of its largest value on the pulse's flank. From this point, the
    flank is followed down to the level. A foot of a different slope, such as the elastic rise of a specimen
    that then flows, is also followed. There is no extrapolation. Arguments are those of `find_arrival`.
    ``level``: default: `low_level` of the largest value.
    """
    width = max(1, round(average / signal.interval))
    smooth = sign * moving_mean(signal.value, width)
    time = signal.time
    inside = np.flatnonzero((time >= after) & (time <= before))
    if inside.size < 2 * width:
        return None
    part = smooth[inside]
    top = float(part.max())
    low = low_level(signal, top, average) if level is None else level
    if top <= max(low, smallest):
        return None
    flank = int(np.flatnonzero(part >= max(HALF * top, low))[0])
    below = np.flatnonzero(part[: flank + 1] < low)
    if not below.size:
        return None  # the pulse began before the record: its rise was not recorded
    at = int(below[-1])
    step = signal.interval
    share = (low - part[at]) / (part[at + 1] - part[at])
    # The slope over the averaging time converts noise of the average to a time of crossing.
    ahead = min(at + max(width, 1), part.size - 1)
    slope = float(part[ahead] - part[at]) / ((ahead - at) * step)
    noise = signal.sigma * sqrt(min(signal.memory / width, 1.0))
    sigma = sqrt((noise / slope) ** 2 + step**2 / 12.0)
    return FirstRise(float(time[inside[at]] + share * step), sigma, low)
