"""The circular cylinder that fits measured points best, with its covariance.

Weighted orthogonal distances: a point of covariance C whose normal to the cylinder is n lies off the
surface by the noise sigma² = nᵀ C n, all that matters to first order when the noise is small beside the
radius. From a part of the circumference the radius and the place of the axis along the view are known
poorly and nearly only together; the covariance says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dic.arrays import BoolArray, FloatArray
from dic.robust import MAD
from dic.surfaces.cylinder_fit import (
    Shape,
    candidate_axes,
    circle,
    complete_basis,
    distances,
    fit_shape,
    slopes,
)

FEWEST_POINTS = 6
FLATTEST = 50.0
"""Largest radius over the extent of the points across the axis that still counts as a cylinder."""


@dataclass(frozen=True)
class Cylinder:
    """A circular cylinder and how well its points determine it."""

    point: FloatArray
    """The point of the axis beside the centroid of the data [m], shape [3]."""
    basis: FloatArray
    """Rows e1, e2 across the axis and the axis itself, right-handed, shape [3, 3]."""
    radius: float
    """Radius [m]."""
    covariance: FloatArray
    """Of shift along e1 and e2 [m], tilt of the axis toward e1 and e2 [rad], radius [m]; shape [5, 5].
    `noise_scale` is in it; the rows of a radius that was held exactly are zero."""
    residual: FloatArray
    """Distance of every point from the surface, outward positive [m], shape [n]."""
    used: BoolArray
    """Points the fit rests on; the others lie too far off, shape [n]."""
    chi2_per_dof: float
    """Sum of squared residuals in their declared sigmas over the degrees of freedom [-]."""
    noise_scale: float
    """Noise used over noise declared, at least 1 [-]."""

    @property
    def axis(self) -> FloatArray:
        """Unit vector along the axis; its sign means nothing, shape [3]."""
        return self.basis[2]

    @property
    def rms(self) -> float:
        """Root mean square distance of the used points from the surface [m]."""
        return float(np.sqrt(np.mean(self.residual[self.used] ** 2)))

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainties in the order of `covariance`, shape [5]."""
        return np.sqrt(np.diag(self.covariance))


def fit_cylinder(
    positions: ArrayLike,
    covariance: ArrayLike,
    *,
    radius: float | None = None,
    radius_sigma: float = 0.0,
    overlap: ArrayLike | None = None,
    reject: float = 4.0,
) -> Cylinder:
    """Fit a cylinder to points by weighted orthogonal distances.

    Parameters
    ----------
    positions
        Points on the surface [m], shape [n, 3]; any frame.
    covariance
        Of the points [m²], shape [n, 3, 3].
    radius
        A radius known beforehand [m]; None to leave it free.
    radius_sigma
        Its standard uncertainty [m]; 0 holds the radius exactly.
    overlap
        Variance factors of points whose subsets overlap, `dic.surfaces.overlap_factor`, shape [n].
    reject
        Points farther off than this many sigmas, or this many robust standard deviations if the scatter
        is larger than the sigmas say, are left out and marked in `Cylinder.used` [-].

    Raises
    ------
    ValueError
        Fewer than 6 points, shapes that do not fit, a number that is not finite or positive, points that
        lie on a plane rather than a cylinder.
    """
    X, C = _checked(positions, covariance, radius, radius_sigma, reject)
    factor = np.ones(len(X)) if overlap is None else np.asarray(overlap, dtype=np.float64)
    centre = X.mean(axis=0)
    X = X - centre
    best = min(_start(X, radius), key=lambda fit: fit[1])[0]
    grown = np.sqrt(factor)
    best = fit_shape(X, _sigmas(X, C, best) * grown, best, radius, radius_sigma, robust=True)
    used = np.zeros(len(X), dtype=bool)
    for _ in range(20):
        sigma = _sigmas(X, C, best)
        off = np.abs(distances(X, best[1], best[0])[0] - best[2]) / sigma
        kept = off <= reject * max(1.0, MAD * float(np.median(off)))
        before, best = best, fit_shape(X[kept], (sigma * grown)[kept], best, radius, radius_sigma)
        settled = np.linalg.norm(best[1] - before[1]) + abs(best[2] - before[2]) < 1e-3 * sigma.min()
        if settled and (kept == used).all():
            break
        used = kept
    return _finished(X, C, factor, centre, best, used, radius, radius_sigma)


def _checked(
    positions: ArrayLike, covariance: ArrayLike, radius: float | None, radius_sigma: float, reject: float
) -> tuple[FloatArray, FloatArray]:
    X, C = np.asarray(positions, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != 3 or C.shape != (len(X), 3, 3):
        raise ValueError(f"positions and covariance must be [n, 3] and [n, 3, 3], got {X.shape}, {C.shape}")
    if len(X) < FEWEST_POINTS:
        raise ValueError(f"a cylinder needs at least {FEWEST_POINTS} points, got {len(X)}")
    if not (np.isfinite(X).all() and np.isfinite(C).all()):
        raise ValueError("positions and covariance must be finite: leave out the points that are not valid")
    if radius is not None and not (np.isfinite(radius) and radius > 0.0):
        raise ValueError(f"radius must be a positive length in metres, got {radius}")
    if not (np.isfinite(radius_sigma) and radius_sigma >= 0.0) or not reject > 0.0:
        raise ValueError(f"radius_sigma must be >= 0 m and reject > 0, got {radius_sigma} and {reject}")
    return X, C


def _start(X: FloatArray, radius: float | None) -> list[tuple[Shape, float]]:
    """A rough fit from each candidate axis, with its mean squared distance; X about its centroid."""
    thin = X[:: max(1, len(X) // 500)]
    unit = np.full(len(thin), float(np.sqrt(np.mean(thin**2))))
    fits = []
    for axis in candidate_axes(thin):
        basis = complete_basis(axis)
        a, b, R = circle(thin @ basis[0], thin @ basis[1])
        shape = fit_shape(thin, unit, (basis, a * basis[0] + b * basis[1], R), None, 0.0, steps=15)
        fits.append((shape, float(np.mean((distances(thin, shape[1], shape[0])[0] - shape[2]) ** 2))))
    if radius is None:
        return fits
    return [((B, p, radius), cost) for (B, p, _), cost in fits]


def _sigmas(X: FloatArray, C: FloatArray, shape: Shape) -> FloatArray:
    """Noise of the points along the normal [m]."""
    normal = distances(X, shape[1], shape[0])[1]
    variance = np.einsum("ni,nij,nj->n", normal, C, normal)
    if not (variance > 0.0).all():
        raise ValueError(
            f"point {int(np.argmin(variance))} has no noise across the surface; every point needs a "
            "covariance that is positive along the normal"
        )
    return np.sqrt(variance)


def _finished(
    X: FloatArray,
    C: FloatArray,
    factor: FloatArray,
    centre: FloatArray,
    shape: Shape,
    used: BoolArray,
    radius: float | None,
    radius_sigma: float,
) -> Cylinder:
    basis, point, R = shape
    point = point - (point @ basis[2]) * basis[2]
    sigma = _sigmas(X, C, shape)
    off, J = slopes(X, (basis, point, R))
    J = (J / (sigma * np.sqrt(factor))[:, None])[used]
    rest = (off / sigma)[used]
    held = radius is not None and radius_sigma == 0.0
    n = 4 if held else 5
    A = J[:, :n].T @ J[:, :n]
    known = radius is not None and not held
    if known:
        A[4, 4] += radius_sigma**-2
    unit = np.sqrt(np.diag(A))  # lengths and angles
    unit[unit == 0.0] = 1.0
    A = A / np.outer(unit, unit)
    extent = float(np.ptp(X @ basis[:2].T, axis=0).max())
    if FLATTEST * extent < R or used.sum() < FEWEST_POINTS or np.linalg.eigvalsh(A)[0] < 1e-12:
        raise ValueError(
            f"the points lie on no cylinder: radius {R:.3g} m over an extent of {extent:.3g} m across the "
            f"axis, {int(used.sum())} of {len(X)} points near it; check the points, or give the radius"
        )
    dof = len(rest) - n + known
    chi2 = float(rest @ rest) / dof if dof else 1.0
    scale = float(np.sqrt(max(1.0, chi2)))
    V = np.zeros((5, 5))
    V[:n, :n] = scale**2 * np.linalg.inv(A) / np.outer(unit, unit)
    return Cylinder(centre + point, basis, R, V, off, used, chi2, scale)
