"""Robust estimates of a standard deviation from medians."""

import numpy as np

from dic.arrays import FloatArray

MAD = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations: 1/Φ⁻¹(3/4)."""
MEDIAN_LENGTH = 1.18
"""Median length of a vector of two independent unit normal components: √(2 ln 2)."""


def median(values: FloatArray, axis: int = 0) -> FloatArray:
    """`numpy.median` of values none of which is NaN, with a fifth of its time for some hundred of them.

    Parameters
    ----------
    values
        The values; at least one along `axis`.
    axis
        Along which the median is taken.
    """
    ordered = np.sort(values, axis=axis).swapaxes(0, axis)
    half = len(ordered) // 2
    return np.asarray(ordered[half] if len(ordered) % 2 else 0.5 * (ordered[half - 1] + ordered[half]))
