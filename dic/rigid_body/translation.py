"""Translation of a rigid body in one frame: least squares over the pixels of both cameras."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.correlation.warp import apply
from dic.outcome import PointOutcome
from dic.robust import MEDIAN_LENGTH, median
from dic.stereo.rays import projection_slope
from dic.surfaces import SpecimenFrame
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
        cls, camera: Camera, track: Track, k: int, places: FloatArray, known: BoolArray
    ) -> "ObservedPoints":
        """The `known` points that were found in frame `k`."""
        rows = np.flatnonzero(known & (track.outcome[k] == PointOutcome.VALID))
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

    Parameters
    ----------
    t
        Frame times [s], shape [n_frames].
    moves
        Translations of the frames that both cameras saw [m], NaN in the others, shape [n_frames, 3].
    counts
        Points that both cameras saw, shape [n_frames].
    pixel
        Length that a pixel shows [m].

    Returns
    -------
    NDArray
        Translations along x and Z [m], shape [n_frames, 2].
    NDArray
        Standard deviations of the motion since, between `LEAST_LATERAL` and `LATERAL_SIGMA` pixels [m], shape
        [n_frames].
    NDArray
        That of the place, along x and Z, common to all frames [m], shape [2].
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
    own = scatter * np.sqrt(weight.sum() / (twice.size * spread))
    speed = float(np.linalg.norm(np.abs(slope) + 2.0 * own))
    apart = np.abs(t - [np.average(t[twice[rows]], weights=weight[rows]) for rows in near])
    return place, np.clip(speed * apart, low, high), scatter


def translation_in(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    k: int,
    places: FloatArray,
    known: BoolArray,
    near: FloatArray,
    lateral: float,
    overlap: csr_array,
) -> tuple[float, float, int] | None:
    """Translation along y in frame `k` [m], its standard deviation and the number of points; None if not
    seen. `lateral` is the prior standard deviation of the translation across y, about that of `near` [m]."""
    seen = [
        ObservedPoints.of(camera, track, k, places, known)
        for camera, track in zip(rig.cameras, body.tracks, strict=True)
    ]
    if not any(points.rows.size for points in seen):
        return None
    move, keep = near.copy(), [np.ones(len(points.rows), dtype=bool) for points in seen]
    off = [points.off(frame, move) for points in seen]
    across = lateral**-2
    counted_before: list[BoolArray] = [np.zeros(0, dtype=bool) for _ in seen]
    shared: list[FloatArray] = [np.zeros(0) for _ in seen]  # covariances of the points that count
    for _ in range(3):
        H = np.diag([across, 0.0, across])
        g = H @ (near - move)
        for i, (points, fine, away) in enumerate(zip(seen, keep, off, strict=True)):
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
        off = [points.off(frame, move) for points in seen]
        keep = [points.inliers(away) for points, away in zip(seen, off, strict=True)]
        if not any(fine.any() for fine in keep):
            return None
    counted = np.unique(np.concatenate([points.rows[fine] for points, fine in zip(seen, keep, strict=True)]))
    return float(move[1]), float(np.sqrt(np.linalg.inv(H)[1, 1])), len(counted)
