"""Guesses handed on from neighbour to neighbour, the most reliable first.

After Pan (Reliability-guided digital image correlation, Applied Optics 48, 2009), in rounds instead of one
by one: in a round every point that has a matched neighbour tries the warp of the best correlated one,
carried over the step between them, all points in one batch.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import warp as warps
from dic.correlation.match import Match

REACH = 3.0
"""Neighbours lie within this many medians of the distance to the nearest point."""


def neighbourhood(points: FloatArray, number: int) -> IntArray:
    """The nearest other points of each, nearest first, shape [n, number]; -1 where there are fewer.

    Parameters
    ----------
    points
        Places in the material picture [px], shape [n, 2].
    number
        Greatest number of neighbours.
    """
    n = len(points)
    if n < 2:
        return np.full((n, number), -1, dtype=np.int64)
    distance, index = cKDTree(points).query(points, k=min(number + 1, n))
    reach = REACH * np.median(distance[:, 1])
    near = np.where(distance[:, 1:] <= reach, index[:, 1:], -1).astype(np.int64)
    return np.pad(near, ((0, 0), (0, number - near.shape[1])), constant_values=-1)


def propagate(
    match: Match,
    points: FloatArray,
    near: IntArray,
    attempts: int,
    attempt: Callable[[IntArray, FloatArray], tuple[Match, BoolArray]],
    found: BoolArray,
) -> BoolArray:
    """Match the points that are not found yet, from neighbours; `match` and `found` are filled in place.

    Parameters
    ----------
    match
        Of all points; rows of points not found yet are overwritten by their last attempt.
    points
        Places in the material picture [px], shape [n, 2].
    near
        `neighbourhood` of the points.
    attempts
        Guesses that a point tries before it is given up.
    attempt
        Matches the points of these rows from these guesses, and says which are to be believed.
    found
        Points that may hand on their warps, shape [n].

    Returns
    -------
    NDArray
        Points that had a guess, shape [n].
    """
    guessed, spent = found.copy(), np.zeros(len(points), dtype=np.int64)
    used = near < 0  # neighbours that have been tried, or are not there
    while True:
        ready = np.where(used | ~found[near], -np.inf, match.zncc[near])
        rows = np.flatnonzero(~found & (spent < attempts) & np.any(np.isfinite(ready), axis=1))
        if not len(rows):
            return guessed
        best = np.argmax(ready[rows], axis=1)
        giver = near[rows, best]
        used[rows, best] = True
        spent[rows] += 1
        guessed[rows] = True
        guess = warps.carried(match.warp[giver], points[rows] - points[giver])
        result, believed = attempt(rows, guess)
        for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
            getattr(match, name)[rows] = getattr(result, name)
        found[rows[believed]] = True
