"""Translations of the flyer along the axis, one a frame, from all points that either camera sees; the rim of
its face."""

from dataclasses import dataclass

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.images import Pictures
from dic.outcome import PointOutcome
from dic.rigid_body.edge_registration import RegisteredEdge
from dic.rigid_body.frames_before import SEARCH_RANGE, consistent_frames, registered_edges
from dic.rigid_body.rest_from_rim import RestGeometry, Rim, find_rim
from dic.rigid_body.translation import FREE, LEAST_LATERAL, lateral_places, translation_in
from dic.stereo.rays import pixels_per_length
from dic.surfaces import SpecimenFrame
from dic.surfaces.overlap import overlap_matrix

OWN_SHARE = 0.5
"""Share of the variance of a match that is the frame's own; the rest is the reference's, common to all."""
ROUNDS = 4
"""Alternating estimates of places on the body and translations."""


@dataclass(frozen=True)
class Translations:
    """Translations of a body along the axis, frame by frame; a frame in which it was not found has no row."""

    frame: IntArray
    """Frames, shape [n]."""
    y: FloatArray
    """Translations [m], shape [n]."""
    sigma: list[float]
    """Standard deviations from frame to frame [m]."""
    n_points: list[int]
    """Points that each is from; 0: the edge strip."""
    common: float
    """Standard deviation that the frames at rest have in common: what the place across the axis may be off
    by there, seen along the axis [m]."""
    pixel: float
    """Length along the axis that a pixel shows [m]."""
    places: FloatArray
    """Places of the points on the body, at translation zero [m], shape [n, 3]."""


def rim_of(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    pictures: tuple[Pictures, Pictures],
    geometry: RestGeometry,
) -> Rim | None:
    """The rim of the body's face, which nothing of `translations` is needed for; arguments as of
    `dic.rigid_body.axial_displacement.axial_displacement`."""
    if not (body.reconstruction.outcome == PointOutcome.VALID).any():
        return None
    return find_rim(pictures, body, rig, frame, *seen_twice(body, frame), geometry)


def seen_twice(body: TrackedBody, frame: SpecimenFrame) -> tuple[FloatArray, FloatArray]:
    """Places of the points on the body [m], shape [n_points, 3], and translations of the frames [m], shape
    [n_frames, 3], by what both cameras saw; NaN where unknown."""
    seen = body.reconstruction.outcome == PointOutcome.VALID
    return _places(frame.positions(np.where(seen[..., None], body.reconstruction.position, np.nan)))


def translations(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    t: FloatArray,
    static: BoolArray,
    *,
    subset: int,
    pictures: tuple[Pictures, Pictures] | None = None,
) -> Translations | None:
    """Translations of a body along the axis; arguments as of
    `dic.rigid_body.axial_displacement.axial_displacement`, None if no point was ever seen by both cameras."""
    both = body.reconstruction.outcome == PointOutcome.VALID
    if not both.any():
        return None
    places, moves = seen_twice(body, frame)
    known = np.asarray(np.isfinite(places).all(axis=1))
    rows, found, sigma, counts, common = [], [], [], [], 0.0
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    overlap = overlap_matrix(body.points, subset)
    middle = frame.in_rig(np.median(places[known], axis=0) + moves[twice[0]])
    pixel = 1.0 / float(np.linalg.norm(pixels_per_length(rig.cameras[0], middle, frame.rotation[1])))
    across, lateral, place_sigma = lateral_places(t, moves, both.sum(axis=1), pixel)
    for k in range(len(t)):
        near = moves[twice[np.argmin(np.abs(twice - k))]]
        sure = FREE * pixel
        if not np.isfinite(moves[k]).all():
            near, sure = np.array([across[k, 0], near[1], across[k, 1]]), LEAST_LATERAL * pixel
        fit = translation_in(body, rig, frame, k, places, known, near, sure, overlap)
        if fit is not None and static[k] and k not in twice and not common:
            off = np.hypot(place_sigma, lateral[k])
            beside = near + np.array([off[0], 0.0, off[1]])
            other = translation_in(body, rig, frame, k, places, known, beside, sure, overlap)
            common = 0.0 if other is None else abs(other[0] - fit[0])
        if fit is not None:
            rows.append(k)
            found.append(fit[0])
            sigma.append(fit[1])
            counts.append(fit[2])
    fine = np.flatnonzero(consistent_frames(rows, found, counts, static, SEARCH_RANGE * pixel)).tolist()
    rows, found = [rows[i] for i in fine], [found[i] for i in fine]
    sigma, counts = [sigma[i] for i in fine], [counts[i] for i in fine]
    if body.material in rows and len(rows) > 1:  # exact there, but not against all others
        at = rows.index(body.material)
        beside = [sigma[k] for k in (at - 1, at + 1) if 0 <= k < len(rows)]
        sigma[at] = max(sigma[at], min(beside))
    by_edge = bool(rows) and not static[rows].any() and pictures is not None
    if by_edge and pictures is not None:
        for k, edge in registered_edges(
            pictures, body, rig, frame, places[known], moves, rows, found, static
        ):
            rows.insert(0, k)
            found.insert(0, edge.y)
            sigma.insert(0, edge.sigma if static[k] else of_moving(edge))
            counts.insert(0, 0)
            common = edge.common  # the last is the first frame's, at rest
    return Translations(
        frame=np.array(rows, dtype=np.int64),
        y=np.array(found),
        sigma=sigma,
        n_points=counts,
        common=common,
        pixel=pixel,
        places=places[known],
    )


def of_moving(edge: RegisteredEdge) -> float:
    """Standard deviation of the registration of a frame that moves, with what frames at rest share [m].

    Static frames show the same rows, and what these are off by is in the place at rest. A body that moves
    shows others in every frame, and the last of its own at another place between two rows of the picture:
    there it is the frame's own, all of it, where of a match only `OWN_SHARE` of the variance is.
    """
    return float(np.hypot(edge.sigma, edge.common / OWN_SHARE**0.5))


def _places(position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places of points on the body [n_points, 3] and translations of the frames [n_frames, 3]; NaN if
    unknown."""
    moves = np.full((len(position), 3), np.nan)
    start = int(np.argmax(np.isfinite(position[..., 0]).sum(axis=1)))
    places = position[start].copy()
    for _ in range(ROUNDS):
        moves = _mean(position - places, axis=1)
        places = _mean(position - moves[:, None], axis=0)
    return places, moves


def _mean(values: FloatArray, axis: int) -> FloatArray:
    """Mean of what is finite, NaN where nothing is."""
    good = np.isfinite(values)
    count = good.sum(axis=axis)
    total = np.where(good, values, 0.0).sum(axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
