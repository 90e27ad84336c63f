"""Least squares over all observations of a rigid body's points: poses and points together.

``x_ik = R_k X_i + p_k`` is the place of point i in frame k. The places X_i on the body are eliminated by
Schur's complement; what remains has six unknowns a frame, and six combinations of them are open until a
frame of the body is chosen.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.rigid_body.rigid_motion import FEWEST_POINTS, kabsch, lever
from dic.robust import MAD

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

    Parameters
    ----------
    observations
        What was seen.
    habits
        What is known of the motion.
    reject
        Observations farther off than this many (robust) sigmas are left out.

    Raises
    ------
    ValueError
        If no frame sees enough points, or the iteration does not settle.
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
        again = _chain(observations)
        if not (np.array_equal(again[0], frames) and np.array_equal(again[1], points)):
            frames, points, R, p, X = again
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
    solved, known = np.zeros(n_frames, dtype=bool), np.zeros(n_points, dtype=bool)
    barred = np.zeros(n_frames, dtype=bool)
    while True:
        common = full & known if solved.any() else full
        count = np.where(solved | barred, 0, common.sum(axis=1))
        k = int(np.argmax(count))
        if count[k] < FEWEST_POINTS:
            break
        who = common[k]
        if not _determined(observations.x[k, who], weights[k, who]):
            barred[k] = True
            continue
        if solved.any():
            R[k], p[k] = kabsch(X[who], observations.x[k, who], weight[k, who])
        new = full[k] & ~known
        X[new] = (observations.x[k, new] - p[k]) @ R[k]
        solved[k], known = True, known | new
        if new.any():
            barred[:] = False  # more points may determine what was open
    if not solved.any():
        raise ValueError(
            f"no frame sees {FEWEST_POINTS} points of the body, not on one line, that another frame sees "
            "too; choose more points, or look at their outcomes"
        )
    with_both = np.flatnonzero(solved)
    for k in np.flatnonzero(~solved).tolist():  # what one camera sees: from the nearest pose
        who = observations.valid[k] & known
        if who.sum() >= FEWEST_POINTS:
            near = with_both[np.argmin(np.abs(with_both - k))]
            R[k], p[k] = R[near], np.mean(observations.x[k, who] - X[who] @ R[near].T, axis=0)
            solved[k] = True
    centre = X[known].mean(axis=0)
    p = p + np.einsum("kab,b->ka", R, centre)
    frames, points = np.flatnonzero(solved), np.flatnonzero(known)
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
    for spread, what in ((prior.rotation_change, "rotation"), (prior.lateral_change, "translation")):
        if spread is not None:
            scaled = spread / unit[0 if what == "rotation" else 3]
            _add_prior(S.reshape(n, 6, n, 6), right.reshape(n, 6), R, p, frames, what, scaled, unit)
    # The body's own frame is open: its six motions get a value of their own.
    common = np.zeros((n, 6, 6))
    common[:, :3, :3] = common[:, 3:, 3:] = R
    N = common.reshape(6 * n, 6) * np.sqrt(float(np.trace(S))) / (6 * n)
    S += N @ N.T
    factor = cho_factor(S, overwrite_a=True, check_finite=False)
    change = cho_solve(factor, right).reshape(n, 6)
    moved = np.einsum("iab,ib->ia", D, point - (change.ravel() @ B).reshape(m, 3)) * sigma

    def covariance() -> FloatArray:
        inverse = cho_solve(factor, np.eye(6 * n), overwrite_b=True, check_finite=False)
        return np.asarray(inverse.reshape(n, 6, n, 6) * unit[:, None, None] * unit)

    return (
        Rotation.from_rotvec(change[:, :3] * unit[0]).as_matrix() @ R,
        p + change[:, 3:] * sigma,
        X + moved,
        float(np.abs(change).max()),
        covariance,
    )


def _add_prior(
    S: FloatArray,
    right: FloatArray,
    R: FloatArray,
    p: FloatArray,
    frames: IntArray,
    what: str,
    scaled: float,
    unit: FloatArray,
) -> None:
    """Add the prior of small changes between neighbouring frames; `scaled` in `unit`s."""
    at = slice(0, 3) if what == "rotation" else slice(3, 6)
    across = np.eye(3) if what == "rotation" else np.diag([1.0, 0.0, 1.0])
    if len(R) < 2:
        return
    a, b = np.arange(len(R) - 1), np.arange(1, len(R))
    w = across / (scaled**2 * np.diff(frames))[:, None, None]
    r = p[1:] - p[:-1]
    if what == "rotation":
        r = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], 1, 2)).as_rotvec()
    pull = (w @ (r / unit[at])[..., None])[..., 0]
    S[a, at, a, at] += w
    S[b, at, b, at] += w
    S[a, at, b, at] -= w
    S[b, at, a, at] -= w
    right[:-1, at] += pull
    right[1:, at] -= pull
