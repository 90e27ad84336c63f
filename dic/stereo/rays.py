"""Rays of cameras, the derivative of a projection with respect to the point, and 2 x 2 matrices in closed
form."""

import numpy as np

from dic.arrays import FloatArray
from dic.camera import Camera


def inverse(M: FloatArray) -> FloatArray:
    """Inverses, shape [..., 2, 2]; not finite where a determinant is zero."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    result = np.empty(M.shape)
    result[..., 0, 0], result[..., 0, 1], result[..., 1, 0], result[..., 1, 1] = d, -b, -c, a
    result /= (a * d - b * c)[..., None, None]
    return result


def largest_eigenvalue(M: FloatArray) -> FloatArray:
    """The larger eigenvalues of matrices that have real ones, shape [...]."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    half = 0.5 * (a - d)
    # rounding must not make a double eigenvalue complex
    return np.asarray(0.5 * (a + d) + np.sqrt(np.maximum(half * half + b * c, 0.0)))


def directions(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Unit vectors from the camera's centre toward what it sees at `pixels`, in the rig's frame [-].

    Parameters
    ----------
    camera
        The camera.
    pixels
        Places in its picture (x, y) [px], shape [..., 2].

    Returns
    -------
    NDArray
        Shape [..., 3]; NaN where the pixel is.

    Raises
    ------
    ValueError
        If the lens distortion cannot be undone there.
    """
    return towards(camera, inside(camera, pixels))


def inside(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Ideal image points on the plane z = 1 of the camera's own frame, with that 1 [-], shape [..., 3]."""
    ideal = camera.undistort(pixels)
    return np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1)


def towards(camera: Camera, x: FloatArray) -> FloatArray:
    """`directions` of what `inside` gave."""
    return np.asarray(x @ camera.rotation / np.linalg.norm(x, axis=-1, keepdims=True))


def pixels_per_length(camera: Camera, X: FloatArray, direction: FloatArray) -> FloatArray:
    """Motion of the pixel of a place that moves along a direction [px/m], shape [2].

    Parameters
    ----------
    camera
        The camera.
    X
        The place in the rig's frame, in front of the camera [m], shape [3].
    direction
        Unit vector in the rig's frame, shape [3].
    """
    return np.asarray(projection_slope(camera, np.asarray(X)) @ direction)


def pixel_slope(camera: Camera, ideal: FloatArray) -> FloatArray:
    """Derivative of the pixel by the ideal image point on the plane z = 1 [px], shape [..., 2, 2]."""
    slope = camera.distortion_slope(ideal)
    if camera.skew:
        return np.asarray(np.array([[camera.fx, camera.skew], [0.0, camera.fy]]) @ slope)
    slope *= np.array([[camera.fx], [camera.fy]])
    return slope


def projection_slope(camera: Camera, X: FloatArray) -> FloatArray:
    """Derivative of `Camera.project` by the point [px/m], shape [..., 2, 3].

    Parameters
    ----------
    camera
        The camera.
    X
        Points in the rig's frame, in front of the camera [m], shape [..., 3].
    """
    place = camera.in_camera(X)
    depth = place[..., 2]
    ideal = place[..., :2] / depth[..., None]
    perspective = np.zeros((*depth.shape, 2, 3))
    perspective[..., 0, 0] = perspective[..., 1, 1] = 1.0 / depth
    perspective[..., :, 2] = -ideal / depth[..., None]
    return np.asarray(pixel_slope(camera, ideal) @ perspective @ camera.rotation)
