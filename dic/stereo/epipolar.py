"""Epipolar distance: disagreement of two cameras about a point, with its sigma.

With the relative pose ``X_1 = R X_0 + t`` the ray of camera 0's ideal image point x0 spans with the baseline
a plane, which camera 1 sees as the line ``l . x1 = 0``, ``l = t × R x0`` (Hartley and Zisserman, Multiple
View Geometry, 2nd ed., eq. 9.11). A lens bends that line into a curve. Distances are those in the picture
as it was taken: ``d = g / |∇g|`` with ``g(p1) = l . undistort(p1)`` and its gradient by the pixel p1.
"""

from typing import NamedTuple

import numpy as np

from dic.arrays import FloatArray
from dic.camera import Camera, StereoRig
from dic.stereo.rays import directions, inside, pixel_slope


def epipolar_distance(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> FloatArray:
    """Distance of camera 1's points from the epipolar curves of camera 0's, signed [px].

    Positive toward larger y for cameras side by side, toward larger x for cameras one above the other. To
    first order in the distance: exact on the curve, off it only as the curve bends and the lens's
    magnification varies within the distance.

    Parameters
    ----------
    rig
        The cameras.
    pixels0, pixels1
        One point seen by both, a row each (x, y) [px], shapes [..., 2].

    Returns
    -------
    NDArray
        Shape [...]; NaN where a pixel is.

    Raises
    ------
    ValueError
        If the cameras have one centre, or a lens distortion cannot be undone.
    """
    return epipolar_slopes(rig, pixels0, pixels1)[0]


def epipolar_sigma(
    rig: StereoRig,
    pixels0: FloatArray,
    pixels1: FloatArray,
    covariance0: FloatArray,
    covariance1: FloatArray,
) -> FloatArray:
    """Standard deviation of `epipolar_distance` that the noise of the pixels predicts [px], shape [...].

    Parameters
    ----------
    rig, pixels0, pixels1
        As for `epipolar_distance`.
    covariance0, covariance1
        Of the pixels, independent between the cameras [px²], shapes [..., 2, 2] or [2, 2].
    """
    _, slope0, slope1 = epipolar_slopes(rig, pixels0, pixels1)
    return sigma_of(slope0, slope1, covariance0, covariance1)


def sigma_of(
    slope0: FloatArray, slope1: FloatArray, covariance0: FloatArray, covariance1: FloatArray
) -> FloatArray:
    """`epipolar_sigma` where the slopes of `epipolar_slopes` are known."""
    variance = np.einsum("...i,...ij,...j->...", slope0, covariance0, slope0)
    return np.asarray(np.sqrt(variance + np.einsum("...i,...ij,...j->...", slope1, covariance1, slope1)))


def epipolar_curve(rig: StereoRig, pixels0: FloatArray, depths: FloatArray) -> FloatArray:
    """Pixels of camera 1 for what camera 0 sees at `pixels0`, at each assumed depth [px].

    Parameters
    ----------
    rig
        The cameras.
    pixels0
        Places in camera 0's picture (x, y) [px], shape [..., 2].
    depths
        Distances along camera 0's ray [m], shape [n].

    Returns
    -------
    NDArray
        Shape [..., n, 2]; NaN for a depth that lies behind camera 1.
    """
    first, second = rig.cameras
    rays = directions(first, pixels0)
    return second.project(first.centre + rays[..., None, :] * np.asarray(depths)[:, None])


def epipolar_slopes(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`epipolar_distance` [px], shape [...], and its derivatives by the two pixels [-], shapes [..., 2].

    The derivatives leave out how the direction of the line changes, a part of the order of the distance over
    the focal length.
    """
    first, second = rig.cameras
    return slopes_between(rig, Rays.of(first, pixels0), Rays.of(second, pixels1))


class Rays(NamedTuple):
    """Rays of a camera's pixels, found once for all that they are compared with."""

    x: FloatArray
    """Ideal image points on the plane z = 1, with that 1 [-], shape [..., 3]."""
    slope: FloatArray
    """Derivatives of the pixels by them [px], shape [..., 2, 2]."""

    @classmethod
    def of(cls, camera: Camera, pixels: FloatArray) -> "Rays":
        """That of `pixels` (x, y) [px], shape [..., 2]; a ValueError if the lens cannot be undone there."""
        x = inside(camera, pixels)
        return cls(x, pixel_slope(camera, x[..., :2]))


def slopes_between(rig: StereoRig, aim0: Rays, aim1: Rays) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`epipolar_slopes` of pixels whose `Rays` is known."""
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
    """Gradient of ``line . x`` by the pixel: (∂pixel/∂x)⁻ᵀ line, shape [..., 2]."""
    (a, b), (c, d) = np.moveaxis(slope, (-2, -1), (0, 1))
    l, m = line[..., 0], line[..., 1]
    return np.asarray(np.stack([d * l - c * m, a * m - b * l], axis=-1) / (a * d - b * c)[..., None])
