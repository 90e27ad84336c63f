"""Noise of the grey values where a series may have no static frames."""


import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import Noise
from dic.images import PictureError, Pictures
from dic.images.noise import grey_noise
from dic.outcome import FrameOutcome


def noise_at_rest(
    pictures: Pictures, health: IntArray, static: int, mask: BoolArray | None
) -> tuple[Noise, float] | None:
    """Noise from the static frames, and its standard deviation [grey]; None if fewer than two are usable.

    Parameters
    ----------
    pictures
        One camera's series.
    health
        `FrameOutcome` of its pictures, shape [n_frames].
    static
        Frames at the beginning in which nothing moves.
    mask
        Pixels that count, shape [rows, columns]; None: all.
    """
    rest = np.flatnonzero(health[:static] == FrameOutcome.VALID)
    if rest.size < 2:
        return None
    try:
        grey = grey_noise(pictures, rest.tolist(), mask=mask)
    except (PictureError, ValueError):
        return None
    line = grey.intercept > 0.0 and grey.slope > 0.0
    found = Noise(floor=grey.intercept**0.5, gain=grey.slope) if line else Noise(floor=grey.sigma)
    return found, grey.sigma


def noise_from_matches(
    picture: NDArray[np.generic], points: FloatArray, zncc: FloatArray, subset: int
) -> float:
    """Standard deviation of a grey value that explains how well subsets correlate [grey].

    Two pictures of one pattern with independent noise σ correlate by ``1 - σ²/s²``, s² the variance of the
    grey values in the subset, noise included. The median over the points of ``s √(1 - zncc)`` also holds
    what interpolation and shape function leave, and is therefore rather too large than too small.

    Parameters
    ----------
    picture
        The reference picture, shape [rows, columns].
    points
        Places of the matched subsets' centres [px], shape [n, 2].
    zncc
        Their correlations, shape [n].
    subset
        Side of the subsets [px].

    Raises
    ------
    ValueError
        If there are no points.
    """
    if not len(points):
        raise ValueError("no subset was matched, so the noise of the grey values is not known: declare it")
    from dic.opencv import cv2

    grey = np.asarray(picture, dtype=np.float64)
    size = (subset, subset)
    mean = cv2.boxFilter(grey, -1, size)
    variance = cv2.boxFilter(grey * grey, -1, size) - mean * mean
    column, row = np.round(points).astype(np.int64).T
    s2 = np.maximum(variance[row, column], 0.0)
    return float(np.sqrt(np.median(s2 * np.maximum(1.0 - zncc, 0.0))))
