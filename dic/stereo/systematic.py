"""Systematic error of positions from the calibration's uncertainty: common to all points of a test.

The parameters θ of a rig are known with a covariance C_θ. A wrong θ moves a point by S δθ with S = ∂X/∂θ at
fixed pixels, the same δθ for every point and frame. So ``S C_θ Sᵀ`` is the covariance of a position, but it
does not average out over points, and a difference of two positions has ``(S_a - S_b) C_θ (S_a - S_b)ᵀ``.
"""

from dataclasses import replace

import numpy as np

from dic.arrays import FloatArray
from dic.camera import PARAMETERS, Camera, StereoRig
from dic.stereo.triangulation import triangulate


def perturbed(rig: StereoRig, change: FloatArray) -> StereoRig:
    """The rig with its parameters changed by a little; camera 0's pose, the frame of all points, stays.

    Parameters
    ----------
    rig
        The cameras.
    change
        By `StereoRig.parameter_names` [px, -, rad, m], shape [26].
    """
    n = len(PARAMETERS)
    first = _changed(rig.cameras[0], change[:n])
    second = _changed(rig.cameras[1], change[n : 2 * n])
    R, t = rig.relative
    turn = _rotation(change[2 * n : 2 * n + 3])
    R, t = turn @ R, t + change[2 * n + 3 :]
    second = replace(second, rotation=R @ first.rotation, translation=t + R @ first.translation)
    return replace(rig, cameras=(first, second))


def calibration_slopes(rig: StereoRig, points: FloatArray) -> FloatArray:
    """Derivatives of positions by the rig's parameters at fixed pixels, by central differences.

    Parameters
    ----------
    rig
        The cameras.
    points
        Positions in the rig's frame, before both cameras [m], shape [..., 3].

    Returns
    -------
    NDArray
        S, in m per unit of each of `StereoRig.parameter_names`, shape [..., 3, 26].
    """
    points = np.asarray(points, dtype=np.float64)
    pixels = [camera.project(points) for camera in rig.cameras]
    unit = np.eye(2)
    slopes = np.empty((*points.shape, len(rig.parameter_names)))
    for k, step in enumerate(_steps(rig)):
        change = np.zeros(slopes.shape[-1])
        change[k] = step
        ahead, behind = (
            triangulate(perturbed(rig, way * change), pixels[0], pixels[1], unit, unit).position
            for way in (1.0, -1.0)
        )
        slopes[..., k] = (ahead - behind) / (2.0 * step)
    return slopes


def calibration_sigma(rig: StereoRig, points: FloatArray) -> FloatArray:
    """Standard deviations of positions that the calibration's covariance alone causes, common to all points.

    Parameters
    ----------
    rig
        The cameras, with a covariance.
    points
        Positions in the rig's frame, before both cameras [m], shape [..., 3]. The result is smooth over the
        field and the same in all frames: the places of one frame, or some of them, tell all.

    Returns
    -------
    NDArray
        By component [m], shape [..., 3].

    Raises
    ------
    ValueError
        A rig without a covariance, or one of another size than its parameters.
    """
    n = len(rig.parameter_names)
    if rig.covariance is None:
        raise ValueError(
            "the rig has no covariance: calibrate it here, camera files of other programs bring none"
        )
    if rig.covariance.shape != (n, n):
        raise ValueError(f"the rig's covariance has shape {rig.covariance.shape}, must be ({n}, {n})")
    slopes = calibration_slopes(rig, points)
    return np.asarray(np.sqrt(np.einsum("...ij,jk,...ik->...i", slopes, rig.covariance, slopes)))


def _changed(camera: Camera, change: FloatArray) -> Camera:
    """A camera with its `PARAMETERS` changed."""
    fx, fy, cx, cy, skew = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew]) + change[:5]
    k1, k2, p1, p2, k3 = np.array(camera.distortion) + change[5:]
    return replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, skew=skew, distortion=(k1, k2, p1, p2, k3))


def _rotation(r: FloatArray) -> FloatArray:
    """Rodrigues' rotation exp([r]) of a rotation vector [rad], shape [3, 3]."""
    angle = float(np.linalg.norm(r))
    cross = np.cross(np.eye(3), r)  # [r], so that [r] v = r × v
    if angle == 0.0:
        return np.eye(3)
    return np.asarray(
        np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross
    )


def _steps(rig: StereoRig) -> FloatArray:
    """Steps of the differences, shape [26]: each moves a pixel by some hundredths, far above round-off."""
    baseline = float(np.linalg.norm(rig.relative[1]))
    steps = []
    for camera in rig.cameras:
        steps += [1e-5 * camera.fx, 1e-5 * camera.fy, 0.01, 0.01, 0.1, 1e-3, 1e-2, 1e-4, 1e-4, 1e-1]
    return np.array([*steps, *[1e-5] * 3, *[1e-5 * baseline] * 3])
