"""Errors that neighbouring points and successive frames share: warm air, highlights, the shape of the lenses.

A match has an error of its own, the noise of its grey values, and one in common with its neighbours in space
and time. Of the second kind no residual of a body's motion shows the size: it looks like motion. But it moves
the two cameras' places apart as much across the epipolar lines as along them, and across them nothing else
does. So the epipolar distances d of points that were followed are the witness. About its mean over time at
each point, d has the covariance

    s^2 exp(-(r / l)^2) exp(-|dt| / tau)

between points that are r apart in the picture and frames that are dt apart; the own errors are left out by
comparing points whose subsets have no pixel in common. What is subtracted with the mean over time is counted.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from dic.arrays import BoolArray, FloatArray

MOST_POINTS = 200
"""Points that are compared with one another, even over the grid."""
FEWEST_POINTS, FEWEST_FRAMES = 6, 12
"""With fewer nothing is said."""
NEAR = 2.0
"""Pairs up to so many subsets apart tell the memory [-]."""
LAGS = 0.4
"""Longest lag over the number of frames [-]."""
STEPS = 25
"""Memories and lengths that are tried, evenly in their logarithms."""


@dataclass(frozen=True)
class SharedError:
    """What neighbours and successive frames have in common of the epipolar distance's error."""

    sigma: float
    """Standard deviation s of the epipolar distance [px]; 0 if none was found."""
    length: float
    """Distance l at which the correlation is 1/e [px]."""
    memory: float
    """Time tau after which it is 1/e [frames]."""


NONE = SharedError(0.0, 1.0, 1.0)
"""No error in common."""


def shared_error(epipolar: FloatArray, valid: BoolArray, points: FloatArray, *, subset: float) -> SharedError:
    """Find the size, the length and the memory of what the errors of matches have in common.

    Parameters
    ----------
    epipolar
        Signed distances of camera 1's points from the epipolar lines of camera 0's [px], shape [n_frames,
        n_points].
    valid
        Which of them are known, same shape.
    points
        Places in the material picture [px], shape [n_points, 2].
    subset
        Side of the subsets [px]: points nearer than that, across and along, share their noise.

    Returns
    -------
    SharedError
        `NONE` where too few points were followed, or their distances have nothing in common.
    """
    steady = np.flatnonzero(valid.mean(axis=0) > 0.5)
    steady = steady[:: max(-(-steady.size // MOST_POINTS), 1)]
    if steady.size < FEWEST_POINTS or len(valid) < FEWEST_FRAMES:
        return NONE
    V = valid[:, steady].astype(np.float64)
    D = np.where(V > 0.0, epipolar[:, steady], 0.0)
    D = np.where(V > 0.0, D - D.sum(axis=0) / V.sum(axis=0), 0.0)
    place = points[steady]
    apart, free = cdist(place, place), cdist(place, place, "chebyshev") >= subset
    near = (free & (apart <= NEAR * subset)).astype(np.float64)
    if not near.any():
        return NONE
    memory = _memory(D, V, near)
    length = _length(D, V, apart, free)
    if memory is None or length is None:
        return NONE
    share = float(demeaned(len(D), memory)[0])
    return SharedError(sigma=float(np.sqrt(length[1] / share)), length=length[0], memory=memory)


def demeaned(n: int, memory: float) -> FloatArray:
    """Covariances by lag of n values of a unit process with memory about their own mean, shape [n].

    The mean of n values of covariance exp(-|i - j| / memory) takes a part of the process with it.
    """
    at = np.arange(n)
    R = np.exp(-np.abs(at[:, None] - at) / memory)
    rows = R.mean(axis=1)
    H = R - rows[:, None] - rows[None, :] + R.mean()
    return np.array([np.diagonal(H, lag).mean() for lag in range(n)])


def _memory(D: FloatArray, V: FloatArray, near: FloatArray) -> float | None:
    """Memory of what near points have in common [frames]; None if that is nothing."""
    n = len(D)
    last = max(int(LAGS * n), 2)
    mates, counts = D @ near, V @ near
    found = np.array([np.sum(D[: n - k] * mates[k:]) for k in range(last)])
    pairs = np.array([np.sum(V[: n - k] * counts[k:]) for k in range(last)])
    if not (pairs > 0.0).all() or found[0] <= 0.0:
        return None
    found = found / pairs
    best, least = None, np.inf
    for memory in np.geomspace(0.5, float(n), STEPS):
        shape = demeaned(n, memory)[:last]
        size = float(shape @ found / (shape @ shape))
        rest = float(np.sum((found - size * shape) ** 2))
        if size > 0.0 and rest < least:
            best, least = float(memory), rest
    return best


def _length(D: FloatArray, V: FloatArray, apart: FloatArray, free: BoolArray) -> tuple[float, float] | None:
    """Length over which points have errors in common [px], and their covariance at no distance [px²]; None if
    they have none."""
    pairs = V.T @ V
    use = free & (pairs > 0.5 * len(D))
    if not use.any():
        return None
    covariance, distance = (D.T @ D)[use] / pairs[use], apart[use]
    best, least = None, np.inf
    for length in np.geomspace(distance.min(), 3.0 * distance.max(), STEPS):
        shape = np.exp(-((distance / length) ** 2))
        size = float(shape @ covariance / max(float(shape @ shape), 1e-300))
        rest = float(np.sum((covariance - size * shape) ** 2))
        if size > 0.0 and rest < least:
            best, least = (float(length), size), rest
    return best
