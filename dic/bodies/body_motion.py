"""Motion of a rigid body whose points enter and leave the view: poses and points by least squares.

The poses of all frames and the positions of all points on the body are estimated together from all valid
observations: ``x_ik = R_k X_i + p_k``. The positions X_i are eliminated by Schur's complement. Six unknowns
per frame remain. Six combinations of them are undetermined until the body's frame is chosen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from dic.basics import MAD, BoolArray, FloatArray, IntArray
from dic.camera import Camera, StereoRig
from dic.correlation.subsets import apply
from dic.outcome import FrameOutcome, PointOutcome
from dic.stereo.reconstruction import Reconstruction
from dic.surfaces.cylinder import SpecimenFrame
from dic.tracking.inputs import Track

FEWEST_POINTS = 3


def _kabsch(X: FloatArray, x: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted least-squares rotation and translation from X to x, both [n, 3] with any origin."""
    w = weight / weight.sum()
    mean_X, mean_x = w @ X, w @ x
    U, _, Vt = np.linalg.svd((x - mean_x).T @ ((X - mean_X) * w[:, None]))
    U[:, -1] *= np.sign(np.linalg.det(U @ Vt))
    R = U @ Vt
    return np.asarray(R), np.asarray(mean_x - R @ mean_X)


def lever(r: FloatArray) -> FloatArray:
    """Derivative of rotated points r with respect to a small rotation and a shift, shape [..., 3, 6]: ω × r +
    d."""
    J = np.zeros((*r.shape[:-1], 3, 6))
    J[..., 0, 1], J[..., 0, 2] = r[..., 2], -r[..., 1]
    J[..., 1, 0], J[..., 1, 2] = -r[..., 2], r[..., 0]
    J[..., 2, 0], J[..., 2, 1] = r[..., 1], -r[..., 0]
    J[..., 3:] = np.eye(3)
    return J


MOST_ROUNDS = 12
MOST_STEPS = 50
ROUGH, FINE = 1e-2, 1e-4
"""Largest change of converged poses [sigmas]. First value: for the rejection of outliers. Second value: for
the final result."""
FLATTEST = 1e-10
"""Smallest eigenvalue of a frame's normal matrix, scaled to a diagonal of 1, for a determined pose."""


@dataclass(frozen=True)
class Observations:
    """Observed positions of the points, frame by frame."""

    x: FloatArray
    """Positions [m], shape [n_frames, n_points, 3]; zero where not valid."""
    W: FloatArray
    """Inverse covariances [1/m²], shape [n_frames, n_points, 3, 3]; zero where not valid."""
    valid: BoolArray
    """Observations that are used, shape [n_frames, n_points]."""
    single: BoolArray
    """Observations by a single camera, shape [n_frames, n_points]. Their W is zero along the camera's ray."""
    factor: FloatArray
    """Variance factors for overlap [-], shape [n_frames, n_points]."""

    @property
    def weights(self) -> FloatArray:
        """Inverse covariances in the sums over points, zero where not used [1/m²]."""
        return self.W * (self.valid / self.factor)[..., None, None]

    def part(self, frames: IntArray, points: IntArray) -> "Observations":
        """Observations of some frames and points."""
        at = np.ix_(frames, points)
        return Observations(self.x[at], self.W[at], self.valid[at], self.single[at], self.factor[at])

    @property
    def components(self) -> IntArray:
        """Number of measured components per observation: 3, or 2 for a single camera, 0 if not used."""
        return np.where(self.valid, np.where(self.single, 2, 3), 0)


@dataclass(frozen=True)
class MotionPrior:
    """Prior of the motion of a body from one frame to the next."""

    rotation_change: float | None
    """Standard deviation of its change of attitude, about each axis [rad]; None: no prior."""
    lateral_change: float | None
    """Standard deviation of its displacement across y, along x and Z [m]; None: no prior."""


@dataclass(frozen=True)
class Poses:
    """Poses of the frames that are connected by common points."""

    frames: IntArray
    """Frame numbers, shape [n]."""
    R: FloatArray
    """Rotations, shape [n, 3, 3]."""
    p: FloatArray
    """Positions of the body's origin [m], shape [n, 3]."""
    covariance: FloatArray
    """Covariance of small rotations after R [rad] and shifts of p [m] for the declared sigmas, shape [n, 6,
    n, 6]. It excludes motions common to all frames."""
    count: IntArray
    """Number of observations used in each frame, shape [n]."""
    chi2_per_dof: float
    """Sum of squared residuals over the declared variances, per degree of freedom [-]."""


def adjust(observations: Observations, prior: MotionPrior, reject: float) -> Poses:
    """Poses of all frames that are connected with the frame with the most points.

    ``prior``: prior of the motion. ``reject``: observations with residuals of more than this many (robust)
    sigmas are left out. Raises ValueError if no frame has enough points, or the iteration does not converge.
    """
    frames, points, R, p, X = _chain(observations)
    tolerance = ROUGH
    for _ in range(MOST_ROUNDS):
        now = observations.part(frames, points)
        # Scaling lengths with the body's size and typical sigmas keeps the normal matrix well conditioned.
        size = float(np.sqrt(np.mean(X**2)))
        sigma = float(np.sqrt(3.0 / np.median(np.trace(now.W[now.valid], axis1=1, axis2=2))))
        for _ in range(MOST_STEPS):
            R, p, X, step, covariance = _step(now, R, p, X, prior, frames, size, sigma)
            if step < tolerance:
                break
        else:
            raise ValueError(f"the body's poses did not settle in {MOST_STEPS} steps; check its points")
        off = now.x - np.einsum("kab,ib->kia", R, X) - p[:, None]
        squared = np.einsum("kia,kiab,kib->ki", off, now.W, off, optimize=True)
        far = np.sqrt(squared / np.where(now.single, 2.0, 3.0))
        limit = reject * max(1.0, MAD * float(np.median(far[now.valid])))
        if not np.any(now.valid & (far > limit)):
            if tolerance == FINE:
                break
            tolerance = FINE
            continue
        valid = observations.valid.copy()
        valid[np.ix_(frames, points)] &= far <= limit
        observations = replace(observations, valid=valid & (valid.sum(axis=0) >= 2))
        chain = _chain(observations)
        if not (np.array_equal(chain[0], frames) and np.array_equal(chain[1], points)):
            frames, points, R, p, X = chain
    dof = int(now.components.sum()) - 3 * len(points) - 6 * len(frames) + 6
    chi2 = float(np.sum(squared[now.valid])) / dof if dof > 0 else 1.0
    return Poses(frames, R, p, covariance(), now.valid.sum(axis=1), chi2)


def _chain(observations: Observations) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Connected frames and points, rough poses, and positions on the body relative to their centroid."""
    n_frames, n_points = observations.valid.shape
    weights = observations.weights
    weight = np.trace(weights, axis1=2, axis2=3)
    full = observations.valid & ~observations.single
    R, p = np.tile(np.eye(3), (n_frames, 1, 1)), np.zeros((n_frames, 3))
    X = np.zeros((n_points, 3))
    solved, located = np.zeros(n_frames, dtype=bool), np.zeros(n_points, dtype=bool)
    barred = np.zeros(n_frames, dtype=bool)
    while True:
        common = full & located if solved.any() else full
        count = np.where(solved | barred, 0, common.sum(axis=1))
        k = int(np.argmax(count))
        if count[k] < FEWEST_POINTS:
            break
        visible = common[k]
        if not _determined(observations.x[k, visible], weights[k, visible]):
            barred[k] = True
            continue
        if solved.any():
            R[k], p[k] = _kabsch(X[visible], observations.x[k, visible], weight[k, visible])
        new = full[k] & ~located
        X[new] = (observations.x[k, new] - p[k]) @ R[k]
        solved[k], located = True, located | new
        if new.any():
            barred[:] = False  # more points may determine further poses
    if not solved.any():
        raise ValueError(
            f"no frame sees {FEWEST_POINTS} points of the body, not on one line, that another frame sees "
            "too; choose more points, or look at their outcomes"
        )
    with_both = np.flatnonzero(solved)
    for k in np.flatnonzero(~solved).tolist():  # seen by one camera: start from the nearest pose
        visible = observations.valid[k] & located
        if visible.sum() >= FEWEST_POINTS:
            near = with_both[np.argmin(np.abs(with_both - k))]
            R[k], p[k] = R[near], np.mean(observations.x[k, visible] - X[visible] @ R[near].T, axis=0)
            solved[k] = True
    centre = X[located].mean(axis=0)
    p = p + np.einsum("kab,b->ka", R, centre)
    frames, points = np.flatnonzero(solved), np.flatnonzero(located)
    return frames, points, R[frames], p[frames], X[points] - centre


def _determined(x: FloatArray, W: FloatArray) -> bool:
    """True if the points determine a pose."""
    J = lever(x - x.mean(axis=0))
    A = J.reshape(-1, 6).T @ (W @ J).reshape(-1, 6)
    unit = np.sqrt(np.diag(A))
    return bool((unit > 0.0).all() and np.linalg.eigvalsh(A / np.outer(unit, unit))[0] > FLATTEST)


def _step(
    observations: Observations,
    R: FloatArray,
    p: FloatArray,
    X: FloatArray,
    prior: MotionPrior,
    frames: IntArray,
    size: float,
    sigma: float,
) -> tuple[FloatArray, FloatArray, FloatArray, float, Callable[[], FloatArray]]:
    """One Gauss-Newton step. Returns poses, points, the largest change in sigmas, and a function for the
    poses' covariance. This function takes as long as several steps."""
    n, m = len(R), len(X)
    unit = sigma * np.repeat([1.0 / size, 1.0], 3)  # rad and m
    W = observations.weights * sigma**2
    turned = np.einsum("kab,ib->kia", R, X)
    J = lever(turned) * (unit / sigma)
    e = (observations.x - turned - p[:, None]) / sigma
    WJ, WR = W @ J, W @ R[:, None]
    A = np.einsum("kija,kijb->kab", J, WJ, optimize=True)
    B = np.einsum("kija,kijb->kaib", J, WR, optimize=True).reshape(6 * n, 3 * m)
    D = np.linalg.inv(np.einsum("kja,kijb->iab", R, WR, optimize=True))
    pose = np.einsum("kija,kij->ka", WJ, e, optimize=True).ravel()
    point = np.einsum("kija,kij->ia", WR, e, optimize=True)
    # B D Bᵀ from D's factors: a matrix times its transpose takes half the time
    root = np.linalg.cholesky(D)
    BL = np.einsum("rib,ibc->ric", B.reshape(6 * n, m, 3), root, optimize=True).reshape(6 * n, 3 * m)
    S = BL @ BL.T
    np.negative(S, out=S)
    S.reshape(n, 6, n, 6)[np.arange(n), :, np.arange(n)] += A
    right = pose - B @ np.einsum("iab,ib->ia", D, point).ravel()
    for spread, coordinate in ((prior.rotation_change, "rotation"), (prior.lateral_change, "translation")):
        if spread is not None:
            scaled = spread / unit[0 if coordinate == "rotation" else 3]
            _add_prior(S.reshape(n, 6, n, 6), right.reshape(n, 6), R, p, frames, coordinate, scaled, unit)
    # The body's frame is undetermined: the six motions of this frame get an arbitrary value.
    common = np.zeros((n, 6, 6))
    common[:, :3, :3] = common[:, 3:, 3:] = R
    N = common.reshape(6 * n, 6) * np.sqrt(float(np.trace(S))) / (6 * n)
    S += N @ N.T
    factor = cho_factor(S, overwrite_a=True, check_finite=False)
    change = cho_solve(factor, right).reshape(n, 6)
    correction = np.einsum("iab,ib->ia", D, point - (change.ravel() @ B).reshape(m, 3)) * sigma

    def covariance() -> FloatArray:
        inverse = cho_solve(factor, np.eye(6 * n), overwrite_b=True, check_finite=False)
        return np.asarray(inverse.reshape(n, 6, n, 6) * unit[:, None, None] * unit)

    return (
        Rotation.from_rotvec(change[:, :3] * unit[0]).as_matrix() @ R,
        p + change[:, 3:] * sigma,
        X + correction,
        float(np.abs(change).max()),
        covariance,
    )


def _add_prior(
    S: FloatArray,
    right: FloatArray,
    R: FloatArray,
    p: FloatArray,
    frames: IntArray,
    coordinate: str,
    scaled: float,
    unit: FloatArray,
) -> None:
    """Add the prior of small changes between successive frames; `scaled` is in `unit`s."""
    at = slice(0, 3) if coordinate == "rotation" else slice(3, 6)
    across = np.eye(3) if coordinate == "rotation" else np.diag([1.0, 0.0, 1.0])
    if len(R) < 2:
        return
    a, b = np.arange(len(R) - 1), np.arange(1, len(R))
    w = across / (scaled**2 * np.diff(frames))[:, None, None]
    r = p[1:] - p[:-1]
    if coordinate == "rotation":
        r = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], 1, 2)).as_rotvec()
    pull = (w @ (r / unit[at])[..., None])[..., 0]
    S[a, at, a, at] += w
    S[b, at, b, at] += w
    S[a, at, b, at] -= w
    S[b, at, a, at] -= w
    right[:-1, at] += pull
    right[1:, at] -= pull


STEP = 1e-6
"""Step of the difference quotients of the projection [m]."""


def _ray_observations(
    camera: Camera, frame: SpecimenFrame, pixels: FloatArray, covariance: FloatArray, near: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points on a camera's rays, and their inverse covariances of rank 2."""
    x = np.array(near)
    for _ in range(3):  # the projection is nearly linear: quadratic convergence
        J = _slope(camera, frame, x)
        off = pixels - camera.project(frame.in_rig(x))
        x = x + np.einsum("nij,nj->ni", np.linalg.pinv(J), off)
    J = _slope(camera, frame, x)
    return x, np.swapaxes(J, 1, 2) @ np.linalg.inv(covariance) @ J


def _slope(camera: Camera, frame: SpecimenFrame, x: FloatArray) -> FloatArray:
    """Derivative of the pixel with respect to the position [px/m], shape [n, 2, 3]."""
    columns = [
        camera.project(frame.in_rig(x + STEP * axis)) - camera.project(frame.in_rig(x - STEP * axis))
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=-1) / (2.0 * STEP)


@dataclass(frozen=True)
class BodyMotion:
    """Displacement of one point of a rigid body, and the body's rotation, from rest; NaN in a LOST frame."""

    at: FloatArray
    """The body's point at rest, in the test frame [m], shape [3]."""
    displacement: FloatArray
    """Displacement of that point; its mean over the rest frames is zero [m], shape [n_frames, 3]."""
    rotation: FloatArray
    """Rotation vectors from the mean attitude at rest [rad], shape [n_frames, 3]."""
    covariance: FloatArray
    """Covariance of rotation [rad] and displacement [m] in the frames with a pose (`frames`), shape [n, 6, n,
    6]. Older result files have all frames; those without a pose are removed."""
    n_points: IntArray
    """Points used in each frame, shape [n_frames]."""
    outcome: IntArray
    """`dic.FrameOutcome`: LOST if too few points are also seen in other frames. Shape [n_frames]."""
    chi2_per_dof: float
    """Sum of squared residuals over their declared variances, per degree of freedom [-]."""
    noise_scale: float
    """Used noise over declared noise, at least 1 [-]."""

    def __post_init__(self) -> None:
        posed = self.frames
        if len(self.covariance) == len(self.outcome) > len(posed):
            six = np.arange(6)
            object.__setattr__(self, "covariance", self.covariance[np.ix_(posed, six, posed, six)])

    @property
    def frames(self) -> IntArray:
        """Frames with a pose, shape [n]."""
        return np.flatnonzero(self.outcome == FrameOutcome.VALID)

    def covariance_of(self, component: int, frames: IntArray) -> FloatArray:
        """Covariance between frames of one component of rotation (0 to 2) or displacement (3 to 5).

        ``component``: 0 to 5. ``frames``: frames with a pose, shape [k]. Returns: [rad²] or [m²], shape [k,
        k]. Raises ValueError if a frame has no pose.
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

        Returns: displacements [m], shape [n_frames]. Returns: covariance [m²], shape [n_frames, n_frames];
        NaN for a frame without a pose.
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
        sigma = np.full((len(self.outcome), 6), np.nan)
        sigma[self.frames] = np.sqrt(np.einsum("kaka->ka", self.covariance))
        return sigma


def body_motion(
    reconstructions: Sequence[Reconstruction],
    frame: SpecimenFrame,
    *,
    at: ArrayLike,
    rest_frames: Sequence[int],
    overlaps: Sequence[ArrayLike] | None = None,
    shared: float = 0.5,
    rig: StereoRig | None = None,
    tracks: Sequence[tuple[Track, Track]] | None = None,
    rotation_change: float | None = None,
    lateral_change: float | None = None,
    reject: float = 5.0,
) -> BodyMotion:
    """Estimate the motion of a rigid body from points on it.

    ``reconstructions``: points of the body, all in the same frames; one for each material picture in which
    points were chosen, if there are several. ``frame``: the test frame. ``at``: position at rest of the
    body's point whose displacement is given, in the test frame [m], shape [3]. ``rest_frames``: frames in
    which the body is at rest; their mean is the zero of displacement and rotation. ``overlaps``: for each
    reconstruction the variance factors of points whose subsets overlap, `overlap_factor`; shape [n_points] or
    [n_frames, n_points]. ``shared``: share of a point's variance that is common to all frames [-]. It comes
    from the noise of the point's material picture. It affects the position of the point on the body, but not
    the motion of the body. ``rig``, ``tracks``: the cameras, and the tracks of each reconstruction. With
    them, points that only one camera sees are used too. Such frames need `rotation_change` and
    `lateral_change`, because one camera measures little along the view. ``rotation_change``: standard
    deviation of the change of attitude from one frame to the next, about each axis [rad]. With it, frames
    with a wide view of the body constrain frames with a narrow view. None: no constraint. ``lateral_change``:
    standard deviation of the displacement across y from one frame to the next, along x and Z [m]; None: no
    constraint. ``reject``: observations with residuals of more than this many sigmas are left out [-]. If the
    scatter exceeds the sigmas, robust standard deviations are used. Raises ValueError if no frame at rest is
    connected with the others, if shapes do not match, or if an option is out of range.
    """
    point = np.asarray(at, dtype=np.float64)
    _check(reconstructions, point, rest_frames, shared, (rotation_change, lateral_change), reject, overlaps)
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
        valid_by_body = np.split(valid, np.cumsum([r.outcome.shape[1] for r in reconstructions])[:-1], axis=1)
        for k, camera in enumerate(rig.cameras):
            mono = np.concatenate(
                [
                    (pair[k].outcome == PointOutcome.VALID) & ~v
                    for pair, v in zip(tracks, valid_by_body, strict=True)
                ],
                axis=1,
            )
            mono &= valid.any(axis=0) & ~single  # its depth must be known from another frame
            pixels = np.concatenate([apply(pair[k].points, pair[k].warp) for pair in tracks], axis=1)
            spread = np.concatenate([pair[k].covariance for pair in tracks], axis=1)
            at_ray, ray_weight = _ray_observations(
                camera, frame, pixels[mono], (1.0 - shared) * spread[mono], _nearest(place, valid)[mono]
            )
            place[mono], information[mono], single = at_ray, ray_weight, single | mono
    visible = valid | single
    visible &= visible.sum(axis=0) >= 2  # a point seen once gives no motion
    poses = adjust(
        Observations(place, information, visible, single, factor),
        MotionPrior(rotation_change, lateral_change),
        reject,
    )
    return _from_rest(poses, point, rest_frames, len(valid))


def _check(
    reconstructions: Sequence[Reconstruction],
    at: FloatArray,
    rest_frames: Sequence[int],
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
    if not len(rest_frames) or min(rest_frames) < 0 or max(rest_frames) >= n:
        raise ValueError(f"rest_frames must name frames in 0..{n - 1}, got {list(rest_frames)}")
    if at.shape != (3,) or not np.isfinite(at).all():
        raise ValueError(f"at must be a point [m] of 3 finite components, got {at}")
    if not 0.0 <= shared < 1.0 or not reject > 0.0 or not all(h is None or h > 0.0 for h in prior):
        raise ValueError(
            f"shared must be in [0, 1), reject > 0, rotation_change [rad] and lateral_change [m] > 0 or "
            f"None, got {shared}, {reject}, {prior[0]}, {prior[1]}"
        )


def _nearest(place: FloatArray, valid: BoolArray) -> FloatArray:
    """Position of each point in the valid frame nearest in time, shape of `place`."""
    n = len(valid)
    frame = np.arange(n)[:, None]
    before = np.maximum.accumulate(np.where(valid, frame, -2 * n), axis=0)
    after = np.minimum.accumulate(np.where(valid, frame, 3 * n)[::-1], axis=0)[::-1]
    nearest = np.where(frame - before <= after - frame, before, after).clip(0, n - 1)
    return np.take_along_axis(place, nearest[..., None], axis=0)


def _from_rest(poses: Poses, at: FloatArray, rest_frames: Sequence[int], n_frames: int) -> BodyMotion:
    """Poses as motions of `at` from rest. The mean at rest determines the motion common to all frames."""
    k, R = poses.frames, poses.R
    still = np.isin(k, list(rest_frames))
    if not still.any():
        raise ValueError(
            f"none of the rest frames {list(rest_frames)} is connected with the others by common points; "
            "name other frames, or choose points that are in view there"
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

    def from_rest(V: FloatArray) -> FloatArray:  # the motions of all frames minus the mean at rest
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
