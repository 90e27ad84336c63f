"""Motion of a rigid body whose points come into view and leave it: poses and points by least squares.

The poses of all frames and the places of all points on the body are found together from every valid
observation: ``x_ik = R_k X_i + p_k``. The places X_i are eliminated by Schur's complement. Six unknowns a
frame remain; six combinations of them are free until a frame of the body is chosen.
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
    """Rotation and translation of least weighted squares from X to x, both [n, 3] about any origin."""
    w = weight / weight.sum()
    mean_X, mean_x = w @ X, w @ x
    U, _, Vt = np.linalg.svd((x - mean_x).T @ ((X - mean_X) * w[:, None]))
    U[:, -1] *= np.sign(np.linalg.det(U @ Vt))
    R = U @ Vt
    return np.asarray(R), np.asarray(mean_x - R @ mean_X)


def lever(r: FloatArray) -> FloatArray:
    """Change of turned points r by a small rotation and a shift, shape [..., 3, 6]: ω × r + d."""
    J = np.zeros((*r.shape[:-1], 3, 6))
    J[..., 0, 1], J[..., 0, 2] = r[..., 2], -r[..., 1]
    J[..., 1, 0], J[..., 1, 2] = -r[..., 2], r[..., 0]
    J[..., 2, 0], J[..., 2, 1] = r[..., 1], -r[..., 0]
    J[..., 3:] = np.eye(3)
    return J


MOST_ROUNDS = 12
MOST_STEPS = 50
ROUGH, FINE = 1e-2, 1e-4
"""Largest change at which poses have converged, in sigmas: to find outliers, and in the end."""
FLATTEST = 1e-10
"""Least eigenvalue of a frame's normal matrix, its diagonal 1, that counts as a known pose."""


@dataclass(frozen=True)
class Observations:
    """Observed places of the points, frame by frame."""

    x: FloatArray
    """Places [m], shape [n_frames, n_points, 3]; zero where not valid."""
    W: FloatArray
    """Inverse covariances [1/m²], shape [n_frames, n_points, 3, 3]; zero where not valid."""
    valid: BoolArray
    """Observations that are used, shape [n_frames, n_points]."""
    single: BoolArray
    """Those of a single camera: W knows nothing along its ray, shape [n_frames, n_points]."""
    factor: FloatArray
    """Variance factors for overlap [-], shape [n_frames, n_points]."""

    @property
    def weights(self) -> FloatArray:
        """Inverse covariances for the sums over points, zero where not used [1/m²]."""
        return self.W * (self.valid / self.factor)[..., None, None]

    def part(self, frames: IntArray, points: IntArray) -> "Observations":
        """Some frames and points."""
        at = np.ix_(frames, points)
        return Observations(self.x[at], self.W[at], self.valid[at], self.single[at], self.factor[at])

    @property
    def components(self) -> IntArray:
        """Numbers that each observation measures: 3, 2 of a single camera, 0 if not used."""
        return np.where(self.valid, np.where(self.single, 2, 3), 0)


@dataclass(frozen=True)
class MotionPrior:
    """Prior of the motion of a body from one frame to the next."""

    rotation_change: float | None
    """Standard deviation of its change of attitude, about each axis [rad]; None: any."""
    lateral_change: float | None
    """Standard deviation of its displacement across y, along x and Z [m]; None: any."""


@dataclass(frozen=True)
class Poses:
    """Poses of the frames that hang together by common points."""

    frames: IntArray
    """Their numbers, shape [n]."""
    R: FloatArray
    """Rotations, shape [n, 3, 3]."""
    p: FloatArray
    """Places of the body's origin [m], shape [n, 3]."""
    covariance: FloatArray
    """Of small rotations after R [rad] and shifts of p [m], up to motions common to all frames, in the
    declared sigmas; shape [n, 6, n, 6]."""
    count: IntArray
    """Observations used in each of the frames, shape [n]."""
    chi2_per_dof: float
    """Sum of squared residuals in the declared sigmas over the degrees of freedom [-]."""


def adjust(observations: Observations, prior: MotionPrior, reject: float) -> Poses:
    """Poses of all frames that are connected with the one that sees most points.

    ``habits``: what is known of the motion. ``reject``: observations farther off than this many (robust)
    sigmas are left out. Raises ValueError if no frame sees enough points, or the iteration does not settle.
    """
    frames, points, R, p, X = _chain(observations)
    tolerance = ROUGH
    for _ in range(MOST_ROUNDS):
        now = observations.part(frames, points)
        # Lengths in the body's size and in typical sigmas keep the normal matrix well conditioned.
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
    """Frames and points that hang together, rough poses, places on the body about their centroid."""
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
            barred[:] = False  # more points may determine what was open
    if not solved.any():
        raise ValueError(
            f"no frame sees {FEWEST_POINTS} points of the body, not on one line, that another frame sees "
            "too; choose more points, or look at their outcomes"
        )
    with_both = np.flatnonzero(solved)
    for k in np.flatnonzero(~solved).tolist():  # what one camera sees: from the nearest pose
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
    """True if points fix a pose."""
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
    """One Gauss-Newton step: poses, points, largest change in sigmas, and what gives the poses' covariance,
    which takes as long as several steps."""
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
    # B D Bᵀ of D's factors: a matrix times its own transpose is half the work
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
    # The body's own frame is open: its six motions get a value of their own.
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
    """Add the prior of small changes between neighbouring frames; `scaled` in `unit`s."""
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
"""Of the difference quotients of the projection [m]."""


def _ray_observations(
    camera: Camera, frame: SpecimenFrame, pixels: FloatArray, covariance: FloatArray, near: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points on a camera's rays and their inverse covariances, which are of rank 2."""
    x = np.array(near)
    for _ in range(3):  # the projection is nearly linear: each step leaves the square of the last
        J = _slope(camera, frame, x)
        off = pixels - camera.project(frame.in_rig(x))
        x = x + np.einsum("nij,nj->ni", np.linalg.pinv(J), off)
    J = _slope(camera, frame, x)
    return x, np.swapaxes(J, 1, 2) @ np.linalg.inv(covariance) @ J


def _slope(camera: Camera, frame: SpecimenFrame, x: FloatArray) -> FloatArray:
    """Derivative of the pixel by the place [px/m], shape [n, 2, 3]."""
    columns = [
        camera.project(frame.in_rig(x + STEP * axis)) - camera.project(frame.in_rig(x - STEP * axis))
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=-1) / (2.0 * STEP)


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

        ``component``: 0 to 5. ``frames``: frames that have a pose, shape [k]. Returns: [rad²] or [m²], shape
        [k, k]. Raises ValueError if a frame has none.
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
    """Find the motion of a rigid body from points on it.

    ``reconstructions``: points of the body, all in the same frames; one for each material picture that points
    were chosen in, if there are several. ``frame``: the test frame. ``at``: the body's point whose
    displacement is wanted, at rest, in the test frame [m], shape [3]. ``rest_frames``: frames in which the
    body rests; their mean is the zero of displacement and rotation. ``overlaps``: for each reconstruction the
    variance factors of points whose subsets overlap, `overlap_factor`; shape [n_points] or
    [n_frames, n_points]. ``shared``: share of a point's variance that is the same in all frames, being the
    noise of its material picture: it moves the point on the body, not the body [-]. ``rig``, ``tracks``: the
    cameras, and for each reconstruction the tracks it was made from: then a frame in which only one camera
    sees a point counts too, with what that camera knows. Such frames need `rotation_change` and
    `lateral_change`, or they know little along the view. ``rotation_change``: standard deviation of the
    change of attitude from one frame to the next, about each axis [rad], by which narrow views of the body
    borrow their attitude from wide ones; None: every frame has its own. ``lateral_change``: standard
    deviation of the displacement across y from one frame to the next, along x and Z [m]; None: any.
    ``reject``: observations farther off than this many sigmas, or this many robust standard deviations if the
    scatter is larger than the sigmas say, are left out [-]. Raises ValueError: no frame at rest that is
    connected with the others, shapes that do not fit, options out of range.
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
            mono &= valid.any(axis=0) & ~single  # its depth must be known from some frame
            pixels = np.concatenate([apply(pair[k].points, pair[k].warp) for pair in tracks], axis=1)
            spread = np.concatenate([pair[k].covariance for pair in tracks], axis=1)
            at_ray, ray_weight = _ray_observations(
                camera, frame, pixels[mono], (1.0 - shared) * spread[mono], _nearest(place, valid)[mono]
            )
            place[mono], information[mono], single = at_ray, ray_weight, single | mono
    visible = valid | single
    visible &= visible.sum(axis=0) >= 2  # a point seen once says nothing about motion
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
    """Place of each point in the valid frame nearest in time, shape of `place`."""
    n = len(valid)
    frame = np.arange(n)[:, None]
    before = np.maximum.accumulate(np.where(valid, frame, -2 * n), axis=0)
    after = np.minimum.accumulate(np.where(valid, frame, 3 * n)[::-1], axis=0)[::-1]
    nearest = np.where(frame - before <= after - frame, before, after).clip(0, n - 1)
    return np.take_along_axis(place, nearest[..., None], axis=0)


def _from_rest(poses: Poses, at: FloatArray, rest_frames: Sequence[int], n_frames: int) -> BodyMotion:
    """Poses as motions of `at` from rest; what is common to all frames is fixed by the mean at rest."""
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
