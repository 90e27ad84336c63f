"""Motion of a rigid body whose points come into view and go out of it.

Poses of all frames and places of all points on the body are found together, by least squares over every
valid observation of every point: points first seen in a late frame are tied to the body by the points seen
together with them, backward and forward in time, and the covariance contains every link of such a chain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation.warp import apply
from dic.outcome import FrameOutcome, PointOutcome
from dic.rigid_body.adjustment import MotionPrior, Observations, Poses, adjust
from dic.rigid_body.ray_observations import ray_observations
from dic.rigid_body.rigid_motion import lever
from dic.stereo.reconstruction import Reconstruction
from dic.surfaces.frame import SpecimenFrame
from dic.tracking.history import Track


@dataclass(frozen=True)
class BodyMotion:
    """Displacement of one point of a rigid body, and its rotation, from rest; NaN in a LOST frame."""

    at: FloatArray
    """The body's point at rest, in the test frame [m], shape [3]."""
    displacement: FloatArray
    """Of that point, mean over the rest frames zero [m], shape [n_frames, 3]."""
    rotation: FloatArray
    """Rotation vectors from the mean attitude at rest [rad], shape [n_frames, 3]."""
    covariance: FloatArray
    """Of rotation [rad] and displacement [m] of the frames that have a pose, `frames`, shape [n, 6, n, 6]. If
    given for all frames, as results of before have it, the others are left out."""
    n_points: IntArray
    """Points used in each frame, shape [n_frames]."""
    outcome: IntArray
    """`dic.FrameOutcome`: LOST with too few points seen elsewhere too, shape [n_frames]."""
    chi2_per_dof: float
    """Sum of squared residuals in their declared sigmas over the degrees of freedom [-]."""
    noise_scale: float
    """Noise used over noise declared, at least 1 [-]."""

    def __post_init__(self) -> None:
        posed = self.frames
        if len(self.covariance) == len(self.outcome) > len(posed):
            six = np.arange(6)
            object.__setattr__(self, "covariance", self.covariance[np.ix_(posed, six, posed, six)])

    @property
    def frames(self) -> IntArray:
        """Frames that have a pose, shape [n]."""
        return np.flatnonzero(self.outcome == FrameOutcome.VALID)

    def covariance_of(self, component: int, frames: IntArray) -> FloatArray:
        """Covariance between frames of one component of rotation (0 to 2) or displacement (3 to 5).

        Parameters
        ----------
        component
            0 to 5.
        frames
            Frames that have a pose, shape [k].

        Returns
        -------
        NDArray
            [rad²] or [m²], shape [k, k].

        Raises
        ------
        ValueError
            If a frame has none.
        """
        posed = self.frames
        at = np.searchsorted(posed, frames)
        if not np.all(np.isin(frames, posed)):
            raise ValueError(f"frames {np.setdiff1d(frames, posed).tolist()} have no pose")
        return np.asarray(self.covariance[:, component][:, :, component][np.ix_(at, at)])

    @property
    def displacement_sigma(self) -> FloatArray:
        """Standard uncertainties of `displacement` [m], shape [n_frames, 3]."""
        return self._sigma()[:, 3:]

    @property
    def rotation_sigma(self) -> FloatArray:
        """Standard uncertainties of `rotation` [rad], shape [n_frames, 3]."""
        return self._sigma()[:, :3]

    def along(self, direction: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Displacement along a unit direction of the test frame and its covariance between frames.

        Returns
        -------
        NDArray
            Displacements [m], shape [n_frames].
        NDArray
            Covariance [m²], shape [n_frames, n_frames]; NaN for a frame without a pose.
        """
        unit = np.asarray(direction, dtype=np.float64)
        if unit.shape != (3,) or not abs(np.linalg.norm(unit) - 1.0) < 1e-9:
            raise ValueError(f"direction must be a unit vector of 3 components, got {unit}")
        block = self.covariance[:, 3:, :, 3:]
        n, posed = len(self.outcome), self.frames
        between = np.full((n, n), np.nan)
        between[np.ix_(posed, posed)] = np.einsum("a,kalb,b->kl", unit, block, unit, optimize=True)
        return self.displacement @ unit, between

    def _sigma(self) -> FloatArray:
        found = np.full((len(self.outcome), 6), np.nan)
        found[self.frames] = np.sqrt(np.einsum("kaka->ka", self.covariance))
        return found


def body_motion(
    reconstructions: Sequence[Reconstruction],
    frame: SpecimenFrame,
    *,
    at: ArrayLike,
    rest: Sequence[int],
    overlaps: Sequence[ArrayLike] | None = None,
    shared: float = 0.5,
    rig: StereoRig | None = None,
    tracks: Sequence[tuple[Track, Track]] | None = None,
    rotation_change: float | None = None,
    lateral_change: float | None = None,
    reject: float = 5.0,
) -> BodyMotion:
    """Find the motion of a rigid body from points on it.

    Parameters
    ----------
    reconstructions
        Points of the body, all in the same frames; one for each material picture that points were chosen
        in, if there are several.
    frame
        The test frame.
    at
        The body's point whose displacement is wanted, at rest, in the test frame [m], shape [3].
    rest
        Frames in which the body rests; their mean is the zero of displacement and rotation.
    overlaps
        For each reconstruction the variance factors of points whose subsets overlap,
        `dic.surfaces.overlap_factor`; shape [n_points] or [n_frames, n_points].
    shared
        Share of a point's variance that is the same in all frames, being the noise of its material
        picture: it moves the point on the body, not the body [-].
    rig, tracks
        The cameras, and for each reconstruction the tracks it was made from: then a frame in which only
        one camera sees a point counts too, with what that camera knows. Such frames need
        `rotation_change` and `lateral_change`, or they know little along the view.
    rotation_change
        Standard deviation of the change of attitude from one frame to the next, about each axis [rad],
        by which narrow views of the body borrow their attitude from wide ones; None: every frame has its
        own.
    lateral_change
        Standard deviation of the displacement across y from one frame to the next, along x and Z [m];
        None: any.
    reject
        Observations farther off than this many sigmas, or this many robust standard deviations if the scatter
        is larger than the sigmas say, are left out [-].

    Raises
    ------
    ValueError
        No frame at rest that is connected with the others, shapes that do not fit, options out of range.
    """
    point = np.asarray(at, dtype=np.float64)
    _check(reconstructions, point, rest, shared, (rotation_change, lateral_change), reject, overlaps)
    valid = np.concatenate([r.outcome == PointOutcome.VALID for r in reconstructions], axis=1)
    place = np.concatenate([frame.positions(r.position) for r in reconstructions], axis=1)
    noise = np.concatenate([frame.covariances(r.covariance) for r in reconstructions], axis=1)
    factor = np.ones(valid.shape)
    if overlaps is not None:
        shape = [(len(valid), r.outcome.shape[1]) for r in reconstructions]
        factor = np.concatenate(
            [np.broadcast_to(np.asarray(o), s) for o, s in zip(overlaps, shape, strict=True)], axis=1
        )
    place = np.where(valid[..., None], place, 0.0)
    information = np.zeros(noise.shape)
    information[valid] = np.linalg.inv((1.0 - shared) * noise[valid])
    single = np.zeros(valid.shape, dtype=bool)
    if rig is not None and tracks is not None:
        both = np.split(valid, np.cumsum([r.outcome.shape[1] for r in reconstructions])[:-1], axis=1)
        for k, camera in enumerate(rig.cameras):
            alone = np.concatenate(
                [(pair[k].outcome == PointOutcome.VALID) & ~v for pair, v in zip(tracks, both, strict=True)],
                axis=1,
            )
            alone &= valid.any(axis=0) & ~single  # its depth must be known from some frame
            pixels = np.concatenate([apply(pair[k].points, pair[k].warp) for pair in tracks], axis=1)
            spread = np.concatenate([pair[k].covariance for pair in tracks], axis=1)
            at_ray, known = ray_observations(
                camera, frame, pixels[alone], (1.0 - shared) * spread[alone], _nearest(place, valid)[alone]
            )
            place[alone], information[alone], single = at_ray, known, single | alone
    seen = valid | single
    seen &= seen.sum(axis=0) >= 2  # a point seen once says nothing about motion
    found = adjust(
        Observations(place, information, seen, single, factor),
        MotionPrior(rotation_change, lateral_change),
        reject,
    )
    return _from_rest(found, point, rest, len(valid))


def _check(
    reconstructions: Sequence[Reconstruction],
    at: FloatArray,
    rest: Sequence[int],
    shared: float,
    prior: tuple[float | None, float | None],
    reject: float,
    overlaps: Sequence[ArrayLike] | None,
) -> None:
    if not reconstructions:
        raise ValueError("no points: give at least one reconstruction of the body")
    frames = {len(r.outcome) for r in reconstructions}
    if len(frames) != 1:
        raise ValueError(f"the reconstructions must have the same frames, have {sorted(frames)}")
    if overlaps is not None and len(overlaps) != len(reconstructions):
        raise ValueError(f"{len(overlaps)} overlaps for {len(reconstructions)} reconstructions")
    n = frames.pop()
    if not len(rest) or min(rest) < 0 or max(rest) >= n:
        raise ValueError(f"rest must name frames in 0..{n - 1}, got {list(rest)}")
    if at.shape != (3,) or not np.isfinite(at).all():
        raise ValueError(f"at must be a point [m] of 3 finite components, got {at}")
    if not 0.0 <= shared < 1.0 or not reject > 0.0 or not all(h is None or h > 0.0 for h in prior):
        raise ValueError(
            f"shared must be in [0, 1), reject > 0, rotation_change [rad] and lateral_change [m] > 0 or "
            f"None, got {shared}, {reject}, {prior[0]}, {prior[1]}"
        )


def _nearest(place: FloatArray, valid: BoolArray) -> FloatArray:
    """Place of each point in the valid frame nearest in time, shape of `place`."""
    n = len(valid)
    frame = np.arange(n)[:, None]
    before = np.maximum.accumulate(np.where(valid, frame, -2 * n), axis=0)
    after = np.minimum.accumulate(np.where(valid, frame, 3 * n)[::-1], axis=0)[::-1]
    nearest = np.where(frame - before <= after - frame, before, after).clip(0, n - 1)
    return np.take_along_axis(place, nearest[..., None], axis=0)


def _from_rest(poses: Poses, at: FloatArray, rest: Sequence[int], n_frames: int) -> BodyMotion:
    """Poses as motions of `at` from rest; what is common to all frames is fixed by the mean at rest."""
    k, R = poses.frames, poses.R
    still = np.isin(k, list(rest))
    if not still.any():
        raise ValueError(
            f"none of the rest frames {list(rest)} is connected with the others by common points; name other "
            "frames, or choose points that are in view there"
        )
    mean = Rotation.from_matrix(R[still]).mean().as_matrix()
    body = mean.T @ (at - poses.p[still].mean(axis=0))
    arm = R @ body
    n = len(k)
    T = np.tile(np.eye(6), (n, 1, 1))
    T[:, 3:] = lever(arm)
    N = np.zeros((n, 6, 6))
    N[:, :3, :3] = N[:, 3:, 3:] = R
    inverse = np.linalg.inv(N[still].mean(axis=0))

    def from_rest(V: FloatArray) -> FloatArray:  # motions of all frames less those that make the rest zero
        return np.asarray(V - np.einsum("kab,bc,cx->kax", N, inverse, V[still].mean(axis=0), optimize=True))

    V = np.einsum("kab,kblc->kalc", T, poses.covariance, optimize=True)
    V = np.einsum("kalc,ldc->kald", V, T, optimize=True)
    V = from_rest(V.reshape(n, 6, 6 * n)).reshape(6 * n, n, 6)
    V = from_rest(np.moveaxis(V, 0, 2)).reshape(n, 6, n, 6)
    scale = float(np.sqrt(max(1.0, poses.chi2_per_dof)))
    covariance = scale**2 * V
    displacement, rotation = np.full((n_frames, 3), np.nan), np.full((n_frames, 3), np.nan)
    displacement[k] = arm + poses.p - at
    rotation[k] = Rotation.from_matrix(R @ mean.T).as_rotvec()
    count = np.zeros(n_frames, dtype=np.int64)
    count[k] = poses.count
    outcome = np.full(n_frames, int(FrameOutcome.LOST), dtype=np.int64)
    outcome[k] = FrameOutcome.VALID
    return BodyMotion(at, displacement, rotation, covariance, count, outcome, poses.chi2_per_dof, scale)
