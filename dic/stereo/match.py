"""Stereo match of camera 0's points in camera 1, guided by reliable neighbours and accepted by gates.

The method follows Pan (Reliability-guided digital image correlation, Applied Optics 48, 2009), but works in
rounds. In a round, every point with matched neighbours tries the warp of the best correlated one. All points
of a round are one batch.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from dic.basics import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation import subsets as warps
from dic.correlation.subsets import Correlation, Match, Noise, PictureStack, Shape
from dic.outcome import PointOutcome
from dic.stereo.epipolar_search import (
    SAMPLES,
    Candidates,
    Pair,
    StereoGates,
    StereoSearch,
    Subsets,
    fit_facet,
    in_mask,
    inside_picture,
    subsets,
)
from dic.stereo.epipolar_search import search as search_curves
from dic.stereo.geometry import directions

REACH = 3.0
"""Largest distance of neighbours, over the median distance of nearest points [-]."""


def neighbourhood(points: FloatArray, number: int) -> IntArray:
    """The nearest other points of each point, nearest first, shape [n, number]; -1 where there are fewer."""
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
    matched: BoolArray,
) -> BoolArray:
    """Match the remaining points from their neighbours. `match` and `matched` are filled in place.

    ``match``: match of all points; rows of the remaining points contain their last attempt.
    ``points``: positions in the material picture [px], shape [n, 2]. ``near``: `neighbourhood` of the points.
    ``attempts``: largest number of guesses per point. ``attempt``: function that matches points (rows) from
    guesses and returns which of them are accepted. ``matched``: points that may propagate their warps, shape
    [n]. Returns: points that had a guess, shape [n].
    """
    guessed, spent = matched.copy(), np.zeros(len(points), dtype=np.int64)
    used = near < 0  # neighbours that have been tried or do not exist
    while True:
        ready = np.where(used | ~matched[near], -np.inf, match.zncc[near])
        rows = np.flatnonzero(~matched & (spent < attempts) & np.any(np.isfinite(ready), axis=1))
        if not len(rows):
            return guessed
        best = np.argmax(ready[rows], axis=1)
        giver = near[rows, best]
        used[rows, best] = True
        spent[rows] += 1
        guessed[rows] = True
        guess = warps.neighbour_warp(match.warp[giver], points[rows] - points[giver])
        result, accepted = attempt(rows, guess)
        for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
            getattr(match, name)[rows] = getattr(result, name)
        matched[rows[accepted]] = True


MOST_SEARCHED = 31
"""Smallest default side of the subset for the search of whole epipolar curves [px]."""


def guided_match(pair: Pair) -> Match:
    """Match seeds, then neighbours of matched points, then all points with the requested shape function.

    A point without a guess is NO_FIRST_GUESS. A point that converged off its epipolar line or far from its
    guess is a STEREO_MISMATCH.
    """
    n = len(pair.points)
    near = neighbourhood(pair.points, pair.search.neighbours)
    whole = np.zeros((2, n), dtype=np.int64)
    match = Match(np.zeros((n, 12)), np.zeros((n, 2, 2)), np.zeros(n), whole[0], whole[1])
    matched, guessed = np.zeros((2, n), dtype=np.bool_)

    def attempt(rows: IntArray, guess: FloatArray) -> tuple[Match, BoolArray]:
        return _attempt(pair, rows, guess)

    while True:  # a region without matched neighbours gets further seeds
        before = matched.sum()
        _seed(pair, match, matched)
        if matched.sum() == before:
            break
        guessed |= propagate(match, pair.points, near, pair.search.attempts, attempt, matched)
    match.outcome[~guessed] = PointOutcome.NO_FIRST_GUESS
    wrong = guessed & ~matched & (match.outcome == PointOutcome.VALID)
    match.outcome[wrong] = PointOutcome.STEREO_MISMATCH
    rows = np.flatnonzero(matched)
    if pair.settings.shape > Shape.AFFINE and len(rows):
        _write(match, rows, pair.correlate(rows, match.warp[rows]))
    return match


def _seed(pair: Pair, match: Match, matched: BoolArray) -> None:
    """Search whole curves for seed points, which are spread over the remaining points."""
    rows = _spread_out(pair.points, ~matched, pair.search.seeds)
    side = pair.search.subset or max(pair.settings.subset, MOST_SEARCHED)
    templates = subsets(pair.pictures[0], pair.points[rows], pair.reference[rows], side, pair.mask)
    limits = pair.search.distances
    if limits is None and matched.any():  # the other points are near the known part of the surface
        matched_rows = np.flatnonzero(matched)
        limits = pair.around(matched_rows, match.warp[matched_rows])
    candidates = search_curves(
        pair.rig,
        templates,
        pair.pictures[1],
        limits=limits,
        turns=pair.search.turns,
        device=pair.stacks[0].device,
    )
    distinct = 1.0 - candidates.zncc < pair.search.distinct * (1.0 - candidates.second_peak)
    good = (candidates.zncc >= pair.search.least_zncc) & distinct
    result, accepted = _attempt(pair, rows[good], candidates.warp[good])
    rows = rows[good][accepted]
    _write(match, rows, result, accepted)
    matched[rows] = True


def _attempt(pair: Pair, rows: IntArray, guess: FloatArray) -> tuple[Match, BoolArray]:
    """An affine match, and the mask of the points that may propagate their warps."""
    result = pair.correlate(rows, guess, shape=Shape.AFFINE)
    converged = result.outcome == PointOutcome.VALID
    shift = np.linalg.norm(result.warp[:, :2] - guess[:, :2], axis=1)
    epipolar, sigma = pair.epipolar(rows, result)
    meets = np.abs(epipolar) <= pair.gates.epipolar + pair.gates.sigmas * sigma
    return result, converged & meets & (shift <= pair.settings.subset / 2.0)


def _spread_out(points: FloatArray, candidates: BoolArray, number: int) -> IntArray:
    """Rows of about `number` candidates, one per cell of a grid over them."""
    rows = np.flatnonzero(candidates)
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


Limits = tuple[float, float]

LOOSE = 0.02
"""Tolerance of the back match [px]. It can be coarse, because the gate is a few tenths. At a picture's border
pixels enter and leave the subset between steps, and a finer tolerance may never be reached."""
COARSE = 0.05
"""Smaller differences of 1 - ZNCC are not significant. Pixel steps and errors of the slope cause them."""
SUSPECT = 0.75
"""If the correlation of the second peak exceeds this, the search is repeated with all slopes. The first
search uses the slope of the match."""


@dataclass(frozen=True)
class GateValues:
    """Value for each gate, one row per point. inf where a value could not be computed."""

    sigma: FloatArray
    """Standard deviation of forward and back match [px], shape [n]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px], shape [n]."""
    epipolar_sigma: FloatArray
    """Its standard deviation due to the noise of the match [px], shape [n]."""
    facet: FloatArray
    """Deformation at the subset's border that no surface can cause [px], shape [n]."""
    incidence: FloatArray
    """Larger angle between the surface's normal and the two rays [rad], shape [n]."""
    back_match: FloatArray
    """Distance of the point from the result of its back match [px], shape [n]."""
    neighbours: FloatArray
    """Distance from the position predicted by the neighbours [px], shape [n]."""
    distinct: FloatArray
    """ZNSSD over that of the second peak [-], shape [n]. It is the worse of both directions."""
    distance: FloatArray
    """Distance along camera 0's ray [m], shape [n]."""
    unseen: FloatArray
    """Share of the masked subset outside a picture [-], shape [n]."""


def measure_gates(pair: Pair, match: Match) -> GateValues:
    """Values of the gates for every match; inf for a match that is not VALID."""
    n = len(pair.points)
    valid = match.outcome == PointOutcome.VALID
    rows = np.flatnonzero(valid)
    epipolar, epipolar_sigma = pair.epipolar(np.arange(n), match)
    neighbours = disagreement(
        pair.points, match.warp, neighbourhood(pair.points, pair.search.neighbours), valid
    )
    sigma, facet, incidence, back, distinct, distance, unseen = np.full((7, n), np.inf)
    if len(rows):
        warp = match.warp[rows]
        distance[rows] = pair.distances(rows, warp)
        A = slope(warp) @ np.linalg.inv(slope(pair.reference[rows]))
        fit = fit_facet(pair.rig, pair.places[rows], distance[rows], A)
        facet[rows] = fit.across * (pair.settings.subset / 2.0)
        incidence[rows] = np.maximum(*fit.incidence)
        unseen[rows] = _facing_away(pair, rows, warp)
        limits = pair.search.distances or pair.around(rows, warp)
        forward = _match_forward(pair, rows, A, limits)
        backward = _match_back(pair, rows, warp, A, limits)
        back_match = pair.correlate_back(rows, warp, backward.warp, LOOSE)
        off = np.linalg.norm(back_match.warp[:, :2] - pair.reference[rows, :2], axis=1)
        back[rows] = np.where(back_match.outcome == PointOutcome.VALID, off, np.inf)
        total = match.covariance[rows] + back_match.covariance
        sigma[rows] = np.sqrt(np.trace(total, axis1=1, axis2=2) / 2.0)
        reach = _reach(pair)
        shares = _share(forward, warp, reach), _share(backward, pair.reference[rows], reach)
        distinct[rows] = np.maximum(*shares)
    return GateValues(
        sigma, epipolar, epipolar_sigma, facet, incidence, back, neighbours, distinct, distance, unseen
    )


def disagreement(points: FloatArray, warp: FloatArray, near: IntArray, valid: BoolArray) -> FloatArray:
    """Distance of each point from the positions predicted by its neighbours, median over them [px], shape
    [n].

    The prediction is the neighbour's match plus the mapped step between the points. The mean of both
    gradients maps the step. It is exact for quadratic displacements.

    ``points``: places in the material picture [px], shape [n, 2]. ``warp``: total warps, shape [n, 12].
    ``near``: their neighbours, shape [n, k], -1 for none. ``valid``: matched points, shape [n]; only these
    are used as neighbours. Returns: inf for a point that is not matched or has no matched neighbour.
    """
    step = points[:, None] - points[near]
    gradient = warp[:, 2:6].reshape(-1, 2, 2)
    mean = (gradient[:, None] + gradient[near]) / 2.0
    off = warp[:, None, :2] - warp[near][..., :2] - np.einsum("nkij,nkj->nki", mean, step)
    usable = (near >= 0) & valid[near]
    result = np.full(len(points), np.inf)
    some = usable.any(axis=1) & valid
    if some.any():
        voted = np.where(usable[..., None], off, np.nan)[some]
        result[some] = np.linalg.norm(np.nanmedian(voted, axis=1), axis=1)
    return result


def slope(warp: FloatArray) -> FloatArray:
    """Derivative of the warped position by ξ at the point [-], shape [n, 2, 2]."""
    return np.asarray(np.eye(2) + warp[..., 2:6].reshape(*warp.shape[:-1], 2, 2))


def _facing_away(pair: Pair, rows: IntArray, warp: FloatArray) -> FloatArray:
    side = np.linspace(-0.5, 0.5, 9) * (pair.settings.subset - 1)
    xi = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    base = np.repeat(pair.points[rows, None], len(xi), axis=1)
    inside = np.ones(base.shape[:2], dtype=np.bool_)
    if pair.mask is not None:
        inside = in_mask(base + xi, pair.mask)
    visible = inside.copy()
    for picture, way in zip(pair.pictures, (pair.reference[rows], warp), strict=True):
        visible &= inside_picture(warps.apply(base, way[:, None], xi), picture.shape)
    return np.asarray(1.0 - visible.sum(axis=1) / np.maximum(inside.sum(axis=1), 1))


def _match_forward(pair: Pair, rows: IntArray, A: FloatArray, limits: Limits) -> Candidates:
    """Search of camera 0's subsets along camera 1's curves."""
    reference = pair.reference[rows]
    templates = subsets(pair.pictures[0], pair.points[rows], reference, pair.settings.subset, pair.mask)
    return _search_twice(pair, pair.rig, templates, pair.pictures[1], limits, A)


def _match_back(pair: Pair, rows: IntArray, warp: FloatArray, A: FloatArray, limits: Limits) -> Candidates:
    """Search of camera 1's subsets along camera 0's curves, within the same range of space."""
    templates = subsets(pair.pictures[1], pair.points[rows], warp, pair.settings.subset, pair.mask)
    first, second = pair.rig.cameras
    rays = directions(first, pair.places[rows])
    span = [np.linalg.norm(first.centre + rays * s - second.centre, axis=1) for s in limits]
    turned = replace(pair.rig, cameras=(second, first), covariance=None)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    limits = float(np.min(span)), float(np.max(span))
    return _search_twice(pair, turned, templates, pair.pictures[0], limits, inverse)


def _search_twice(
    pair: Pair,
    rig: StereoRig,
    templates: Subsets,
    picture: NDArray[np.float32],
    limits: Limits,
    A: FloatArray,
) -> Candidates:
    """Best positions and second peaks of subsets that are deformed as in the match. If the correlation of a
    second peak is close, the search is repeated with all slopes."""
    device = pair.stacks[0].device
    candidates = search_curves(rig, templates, picture, limits=limits, gradients=A, device=device)
    rows = np.flatnonzero(candidates.second_peak > SUSPECT)
    if len(rows):
        second = search_curves(
            rig, templates.take(rows), picture, limits=limits, turns=pair.search.turns, device=device
        )
        apart = np.linalg.norm(second.warp[:, :2] - candidates.warp[rows, :2], axis=1) > _reach(pair)
        second_peak = np.where(apart, np.maximum(second.zncc, second.second_peak), second.second_peak)
        candidates.second_peak[rows] = np.maximum(candidates.second_peak[rows], second_peak)
    return candidates


def _reach(pair: Pair) -> float:
    """Distance up to which positions on a curve count as equal [px]: a few of its steps."""
    return 2.0 + 2.0 * max(1, round(pair.settings.subset / SAMPLES))


def _share(candidates: Candidates, home: FloatArray, reach: float) -> FloatArray:
    """ZNSSD of the best position over that of the second peak. inf if the match is at another position."""
    at_home = np.linalg.norm(candidates.warp[:, :2] - home[:, :2], axis=1) <= reach
    share = np.maximum(1.0 - candidates.zncc, COARSE) / np.maximum(1.0 - candidates.second_peak, 1e-9)
    return np.where(at_home, share, np.inf)


class Gate(IntFlag):
    """Gates of a stereo match; a match may fail several."""

    CORRELATION = 1
    """The correlation failed: the outcome gives the reason."""
    EPIPOLAR = 2
    """The distance of the two rays is too large."""
    FACET = 4
    """The deformation of the subset is impossible for a surface seen by these cameras, or the surface is seen
    too obliquely."""
    BACK_MATCH = 8
    """The back match from camera 1 finds another position in camera 0, or none."""
    NEIGHBOURS = 16
    """The neighbours' warps predict another position, or there are no neighbours."""
    UNIQUENESS = 32
    """Another position on the epipolar line correlates nearly as well, or better."""
    DISTANCE = 64
    """The point lies outside the declared distances."""
    VIEW = 128
    """A camera's picture contains too little of the subset: its outcome is OUT_OF_VIEW."""


def failed_gates(
    gate_values: GateValues, gates: StereoGates, distances: tuple[float, float] | None = None
) -> IntArray:
    """Gates that each match fails, as a sum of `Gate` members, shape [n]."""
    v, (near, far) = gate_values, distances or (0.0, np.inf)
    with np.errstate(invalid="ignore"):  # inf (no value) fails every comparison
        noise = np.where(np.isfinite(v.sigma), gates.sigmas * v.sigma, 0.0)
        passes = {
            Gate.EPIPOLAR: np.abs(v.epipolar) <= gates.epipolar + gates.sigmas * v.epipolar_sigma,
            Gate.FACET: (v.facet <= gates.facet + noise) & (v.incidence <= np.radians(gates.incidence)),
            Gate.BACK_MATCH: v.back_match <= gates.back_match + noise,
            Gate.NEIGHBOURS: v.neighbours <= gates.neighbours + noise,
            Gate.UNIQUENESS: v.distinct <= gates.distinct,
            Gate.DISTANCE: (v.distance >= near) & (v.distance < far),
            Gate.VIEW: v.unseen <= gates.unseen,
        }
    failed = sum(np.where(passed, 0, int(gate)) for gate, passed in passes.items())
    return np.asarray(failed, dtype=np.int64)


@dataclass(frozen=True)
class StereoMatch:
    """Positions of camera 0's points in camera 1, one row per point. Rows that are not VALID contain the last
    attempt."""

    points: FloatArray
    """Positions in the material picture (x, y) [px], shape [n, 2]."""
    warp: FloatArray
    """Total warps from the material picture to camera 1's, shape [n, 12]."""
    covariance: FloatArray
    """Covariance of the position in camera 1 due to the noise of both pictures [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
    failed: IntArray
    """Failed gates, a sum of `Gate` members, shape [n]."""
    gate_values: GateValues
    """The value for each gate."""

    @property
    def valid(self) -> BoolArray:
        """Points that passed every gate, shape [n]."""
        return np.asarray(self.outcome == PointOutcome.VALID)

    def count(self) -> dict[Gate, int]:
        """Number of points that failed each gate; a point may fail several."""
        return {gate: int(np.sum(self.failed & int(gate) != 0)) for gate in Gate}


def match_stereo(
    picture0: ArrayLike,
    picture1: ArrayLike,
    points: ArrayLike,
    rig: StereoRig,
    settings: Correlation,
    *,
    noise: float | Noise | tuple[float | Noise, float | Noise],
    reference_warp: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    search: StereoSearch | None = None,
    gates: StereoGates | None = None,
    device: str = "cpu",
) -> StereoMatch:
    """Match points of camera 0's picture in camera 1's, and check every match by gates.

    A few seeds are searched along their whole epipolar curves. Their subsets are deformed like facets of
    several slopes. The other points get a guess from their neighbours, the most reliable first, and affine
    shape functions. The final match uses the shape function of `settings`. See :ref:`theory-stereo-matching`.

    Parameters
    ----------
    picture0, picture1
        Grey values of one instant, shapes [rows, columns]; the cameras' pictures may differ in shape.
    points
        Places in the material picture (x, y) [px], shape [n, 2].
    rig
        The cameras, for these pictures (`StereoRig.cropped`).
    settings
        Settings of the match; its shape function must be AFFINE or QUADRATIC.
    noise
        Standard deviation of a grey value, of both pictures or of each [grey].
    reference_warp
        Total warps from the material picture to `picture0`, shape [n, 12]; a row with a NaN is a point that
        camera 0 has lost. None: `picture0` is the material picture.
    mask
        Pixels of the material picture that belong to the specimen, shape [rows, columns]; None: all.
    search
        Settings of the search for first guesses.
    gates
        Gates that a match must pass.
    device
        Device of the correlation, "cpu" or "cuda".

    Returns
    -------
    StereoMatch
        The match, one row per point. A point that fails a gate is a STEREO_MISMATCH; a point whose
        correlation failed keeps the outcome of the correlation.

    Raises
    ------
    ValueError
        If the shape function is rigid, if shapes do not match, or if points or pictures are not finite.
    """
    search, gates = search or StereoSearch(), gates or StereoGates()
    if settings.shape < Shape.AFFINE:
        raise ValueError("shape must be AFFINE or QUADRATIC: two cameras never see a surface undeformed")
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ValueError(f"points must be finite and have shape [n, 2], got {points.shape}")
    reference = (
        np.zeros((len(points), 12)) if reference_warp is None else np.array(reference_warp, dtype=float)
    )
    if reference.shape != (len(points), 12):
        raise ValueError(f"reference_warp must have shape {(len(points), 12)}, got {reference.shape}")
    pictures = tuple(np.asarray(picture, dtype=np.float32) for picture in (picture0, picture1))
    noises = noise if isinstance(noise, tuple) else (noise, noise)
    stacks = tuple(
        PictureStack.prepare(picture[None], noise=grey, prefilter=settings.prefilter, device=device)
        for picture, grey in zip(pictures, noises, strict=True)
    )
    finite = np.all(np.isfinite(reference), axis=1)
    pair = Pair(
        rig=rig,
        pictures=(pictures[0], pictures[1]),
        stacks=(stacks[0], stacks[1]),
        points=points[finite],
        reference=reference[finite],
        mask=None if mask is None else np.asarray(mask),
        settings=settings,
        search=search,
        gates=gates,
    )
    return _spread(_judged(pair), points, finite)


def _judged(pair: Pair) -> StereoMatch:
    """The match of a pair, checked by the gates."""
    match = guided_match(pair)
    gate_values = measure_gates(pair, match)
    valid = match.outcome == PointOutcome.VALID
    failed = np.where(
        valid, failed_gates(gate_values, pair.gates, pair.search.distances), int(Gate.CORRELATION)
    )
    outcome = np.where(valid & (failed != 0), int(PointOutcome.STEREO_MISMATCH), match.outcome)
    outcome[valid & (failed & int(Gate.VIEW) != 0)] = PointOutcome.OUT_OF_VIEW
    return StereoMatch(pair.points, match.warp, match.covariance, match.zncc, outcome, failed, gate_values)


def _spread(part: StereoMatch, points: FloatArray, finite: BoolArray) -> StereoMatch:
    """The result for all points. Points that camera 0 has lost have no first guess."""
    if finite.all():
        return part

    def whole(values: NDArray, fill: float) -> NDArray:
        result = np.full((len(points), *values.shape[1:]), fill, dtype=values.dtype)
        result[finite] = values
        return result

    gate_values = GateValues(**{name: whole(value, np.inf) for name, value in vars(part.gate_values).items()})
    return StereoMatch(
        points=points,
        warp=whole(part.warp, 0.0),
        covariance=whole(part.covariance, 0.0),
        zncc=whole(part.zncc, 0.0),
        outcome=whole(part.outcome, int(PointOutcome.NO_FIRST_GUESS)),
        failed=whole(part.failed, int(Gate.CORRELATION)),
        gate_values=gate_values,
    )
