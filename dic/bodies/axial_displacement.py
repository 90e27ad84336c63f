"""Axial displacement of the flyer: one translation per frame, by least squares over the pixels of both
cameras.

Every point that at least one camera sees is used. The rim of the flyer's face gives its position at rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from dic.basics import MEDIAN_LENGTH, BoolArray, FloatArray, IntArray
from dic.bodies.edge_registration import SEARCH_RANGE, RegisteredEdge, consistent_frames, registered_edges
from dic.bodies.follow import TrackedBody
from dic.bodies.rest_from_rim import RestGeometry, Rim, face_width, find_rim
from dic.camera import Camera, StereoRig
from dic.correlation.subsets import apply, overlap_matrix
from dic.images import Pictures
from dic.outcome import PointOutcome
from dic.stereo.geometry import pixels_per_length, projection_slope
from dic.surfaces.cylinder import SpecimenFrame
from dic.tracking import Track

FREE = 9.0
"""Prior standard deviation of the lateral motion, over the length of a pixel [-]. It is used where both
cameras see the body and determine this motion."""
LATERAL_SIGMA = 0.9
"""Largest standard deviation of the lateral motion where only one camera sees the body, over the length of a
pixel [-]. The motion counts from the nearest frame that both cameras see."""
LEAST_LATERAL = 0.02
"""Smallest value of this standard deviation [-]. It is also the prior if only one camera ever sees the body.
It is small because one camera measures depth only by perspective, and warm air causes similar
displacements."""
NEAREST = 20
"""The mean of this number of frames gives the lateral position of a body. Both cameras must see these
frames."""
FEWEST_FRAMES = 10
"""Smallest number of frames seen by both cameras for an estimate of the lateral velocity."""
GATE = 5.0
"""Outlier threshold: a point this many robust standard deviations off the body's motion is left out [-]."""


@dataclass(frozen=True)
class ObservedPoints:
    """Points of a body in several frames of one camera, frame by frame."""

    camera: Camera
    frame: IntArray
    """Index of the frame of each observation, in increasing order, shape [n]."""
    rows: IntArray
    """The points, shape [n]."""
    places: FloatArray
    """Their positions on the body [m], shape [n, 3]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    covariance: FloatArray
    """Covariance of the pixels [px²], shape [n, 2, 2]."""

    @cached_property
    def noise(self) -> FloatArray:
        """Standard deviation of a coordinate [px], shape [n]."""
        return np.asarray(np.sqrt(0.5 * np.trace(self.covariance, axis1=1, axis2=2)))

    @classmethod
    def of(
        cls, camera: Camera, track: Track, frames: IntArray, places: FloatArray, finite: BoolArray
    ) -> "ObservedPoints":
        """The `finite` points that were found in these frames."""
        k, rows = np.nonzero(finite & (track.outcome[frames] == PointOutcome.VALID))
        pixels = apply(track.points[rows], track.warp[frames[k], rows])
        return cls(camera, k, rows, places[rows], pixels, track.covariance[frames[k], rows])

    def off(self, frame: SpecimenFrame, moves: FloatArray) -> FloatArray:
        """Residuals: observed pixels minus those of a body displaced by `moves` [px], shape [n, 2].
        ``moves``: displacement in each frame [m], shape [n_frames, 3]."""
        return np.asarray(self.pixels - self.camera.project(frame.in_rig(self.places + moves[self.frame])))

    def inliers(self, off: FloatArray) -> BoolArray:
        """Points within `GATE` robust standard deviations of the body's motion in their frame, shape [n]."""
        size = np.linalg.norm(off - _medians(off, self.frame), axis=1)
        spread = np.maximum(1.0, _medians(size / self.noise, self.frame) / MEDIAN_LENGTH)
        return np.asarray(size <= GATE * spread * self.noise)


def _medians(values: FloatArray, frame: IntArray) -> FloatArray:
    """Median over the values of the same frame for each value, shape of `values`. Frames are in order."""
    first, end = (np.searchsorted(frame, frame, side=side) for side in ("left", "right"))
    columns = np.atleast_2d(values.T)
    ordered = np.stack([column[np.lexsort((column, frame))] for column in columns], axis=1)
    middle = 0.5 * (ordered[(first + end - 1) // 2] + ordered[(first + end) // 2])
    return np.asarray(middle.reshape(values.shape))


def lateral_places(
    t: FloatArray, moves: FloatArray, counts: IntArray, pixel: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lateral position of a body in frames that only one camera sees, from those that both see.

    It is the mean over the `NEAREST` of these frames, weighted with the number of points, because the nearest
    frame has the fewest points. The lateral velocity of the body is constant in flight. The bound of the
    velocity is its estimate plus twice its standard deviation. This bound times the time to these frames
    limits the additional displacement. The scatter of the frames about their straight line limits the error
    of the position, which is common to all frames.
    """
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    across, weight = moves[twice][:, [0, 2]], counts[twice].astype(np.float64)
    low, high = LEAST_LATERAL * pixel, LATERAL_SIGMA * pixel
    near = [twice_near[:NEAREST] for twice_near in np.argsort(np.abs(t[:, None] - t[twice]), axis=1)]
    place = np.array([np.average(across[rows], axis=0, weights=weight[rows]) for rows in near])
    if twice.size < FEWEST_FRAMES:
        return place, np.full(len(t), high), np.full(2, low)
    since = t[twice] - np.average(t[twice], weights=weight)
    spread = float(weight @ since**2)
    slope = (weight * since) @ across / spread
    off = across - np.average(across, axis=0, weights=weight) - np.outer(since, slope)
    scatter = np.sqrt((weight @ off**2) / weight.sum() * twice.size / (twice.size - 2))
    slope_sigma = scatter * np.sqrt(weight.sum() / (twice.size * spread))
    speed = float(np.linalg.norm(np.abs(slope) + 2.0 * slope_sigma))
    apart = np.abs(t - [np.average(t[twice[rows]], weights=weight[rows]) for rows in near])
    return place, np.clip(speed * apart, low, high), scatter


MOST_OBSERVATIONS = 200_000
"""Largest number of points times frames that are fitted together. The memory grows with it."""


def _translations_in(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    frames: IntArray,
    places: FloatArray,
    finite: BoolArray,
    near: FloatArray,
    lateral: FloatArray,
    overlap: csr_array,
) -> tuple[BoolArray, FloatArray, FloatArray, IntArray]:
    """Frames that show the body, its translations along y [m], their standard deviations and the numbers of
    points, shape of `frames` each. ``lateral``: prior standard deviations of the translation across y from
    the lateral position of `near` [m]."""
    observed = [
        ObservedPoints.of(camera, track, frames, places, finite)
        for camera, track in zip(rig.cameras, body.tracks, strict=True)
    ]
    moves, keep = near.copy(), [np.ones(len(points.rows), dtype=bool) for points in observed]
    off = [points.off(frame, moves) for points in observed]
    shows = np.ones(len(frames), dtype=bool)
    for _ in range(3):
        used = np.zeros((len(observed), len(places), len(frames)))
        for points, fine, by_point in zip(observed, keep, used, strict=True):
            by_point[points.rows[fine], points.frame[fine]] = 1.0
        shows &= used.any(axis=(0, 1))
        H = lateral[:, None, None] ** -2 * np.diag([1.0, 0.0, 1.0])
        g = (H @ (near - moves)[..., None])[..., 0]
        for points, fine, away, by_point in zip(observed, keep, off, used, strict=True):
            k, at = points.frame[fine], points.places[fine] + moves[points.frame[fine]]
            J = projection_slope(points.camera, frame.in_rig(at)) @ frame.rotation.T
            factor = (overlap @ by_point)[points.rows[fine], k]
            weighted = np.linalg.solve(points.covariance[fine] * factor[:, None, None], J)
            first = np.flatnonzero(np.diff(k, prepend=-1))
            H[k[first]] += np.add.reduceat(np.swapaxes(J, 1, 2) @ weighted, first)
            g[k[first]] += np.add.reduceat(np.einsum("nij,ni->nj", weighted, away[fine]), first)
        H[~shows] = np.eye(3)
        moves = moves + np.linalg.solve(H, g[..., None])[..., 0]
        off = [points.off(frame, moves) for points in observed]
        keep = [points.inliers(away) for points, away in zip(observed, off, strict=True)]
    counted = np.zeros((len(frames), len(places)), dtype=bool)
    for points, fine in zip(observed, keep, strict=True):
        counted[points.frame[fine], points.rows[fine]] = True
    counts = counted.sum(axis=1)
    return shows & (counts > 0), moves[:, 1], np.sqrt(np.linalg.inv(H)[:, 1, 1]), counts


OWN_SHARE = 0.5
"""Share of the variance of a match that comes from the current frame. The rest comes from the reference and
is common to all frames."""
ROUNDS = 4
"""Number of alternating estimates of positions on the body and translations."""


@dataclass(frozen=True)
class Translations:
    """Translations of a body along the axis, frame by frame. A frame in which it was not found has no row."""

    frame: IntArray
    """Frames, shape [n]."""
    y: FloatArray
    """Translations [m], shape [n]."""
    sigma: list[float]
    """Standard deviations, independent from frame to frame [m]."""
    n_points: list[int]
    """Number of points of each frame; 0 for a translation from the edge strip."""
    common: float
    """Standard deviation common to all frames at rest [m]: the effect of an error of the lateral position on
    the axial one."""
    pixel: float
    """Length along the axis that one pixel shows [m]."""
    places: FloatArray
    """Positions of the points on the body, at translation zero [m], shape [n, 3]."""


def rim_of(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    pictures: tuple[Pictures, Pictures],
    geometry: RestGeometry,
) -> Rim | None:
    """The rim of the body's face. ``geometry``: the specimen at rest; other parameters as for
    `translations`."""
    if not (body.reconstruction.outcome == PointOutcome.VALID).any():
        return None
    return find_rim(pictures, body, rig, frame, *stereo_translations(body, frame), geometry)


def stereo_translations(body: TrackedBody, frame: SpecimenFrame) -> tuple[FloatArray, FloatArray]:
    """Positions of the points on the body [m], shape [n_points, 3], and translations of the frames [m], shape
    [n_frames, 3], from points seen by both cameras; NaN where unknown."""
    valid = body.reconstruction.outcome == PointOutcome.VALID
    return _places(frame.positions(np.where(valid[..., None], body.reconstruction.position, np.nan)))


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
    """Translations of a body along the axis, None if no point was ever seen by both cameras.

    The positions of the points on the body come from the frames in which both cameras see them. The
    translation of every frame is then the weighted least-squares fit to all pixels of both cameras. If only
    one camera sees the body, the nearest frames of both cameras constrain its lateral position.

    ``t``: frame times [s], and ``static``: frames in which the flyer is at rest, both of shape [n_frames].
    ``subset``: side of the subsets [px]: those that overlap share their noise. ``pictures``: both series. The
    first point may come into view only after the static frames. Then the edge strip of the body is registered
    in the earlier frames (`dic.bodies.edge_registration`). None: no registration.
    """
    valid = body.reconstruction.outcome == PointOutcome.VALID
    if not valid.any():
        return None
    places, moves = stereo_translations(body, frame)
    finite = np.asarray(np.isfinite(places).all(axis=1))
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    overlap = overlap_matrix(body.points, subset)
    middle = frame.in_rig(np.median(places[finite], axis=0) + moves[twice[0]])
    pixel = 1.0 / float(np.linalg.norm(pixels_per_length(rig.cameras[0], middle, frame.rotation[1])))
    across, lateral, place_sigma = lateral_places(t, moves, valid.sum(axis=1), pixel)
    every, unseen = np.arange(len(t)), ~np.isfinite(moves).all(axis=1)
    near = moves[twice[np.argmin(np.abs(twice - every[:, None]), axis=1)]]
    near[unseen, ::2] = across[unseen]
    sure = np.where(unseen, LEAST_LATERAL, FREE) * pixel

    def fit(some: IntArray, near: FloatArray) -> tuple[NDArray[Any], ...]:
        return _translations_in(body, rig, frame, some, places, finite, near, sure[some], overlap)

    blocks = np.array_split(every, -(-every.size * len(places) // MOST_OBSERVATIONS))
    fitted = zip(*(fit(some, near[some]) for some in blocks), strict=True)
    shows, y, sigmas, numbers = map(np.concatenate, fitted)
    common = 0.0
    for one in np.flatnonzero(shows & static & unseen)[:, None]:
        aside = np.hypot(place_sigma, lateral[one[0]])
        also, beside, *_ = fit(one, near[one] + np.array([aside[0], 0.0, aside[1]]))
        common = float(abs(beside - y[one])[0]) if also[0] else 0.0
        if common:
            break
    rows, fits, sigma, counts = (of[shows].tolist() for of in (every, y, sigmas, numbers))
    fine = np.flatnonzero(consistent_frames(rows, fits, counts, static, SEARCH_RANGE * pixel)).tolist()
    rows, fits = [rows[i] for i in fine], [fits[i] for i in fine]
    sigma, counts = [sigma[i] for i in fine], [counts[i] for i in fine]
    if body.material in rows and len(rows) > 1:  # exact in this frame, but not relative to other frames
        at = rows.index(body.material)
        displaced = [sigma[k] for k in (at - 1, at + 1) if 0 <= k < len(rows)]
        sigma[at] = max(sigma[at], min(displaced))
    by_edge = bool(rows) and not static[rows].any() and pictures is not None
    if by_edge and pictures is not None:
        for k, edge in registered_edges(
            pictures, body, rig, frame, places[finite], moves, rows, fits, static
        ):
            rows.insert(0, k)
            fits.insert(0, edge.y)
            sigma.insert(0, edge.sigma if static[k] else of_moving(edge))
            counts.insert(0, 0)
            common = edge.common  # the last one belongs to the first frame, at rest
    return Translations(
        frame=np.array(rows, dtype=np.int64),
        y=np.array(fits),
        sigma=sigma,
        n_points=counts,
        common=common,
        pixel=pixel,
        places=places[finite],
    )


def of_moving(edge: RegisteredEdge) -> float:
    """Standard deviation of the registration of a moving frame [m]. It includes the error common to frames at
    rest.

    Static frames show the same rows; the position at rest contains their error. A moving body shows different
    rows in every frame, and its last row at another sub-pixel position. The error of the rows is then
    independent in each frame. For a match only `OWN_SHARE` of the variance is independent.
    """
    return float(np.hypot(edge.sigma, edge.common / OWN_SHARE**0.5))


def _places(position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions of points on the body [n_points, 3] and translations of the frames [n_frames, 3]; NaN if
    unknown."""
    moves = np.full((len(position), 3), np.nan)
    start = int(np.argmax(np.isfinite(position[..., 0]).sum(axis=1)))
    places = position[start].copy()
    for _ in range(ROUNDS):
        moves = _mean(position - places, axis=1)
        places = _mean(position - moves[:, None], axis=0)
    return places, moves


def _mean(values: FloatArray, axis: int) -> FloatArray:
    """Mean of the finite values; NaN where there are none."""
    good = np.isfinite(values)
    count = good.sum(axis=axis)
    total = np.where(good, values, 0.0).sum(axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


MODEL = 0.008
"""Standard deviation of the mean position at rest due to errors common to the static frames: warm air,
interpolation [px]."""
FACE_SHARE, NARROW_FACE = 0.001, 1.0
"""Additional error where a camera sees the flyer's face next to its rim. It is the first value times the
face's visible width, if this width exceeds the second value [px]. The face moves with the flyer, but the
hidden part of the specimen does not."""
FEWEST_AT_REST = 3
"""If fewer static frames show the body, the others also get its position at rest."""
MOST_APART = 4.0
"""Largest disagreement of two positions at rest that are combined, in standard deviations."""


@dataclass(frozen=True)
class AxialDisplacement:
    """Displacement of the flyer toward the specimen; frames in which it was not found have no row."""

    t: FloatArray
    """Times [s], shape [n]."""
    frame: IntArray
    """Frames, shape [n]."""
    displacement: FloatArray
    """Displacement toward the specimen from the mean position at rest [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation, independent from frame to frame [m], shape [n]."""
    n_points: IntArray
    """Number of points used, shape [n]."""
    rest_sigma: float
    """Standard deviation of the mean position at rest [m]. It is common to all later displacements."""
    from_rim: bool = False
    """True if no static frame shows the body. The rim of the body's face at the specimen's upper end then
    gives the position at rest. The displacement in the static frames is zero by declaration."""
    rim_disagreement: tuple[float, float] | None = None
    """Height at rest of the rim of the body's face above the specimen's upper end, and its standard deviation
    [m]. The specimen's length gives the upper end. None if the body or its rim is not visible at rest."""


def from_rest(
    motion: Translations | None,
    rim: Rim | None,
    rig: StereoRig,
    frame: SpecimenFrame,
    t: FloatArray,
    static: BoolArray,
    geometry: RestGeometry | None,
) -> AxialDisplacement | None:
    """Displacement from the position at rest, from the results of `translations` and `rim_of`.

    ``geometry``: the specimen at rest. If no static frame shows the body, its rim gives the position at rest
    (`dic.bodies.rest_from_rim`). None: not known. Returns None if the cameras never saw a common point, or if
    the position at rest is not known. It is not known if no static frame shows the body and too few frames
    show its rim.
    """
    if motion is None:
        return None
    index, y, sigma, counts = motion.frame, motion.y, motion.sigma, motion.n_points
    at_rest = static[index]
    from_rim = not at_rest.any()
    disagreement = None
    if at_rest.any():
        rest_y = float(np.mean(y[at_rest]))
        face = 0.0 if geometry is None else _widest_face(rig, frame, motion.places, geometry) / motion.pixel
        rest_sigma = float(
            np.hypot(
                np.hypot(_of_mean(np.array(sigma)[at_rest]), motion.common), common_sigma(face) * motion.pixel
            )
        )
        if rim is not None and geometry is not None:
            by_end = geometry.length - rim.y
            sigma_by_end = float(np.hypot(rim.sigma, geometry.length_sigma))
            disagreement = (rest_y - by_end, float(np.hypot(sigma_by_end, rest_sigma)))
            rest_y, rest_sigma = combine_rest((rest_y, rest_sigma), (by_end, sigma_by_end))
        if int(at_rest.sum()) < FEWEST_AT_REST:
            index, y, sigma, counts = include_static_frames(
                np.flatnonzero(static), rest_y, index, y, sigma, counts
            )
    else:
        if rim is None or geometry is None or not geometry.length_is_certain:
            return None
        # Until the flyer moves, its face is the specimen's upper end: no displacement in the static frames.
        rest_y = geometry.length - rim.y
        rest_sigma = float(np.hypot(rim.sigma, geometry.length_sigma))
        if not replace(geometry, length_sigma=rest_sigma).length_is_certain:
            return None
        index, y, sigma, counts = include_static_frames(
            np.flatnonzero(static), rest_y, index, y, sigma, counts
        )
    return AxialDisplacement(
        t=t[index],
        frame=index,
        displacement=rest_y - y,
        sigma=np.array(sigma) * OWN_SHARE**0.5,
        n_points=np.array(counts, dtype=np.int64),
        rest_sigma=rest_sigma,
        from_rim=from_rim,
        rim_disagreement=disagreement,
    )


def include_static_frames(
    static: IntArray, rest_y: float, index: IntArray, y: FloatArray, sigma: list[float], counts: list[int]
) -> tuple[IntArray, FloatArray, list[float], list[int]]:
    """Add the static frames that do not show the body. There its displacement is that at rest."""
    still = np.setdiff1d(static, index)
    order = np.argsort(np.concatenate([still, index]), kind="stable")
    spread = np.concatenate([np.full(still.size, float(np.median(sigma))), sigma])[order]
    n = np.concatenate([np.zeros(still.size, dtype=np.int64), counts])[order]
    return (
        np.concatenate([still, index])[order],
        np.concatenate([np.full(still.size, rest_y), y])[order],
        spread.tolist(),
        n.tolist(),
    )


def common_sigma(face: float) -> float:
    """The part of the standard deviation of the mean position at rest that more static frames do not reduce
    [px]. ``face``: widest strip of the flyer's face that a camera sees [px]."""
    return float(np.hypot(MODEL, FACE_SHARE * max(face - NARROW_FACE, 0.0)))


def _widest_face(rig: StereoRig, frame: SpecimenFrame, places: FloatArray, geometry: RestGeometry) -> float:
    """Widest strip of the flyer's face that either camera sees at rest [m]."""
    radius = float(np.median(np.hypot(places[:, 0], places[:, 2])))
    return max(
        face_width(frame.positions(camera.centre), geometry.length, radius, geometry)[0]
        for camera in rig.cameras
    )


def combine_rest(by_frames: tuple[float, float], by_end: tuple[float, float]) -> tuple[float, float]:
    """Position at rest and its standard deviation, from the visible body and from the specimen's end.

    Least squares combine both. If they disagree by more than `MOST_APART` standard deviations, only
    the position of the visible body is used.

    ``by_frames``, ``by_end``: position and standard deviation [m].
    """
    apart = by_frames[0] - by_end[0]
    if abs(apart) > MOST_APART * float(np.hypot(by_frames[1], by_end[1])):
        return by_frames
    w = np.array([by_frames[1], by_end[1]]) ** -2.0
    return float((w[0] * by_frames[0] + w[1] * by_end[0]) / w.sum()), float(w.sum() ** -0.5)


def _of_mean(sigma: FloatArray) -> float:
    """Sigma of the mean of static frames; the part of the reference does not average out."""
    return float(np.sqrt(np.mean(sigma**2) * (1.0 - OWN_SHARE + OWN_SHARE / sigma.size)))
