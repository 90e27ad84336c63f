"""Triangulation: points in space from two cameras' rays, with covariance.

The point sought is the one whose two projections lie nearest to what was seen, with the weights that the
noise of the matches gives (Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 12.3)::

    X = argmin Σ_k (p_k - π_k(X))ᵀ C_k⁻¹ (p_k - π_k(X)),      cov X = (Σ_k J_kᵀ C_k⁻¹ J_k)⁻¹

with J_k = ∂π_k/∂X. It is found by Gauss-Newton steps from the middle between the two lines; its covariance
is the first-order propagation of the C_k, exact for noise that is small against the distance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.stereo.epipolar import Rays, sigma_of, slopes_between
from dic.stereo.rays import directions, inverse, projection_slope, towards

EXACT = 1e-10
"""Variance that is added to all, so that a place which was chosen has a weight too [px²]: (1e-5 px)²."""
STEPS = 10
"""Gauss-Newton steps at most; two are enough unless the cameras disagree by many pixels."""


class Triangulation(NamedTuple):
    """Points in space, and what they rest on."""

    position: FloatArray
    """In the rig's frame [m], shape [..., 3]; NaN where a pixel is, or where no point lies before both."""
    covariance: FloatArray
    """Of the position, from the noise of the pixels [m²], shape [..., 3, 3]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px], shape [...]."""
    epipolar_sigma: FloatArray
    """Its standard deviation, from the noise of the pixels [px], shape [...]."""


def midpoint(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> FloatArray:
    """The middle of the shortest connection of the two rays [m], shape [..., 3].

    Parameters
    ----------
    rig
        The cameras.
    pixels0, pixels1
        One point seen by both, a row each (x, y) [px], shapes [..., 2].

    Raises
    ------
    ValueError
        If a lens distortion cannot be undone.
    """
    first, second = rig.cameras
    return _middle(rig, directions(first, pixels0), directions(second, pixels1))


def _middle(rig: StereoRig, d0: FloatArray, d1: FloatArray) -> FloatArray:
    """`midpoint` of rays along unit vectors d0 and d1, shapes [..., 3]."""
    first, second = rig.cameras
    base = second.centre - first.centre
    c, a0, a1 = np.sum(d0 * d1, axis=-1), d0 @ base, d1 @ base
    parallel = 1.0 - c * c
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel lines meet nowhere: not finite
        s0, s1 = (a0 - c * a1) / parallel, (c * a0 - a1) / parallel
        return np.asarray((first.centre + s0[..., None] * d0 + second.centre + s1[..., None] * d1) / 2.0)


def triangulate(
    rig: StereoRig,
    pixels0: FloatArray,
    pixels1: FloatArray,
    covariance0: FloatArray,
    covariance1: FloatArray,
) -> Triangulation:
    """Points in space from points in two pictures, with covariances.

    Parameters
    ----------
    rig
        The cameras.
    pixels0, pixels1
        One point seen by both, a row each (x, y) [px], shapes [..., 2].
    covariance0, covariance1
        Of the pixels, independent between the cameras [px²], shapes [..., 2, 2] or [2, 2], wherever the
        pixels are finite; zero for a place that was chosen, as a material point's in its own picture.

    Returns
    -------
    Triangulation
        Position, covariance, epipolar distance and its sigma.

    Raises
    ------
    ValueError
        Shapes that do not fit, a covariance that is none, a lens distortion that cannot be undone.
    """
    pixels0, pixels1 = (np.asarray(p, dtype=np.float64) for p in (pixels0, pixels1))
    if pixels0.shape != pixels1.shape or pixels0.shape[-1:] != (2,):
        raise ValueError(
            f"pixels0 and pixels1 must have one shape [..., 2], got {pixels0.shape} and {pixels1.shape}"
        )
    seen = np.all(np.isfinite(pixels0) & np.isfinite(pixels1), axis=-1)
    noise = (_covariances(covariance0, seen, 0), _covariances(covariance1, seen, 1))
    position = np.full((*seen.shape, 3), np.nan)
    covariance = np.full((*seen.shape, 3, 3), np.nan)
    epipolar, sigma = np.full(seen.shape, np.nan), np.full(seen.shape, np.nan)
    pixels = (pixels0[seen], pixels1[seen])
    aims = [Rays.of(camera, places) for camera, places in zip(rig.cameras, pixels, strict=True)]
    epipolar[seen], *slopes = slopes_between(rig, aims[0], aims[1])
    sigma[seen] = sigma_of(slopes[0], slopes[1], *noise)
    d0, d1 = (towards(camera, aim.x) for camera, aim in zip(rig.cameras, aims, strict=True))
    weights = inverse(noise[0] + EXACT * np.eye(2)), inverse(noise[1] + EXACT * np.eye(2))
    position[seen], covariance[seen] = _nearest(rig, _middle(rig, d0, d1), pixels, weights)
    return Triangulation(position, covariance, epipolar, sigma)


def projection_error(
    rig: StereoRig, position: FloatArray, pixels0: FloatArray, pixels1: FloatArray
) -> FloatArray:
    """Distance of the points' projections from what was seen: rms over the cameras [px], shape [...].

    It is what the epipolar distance leaves in both pictures, about |d|/2.

    Parameters
    ----------
    rig
        The cameras.
    position
        Points in the rig's frame [m], shape [..., 3].
    pixels0, pixels1
        What was seen [px], shapes [..., 2].
    """
    square = [
        np.sum((camera.project(position) - pixels) ** 2, axis=-1)
        for camera, pixels in zip(rig.cameras, (pixels0, pixels1), strict=True)
    ]
    return np.asarray(np.sqrt((square[0] + square[1]) / 2.0))


def _covariances(covariance: FloatArray, seen: NDArray[np.bool_], camera: int) -> FloatArray:
    """Covariances of the pixels that were seen [px²], shape [n, 2, 2]."""
    covariance = np.asarray(covariance, dtype=np.float64)
    if covariance.shape not in ((2, 2), (*seen.shape, 2, 2)):
        raise ValueError(
            f"covariance{camera} has shape {covariance.shape}, must be (2, 2) or {(*seen.shape, 2, 2)}"
        )
    used = np.broadcast_to(covariance, (*seen.shape, 2, 2))[seen]
    a, b, c, d = used[:, 0, 0], used[:, 0, 1], used[:, 1, 0], used[:, 1, 1]
    tiny = 1e-6 * (a + d)
    fine = (a >= 0.0) & (d >= 0.0) & (np.abs(b - c) <= tiny) & (a * d - b * c >= -(tiny**2))
    if not np.all(fine):
        point, found = np.argwhere(seen)[np.argmin(fine)].tolist(), used[np.argmin(fine)].tolist()
        raise ValueError(
            f"covariance{camera} of point {point} is {found} px², must be symmetric and have no negative "
            "eigenvalue: give the point an outcome instead"
        )
    return used


def _nearest(
    rig: StereoRig,
    start: FloatArray,
    pixels: tuple[FloatArray, FloatArray],
    weights: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Positions [n, 3] and covariances [n, 3, 3] by Gauss-Newton; NaN where no point lies before both."""
    X = start.copy()
    covariance = np.full((len(X), 3, 3), np.nan)
    searching = np.flatnonzero(_before(rig, X))
    settled = np.zeros(len(X), dtype=bool)
    for _ in range(STEPS):
        H, g = np.zeros((len(searching), 3, 3)), np.zeros((len(searching), 3))
        for camera, seen, weight in zip(rig.cameras, pixels, weights, strict=True):
            J = projection_slope(camera, X[searching])
            JW = np.swapaxes(J, 1, 2) @ weight[searching]
            H += JW @ J
            g += (JW @ (seen[searching] - camera.project(X[searching]))[..., None])[..., 0]
        covariance[searching] = _inverse(H)
        move = (covariance[searching] @ g[..., None])[..., 0]
        X[searching] += move
        there = _before(rig, X[searching])
        small = np.sum(move * g, axis=-1) < 1e-12  # the step is a millionth of its own sigma
        settled[searching[there & small]] = True
        searching = searching[there & ~small]
        if not len(searching):
            break
    X[~settled], covariance[~settled] = np.nan, np.nan
    return X, covariance


def _before(rig: StereoRig, X: FloatArray) -> NDArray[np.bool_]:
    """Points in front of both cameras, at a finite distance, shape [n]."""
    depth = np.stack([camera.in_camera(X)[:, 2] for camera in rig.cameras])
    return np.asarray(np.all(np.isfinite(depth) & (depth > 0.0), axis=0))


def _inverse(H: FloatArray) -> FloatArray:
    """Inverses of symmetric matrices by their cofactors, shape [n, 3, 3]; not finite for a singular one."""
    a, b, c = H[:, 0], H[:, 1], H[:, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = cofactors / np.sum(a * cofactors[..., 0], axis=-1)[:, None, None]
    return np.asarray((inverse + np.swapaxes(inverse, 1, 2)) / 2.0)
