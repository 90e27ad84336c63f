"""Epipolar curves, walked in equal steps from end to end."""

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.camera import Camera, StereoRig
from dic.stereo.facet import distance_along
from dic.stereo.sight import directions
from dic.stereo.triangulation import midpoint

KNOTS = 65
"""Places a curve is followed through before it is divided into equal steps."""
NARROWINGS = 3
"""How often the piece of a curve that lies in the picture is cut out anew, a few dozen times finer each."""


def curve_distances(
    rig: StereoRig,
    pixels0: FloatArray,
    shape1: tuple[int, int],
    limits: tuple[float, float] | None,
    step: float,
) -> FloatArray:
    """Distances along camera 0's lines of sight that walk the epipolar curves in equal steps of camera 1.

    Parameters
    ----------
    rig
        The cameras.
    pixels0
        Places in camera 0's picture [px], shape [n, 2].
    shape1
        Rows and columns of camera 1's picture.
    limits
        Nearest and farthest distance [m]; None: as far as the curves stay in camera 1's picture.
    step
        Along the curve [px].

    Returns
    -------
    NDArray
        Distances [m], shape [n, k], increasing; rows end in NaN.
    """
    n = len(pixels0)
    near, far = limits if limits is not None else (_axes_meet(rig) / 20.0, _axes_meet(rig) * 20.0)
    # equal steps of 1/s are about equal steps along the curve: the disparity goes with 1/s
    inverse = np.broadcast_to(np.linspace(1.0 / far, 1.0 / near, KNOTS), (n, KNOTS))
    for _ in range(NARROWINGS):  # down to the piece of the curve that camera 1's picture shows
        seen = shows(rig.cameras[1], points_along(rig, pixels0, 1.0 / inverse), shape1)
        first = np.maximum(np.argmax(seen, axis=1) - 1, 0)
        last = np.minimum(KNOTS - np.argmax(seen[:, ::-1], axis=1), KNOTS - 1)
        ends = [np.take_along_axis(inverse, k[:, None], axis=1) for k in (first, last)]
        ends[1] = np.where(seen.any(axis=1, keepdims=True), ends[1], ends[0])
        inverse = ends[0] + (ends[1] - ends[0]) * np.linspace(0.0, 1.0, KNOTS)
    curve = rig.cameras[1].project(points_along(rig, pixels0, 1.0 / inverse))
    pace = np.nan_to_num(np.linalg.norm(np.diff(curve, axis=1), axis=2))
    length = np.concatenate([np.zeros((n, 1)), np.cumsum(pace, axis=1)], axis=1)
    most = int(np.max(length[:, -1], initial=0.0) / step) + 1
    distances = np.full((n, most), np.nan)
    for row in range(n):
        s = np.arange(0.0, length[row, -1] + 1e-9, step)[::-1]
        distances[row, : len(s)] = 1.0 / np.interp(s, length[row], inverse[row])
    return distances


def points_along(rig: StereoRig, pixels0: FloatArray, distances: FloatArray) -> FloatArray:
    """Points on camera 0's lines of sight at distances of their own [m], shape [n, k, 3]."""
    first = rig.cameras[0]
    return np.asarray(first.centre + directions(first, pixels0)[:, None] * distances[..., None])


def shows(camera: Camera, X: FloatArray, shape: tuple[int, int]) -> BoolArray:
    """Whether a picture shows these places, shape [...]; what a lens model folds back there is not."""
    rows, columns = shape
    k1, k2, _, _, k3 = camera.distortion
    turning = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])  # squared radii where r (1 + k1 r² + ...) turns
    folds = min((root.real for root in turning if abs(root.imag) < 1e-12 and root.real > 0.0), default=np.inf)
    inside = camera.in_camera(X)
    before = inside[..., 2] > 0.0
    ideal = inside[..., :2] / np.where(before, inside[..., 2], 1.0)[..., None]
    at = camera.to_pixels(camera.distort(np.where(before[..., None], ideal, 0.0)))
    seen = np.all((at >= 0.0) & (at <= (columns - 1.0, rows - 1.0)), axis=-1)
    return np.asarray(before & seen & (np.sum(ideal * ideal, axis=-1) < folds))


def _axes_meet(rig: StereoRig) -> float:
    """How far before camera 0 the optical axes come nearest to each other [m]."""
    first, second = rig.cameras
    centres = np.array([[camera.cx, camera.cy] for camera in rig.cameras])
    meet = midpoint(rig, centres[0], centres[1])
    s = float(distance_along(rig, centres[0], meet))
    if not (np.isfinite(s) and s > 0.0):
        baseline = float(np.linalg.norm(second.centre - first.centre))
        s = 3.0 * baseline
    return s
