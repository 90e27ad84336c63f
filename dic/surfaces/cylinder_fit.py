"""Least-squares fit of a cylinder: first guesses of its axis, and the fit from one of them."""

import numpy as np
from scipy.optimize import least_squares

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
    (a, b, c), (x, y, z) = axis.tolist(), e1.tolist()  # numpy.cross takes a hundred times as long for two
    return np.array([e1, [b * z - c * y, c * x - a * z, a * y - b * x], axis])


Shape = tuple[FloatArray, FloatArray, float]
"""Basis with the axis in its last row, a point of the axis, the radius."""


def fit_shape(
    X: FloatArray,
    sigma: FloatArray,
    start: Shape,
    radius: float | None,
    radius_sigma: float,
    *,
    robust: bool = False,
    steps: int = 100,
) -> Shape:
    """Least squares of the distances over their sigmas.

    Parameters
    ----------
    X
        Points about their centroid [m], shape [n, 3].
    sigma
        Their noise along the normal [m], shape [n].
    start
        Where to begin.
    radius, radius_sigma
        As `dic.surfaces.fit_cylinder`.
    robust
        Sum 2 (√(1 + r²) - 1) in place of r², at which single points pull little.
    steps
        Most evaluations.
    """
    held = radius is not None and radius_sigma == 0.0
    begin = (start[0], start[1], float(radius)) if held and radius is not None else start
    size = float(np.sqrt(np.mean(X**2)))
    unit = np.array([size, size, 1.0, 1.0, size])  # shifts, tilts, growth of the radius

    def shape(x: FloatArray) -> Shape:
        return _changed(begin, np.append(x, 0.0) * unit if held else x * unit)

    def residual(x: FloatArray) -> FloatArray:
        basis, point, R = shape(x)
        off = (np.linalg.norm(_from_axis(X, point, basis), axis=1) - R) / sigma
        return off if held or radius is None else np.append(off, (R - radius) / radius_sigma)

    found = least_squares(
        residual,
        np.zeros(4 if held else 5),
        jac="3-point",
        loss="soft_l1" if robust else "linear",
        xtol=1e-10,
        ftol=1e-14,
        gtol=1e-14,
        max_nfev=steps,
    )
    return shape(found.x)


def slopes(X: FloatArray, shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Distances from the surface [m]; their change by a growth of shifts, tilts, radius, [n, 5]."""
    basis, point, R = shape
    distance, normal = distances(X, point, basis)
    cos, sin, s = normal @ basis[0], normal @ basis[1], (X - point) @ basis[2]
    return distance - R, -np.column_stack([cos, sin, s * cos, s * sin, np.ones(len(X))])


def _changed(shape: Shape, change: FloatArray) -> Shape:
    basis, point, R = shape
    axis = basis[2] + change[2] * basis[0] + change[3] * basis[1]
    axis = axis / np.linalg.norm(axis)
    moved = point + change[0] * basis[0] + change[1] * basis[1]
    return complete_basis(axis, near=basis[0]), moved, float(R + change[4])


def distances(X: FloatArray, point: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances from the axis [m], shape [n], and unit normals, shape [n, 3]."""
    away = _from_axis(X, point, basis)
    distance = np.linalg.norm(away, axis=1)
    return distance, away / np.maximum(distance, np.finfo(float).tiny)[:, None]


def _from_axis(X: FloatArray, point: FloatArray, basis: FloatArray) -> FloatArray:
    """Vectors from the axis to points, across it [m], shape [n, 3]."""
    away = X - point
    return np.asarray(away - np.outer(away @ basis[2], basis[2]))
