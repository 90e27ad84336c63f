"""Grey-value gradients of a picture: derivatives of its interpolating quintic B-spline."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray

_VALUE = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0
_SLOPE = np.array([-1.0, -10.0, 0.0, 10.0, 1.0]) / 24.0
"""The quintic B-spline and its derivative at whole pixels."""


def gradient(picture: NDArray[np.generic]) -> tuple[FloatArray, FloatArray]:
    """Derivatives along x (columns) and y (rows) at the pixel centres [grey/px].

    Parameters
    ----------
    picture
        Grey values, shape [rows, columns].

    Returns
    -------
    tuple
        The two derivatives, each of shape [rows, columns].
    """
    from scipy import ndimage

    coefficients = ndimage.spline_filter(np.asarray(picture, dtype=np.float64), order=5, mode="mirror")

    def along(axis: int) -> FloatArray:
        sloped = ndimage.correlate1d(coefficients, _SLOPE, axis=axis, mode="mirror")
        return np.asarray(ndimage.correlate1d(sloped, _VALUE, axis=1 - axis, mode="mirror"))

    return along(1), along(0)


@cache
def noise_gain() -> float:
    """Variance of `gradient` over that of independent noise of the pixels [1/px²]."""
    impulse = np.zeros((65, 65))
    impulse[32, 32] = 1.0
    return float(np.sum(gradient(impulse)[0] ** 2))
