"""The numbers that a stereo match is judged by, each found in a way of its own."""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from dic.correlation import warp as warps
from dic.stereo.settings import StereoGates

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class Gate(IntFlag):
    """What a match failed; several may be set."""

    CORRELATION = 1
    """No match in the first place: its outcome says why."""
    EPIPOLAR = 2
    """The two lines of sight pass each other too far apart."""
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


@dataclass(frozen=True)
class Evidence:
    """The number behind each gate, one row a point; inf where it could not be had."""

    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px], shape [n]."""
    epipolar_sigma: FloatArray
    """Standard deviation of it by the noise of the match [px], shape [n]."""
    facet: FloatArray
    """Deformation at the subset's rim that no surface can cause [px], shape [n]."""
    incidence: FloatArray
    """Larger angle between the surface's normal and the two lines of sight [rad], shape [n]."""
    back_match: FloatArray
    """Distance from the point to where its match is found back [px], shape [n]."""
    neighbours: FloatArray
    """Distance from where the neighbours put it [px], shape [n]."""
    distinct: FloatArray
    """ZNSSD over that of the best rival, the worse of both directions [-], shape [n]."""
    distance: FloatArray
    """Along camera 0's line of sight [m], shape [n]."""


def judge(
    evidence: Evidence,
    sigma: FloatArray,
    gates: StereoGates,
    distances: tuple[float, float] | None,
) -> IntArray:
    """Gates that each match fails, as a sum of `Gate` members, shape [n].

    Parameters
    ----------
    evidence
        The numbers.
    sigma
        Standard deviation of the match, the worse of both directions [px], shape [n].
    gates
        The limits.
    distances
        Declared nearest and farthest distance along camera 0's lines of sight [m].
    """
    wide = gates.sigmas * sigma
    near, far = distances if distances is not None else (0.0, np.inf)
    oblique = evidence.incidence > np.radians(gates.incidence)
    fails = (
        (Gate.EPIPOLAR, np.abs(evidence.epipolar) > gates.epipolar + gates.sigmas * evidence.epipolar_sigma),
        (Gate.FACET, (evidence.facet > gates.facet + wide) | oblique),
        (Gate.BACK_MATCH, evidence.back_match > gates.back_match + wide),
        (Gate.NEIGHBOURS, evidence.neighbours > gates.neighbours + wide),
        (Gate.UNIQUENESS, evidence.distinct > gates.distinct),
        (Gate.DISTANCE, ~((evidence.distance >= near) & (evidence.distance <= far))),
    )
    return np.asarray(sum(np.where(failed, int(gate), 0) for gate, failed in fails), dtype=np.int64)


def neighbours_disagree(points: FloatArray, warp: FloatArray, near: IntArray, valid: BoolArray) -> FloatArray:
    """How far each point lies from where its neighbours put it, median over them [px], shape [n].

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
    """
    step = points[:, None] - points[near]
    gradient = warp[:, 2:6].reshape(-1, 2, 2)
    mean = (gradient[:, None] + gradient[near]) / 2.0
    off = warp[:, None, :2] - warp[near][..., :2] - np.einsum("nkij,nkj->nki", mean, step)
    asked = (near >= 0) & valid[near]
    result = np.full(len(points), np.inf)
    some = asked.any(axis=1) & valid
    voted = np.where(asked[..., None], off, np.nan)[some]
    if some.any():
        result[some] = np.linalg.norm(np.nanmedian(voted, axis=1), axis=1)
    return result


def pulled_back(points: FloatArray, warp: FloatArray, places: FloatArray) -> FloatArray:
    """Offsets ξ in the material picture whose warp is `places`, by Newton's method [px], shape [n, 2]."""
    xi = np.zeros_like(points)
    for _ in range(4):  # quadratic convergence from half a pixel away
        off = warps.apply(points, warp, xi) - places
        xi = xi - np.linalg.solve(slope(warp, xi), off[..., None])[..., 0]
    return xi


def slope(warp: FloatArray, xi: FloatArray | float = 0.0) -> FloatArray:
    """Gradient of the warped place by ξ [-], shape [n, 2, 2]."""
    step = np.broadcast_to(np.asarray(xi, dtype=np.float64), (*warp.shape[:-1], 2))
    return np.eye(2) + warps.carried(warp, step)[..., 2:6].reshape(*warp.shape[:-1], 2, 2)
