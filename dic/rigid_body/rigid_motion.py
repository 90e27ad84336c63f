"""Rigid motion between two sets of points, with its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dic.arrays import BoolArray, FloatArray
from dic.robust import MAD

FEWEST_POINTS = 3


@dataclass(frozen=True)
class RigidMotion:
    """The motion ``x = R (X - centre) + centre + translation`` and how well it is known."""

    rotation: FloatArray
    """R, shape [3, 3]."""
    translation: FloatArray
    """Displacement of `centre` [m], shape [3]."""
    centre: FloatArray
    """The weighted mean of the points at rest [m], shape [3]."""
    covariance: FloatArray
    """Of a small rotation after R about the three axes [rad] and of the translation [m], shape [6, 6];
    `noise_scale` is in it."""
    used: BoolArray
    """Points the motion rests on; the others lie too far off, shape [n]."""
    chi2_per_dof: float
    """Sum of squared residuals in their declared sigmas over the degrees of freedom [-]."""
    noise_scale: float
    """Noise used over noise declared, at least 1 [-]."""

    @property
    def rotation_vector(self) -> FloatArray:
        """Axis of the rotation times its angle [rad], shape [3]."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_rotvec())

    def moved(self, X: FloatArray) -> FloatArray:
        """Moved points of the body [m], shape [..., 3]."""
        return np.asarray((X - self.centre) @ self.rotation.T + self.centre + self.translation)


def rigid_motion(
    X: ArrayLike,
    x: ArrayLike,
    covariance: ArrayLike,
    *,
    overlap: ArrayLike | None = None,
    reject: float = 4.0,
) -> RigidMotion:
    """Find the rigid motion from points at rest to their places now.

    The start is Kabsch's rotation by singular values with scalar weights; Gauss-Newton steps then weigh
    with the whole covariances.

    Parameters
    ----------
    X
        Points at rest [m], shape [n, 3].
    x
        The same points now [m], shape [n, 3].
    covariance
        Of the differences between the two [m²], shape [n, 3, 3].
    overlap
        Variance factors of points whose subsets overlap, `dic.surfaces.overlap_factor`, shape [n].
    reject
        Points farther off than this many sigmas, or this many robust standard deviations if the scatter
        is larger than the sigmas say, are left out and marked in `RigidMotion.used` [-].

    Raises
    ------
    ValueError
        Fewer than 3 points, shapes that do not fit, numbers that are not finite, covariances that are not
        positive definite, or points on one line, about which the rotation is open.

    References
    ----------
    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica
    A32 (1976) 922-923.
    """
    rest, now = np.asarray(X, dtype=np.float64), np.asarray(x, dtype=np.float64)
    C = np.asarray(covariance, dtype=np.float64)
    n = len(rest)
    if rest.shape != (n, 3) or now.shape != (n, 3) or C.shape != (n, 3, 3):
        raise ValueError(
            f"X, x and covariance must be [n, 3], [n, 3], [n, 3, 3], got {rest.shape}, {now.shape}, {C.shape}"
        )
    if n < FEWEST_POINTS or not reject > 0.0:
        raise ValueError(f"a rigid motion needs {FEWEST_POINTS} points and reject > 0, got {n} and {reject}")
    if not (np.isfinite(rest).all() and np.isfinite(now).all() and np.isfinite(C).all()):
        raise ValueError("points and covariances must be finite: leave out the points that are not valid")
    if np.linalg.eigvalsh(C).min() <= 0.0:
        raise ValueError("every point's covariance must be positive definite")
    own = np.linalg.inv(C)
    factor = np.ones(n) if overlap is None else np.asarray(overlap, dtype=np.float64)
    W = np.asarray(own / factor[:, None, None], dtype=np.float64)
    weight = np.asarray(np.trace(W, axis1=1, axis2=2))
    centre = np.average(rest, axis=0, weights=weight)
    used = np.ones(n, dtype=bool)
    R, d = kabsch(rest - centre, now - centre, weight)
    for _ in range(30):
        R, d, step, A = _newton_step(rest[used] - centre, now[used] - centre, W[used], R, d)
        off = now - centre - d - (rest - centre) @ R.T
        size = np.sqrt(np.einsum("ni,nij,nj->n", off, own, off) / 3.0)
        kept = size <= reject * max(1.0, MAD * float(np.median(size)))
        if (kept == used).all() and step < 1e-10:
            break
        if kept.sum() < FEWEST_POINTS:
            raise ValueError(f"only {int(kept.sum())} of {n} points move as one rigid body")
        used = kept
    dof = 3 * int(used.sum()) - 6
    chi2 = float(3.0 * np.sum(size[used] ** 2)) / dof if dof else 1.0
    scale = float(np.sqrt(max(1.0, chi2)))
    unit = np.sqrt(np.diag(A))
    V = scale**2 * np.linalg.inv(A / np.outer(unit, unit)) / np.outer(unit, unit)
    return RigidMotion(R, d, centre, V, used, chi2, scale)


def kabsch(X: FloatArray, x: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
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


def _newton_step(
    X: FloatArray, x: FloatArray, W: FloatArray, R: FloatArray, d: FloatArray
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """New rotation, new translation, angle of the step [rad], normal matrix."""
    turned = X @ R.T
    J = lever(turned)
    A = np.einsum("nia,nij,njb->ab", J, W, J, optimize=True)
    b = np.einsum("nia,nij,nj->a", J, W, x - turned - d, optimize=True)
    unit = np.sqrt(np.diag(A))
    scaled = A / np.outer(unit, unit)
    if not np.linalg.eigvalsh(scaled)[0] > 1e-12:
        raise ValueError("the points lie on one line: their rotation about it is open; use more points")
    step = np.linalg.solve(scaled, b / unit) / unit
    return (
        Rotation.from_rotvec(step[:3]).as_matrix() @ R,
        d + step[3:],
        float(np.linalg.norm(step[:3])),
        A,
    )
