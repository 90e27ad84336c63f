"""Best-fit circular cylinder of measured points, and the test frame on it.

The test frame is right-handed, with y along the specimen's axis and Z toward the cameras. The direction of
the axis and y = 0 are declared. Distances are weighted with the noise ``nᵀ C n`` along the normal n. If only
part of the circumference is visible, radius and depth of the axis are strongly correlated. The covariance
includes this correlation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from dic.basics import MAD, BoolArray, FloatArray
from dic.camera import Camera, StereoRig


def _candidate_axes(X: FloatArray) -> list[FloatArray]:
    """Initial directions of the axis for the fit, unit vectors."""
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


def _complete_basis(axis: FloatArray, near: FloatArray | None = None) -> FloatArray:
    """Rows e1, e2, `axis`, orthonormal and right-handed; e1 as close as possible to `near`, shape [3, 3]."""
    if near is None:
        near = np.eye(3)[np.argmin(np.abs(axis))]
    e1 = near - (near @ axis) * axis
    e1 = e1 / np.linalg.norm(e1)
    (a, b, c), (x, y, z) = axis.tolist(), e1.tolist()  # numpy.cross is a hundred times slower
    return np.array([e1, [b * z - c * y, c * x - a * z, a * y - b * x], axis])


Shape = tuple[FloatArray, FloatArray, float]
"""Basis with the axis in its last row, a point of the axis, and the radius."""


def _fit_shape(
    X: FloatArray,
    sigma: FloatArray,
    start: Shape,
    radius: float | None,
    radius_sigma: float,
    *,
    robust: bool = False,
    steps: int = 100,
) -> Shape:
    """Least squares of the distances over their sigmas."""
    fixed = radius is not None and radius_sigma == 0.0
    begin = (start[0], start[1], float(radius)) if fixed and radius is not None else start
    size = float(np.sqrt(np.mean(X**2)))
    unit = np.array([size, size, 1.0, 1.0, size])  # shifts, tilts, growth of the radius

    def shape(x: FloatArray) -> Shape:
        return _changed(begin, np.append(x, 0.0) * unit if fixed else x * unit)

    def residual(x: FloatArray) -> FloatArray:
        basis, point, R = shape(x)
        off = (np.linalg.norm(_from_axis(X, point, basis), axis=1) - R) / sigma
        return off if fixed or radius is None else np.append(off, (R - radius) / radius_sigma)

    solution = least_squares(
        residual,
        np.zeros(4 if fixed else 5),
        jac="3-point",
        loss="soft_l1" if robust else "linear",
        xtol=1e-10,
        ftol=1e-14,
        gtol=1e-14,
        max_nfev=steps,
    )
    return shape(solution.x)


def slopes(X: FloatArray, shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Distances from the surface [m], and their derivatives by shifts, tilts and radius, [n, 5]."""
    basis, point, R = shape
    distance, normal = distances(X, point, basis)
    cos, sin, s = normal @ basis[0], normal @ basis[1], (X - point) @ basis[2]
    return distance - R, -np.column_stack([cos, sin, s * cos, s * sin, np.ones(len(X))])


def _changed(shape: Shape, change: FloatArray) -> Shape:
    basis, point, R = shape
    axis = basis[2] + change[2] * basis[0] + change[3] * basis[1]
    axis = axis / np.linalg.norm(axis)
    shifted = point + change[0] * basis[0] + change[1] * basis[1]
    return _complete_basis(axis, near=basis[0]), shifted, float(R + change[4])


def distances(X: FloatArray, point: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances from the axis [m], shape [n], and unit normals, shape [n, 3]."""
    away = _from_axis(X, point, basis)
    distance = np.linalg.norm(away, axis=1)
    return distance, away / np.maximum(distance, np.finfo(float).tiny)[:, None]


def _from_axis(X: FloatArray, point: FloatArray, basis: FloatArray) -> FloatArray:
    """Vectors from the axis to points, across it [m], shape [n, 3]."""
    away = X - point
    return np.asarray(away - np.outer(away @ basis[2], basis[2]))


FEWEST_POINTS = 6
FLATTEST = 50.0
"""Largest accepted radius over the extent of the points across the axis; flatter surfaces are no cylinder."""


@dataclass(frozen=True)
class Cylinder:
    """A circular cylinder and its covariance."""

    point: FloatArray
    """The point of the axis nearest to the centroid of the data [m], shape [3]."""
    basis: FloatArray
    """Rows e1, e2 across the axis and the axis itself, right-handed, shape [3, 3]."""
    radius: float
    """Radius [m]."""
    covariance: FloatArray
    """Covariance of shift along e1 and e2 [m], tilt of the axis toward e1 and e2 [rad], and radius [m], shape
    [5, 5]. It includes `noise_scale`. Row and column of a fixed radius are zero."""
    residual: FloatArray
    """Distance of every point from the surface, outward positive [m], shape [n]."""
    used: BoolArray
    """True for points used in the fit; the others were rejected as outliers, shape [n]."""
    chi2_per_dof: float
    """Sum of squared residuals over their declared variances, per degree of freedom [-]."""
    noise_scale: float
    """Noise used over noise declared, at least 1 [-]."""

    @property
    def axis(self) -> FloatArray:
        """Unit vector along the axis, shape [3]; its sign is arbitrary."""
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

    ``positions``: points on the surface [m], shape [n, 3]; any frame. ``covariance``: of the points [m²],
    shape [n, 3, 3]. ``radius``: a known radius [m]; None: the radius is estimated. ``radius_sigma``: its
    standard uncertainty [m]; 0 fixes the radius. ``overlap``: variance factors of points whose subsets
    overlap, `overlap_factor`, shape [n]. ``reject``: points farther from the surface than this many sigmas
    are left out and marked in `Cylinder.used` [-]. If the scatter exceeds the sigmas, robust standard
    deviations are used. Raises ValueError if there are fewer than 6 points, if shapes do not match, if a
    number is not finite or positive, or if the points lie on a plane.
    """
    X, C = _checked(positions, covariance, radius, radius_sigma, reject)
    factor = np.ones(len(X)) if overlap is None else np.asarray(overlap, dtype=np.float64)
    centre = X.mean(axis=0)
    X = X - centre
    best = min(_start(X, radius), key=lambda fit: fit[1])[0]
    grown = np.sqrt(factor)
    best = _fit_shape(X, _sigmas(X, C, best) * grown, best, radius, radius_sigma, robust=True)
    used = np.zeros(len(X), dtype=bool)
    for _ in range(20):
        sigma = _sigmas(X, C, best)
        off = np.abs(distances(X, best[1], best[0])[0] - best[2]) / sigma
        inliers = off <= reject * max(1.0, MAD * float(np.median(off)))
        before, best = best, _fit_shape(X[inliers], (sigma * grown)[inliers], best, radius, radius_sigma)
        settled = np.linalg.norm(best[1] - before[1]) + abs(best[2] - before[2]) < 1e-3 * sigma.min()
        if settled and (inliers == used).all():
            break
        used = inliers
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
    """A rough fit from each candidate axis, with its mean squared distance. X is relative to the centroid."""
    thin = X[:: max(1, len(X) // 500)]
    unit = np.full(len(thin), float(np.sqrt(np.mean(thin**2))))
    fits = []
    for axis in _candidate_axes(thin):
        basis = _complete_basis(axis)
        a, b, R = circle(thin @ basis[0], thin @ basis[1])
        shape = _fit_shape(thin, unit, (basis, a * basis[0] + b * basis[1], R), None, 0.0, steps=15)
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
    residual = (off / sigma)[used]
    fixed = radius is not None and radius_sigma == 0.0
    n = 4 if fixed else 5
    A = J[:, :n].T @ J[:, :n]
    prior = radius is not None and not fixed
    if prior:
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
    dof = len(residual) - n + prior
    chi2 = float(residual @ residual) / dof if dof else 1.0
    scale = float(np.sqrt(max(1.0, chi2)))
    V = np.zeros((5, 5))
    V[:n, :n] = scale**2 * np.linalg.inv(A) / np.outer(unit, unit)
    return Cylinder(centre + point, basis, R, V, off, used, chi2, scale)


WIDEST_ANGLE = 45.0
"""Largest angle between the axis seen by camera 0 and the direction declared for it [degrees]."""


@dataclass(frozen=True)
class SpecimenFrame:
    """A frame (x, y, Z) within the rig's frame, and its covariance."""

    rotation: FloatArray
    """Rows x, y, Z as unit vectors of the rig's frame, shape [3, 3]."""
    origin: FloatArray
    """The point of the axis at y = 0, in the rig's frame [m], shape [3]."""
    covariance: FloatArray
    """Covariance of small rotations about x, y, Z [rad] and shifts of the origin along them [m], shape [6,
    6]. The cameras fix the rotation about y; it has no variance."""

    def positions(self, X: FloatArray) -> FloatArray:
        """Points of the rig's frame, transformed to this frame [m], shape [..., 3]."""
        return np.asarray((X - self.origin) @ self.rotation.T)

    def in_rig(self, x: FloatArray) -> FloatArray:
        """Points of this frame, transformed to the rig's frame [m], shape [..., 3]."""
        return np.asarray(x @ self.rotation + self.origin)

    def covariances(self, C: FloatArray) -> FloatArray:
        """Covariances in the rig's frame, transformed to this frame [m²], shape [..., 3, 3]."""
        return np.asarray(self.rotation @ C @ self.rotation.T)

    def variances(self, C: FloatArray) -> FloatArray:
        """Diagonals of `covariances` [m²], shape [..., 3]."""
        return np.einsum("ij,...jk,ik->...i", self.rotation, C, self.rotation)

    def sigma(self, x: FloatArray) -> FloatArray:
        """Standard deviation of positions from the uncertainty of the frame. The error is common to all
        points.

        ``x``: points in this frame [m], shape [..., 3]. Returns: standard uncertainties by component [m],
        shape [..., 3].
        """
        x = np.asarray(x, dtype=np.float64)
        J = np.zeros((*x.shape, 6))  # in a frame turned by r and shifted by d, x is at x - r × x - d
        J[..., 0, 1], J[..., 0, 2] = -x[..., 2], x[..., 1]
        J[..., 1, 0], J[..., 1, 2] = x[..., 2], -x[..., 0]
        J[..., 2, 0], J[..., 2, 1] = -x[..., 1], x[..., 0]
        J[..., 3:] = -np.eye(3)
        return np.sqrt(np.einsum("...ij,jk,...ik->...i", J, self.covariance, J).clip(min=0.0))


def test_frame(
    cylinder: Cylinder,
    rig: StereoRig,
    *,
    toward_flyer: tuple[float, float],
    zero: ArrayLike,
    zero_sigma: float = 0.0,  # noqa: PT028
) -> SpecimenFrame:
    """Place the test frame on the cylinder of the undeformed specimen.

    y runs along the axis, positive toward the side declared by `toward_flyer`. Z is perpendicular to the axis
    and points from the axis to the midpoint between the cameras. The origin lies on the axis in the plane y =
    0.

    ``cylinder``: of the undeformed specimen, from points in the rig's frame. ``rig``: the cameras that
    measured the points. ``toward_flyer``: direction from the transmission side toward the flyer in camera 0's
    picture (right, down), of any length; (0, -1) is up. ``zero``: a point of the plane y = 0 in the rig's
    frame [m], shape [3]. The plane is the transmission platen's face; `on_cylinder` finds the point from a
    pixel. ``zero_sigma``: standard uncertainty of its position along the axis [m]. Raises ValueError if the
    axis in camera 0's picture deviates from the declared direction by more than 45°, or if numbers are not
    finite.
    """
    zero = np.asarray(zero, dtype=np.float64)
    declared = np.asarray(toward_flyer, dtype=np.float64)
    if zero.shape != (3,) or not np.isfinite(zero).all() or not zero_sigma >= 0.0:
        raise ValueError(
            f"zero must be a point of the rig's frame [m] and zero_sigma >= 0 m, got {zero}, {zero_sigma}"
        )
    if declared.shape != (2,) or not np.isfinite(declared).all() or not np.any(declared):
        raise ValueError(f"toward_flyer must be a direction (right, down) in the picture, got {toward_flyer}")
    axis = _in_picture(rig.cameras[0], cylinder)
    cosine = float(axis @ declared / np.linalg.norm(declared))
    if abs(cosine) < np.cos(np.radians(WIDEST_ANGLE)):
        raise ValueError(
            f"toward_flyer is {toward_flyer} (right, down), but camera 0 sees the axis along "
            f"({axis[0]:.2f}, {axis[1]:.2f}) or its reverse: must agree within {WIDEST_ANGLE:g}°; declare "
            "the direction of the flyer in camera 0's picture, or check the cylinder's points"
        )
    y = cylinder.axis * np.sign(cosine)
    middle = 0.5 * (rig.cameras[0].centre + rig.cameras[1].centre)
    view = middle - cylinder.point
    Z = view - (view @ y) * y
    Z = Z / np.linalg.norm(Z)
    rotation = np.array([np.cross(y, Z), y, Z])
    origin = cylinder.point + ((zero - cylinder.point) @ y) * y
    return SpecimenFrame(rotation, origin, _covariance(cylinder, rotation, origin, zero, zero_sigma))


test_frame.__test__ = False  # type: ignore[attr-defined]  # a name that test runners collect


def on_cylinder(camera: Camera, pixel: ArrayLike, cylinder: Cylinder) -> FloatArray:
    """The point of the cylinder that a camera sees at a pixel [m], in the rig's frame, shape [3].

    ``camera``: one camera of the rig that measured the cylinder. ``pixel``: position in its picture (x, y)
    [px]. ``cylinder``: the cylinder. The first intersection of the pixel's ray with it is returned. Raises
    ValueError if the ray misses the cylinder.
    """
    ideal = camera.undistort(np.asarray(pixel, dtype=np.float64))
    ray = camera.rotation.T @ np.array([ideal[0], ideal[1], 1.0])
    start = camera.centre - cylinder.point
    d, w = cylinder.basis[:2] @ ray, cylinder.basis[:2] @ start
    a, b, c = d @ d, d @ w, w @ w - cylinder.radius**2
    under = b * b - a * c
    if not under >= 0.0:
        raise ValueError(
            f"the ray of pixel {tuple(np.asarray(pixel).tolist())} passes the cylinder of radius "
            f"{cylinder.radius:.4g} m by; choose a pixel on the specimen"
        )
    return np.asarray(camera.centre + (-b - np.sqrt(under)) / a * ray)


def _in_picture(camera: Camera, cylinder: Cylinder) -> FloatArray:
    """Unit direction of the axis in a camera's picture (right, down)."""
    ends = cylinder.point + np.outer([-0.1, 0.1], cylinder.radius * cylinder.axis)
    direction = np.diff(camera.project(ends), axis=0)[0]
    return np.asarray(direction / np.linalg.norm(direction))


def _covariance(
    cylinder: Cylinder, rotation: FloatArray, origin: FloatArray, zero: FloatArray, zero_sigma: float
) -> FloatArray:
    """Effect of shifts a, b and tilts α, β of the cylinder's axis. The direction y changes by t = ±(α e1 + β
    e2), the origin by a e1 + b e2 + s t. The plane y = 0 turns about the declared point."""
    across = rotation @ cylinder.basis[:2].T  # e1, e2 in the test frame, shape [3, 2]
    sense = float(np.sign(rotation[1] @ cylinder.axis))
    s = float((origin - cylinder.point) @ rotation[1])
    x0, _, Z0 = rotation @ (zero - origin)
    J = np.zeros((6, 5))
    turn = sense * across
    J[0, 2:4], J[2, 2:4] = turn[2], -turn[0]  # r × y = t: t_Z = r_x, t_x = -r_Z
    J[3:, 0:2] = across
    J[3:, 2:4] = s * turn
    J[4] = Z0 * J[0] - x0 * J[2]
    V = np.asarray(J @ cylinder.covariance @ J.T)
    V[4, 4] += zero_sigma**2
    return V
