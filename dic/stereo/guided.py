"""Stereo match of all points from seeds on whole epipolar curves: neighbours start from a match, the most
reliable first.

After Pan (Reliability-guided digital image correlation, Applied Optics 48, 2009), in rounds instead of one
by one: in a round every point that has a matched neighbour tries the warp of the best correlated one,
carried over the step between them, all points in one batch.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import warp as warps
from dic.correlation.settings import Match
from dic.correlation.warp import Shape
from dic.outcome import PointOutcome
from dic.stereo.epipolar_search import search as search_curves
from dic.stereo.pair import Pair
from dic.stereo.template import subsets

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
        Matches the points of these rows from these guesses, and which of them are accepted.
    found
        Points that may propagate their warps, shape [n].

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
        result, accepted = attempt(rows, guess)
        for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
            getattr(match, name)[rows] = getattr(result, name)
        found[rows[accepted]] = True


SEARCHED = 31
"""Smallest side of the subset that a whole epipolar curve is searched with by default [px]."""


def guided_match(pair: Pair) -> Match:
    """Seeds, neighbours of matched points, and the last word of the shape function that was asked for.

    A point that nothing led to is NO_FIRST_GUESS; one that converged off its epipolar line or far from its
    guess is a STEREO_MISMATCH.
    """
    n = len(pair.points)
    near = neighbourhood(pair.points, pair.search.neighbours)
    whole = np.zeros((2, n), dtype=np.int64)
    match = Match(np.zeros((n, 12)), np.zeros((n, 2, 2)), np.zeros(n), whole[0], whole[1])
    found, guessed = np.zeros((2, n), dtype=np.bool_)

    def attempt(rows: IntArray, guess: FloatArray) -> tuple[Match, BoolArray]:
        return _attempt(pair, rows, guess)

    while True:  # a region that no neighbour leads to gets seeds of its own
        before = found.sum()
        _seed(pair, match, found)
        if found.sum() == before:
            break
        guessed |= propagate(match, pair.points, near, pair.search.attempts, attempt, found)
    match.outcome[~guessed] = PointOutcome.NO_FIRST_GUESS
    wrong = guessed & ~found & (match.outcome == PointOutcome.VALID)
    match.outcome[wrong] = PointOutcome.STEREO_MISMATCH
    rows = np.flatnonzero(found)
    if pair.settings.shape > Shape.AFFINE and len(rows):
        _write(match, rows, pair.correlate(rows, match.warp[rows]))
    return match


def _seed(pair: Pair, match: Match, found: BoolArray) -> None:
    """Search whole curves for points spread over those not found yet."""
    rows = _spread_out(pair.points, ~found, pair.search.seeds)
    side = pair.search.subset or max(pair.settings.subset, SEARCHED)
    wanted = subsets(pair.pictures[0], pair.points[rows], pair.reference[rows], side, pair.mask)
    limits = pair.search.distances
    if limits is None and found.any():  # the rest of the surface is near what is known of it
        known = np.flatnonzero(found)
        limits = pair.around(known, match.warp[known])
    candidates = search_curves(
        pair.rig,
        wanted,
        pair.pictures[1],
        limits=limits,
        turns=pair.search.turns,
        device=pair.stacks[0].device,
    )
    alone = 1.0 - candidates.zncc < pair.search.distinct * (1.0 - candidates.second_peak)
    good = (candidates.zncc >= pair.search.least_zncc) & alone
    result, accepted = _attempt(pair, rows[good], candidates.warp[good])
    rows = rows[good][accepted]
    _write(match, rows, result, accepted)
    found[rows] = True


def _attempt(pair: Pair, rows: IntArray, guess: FloatArray) -> tuple[Match, BoolArray]:
    """An affine match, and which of them may propagate their warps."""
    result = pair.correlate(rows, guess, shape=Shape.AFFINE)
    converged = result.outcome == PointOutcome.VALID
    moved = np.linalg.norm(result.warp[:, :2] - guess[:, :2], axis=1)
    epipolar, sigma = pair.epipolar(rows, result)
    meets = np.abs(epipolar) <= pair.gates.epipolar + pair.gates.sigmas * sigma
    return result, converged & meets & (moved <= pair.settings.subset / 2.0)


def _spread_out(points: FloatArray, wanted: BoolArray, number: int) -> IntArray:
    """Rows of about `number` wanted points, one a cell of a grid over them."""
    rows = np.flatnonzero(wanted)
    if len(rows) <= number:
        return rows
    low = points[rows].min(axis=0)
    extent = np.maximum(points[rows].max(axis=0) - low, 1.0)
    cell = np.sqrt(extent[0] * extent[1] / number)
    index = np.floor((points[rows] - low) / cell)
    off = np.linalg.norm((points[rows] - low) / cell - index - 0.5, axis=1)
    order = np.lexsort((off, index[:, 0], index[:, 1]))  # in each cell the point nearest to its middle
    first = np.r_[True, np.any(np.diff(index[order], axis=0) != 0.0, axis=1)]
    return rows[order[first]]


def _write(match: Match, rows: IntArray, result: Match, which: BoolArray | slice = slice(None)) -> None:
    for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
        getattr(match, name)[rows] = getattr(result, name)[which]
