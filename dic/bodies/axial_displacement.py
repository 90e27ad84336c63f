"""Axial displacement of the flyer: one translation a frame, by least squares over the pixels of both cameras.

Every point counts that either camera sees. The rim of the flyer's face gives its position at rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from dic.basics import MEDIAN_LENGTH, BoolArray, FloatArray, IntArray, median
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
"""Prior standard deviation of the lateral motion where both cameras see the body, which tell it, in lengths
that a pixel shows [-]."""
LATERAL_SIGMA = 0.9
"""Standard deviation of it, at most, since the nearest frame that both cameras saw, where one alone does
[-]."""
LEAST_LATERAL = 0.02
"""And at least [-]; also the prior one where one camera alone sees the body: little, for it tells depth by
the perspective of its points, and warm air looks like it."""
NEAREST = 20
"""Frames that both cameras saw whose mean tells where a body is across the axis."""
FEWEST_FRAMES = 10
"""Frames that both cameras saw, from which on they tell the lateral velocity."""
GATE = 5.0
"""Outlier threshold: a point this many robust standard deviations off the body's motion is left out [-]."""


@dataclass(frozen=True)
class ObservedPoints:
    """Points of a body that one camera saw in one frame."""

    camera: Camera
    rows: IntArray
    """The points, shape [n]."""
    places: FloatArray
    """Their places on the body [m], shape [n, 3]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    covariance: FloatArray
    """Of the pixels [px²], shape [n, 2, 2]."""

    @cached_property
    def noise(self) -> FloatArray:
        """Standard deviation of a coordinate [px], shape [n]."""
        return np.asarray(np.sqrt(0.5 * np.trace(self.covariance, axis1=1, axis2=2)))

    @classmethod
    def of(
        cls, camera: Camera, track: Track, k: int, places: FloatArray, finite: BoolArray
    ) -> "ObservedPoints":
        """The `finite` points that were found in frame `k`."""
        rows = np.flatnonzero(finite & (track.outcome[k] == PointOutcome.VALID))
        pixels = apply(track.points[rows], track.warp[k, rows])
        return cls(camera, rows, places[rows], pixels, track.covariance[k, rows])

    def off(self, frame: SpecimenFrame, move: FloatArray) -> FloatArray:
        """Residuals: observed pixels less those of a body moved by `move` [px], shape [n, 2]."""
        return np.asarray(self.pixels - self.camera.project(frame.in_rig(self.places + move)))

    def inliers(self, off: FloatArray) -> BoolArray:
        """Points within `GATE` robust standard deviations of the body's motion, shape [n]."""
        if not len(off):
            return np.zeros(0, dtype=bool)
        size = np.linalg.norm(off - median(off), axis=1)
        spread = max(1.0, float(median(size / self.noise)) / MEDIAN_LENGTH)
        return np.asarray(size <= GATE * spread * self.noise)


def lateral_places(
    t: FloatArray, moves: FloatArray, counts: IntArray, pixel: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a body is across the axis in the frames that one camera alone sees, by those that both saw.

    It is the mean over the `NEAREST` of these, each with the number of its points as weight: the nearest of
    all shows the fewest. A body that flies keeps its lateral velocity: what these frames show of it, with
    twice its standard deviation, times the time to them may have been added since. The scatter of the frames
    about their line is what the place itself is off by at most, in all frames alike.
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


def _translation_in(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    k: int,
    places: FloatArray,
    finite: BoolArray,
    near: FloatArray,
    lateral: float,
    overlap: csr_array,
) -> tuple[float, float, int] | None:
    """Translation along y in frame `k` [m], its standard deviation and the number of points; None if not
    seen. `lateral` is the prior standard deviation of the translation across y, about that of `near` [m]."""
    observed = [
        ObservedPoints.of(camera, track, k, places, finite)
        for camera, track in zip(rig.cameras, body.tracks, strict=True)
    ]
    if not any(points.rows.size for points in observed):
        return None
    move, keep = near.copy(), [np.ones(len(points.rows), dtype=bool) for points in observed]
    off = [points.off(frame, move) for points in observed]
    across = lateral**-2
    counted_before: list[BoolArray] = [np.zeros(0, dtype=bool) for _ in observed]
    shared: list[FloatArray] = [np.zeros(0) for _ in observed]  # covariances of the points that count
    for _ in range(3):
        H = np.diag([across, 0.0, across])
        g = H @ (near - move)
        for i, (points, fine, away) in enumerate(zip(observed, keep, off, strict=True)):
            if not fine.any():
                continue
            J = projection_slope(points.camera, frame.in_rig(points.places[fine] + move)) @ frame.rotation.T
            if not np.array_equal(fine, counted_before[i]):  # mostly the same ones again
                rows = points.rows[fine]
                together = np.bincount(rows, minlength=len(places)).astype(np.float64)
                factor = (overlap @ together)[rows]
                counted_before[i], shared[i] = fine, points.covariance[fine] * factor[:, None, None]
            weighted = np.linalg.solve(shared[i], J)
            H += np.tensordot(J, weighted, axes=([0, 1], [0, 1]))
            g += np.tensordot(weighted, away[fine], axes=([0, 1], [0, 1]))
        move = move + np.linalg.solve(H, g)
        off = [points.off(frame, move) for points in observed]
        keep = [points.inliers(away) for points, away in zip(observed, off, strict=True)]
        if not any(fine.any() for fine in keep):
            return None
    counted = np.unique(
        np.concatenate([points.rows[fine] for points, fine in zip(observed, keep, strict=True)])
    )
    return float(move[1]), float(np.sqrt(np.linalg.inv(H)[1, 1])), len(counted)


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
    """The rim of the body's face; ``geometry``: the specimen at rest, the rest as of `translations`."""
    if not (body.reconstruction.outcome == PointOutcome.VALID).any():
        return None
    return find_rim(pictures, body, rig, frame, *stereo_translations(body, frame), geometry)


def stereo_translations(body: TrackedBody, frame: SpecimenFrame) -> tuple[FloatArray, FloatArray]:
    """Places of the points on the body [m], shape [n_points, 3], and translations of the frames [m], shape
    [n_frames, 3], by what both cameras saw; NaN where unknown."""
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

    The places of the points on the body come from the frames in which both cameras see them. In every frame
    the translation is then the one that fits all pixels of both cameras best, in their covariances; where one
    camera alone sees the body, its place across the axis is held to that of the nearest frame that both saw.

    ``t``: frame times [s], and ``static``: frames in which the flyer rests, both of shape [n_frames].
    ``subset``: side of the subsets [px]: those that overlap share their noise. ``pictures``: both series, to
    look for the edge strip of the body (`dic.bodies.edge_registration`) in the frames before its first point
    came into view, where that is after the static ones; None: do not.
    """
    valid = body.reconstruction.outcome == PointOutcome.VALID
    if not valid.any():
        return None
    places, moves = stereo_translations(body, frame)
    finite = np.asarray(np.isfinite(places).all(axis=1))
    rows, fits, sigma, counts, common = [], [], [], [], 0.0
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    overlap = overlap_matrix(body.points, subset)
    middle = frame.in_rig(np.median(places[finite], axis=0) + moves[twice[0]])
    pixel = 1.0 / float(np.linalg.norm(pixels_per_length(rig.cameras[0], middle, frame.rotation[1])))
    across, lateral, place_sigma = lateral_places(t, moves, valid.sum(axis=1), pixel)
    for k in range(len(t)):
        near = moves[twice[np.argmin(np.abs(twice - k))]]
        sure = FREE * pixel
        if not np.isfinite(moves[k]).all():
            near, sure = np.array([across[k, 0], near[1], across[k, 1]]), LEAST_LATERAL * pixel
        fit = _translation_in(body, rig, frame, k, places, finite, near, sure, overlap)
        if fit is not None and static[k] and k not in twice and not common:
            off = np.hypot(place_sigma, lateral[k])
            displaced = near + np.array([off[0], 0.0, off[1]])
            displaced_fit = _translation_in(body, rig, frame, k, places, finite, displaced, sure, overlap)
            common = 0.0 if displaced_fit is None else abs(displaced_fit[0] - fit[0])
        if fit is not None:
            rows.append(k)
            fits.append(fit[0])
            sigma.append(fit[1])
            counts.append(fit[2])
    fine = np.flatnonzero(consistent_frames(rows, fits, counts, static, SEARCH_RANGE * pixel)).tolist()
    rows, fits = [rows[i] for i in fine], [fits[i] for i in fine]
    sigma, counts = [sigma[i] for i in fine], [counts[i] for i in fine]
    if body.material in rows and len(rows) > 1:  # exact there, but not against all others
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
            common = edge.common  # the last is the first frame's, at rest
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


MODEL = 0.008
"""Standard deviation of the mean place at rest for what the static frames share: warm air, interpolation
[px]."""
FACE_SHARE, NARROW_FACE = 0.001, 1.0
"""And this share of the flyer's face beside its rim, where a camera sees more than so much of it [px]: it
moves with the flyer, but what it hides of the specimen does not."""
FEWEST_AT_REST = 3
"""With fewer static frames that show the body, the others are given its place at rest too."""
MOST_APART = 4.0
"""Largest disagreement of two places at rest that are joined, in standard deviations."""


@dataclass(frozen=True)
class AxialDisplacement:
    """Displacement of the flyer toward the specimen; a frame in which it was not found has no row."""

    t: FloatArray
    """Times [s], shape [n]."""
    frame: IntArray
    """Frames, shape [n]."""
    displacement: FloatArray
    """Toward the specimen, from its mean place at rest [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation from frame to frame [m], shape [n]."""
    n_points: IntArray
    """Points it is from, shape [n]."""
    rest_sigma: float
    """Standard deviation of the mean place at rest, common to all displacements after it [m]."""
    from_rim: bool = False
    """True if no static frame shows the body: the place at rest is then that of the specimen's upper end,
    where the rim of the body's face was, and the displacement in the static frames is the declared rest."""
    rim_disagreement: tuple[float, float] | None = None
    """Height of the rim of the body's face above the specimen's upper end at rest by its length, and the
    standard deviation of that [m]; None where the body is not seen at rest, or its rim is not."""


def from_rest(
    motion: Translations | None,
    rim: Rim | None,
    rig: StereoRig,
    frame: SpecimenFrame,
    t: FloatArray,
    static: BoolArray,
    geometry: RestGeometry | None,
) -> AxialDisplacement | None:
    """Displacement from the place at rest, of what `translations` and `rim_of` gave.

    ``geometry``: where the body is in view in no static frame, its rim gives the place at rest
    (`dic.bodies.rest_from_rim`); None: it is not known. Returns None if no point was ever seen by both
    cameras, or the place at rest, which displacements count from, is not known: the body is seen in no static
    frame, and its rim in too few.
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
        # Before contact moves it, the face is the specimen's upper end: no displacement in the static frames.
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
    """The displacements with the static frames that do not show the body: there it rests."""
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
    """Standard deviation of the mean place at rest that no number of static frames lowers [px], where the
    widest strip of the flyer's face that a camera sees is `face` [px]."""
    return float(np.hypot(MODEL, FACE_SHARE * max(face - NARROW_FACE, 0.0)))


def _widest_face(rig: StereoRig, frame: SpecimenFrame, places: FloatArray, geometry: RestGeometry) -> float:
    """Widest strip of the flyer's face that either camera sees at rest [m]."""
    radius = float(np.median(np.hypot(places[:, 0], places[:, 2])))
    return max(
        face_width(frame.positions(camera.centre), geometry.length, radius, geometry)[0]
        for camera in rig.cameras
    )


def combine_rest(by_frames: tuple[float, float], by_end: tuple[float, float]) -> tuple[float, float]:
    """Place at rest and its standard deviation, from what was seen of the body and from the specimen's end.

    By least squares; two that disagree by more than `MOST_APART` standard deviations are not joined, and
    what was seen counts.

    ``by_frames``, ``by_end``: place and standard deviation [m].
    """
    apart = by_frames[0] - by_end[0]
    if abs(apart) > MOST_APART * float(np.hypot(by_frames[1], by_end[1])):
        return by_frames
    w = np.array([by_frames[1], by_end[1]]) ** -2.0
    return float((w[0] * by_frames[0] + w[1] * by_end[0]) / w.sum()), float(w.sum() ** -0.5)


def _of_mean(sigma: FloatArray) -> float:
    """Sigma of the mean of static frames, in which the reference's part does not average out."""
    return float(np.sqrt(np.mean(sigma**2) * (1.0 - OWN_SHARE + OWN_SHARE / sigma.size)))
