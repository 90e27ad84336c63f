"""Geometry of two cameras: rays, epipolar distance with its uncertainty, triangulation with covariance.

Camera 1 sees the ray of camera 0's ideal point x0 as the line ``l . x1 = 0``, ``l = t × R x0`` (Hartley and
Zisserman, Multiple View Geometry, 2nd ed., eq. 9.11). Distances in the distorted picture are ``d = g / |∇g|``
with ``g(p1) = l . undistort(p1)``. A point in space minimises (section 12.3 of the same book) ::

    X = argmin Σ_k (p_k - π_k(X))ᵀ C_k⁻¹ (p_k - π_k(X)),      cov X = (Σ_k J_kᵀ C_k⁻¹ J_k)⁻¹

with J_k = ∂π_k/∂X. Gauss-Newton steps start from the middle between the two lines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.camera import Camera, StereoRig


def inverse(M: FloatArray) -> FloatArray:
    """Inverses, shape [..., 2, 2]; not finite where a determinant is zero."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    result = np.empty(M.shape)
    result[..., 0, 0], result[..., 0, 1], result[..., 1, 0], result[..., 1, 1] = d, -b, -c, a
    result /= (a * d - b * c)[..., None, None]
    return result


def largest_eigenvalue(M: FloatArray) -> FloatArray:
    """The larger eigenvalue of matrices with real eigenvalues, shape [...]."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    half = 0.5 * (a - d)
    # prevents complex eigenvalues by rounding
    return np.asarray(0.5 * (a + d) + np.sqrt(np.maximum(half * half + b * c, 0.0)))


def directions(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Unit vectors of the rays from the camera's centre through `pixels`, in the rig's frame [-].

    ``camera``: the camera. ``pixels``: positions in its picture (x, y) [px], shape [..., 2]. Returns: shape
    [..., 3]; NaN where the pixel is NaN. Raises ValueError if the lens distortion cannot be inverted there.
    """
    return towards(camera, inside(camera, pixels))


def inside(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Ideal image points (x, y, 1) on the plane z = 1 of the camera's frame [-], shape [..., 3]."""
    ideal = camera.undistort(pixels)
    return np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1)


def towards(camera: Camera, x: FloatArray) -> FloatArray:
    """`directions` for a result of `inside`."""
    return np.asarray(x @ camera.rotation / np.linalg.norm(x, axis=-1, keepdims=True))


def pixels_per_length(camera: Camera, X: FloatArray, direction: FloatArray) -> FloatArray:
    """Motion of the pixel of a point that moves along a direction [px/m], shape [2].

    ``camera``: the camera. ``X``: the point in the rig's frame, in front of the camera [m], shape [3].
    ``direction``: unit vector in the rig's frame, shape [3].
    """
    return np.asarray(projection_slope(camera, np.asarray(X)) @ direction)


def pixel_slope(camera: Camera, ideal: FloatArray) -> FloatArray:
    """Derivative of the pixel with respect to the ideal image point on the plane z = 1 [px], shape [..., 2,
    2]."""
    slope = camera.distortion_slope(ideal)
    if camera.skew:
        return np.asarray(np.array([[camera.fx, camera.skew], [0.0, camera.fy]]) @ slope)
    slope *= np.array([[camera.fx], [camera.fy]])
    return slope


def projection_slope(camera: Camera, X: FloatArray) -> FloatArray:
    """Derivative of `Camera.project` with respect to the point [px/m], shape [..., 2, 3].

    ``camera``: the camera. ``X``: points in the rig's frame, in front of the camera [m], shape [..., 3].
    """
    place = camera.in_camera(X)
    depth = place[..., 2]
    ideal = place[..., :2] / depth[..., None]
    perspective = np.zeros((*depth.shape, 2, 3))
    perspective[..., 0, 0] = perspective[..., 1, 1] = 1.0 / depth
    perspective[..., :, 2] = -ideal / depth[..., None]
    return np.asarray(pixel_slope(camera, ideal) @ perspective @ camera.rotation)


def epipolar_distance(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> FloatArray:
    """Distance of camera 1's points from the epipolar curves of camera 0's, signed [px].

    For cameras side by side it is positive toward larger y. For cameras one above the other it is positive
    toward larger x. It is correct to first order in the distance and exact on the curve. Its error comes from
    the curvature of the curve and from the variation of the lens's magnification within the distance.

    ``pixels0``, ``pixels1``: pixels (x, y) of the same points in both cameras [px], shapes [..., 2]. Returns:
    shape [...]; NaN where a pixel is NaN. Raises ValueError if the cameras have the same centre, or a lens
    distortion cannot be inverted.
    """
    return epipolar_slopes(rig, pixels0, pixels1)[0]


def epipolar_sigma(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, covariance0: FloatArray, covariance1: FloatArray
) -> FloatArray:
    """Standard deviation of `epipolar_distance` due to the noise of the pixels [px], shape [...].

    ``rig``, ``pixels0``, ``pixels1``: as for `epipolar_distance`. ``covariance0``, ``covariance1``:
    covariances of the pixels, independent between the cameras [px²], shapes [..., 2, 2] or [2, 2].
    """
    _, slope0, slope1 = epipolar_slopes(rig, pixels0, pixels1)
    return sigma_of(slope0, slope1, covariance0, covariance1)


def sigma_of(
    slope0: FloatArray, slope1: FloatArray, covariance0: FloatArray, covariance1: FloatArray
) -> FloatArray:
    """`epipolar_sigma` for slopes that `epipolar_slopes` has computed."""
    variance = np.einsum("...i,...ij,...j->...", slope0, covariance0, slope0)
    return np.asarray(np.sqrt(variance + np.einsum("...i,...ij,...j->...", slope1, covariance1, slope1)))


def epipolar_curve(rig: StereoRig, pixels0: FloatArray, depths: FloatArray) -> FloatArray:
    """Pixels of camera 1 [px] of the points that camera 0 sees at `pixels0`, for each assumed depth."""
    first, second = rig.cameras
    rays = directions(first, pixels0)
    return second.project(first.centre + rays[..., None, :] * np.asarray(depths)[:, None])


def epipolar_slopes(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`epipolar_distance` [px], shape [...], and its derivatives by the two pixels [-], shapes [..., 2].

    The derivatives neglect the change of the line's direction. The relative error is of the order of distance
    over focal length.
    """
    first, second = rig.cameras
    return slopes_between(rig, Rays.of(first, pixels0), Rays.of(second, pixels1))


class Rays(NamedTuple):
    """Rays of a camera's pixels. They are computed once and used in several comparisons."""

    x: FloatArray
    """Ideal image points (x, y, 1) on the plane z = 1 [-], shape [..., 3]."""
    slope: FloatArray
    """Derivatives of the pixels with respect to `x` [px], shape [..., 2, 2]."""

    @classmethod
    def of(cls, camera: Camera, pixels: FloatArray) -> "Rays":
        """Rays of `pixels` (x, y) [px], shape [..., 2]; ValueError if the lens distortion cannot be inverted
        there."""
        x = inside(camera, pixels)
        return cls(x, pixel_slope(camera, x[..., :2]))


def slopes_between(rig: StereoRig, aim0: Rays, aim1: Rays) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`epipolar_slopes` for pixels with known `Rays`."""
    R, t = rig.relative
    if not np.any(t):
        raise ValueError("both cameras have the same centre, 0 m apart: two views of one place give no depth")
    sign = np.sign(-t[0]) if abs(t[0]) >= abs(t[1]) else np.sign(t[1])
    E = (sign or 1.0) * np.cross(t, R, axisa=0, axisb=0, axisc=0)
    line1, line0 = aim0.x @ E.T, aim1.x @ E
    gradient0, gradient1 = _by_pixel(line0, aim0.slope), _by_pixel(line1, aim1.slope)
    length = np.linalg.norm(gradient1, axis=-1)
    distance = np.sum(line1 * aim1.x, axis=-1) / length
    return distance, gradient0 / length[..., None], gradient1 / length[..., None]


def _by_pixel(line: FloatArray, slope: FloatArray) -> FloatArray:
    """Gradient of ``line . x`` with respect to the pixel: (∂pixel/∂x)⁻ᵀ line, shape [..., 2]."""
    (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
    l, m = line[..., 0], line[..., 1]
    return np.asarray(np.stack([d * l - c * m, a * m - b * l], axis=-1) / (a * d - b * c)[..., None])


EXACT = 1e-10
"""Variance that is added to every position [px²]: (1e-5 px)². It gives a chosen (exact) position a finite
weight."""
STEPS = 10
"""Largest number of Gauss-Newton steps. Two steps are sufficient unless the cameras disagree by many
pixels."""


class Triangulation(NamedTuple):
    """Points in space with their covariances and epipolar distances."""

    position: FloatArray
    """Position in the rig's frame [m], shape [..., 3]; NaN where a pixel is NaN, or no point lies in front of
    both cameras."""
    covariance: FloatArray
    """Covariance of the position due to the noise of the pixels [m²], shape [..., 3, 3]."""
    epipolar: FloatArray
    """Signed distance of camera 1's point from the epipolar line of camera 0's point [px], shape [...]."""
    epipolar_sigma: FloatArray
    """Its standard deviation, from the noise of the pixels [px], shape [...]."""


def midpoint(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> FloatArray:
    """Midpoint of the shortest segment between the two rays [m], shape [..., 3].

    ``pixels0``, ``pixels1``: pixels (x, y) of the same points in both cameras [px], shapes [..., 2]. Raises
    ValueError if a lens distortion cannot be inverted.
    """
    first, second = rig.cameras
    return _middle(rig, directions(first, pixels0), directions(second, pixels1))


def _middle(rig: StereoRig, d0: FloatArray, d1: FloatArray) -> FloatArray:
    """`midpoint` of rays along unit vectors d0 and d1, shapes [..., 3]."""
    first, second = rig.cameras
    base = second.centre - first.centre
    c, a0, a1 = np.sum(d0 * d1, axis=-1), d0 @ base, d1 @ base
    parallel = 1.0 - c * c
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel lines do not meet: not finite
        s0, s1 = (a0 - c * a1) / parallel, (c * a0 - a1) / parallel
        return np.asarray((first.centre + s0[..., None] * d0 + second.centre + s1[..., None] * d1) / 2.0)


def triangulate(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, covariance0: FloatArray, covariance1: FloatArray
) -> Triangulation:
    """Points in space from points in two pictures, with covariances.

    ``rig``: the cameras. ``pixels0``, ``pixels1``: pixels (x, y) of the same points in both cameras [px],
    shapes [..., 2]. ``covariance0``, ``covariance1``: covariances of the finite pixels, independent between
    the cameras [px²], shapes [..., 2, 2] or [2, 2]. Zero for a chosen position, e.g. a material point in the
    material picture. Returns: position, covariance, epipolar distance and its sigma. Raises ValueError if
    shapes do not match, a covariance is invalid, or a lens distortion cannot be inverted.
    """
    pixels0, pixels1 = (np.asarray(p, dtype=np.float64) for p in (pixels0, pixels1))
    if pixels0.shape != pixels1.shape or pixels0.shape[-1:] != (2,):
        raise ValueError(
            f"pixels0 and pixels1 must have one shape [..., 2], got {pixels0.shape} and {pixels1.shape}"
        )
    finite = np.all(np.isfinite(pixels0) & np.isfinite(pixels1), axis=-1)
    noise = (_covariances(covariance0, finite, 0), _covariances(covariance1, finite, 1))
    position = np.full((*finite.shape, 3), np.nan)
    covariance = np.full((*finite.shape, 3, 3), np.nan)
    epipolar, sigma = np.full(finite.shape, np.nan), np.full(finite.shape, np.nan)
    pixels = (pixels0[finite], pixels1[finite])
    aims = [Rays.of(camera, places) for camera, places in zip(rig.cameras, pixels, strict=True)]
    epipolar[finite], *slopes = slopes_between(rig, aims[0], aims[1])
    sigma[finite] = sigma_of(slopes[0], slopes[1], *noise)
    d0, d1 = (towards(camera, aim.x) for camera, aim in zip(rig.cameras, aims, strict=True))
    weights = inverse(noise[0] + EXACT * np.eye(2)), inverse(noise[1] + EXACT * np.eye(2))
    position[finite], covariance[finite] = _nearest(rig, _middle(rig, d0, d1), pixels, weights)
    return Triangulation(position, covariance, epipolar, sigma)


def _covariances(covariance: FloatArray, finite: NDArray[np.bool_], camera: int) -> FloatArray:
    """Covariances of the finite pixels [px²], shape [n, 2, 2]."""
    covariance = np.asarray(covariance, dtype=np.float64)
    if covariance.shape not in ((2, 2), (*finite.shape, 2, 2)):
        raise ValueError(
            f"covariance{camera} has shape {covariance.shape}, must be (2, 2) or {(*finite.shape, 2, 2)}"
        )
    used = np.broadcast_to(covariance, (*finite.shape, 2, 2))[finite]
    a, b, c, d = used[:, 0, 0], used[:, 0, 1], used[:, 1, 0], used[:, 1, 1]
    tiny = 1e-6 * (a + d)
    fine = (a >= 0.0) & (d >= 0.0) & (np.abs(b - c) <= tiny) & (a * d - b * c >= -(tiny**2))
    if not np.all(fine):
        point, matrix = np.argwhere(finite)[np.argmin(fine)].tolist(), used[np.argmin(fine)].tolist()
        raise ValueError(
            f"covariance{camera} of point {point} is {matrix} px², must be symmetric and have no negative "
            "eigenvalue: give the point an outcome instead"
        )
    return used


def _nearest(
    rig: StereoRig,
    start: FloatArray,
    pixels: tuple[FloatArray, FloatArray],
    weights: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Positions [n, 3] and covariances [n, 3, 3] by Gauss-Newton; NaN where no point lies in front of both
    cameras."""
    X = start.copy()
    covariance = np.full((len(X), 3, 3), np.nan)
    searching = np.flatnonzero(_before(rig, X))
    settled = np.zeros(len(X), dtype=bool)
    for _ in range(STEPS):
        H, g = np.zeros((len(searching), 3, 3)), np.zeros((len(searching), 3))
        for camera, observed, weight in zip(rig.cameras, pixels, weights, strict=True):
            J = projection_slope(camera, X[searching])
            JW = np.swapaxes(J, 1, 2) @ weight[searching]
            H += JW @ J
            g += (JW @ (observed[searching] - camera.project(X[searching]))[..., None])[..., 0]
        covariance[searching] = _inverse(H)
        move = (covariance[searching] @ g[..., None])[..., 0]
        X[searching] += move
        in_front = _before(rig, X[searching])
        small = np.sum(move * g, axis=-1) < 1e-12  # the step is a millionth of its sigma
        settled[searching[in_front & small]] = True
        searching = searching[in_front & ~small]
        if not len(searching):
            break
    X[~settled], covariance[~settled] = np.nan, np.nan
    return X, covariance


def _before(rig: StereoRig, X: FloatArray) -> NDArray[np.bool_]:
    """True for points in front of both cameras at a finite distance, shape [n]."""
    depth = np.stack([camera.in_camera(X)[:, 2] for camera in rig.cameras])
    return np.asarray(np.all(np.isfinite(depth) & (depth > 0.0), axis=0))


def _inverse(H: FloatArray) -> FloatArray:
    """Inverses of symmetric matrices by their cofactors, shape [n, 3, 3]; not finite for a singular one."""
    a, b, c = H[:, 0], H[:, 1], H[:, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = cofactors / np.sum(a * cofactors[..., 0], axis=-1)[:, None, None]
    return np.asarray((inverse + np.swapaxes(inverse, 1, 2)) / 2.0)
