"""First rise of a pulse: the time at which its flank passes a low level, without extrapolating the flank."""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from kolsky.bars.records import Signal
from kolsky.bars.signals.arrival import THRESHOLD, moving_mean

LOW = 0.05
"""Share of a pulse's own level at which its first rise is taken, unless the noise is higher."""
HALF = 0.5
"""Share of the largest value by which the pulse itself is found."""


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
    """Level of a first rise: `LOW` of the pulse's, or `THRESHOLD` standard deviations of averaged noise.

    Parameters
    ----------
    signal
        The signal, with the noise of its samples.
    top
        Level of the pulse, >= 0.
    average
        Time over which is averaged [s].
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
    """Time at which the flank of the largest pulse passes a low level on its way up.

    The averaged signal first exceeds `HALF` of its largest value on the pulse's flank; from there the flank
    is followed down to the level. A foot of another slope, such as the elastic rise of a specimen that then
    flows, is followed as it is: nothing is extrapolated.

    Parameters
    ----------
    signal
        The signal, its baseline removed.
    sign
        +1 for a pulse of positive values, -1 for negative ones.
    average
        Time over which is averaged [s], > 0.
    after, before
        The pulse is looked for between these times [s].
    level
        The level, > 0; without it `low_level` of the largest value found.
    smallest
        A pulse's largest value must exceed this, in the signal's unit.

    Returns
    -------
    FirstRise or None
        None if nothing rises beyond the level there.
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
        return None  # it is there from the beginning: when it rose is not seen
    at = int(below[-1])
    step = signal.interval
    share = (low - part[at]) / (part[at + 1] - part[at])
    # The slope over the averaging time: what noise of the average makes of the crossing.
    ahead = min(at + max(width, 1), part.size - 1)
    slope = float(part[ahead] - part[at]) / ((ahead - at) * step)
    noise = signal.sigma * sqrt(min(signal.memory / width, 1.0))
    sigma = sqrt((noise / slope) ** 2 + step**2 / 12.0)
    return FirstRise(float(time[inside[at]] + share * step), sigma, low)
