"""Values found for a shot file, and unambiguous properties of a record: its rest, noise, first departure.

Every function returns None if the data are ambiguous; `kolsky new` then leaves a blank.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kolsky.base.arrays import FloatArray


@dataclass
class Findings:
    """Values of a shot file and remarks above their lines, by dotted key."""

    values: dict[str, str | None] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    def add(self, key: str, value: str, note: str) -> None:
        """Add a value in TOML syntax with its reason."""
        self.values[key], self.notes[key] = value, note


DEPARTURE = 5.0
"""Threshold in standard deviations above which a value is not noise. With `IN_A_ROW`, there is one false
alarm in 1e18 values."""
IN_A_ROW = 3
"""Number of successive values beyond `DEPARTURE` that end the rest. A single value is an outlier."""
CLEAR = 50.0
"""Smallest amplitude of a signal in standard deviations. A smaller one is a disturbance and not the test."""
ROUNDING = 0.29
"""Standard deviation of rounding, in steps of the last digit: 1/sqrt(12)."""
FIRST_PUSH = 0.2
"""Share of the largest departure at which the sign is determined. It is far above noise and long before the
peak."""
LONGEST_TOP = 10
"""Number of successive samples at the largest value that indicates clipping. A noisy peak has fewer."""

MOST_POINTS = 2000
"""Largest number of points of a curve for the estimate of its scatter. More points change it by less than 2
%."""


FEWEST_SAMPLES = 20
"""Smallest number of samples of a baseline. The standard deviation of its mean is then a quarter of the
noise."""


@dataclass(frozen=True)
class QuietStretch:
    """The beginning of a record, before anything moves."""

    count: int
    """Number of values at rest, from the first one."""
    level: float
    """Their mean."""
    scatter: float
    """Their standard deviation, from differences of successive values. A slow drift then has no effect."""


def quiet_stretch(values: FloatArray, *, fewest: int) -> QuietStretch | None:
    """The rest at the beginning of a record. None if there is no clear rest or no departure from it.

    ``values``: the record, shape [n]. ``fewest``: smallest number of values of a rest.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size < fewest + IN_A_ROW or not np.isfinite(x).all():
        return None
    steps = np.abs(np.diff(x))
    digit = float(steps[steps > 0.0].min(initial=np.inf))
    if not np.isfinite(digit):
        return None
    k = np.arange(1, x.size)
    level = x[0] + np.cumsum(x - x[0])[:-1] / k  # mean of the first k values
    noise = np.sqrt(np.concatenate(([0.0], np.cumsum(np.diff(x)[:-1] ** 2))) / (2.0 * np.maximum(k - 1, 1)))
    noise = np.maximum(noise, ROUNDING * digit)
    last = x.size - IN_A_ROW
    ahead = np.lib.stride_tricks.sliding_window_view(x, IN_A_ROW)[1 : last + 1]
    off = (ahead - level[:last, None]) / noise[:last, None]
    away = (off > DEPARTURE).all(axis=1) | (off < -DEPARTURE).all(axis=1)
    ends = np.flatnonzero(away[fewest - 1 :])
    if not ends.size:
        return None
    count = int(ends[0]) + fewest
    # The noise of the first half, before any slow start of the motion, is used to trim the second half.
    half = max(2, count // 2)
    scatter = max(float(noise[half - 1]), ROUNDING * digit)
    begin = float(x[:half].mean())
    while count > half and abs(x[count - 1] - begin) > 2.0 * scatter and x[count - 1] != begin:
        count -= 1
    if count < fewest or np.abs(x - begin).max() < CLEAR * scatter:
        return None
    middle = count // 2
    drift = abs(float(x[middle:count].mean() - x[:middle].mean()))
    if drift > DEPARTURE * scatter:
        return None
    return QuietStretch(count, float(x[:count].mean()), scatter)


def first_push(values: FloatArray, quiet: QuietStretch) -> int | None:
    """Sign of the first large departure from the rest. None unless it is also the largest one."""
    off = np.asarray(values, dtype=np.float64) - quiet.level
    largest = float(np.abs(off).max())
    first = off[np.flatnonzero(np.abs(off) >= FIRST_PUSH * largest)[0]]
    top = off[int(np.argmax(np.abs(off)))]
    return int(np.sign(first)) if np.sign(first) == np.sign(top) else None


def range_above(values: FloatArray) -> float | None:
    """The smallest of 1, 2, 5 times a power of ten above all values. None for a clipped record."""
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    largest = float(sizes.max())
    if largest <= 0.0:
        return None
    at_top = np.concatenate(([0], (sizes == largest).astype(int), [0]))
    edges = np.flatnonzero(np.diff(at_top))
    if int((edges[1::2] - edges[::2]).max()) >= LONGEST_TOP:
        return None
    decade = 10.0 ** np.floor(np.log10(largest))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade > largest))


def relative_scatter(x: FloatArray, y: FloatArray) -> float | None:
    """Relative standard deviation of the points about a smooth curve; None for too few points.

    Each point is compared with the cubic through its four neighbours. The median is used, because a kink or
    an outlier does not affect it.

    ``x``, ``y``: the points, shape [n].
    """
    order = np.argsort(x, kind="stable")
    x, y = np.asarray(x, dtype=np.float64)[order], np.asarray(y, dtype=np.float64)[order]
    if x.size < 12 or (np.diff(x) <= 0.0).any():
        return None
    i = np.arange(2, x.size - 2, max(1, x.size // MOST_POINTS))
    i = i[y[i] != 0.0]
    if i.size < 8:
        return None
    near = i + np.array([-2, -1, 1, 2])[:, None]
    others = [np.delete(near, a, axis=0) for a in range(4)]
    weights = [np.prod((x[i] - x[b]) / (x[a] - x[b]), axis=0) for a, b in zip(near, others, strict=True)]
    off = np.abs(y[i] - np.sum(weights * y[near], axis=0))  # from Lagrange's cubic
    scale = np.abs(y[i]) * np.sqrt(1.0 + np.sum(np.square(weights), axis=0))
    return float(np.median(off / scale)) * 1.4826  # of a normal distribution: 1 / 0.6745


def common_sign(values: FloatArray) -> int | None:
    """Sign of a curve's values away from rest, or None if they have both signs."""
    sizes = np.abs(values)
    away = values[sizes > 0.05 * sizes.max(initial=0.0)]  # near zero the sign depends on offset or noise
    signs = np.unique(np.sign(away))
    return int(signs[0]) if signs.size == 1 and signs[0] != 0.0 else None


def two_figures(value: float) -> float:
    """A positive value rounded up to two significant figures."""
    decade = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.ceil(value / decade - 1e-9) * decade:.2g}")
