"""Noise of the grey values, from frames in which nothing moves, and the grey-value gradients that it is
compared with: derivatives of a picture's interpolating quintic B-spline."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.images.series import Pictures

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


_BINS = 20


@dataclass(frozen=True)
class GreyNoise:
    """Standard deviation of the grey values, and how it depends on them."""

    sigma: float
    """Of one pixel of one frame, over the whole mask [grey]."""
    intercept: float
    """Variance at grey value 0 by the straight line `intercept + slope * grey` [grey²]."""
    slope: float
    """Growth of the variance with the grey value [grey]; photon noise makes it positive."""
    slope_sigma: float
    """Standard deviation of the slope [grey]."""
    gain: FloatArray
    """Brightness of each frame relative to their mean, the flicker that was removed [-], shape [n_frames]."""
    motion: FloatArray
    """Rigid motion (x, y) of each frame against their mean, removed too [px], shape [n_frames, 2]."""

    def variance(self, grey: NDArray[np.generic]) -> FloatArray:
        """Variance at given grey values [grey²], by the straight line, not below a tenth of `sigma²`."""
        line = self.intercept + self.slope * np.asarray(grey, dtype=np.float64)
        return np.asarray(np.maximum(line, 0.1 * self.sigma**2))


def grey_noise(
    pictures: Pictures | Sequence[NDArray[np.generic]],
    frames: Sequence[int],
    *,
    mask: NDArray[np.bool_] | None = None,
) -> GreyNoise:
    """Measure the noise in static frames.

    Each frame k is compared with the mean M of all: ``f_k = b (M - u·∇M) + c + noise``, by least squares over
    the mask. The gain b and offset c take the flicker away, u a rigid motion of a small part of a pixel. The
    variance is that of the differences of neighbouring frames' remainders, halved: a slow change of the
    picture does not count as noise. Its median over the pairs is ``sigma²``; the line is fitted to its mean
    over pixels of like brightness, weighted by how well each is known.

    Parameters
    ----------
    pictures
        A series, or pictures of shape [rows, columns].
    frames
        Numbers of the static frames, at least two.
    mask
        The pixels that count, shape [rows, columns]; all if None. Leave saturated pixels out.

    Raises
    ------
    ValueError
        Fewer than two frames, a mask of other shape or of fewer than 100 pixels, or no noise at all.
    PictureError
        A frame that cannot be read.
    """
    if len(frames) < 2:
        raise ValueError(f"noise needs at least 2 static frames, got {len(frames)}")
    read = pictures.frame if isinstance(pictures, Pictures) else pictures.__getitem__
    stack = [np.asarray(read(index)) for index in frames]
    mean = np.asarray(np.mean(stack, axis=0, dtype=np.float64))
    used = np.ones(mean.shape, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if used.shape != mean.shape or used.sum() < 100:
        raise ValueError(
            f"mask must be of shape {mean.shape} with at least 100 pixels, "
            f"is of shape {used.shape} with {used.sum()}"
        )
    columns = np.stack([part[used] for part in (mean, np.ones_like(mean), *gradient(mean))], axis=1)
    normal = np.linalg.pinv(columns.T @ columns)
    fitted = np.array([normal @ (columns.T @ frame[used]) for frame in stack])
    squares, levels = np.zeros(len(columns)), []
    for k in range(len(stack) - 1):  # a pair at a time: the frames may be many and large
        here, there = (stack[m][used] - columns @ fitted[m] for m in (k, k + 1))
        square = (there - here) ** 2 / 2.0  # the variance of one frame's noise
        squares += square / (len(stack) - 1)
        levels.append(square.mean())
    sigma2 = float(np.median(levels))
    if sigma2 <= 0.0:
        raise ValueError("the frames are equal to the last bit: give other frames, or the noise as a number")
    intercept, slope, error = _line(mean[used], squares)
    gain = np.array([frame[used].mean() for frame in stack])
    return GreyNoise(
        sigma=float(np.sqrt(sigma2)),
        intercept=intercept,
        slope=slope,
        slope_sigma=error,
        gain=np.asarray(gain / gain.mean()),
        motion=np.asarray(-fitted[:, 2:] / fitted[:, :1]),  # moved by u, b M looks like b (M - u·∇M)
    )


def _line(grey: FloatArray, variance: FloatArray) -> tuple[float, float, float]:
    """Intercept, slope and the slope's standard deviation of variance over grey value."""
    order = np.argsort(grey, kind="stable")
    bins = [part for part in np.array_split(order, _BINS) if part.size > 1]
    x = np.array([grey[part].mean() for part in bins])
    y = np.array([variance[part].mean() for part in bins])
    weight = 1.0 / np.array([max(variance[part].std() ** 2 / part.size, 1e-12) for part in bins])
    centre = np.sum(weight * x) / np.sum(weight)
    spread = float(np.sum(weight * (x - centre) ** 2))
    if spread <= 0.0 or np.ptp(x) <= 1e-9 * max(1.0, abs(centre)):
        return float(np.average(y, weights=weight)), 0.0, float("inf")
    slope = float(np.sum(weight * (x - centre) * y) / spread)
    return float(np.average(y, weights=weight) - slope * centre), slope, float(spread**-0.5)
