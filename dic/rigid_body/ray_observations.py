"""Points on the rays of one camera, with what it knows of them."""

import numpy as np

from dic.arrays import FloatArray
from dic.camera import Camera
from dic.surfaces.frame import SpecimenFrame

STEP = 1e-6
"""Of the difference quotients of the projection [m]."""


def ray_observations(
    camera: Camera, frame: SpecimenFrame, pixels: FloatArray, covariance: FloatArray, near: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points on a camera's rays and their inverse covariances, which are of rank 2.

    Parameters
    ----------
    camera
        One camera of the rig.
    frame
        The frame that points are wanted in.
    pixels
        Where the camera sees them [px], shape [n, 2].
    covariance
        Of the pixels [px²], shape [n, 2, 2].
    near
        Points near them, whose depth is taken, in the frame [m], shape [n, 3].

    Returns
    -------
    NDArray
        The point of each ray nearest to `near`, to first order [m], shape [n, 3].
    NDArray
        Inverse covariances ``Jᵀ C⁻¹ J``, J the projection's derivative [1/m²], shape [n, 3, 3].
    """
    x = np.array(near)
    for _ in range(3):  # the projection is nearly linear: each step leaves the square of the last
        J = _slope(camera, frame, x)
        off = pixels - camera.project(frame.in_rig(x))
        x = x + np.einsum("nij,nj->ni", np.linalg.pinv(J), off)
    J = _slope(camera, frame, x)
    return x, np.swapaxes(J, 1, 2) @ np.linalg.inv(covariance) @ J


def _slope(camera: Camera, frame: SpecimenFrame, x: FloatArray) -> FloatArray:
    """Derivative of the pixel by the place [px/m], shape [n, 2, 3]."""
    columns = [
        camera.project(frame.in_rig(x + STEP * axis)) - camera.project(frame.in_rig(x - STEP * axis))
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=-1) / (2.0 * STEP)
