"""Gates of a stereo match, and the independent numbers that it is judged by."""

from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation import warp as warps
from dic.correlation.settings import Match
from dic.outcome import PointOutcome
from dic.stereo.epipolar_search import Candidates
from dic.stereo.epipolar_search import search as search_curves
from dic.stereo.facet import fit_facet
from dic.stereo.guided import neighbourhood
from dic.stereo.pair import Pair
from dic.stereo.rays import directions
from dic.stereo.settings import StereoGates
from dic.stereo.template import SAMPLES, Subsets, in_mask, inside_picture, subsets

Limits = tuple[float, float]

LOOSE = 0.02
"""Tolerance of the way back [px], which a gate of a few tenths judges; at a picture's rim, where pixels come
and go between the steps, a finer one may never be met."""
COARSE = 0.05
"""Differences of 1 - ZNCC that mean nothing: what steps of a pixel and a slope that is off hide."""
SUSPECT = 0.75
"""Correlation of a second peak from which on the search is repeated with every slope; the first has the
match's own."""


@dataclass(frozen=True)
class GateValues:
    """Number behind each gate, one row a point; inf where it could not be had."""

    sigma: FloatArray
    """Standard deviation of the match there and back [px], shape [n]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px], shape [n]."""
    epipolar_sigma: FloatArray
    """Standard deviation of it by the noise of the match [px], shape [n]."""
    facet: FloatArray
    """Deformation at the subset's rim that no surface can cause [px], shape [n]."""
    incidence: FloatArray
    """Larger angle between the surface's normal and the two rays [rad], shape [n]."""
    back_match: FloatArray
    """Distance from the point to where its match is found back [px], shape [n]."""
    neighbours: FloatArray
    """Distance from where the neighbours put it [px], shape [n]."""
    distinct: FloatArray
    """ZNSSD over that of the second peak, the worse of both directions [-], shape [n]."""
    distance: FloatArray
    """Along camera 0's ray [m], shape [n]."""
    unseen: FloatArray
    """Share of the subset within the mask that a picture does not hold [-], shape [n]."""


def measure_gates(pair: Pair, match: Match) -> GateValues:
    """Numbers of the gates for every match; a match that is not VALID has none."""
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
        unseen[rows] = _unseen(pair, rows, warp)
        limits = pair.search.distances or pair.around(rows, warp)
        there = _there(pair, rows, A, limits)
        again = _back(pair, rows, warp, A, limits)
        back_match = pair.correlate_back(rows, warp, again.warp, LOOSE)
        off = np.linalg.norm(back_match.warp[:, :2] - pair.reference[rows, :2], axis=1)
        back[rows] = np.where(back_match.outcome == PointOutcome.VALID, off, np.inf)
        both = match.covariance[rows] + back_match.covariance
        sigma[rows] = np.sqrt(np.trace(both, axis1=1, axis2=2) / 2.0)
        reach = _reach(pair)
        shares = _share(there, warp, reach), _share(again, pair.reference[rows], reach)
        distinct[rows] = np.maximum(*shares)
    return GateValues(
        sigma, epipolar, epipolar_sigma, facet, incidence, back, neighbours, distinct, distance, unseen
    )


def disagreement(points: FloatArray, warp: FloatArray, near: IntArray, valid: BoolArray) -> FloatArray:
    """Distance of each point from where its neighbours put it, median over them [px], shape [n].

    A neighbour puts it at its own match plus the step between them, taken through the mean of both
    gradients: exact for displacements of second order.

    Parameters
    ----------
    points
        Places in the material picture [px], shape [n, 2].
    warp
        Total warps, shape [n, 12].
    near
        Their neighbours, shape [n, k], -1 for none.
    valid
        Points that are matched, shape [n]; only those are asked.

    Returns
    -------
    NDArray
        inf for a point that is not matched or has no matched neighbour.
    """
    step = points[:, None] - points[near]
    gradient = warp[:, 2:6].reshape(-1, 2, 2)
    mean = (gradient[:, None] + gradient[near]) / 2.0
    off = warp[:, None, :2] - warp[near][..., :2] - np.einsum("nkij,nkj->nki", mean, step)
    asked = (near >= 0) & valid[near]
    result = np.full(len(points), np.inf)
    some = asked.any(axis=1) & valid
    if some.any():
        voted = np.where(asked[..., None], off, np.nan)[some]
        result[some] = np.linalg.norm(np.nanmedian(voted, axis=1), axis=1)
    return result


def slope(warp: FloatArray) -> FloatArray:
    """Gradient of the warped place by ξ at the point [-], shape [n, 2, 2]."""
    return np.asarray(np.eye(2) + warp[..., 2:6].reshape(*warp.shape[:-1], 2, 2))


def _unseen(pair: Pair, rows: IntArray, warp: FloatArray) -> FloatArray:
    side = np.linspace(-0.5, 0.5, 9) * (pair.settings.subset - 1)
    xi = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    base = np.repeat(pair.points[rows, None], len(xi), axis=1)
    wanted = np.ones(base.shape[:2], dtype=np.bool_)
    if pair.mask is not None:
        wanted = in_mask(base + xi, pair.mask)
    held = wanted.copy()
    for picture, way in zip(pair.pictures, (pair.reference[rows], warp), strict=True):
        held &= inside_picture(warps.apply(base, way[:, None], xi), picture.shape)
    return np.asarray(1.0 - held.sum(axis=1) / np.maximum(wanted.sum(axis=1), 1))


def _there(pair: Pair, rows: IntArray, A: FloatArray, limits: Limits) -> Candidates:
    """Camera 0's subsets, looked for along camera 1's curves."""
    reference = pair.reference[rows]
    wanted = subsets(pair.pictures[0], pair.points[rows], reference, pair.settings.subset, pair.mask)
    return _looked_for(pair, pair.rig, wanted, pair.pictures[1], limits, A)


def _back(pair: Pair, rows: IntArray, warp: FloatArray, A: FloatArray, limits: Limits) -> Candidates:
    """Camera 1's subsets, looked for along camera 0's curves, within the same span of space."""
    wanted = subsets(pair.pictures[1], pair.points[rows], warp, pair.settings.subset, pair.mask)
    first, second = pair.rig.cameras
    rays = directions(first, pair.places[rows])
    span = [np.linalg.norm(first.centre + rays * s - second.centre, axis=1) for s in limits]
    turned = replace(pair.rig, cameras=(second, first), covariance=None)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    limits = float(np.min(span)), float(np.max(span))
    return _looked_for(pair, turned, wanted, pair.pictures[0], limits, inverse)


def _looked_for(
    pair: Pair,
    rig: StereoRig,
    wanted: Subsets,
    picture: NDArray[np.float32],
    limits: Limits,
    A: FloatArray,
) -> Candidates:
    """Best places and second peaks of subsets deformed as matched; where a second peak comes near, of any
    slope."""
    device = pair.stacks[0].device
    found = search_curves(rig, wanted, picture, limits=limits, gradients=A, device=device)
    rows = np.flatnonzero(found.second_peak > SUSPECT)
    if len(rows):
        again = search_curves(
            rig, wanted.take(rows), picture, limits=limits, turns=pair.search.turns, device=device
        )
        apart = np.linalg.norm(again.warp[:, :2] - found.warp[rows, :2], axis=1) > _reach(pair)
        second_peak = np.where(apart, np.maximum(again.zncc, again.second_peak), again.second_peak)
        found.second_peak[rows] = np.maximum(found.second_peak[rows], second_peak)
    return found


def _reach(pair: Pair) -> float:
    """Distance up to which places on a curve count as the same [px]: a few of its steps."""
    return 2.0 + 2.0 * max(1, round(pair.settings.subset / SAMPLES))


def _share(candidates: Candidates, home: FloatArray, reach: float) -> FloatArray:
    """ZNSSD of the best place over that of the second peak; inf if the best place is not the match's."""
    at_home = np.linalg.norm(candidates.warp[:, :2] - home[:, :2], axis=1) <= reach
    share = np.maximum(1.0 - candidates.zncc, COARSE) / np.maximum(1.0 - candidates.second_peak, 1e-9)
    return np.where(at_home, share, np.inf)


class Gate(IntFlag):
    """Gates of a stereo match; several may be failed."""

    CORRELATION = 1
    """No match in the first place: its outcome says why."""
    EPIPOLAR = 2
    """The two rays pass each other too far apart."""
    FACET = 4
    """The subset deforms as no piece of surface seen by these cameras can, or one seen too obliquely."""
    BACK_MATCH = 8
    """Looked for from camera 1, the point is found elsewhere in camera 0, or not at all."""
    NEIGHBOURS = 16
    """The neighbours' warps put the point elsewhere, or there are none."""
    UNIQUENESS = 32
    """Another place on the epipolar line looks nearly as much alike, or more."""
    DISTANCE = 64
    """The point lies outside the declared distances."""
    VIEW = 128
    """A camera's picture holds too little of the subset: its outcome is OUT_OF_VIEW."""


def failed_gates(
    gate_values: GateValues, gates: StereoGates, distances: tuple[float, float] | None = None
) -> IntArray:
    """Gates that each match fails, as a sum of `Gate` members, shape [n].

    Parameters
    ----------
    evidence
        The numbers; one that could not be had fails its gate.
    gates
        The limits.
    distances
        Declared nearest and farthest distance along camera 0's rays [m].
    """
    near, far = distances if distances is not None else (0.0, np.inf)
    with np.errstate(invalid="ignore"):  # inf, where there is no evidence, passes no comparison
        noise = np.where(np.isfinite(gate_values.sigma), gates.sigmas * gate_values.sigma, 0.0)
        passes = (
            (
                Gate.EPIPOLAR,
                np.abs(gate_values.epipolar) <= gates.epipolar + gates.sigmas * gate_values.epipolar_sigma,
            ),
            (
                Gate.FACET,
                (gate_values.facet <= gates.facet + noise)
                & (gate_values.incidence <= np.radians(gates.incidence)),
            ),
            (Gate.BACK_MATCH, gate_values.back_match <= gates.back_match + noise),
            (Gate.NEIGHBOURS, gate_values.neighbours <= gates.neighbours + noise),
            (Gate.UNIQUENESS, gate_values.distinct <= gates.distinct),
            (Gate.DISTANCE, (gate_values.distance >= near) & (gate_values.distance < far)),
            (Gate.VIEW, gate_values.unseen <= gates.unseen),
        )
    return np.asarray(sum(np.where(passed, 0, int(gate)) for gate, passed in passes), dtype=np.int64)
