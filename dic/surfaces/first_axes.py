"""First guesses of a cylinder's axis from points on a part of it."""

import numpy as np

from dic.arrays import FloatArray


def candidate_axes(X: FloatArray) -> list[FloatArray]:
    """Directions worth starting a fit from, unit vectors.

    The direction of least curvature of the paraboloid over the plane that fits best, right for any arc
    up to a half circle; the principal directions of the points, right for a long cylinder.

    Parameters
    ----------
    X
        Points about their centroid [m], shape [n, 3].
    """
    _, vectors = np.linalg.eigh(X.T @ X)
    normal, first, second = vectors.T
    size = float(np.sqrt(np.mean(X**2)))
    a, b, h = X @ first / size, X @ second / size, X @ normal / size
    terms = np.column_stack([np.ones_like(a), a, b, a * a, a * b, b * b])
    fitted = np.linalg.lstsq(terms, h, rcond=None)[0]
    hessian = np.array([[2.0 * fitted[3], fitted[4]], [fitted[4], 2.0 * fitted[5]]])
    curvature, directions = np.linalg.eigh(hessian)
    straight = directions[:, np.argmin(np.abs(curvature))]
    slope = straight @ fitted[1:3]
    along = straight[0] * first + straight[1] * second + slope * normal
    return [along / np.linalg.norm(along), *vectors.T]


def circle(u: FloatArray, v: FloatArray) -> tuple[float, float, float]:
    """Centre (u, v) and radius of the circle through plane points, by linear least squares (Kåsa)."""
    terms = np.column_stack([2.0 * u, 2.0 * v, np.ones_like(u)])
    a, b, c = np.linalg.lstsq(terms, u * u + v * v, rcond=None)[0]
    return float(a), float(b), float(np.sqrt(max(c + a * a + b * b, 0.0)))


def complete_basis(axis: FloatArray, near: FloatArray | None = None) -> FloatArray:
    """Rows e1, e2, `axis`, orthonormal and right-handed; e1 as near as can be to `near`, shape [3, 3]."""
    if near is None:
        near = np.eye(3)[np.argmin(np.abs(axis))]
    e1 = near - (near @ axis) * axis
    e1 = e1 / np.linalg.norm(e1)
    return np.array([e1, np.cross(axis, e1), axis])
