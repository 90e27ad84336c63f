"""Projection of a target's points into a camera, with derivatives: circles by their image's centroid.

A flat disc of radius r about X, with unit normal n, is seen as an ellipse whose centre is not the image of
X. On the plane z = 1 the dual of its outline is C* = H diag(1, 1, -1) Hᵀ with H = [r e1, r e2, X], so that
the centre is

    c = (X X_z - r² (ẑ - n n_z)) / (X_z² - r² (1 - n_z²))                                         (C.1)

in closed form [Heikkilä2000]_. The centroid of any flat, symmetric patch moves, to the order kept by (C.1),
with its second moment s per axis: r² = 4 s, with s = (r² + h²)/4 for a ring of radii r and h and a²/12 for
a square of side a.

On a surface of curvature κ in the direction b the patch also bends back from its tangent plane, and its far
side is seen more obliquely than its near side. Both together move the centroid as if its middle were at

    X + s κ (b (b · v) / (n · v) - n / 2)                                                           (C.2)

with v from X to the camera.

.. [Heikkilä2000] J. Heikkilä, Geometric camera calibration using circular control points, IEEE Trans.
   PAMI 22 (2000) 1066-1077, doi:10.1109/34.879788.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import PARAMETERS, POSE, Camera

OWN = len(PARAMETERS)
SHARED = 2 * OWN + len(POSE)
"""Parameters of a rig, in the order of `StereoRig.parameter_names`."""


@dataclass(frozen=True)
class View:
    """Points of the target in one camera's picture of one pair."""

    pair: int
    camera: int
    """0 or 1."""
    ids: NDArray[np.int64]
    """Numbers of the points, shape [n]."""
    points: FloatArray
    """Their places on the target [m], shape [n, 3]."""
    normals: FloatArray
    """Their normals, shape [n, 3]."""
    spread: FloatArray
    """Their second moments [m²], shape [n]."""
    bend: FloatArray
    """Directions of the surface's curvature times its root [m^-½], shape [n, 3]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviations of the coordinates [px], shape [n]."""


def exponential(r: FloatArray) -> FloatArray:
    """Rotation about r by its length [rad], shape [3, 3]."""
    angle = float(np.linalg.norm(r))
    K = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + a * K + b * K @ K)


def crossed(v: FloatArray, rows: FloatArray) -> FloatArray:
    """v x w of each v and each w of its rows, shape [n, m, 3]: `numpy.cross` with a third of its time."""
    (x, y, z), (a, b, c) = v.T[:, :, None], np.moveaxis(rows, 2, 0)
    found = np.empty(rows.shape)
    found[..., 0], found[..., 1], found[..., 2] = y * c - z * b, z * a - x * c, x * b - y * a
    return found


def centroids(inside: FloatArray, normals: FloatArray, spread: FloatArray) -> FloatArray:
    """Centroids on the plane z = 1 of patches in the camera's frame, Eq. (C.1), shape [n, 2]."""
    z, nz, r2 = inside[:, 2], normals[:, 2], 4.0 * spread
    below = z * z - r2 * (1.0 - nz * nz)
    return np.asarray((inside[:, :2] * z[:, None] + (r2 * nz)[:, None] * normals[:, :2]) / below[:, None])


def bent(inside: FloatArray, normals: FloatArray, spread: FloatArray, bend: FloatArray) -> FloatArray:
    """Middles of patches in the camera's frame as their curvature moves them, Eq. (C.2) [m], shape [n, 3]."""
    oblique = np.sum(bend * inside, axis=1) / np.sum(normals * inside, axis=1)
    curvature = np.sum(bend * bend, axis=1)
    return np.asarray(
        inside + spread[:, None] * (oblique[:, None] * bend - 0.5 * curvature[:, None] * normals)
    )


def joined(views: Sequence[View]) -> View:
    """All points of several views of one camera as one view; `poses_of` says where the target was."""
    parts = {
        name: np.concatenate([getattr(view, name) for view in views])
        for name in ("ids", "points", "normals", "spread", "bend", "pixels", "sigma")
    }
    return View(pair=-1, camera=views[0].camera, **parts)


def poses_of(
    views: Sequence[View], poses: Mapping[int, tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """R and t of each point of joined views, as `seen` and `derivatives` take them, [n, 3, 3] and [n, 3]."""
    count = [len(view.ids) for view in views]
    R, t = (np.repeat([poses[view.pair][k] for view in views], count, axis=0) for k in (0, 1))
    return R, t


def _turned(v: FloatArray, R: FloatArray) -> FloatArray:
    """R v for each row, shape [n, 3]; R of shape [3, 3] or one a row."""
    return np.asarray(v @ R.T if R.ndim == 2 else np.einsum("nij,nj->ni", R, v))


def seen(camera: Camera, view: View, R: FloatArray, t: FloatArray, *, patches: bool = True) -> FloatArray:
    """Pixels of a target's points in a camera, shape [n, 2]; NaN behind it.

    Parameters
    ----------
    camera
        With its pose in the rig's frame.
    view
        Whose points.
    R, t
        From the target's frame to the rig's, shapes [3, 3] and [3], or one a point.
    patches
        Centroids of the patches, as they are measured; False: the points themselves.
    """
    inside = camera.in_camera(_turned(view.points, R) + t)
    inside = np.where(inside[:, 2:] > 0.0, inside, np.nan)
    normals = _turned(view.normals, R) @ camera.rotation.T
    if patches and view.bend.any():
        inside = bent(inside, normals, view.spread, _turned(view.bend, R) @ camera.rotation.T)
    return camera.to_pixels(camera.distort(centroids(inside, normals, view.spread * patches)))


def derivatives(camera: Camera, view: View, R: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives of `seen` after the rig's parameters and after the target's pose.

    The small changes of (C.1) and (C.2) with the pose are left out: they are (r/z)² and s κ/z of what stays.

    Returns
    -------
    shared
        Shape [n, 2, SHARED], in the order of `StereoRig.parameter_names`.
    pose
        After a small rotation applied after R, and t, shape [n, 2, 6].
    """
    n = len(view.points)
    turned = _turned(view.points, R)
    first = turned + t
    inside = camera.in_camera(first)
    normals = _turned(view.normals, R) @ camera.rotation.T
    patch = inside
    if view.bend.any():
        patch = bent(inside, normals, view.spread, _turned(view.bend, R) @ camera.rotation.T)
    ideal = centroids(patch, normals, view.spread)
    plane = camera.distort(ideal)
    x, y = ideal.T
    r2 = x * x + y * y

    shared = np.zeros((n, 2, SHARED))
    own = shared[:, :, camera_columns(view.camera)]
    own[:, 0, 0], own[:, 1, 1] = plane[:, 0], plane[:, 1]
    own[:, 0, 2] = own[:, 1, 3] = 1.0
    own[:, 0, 4] = plane[:, 1]
    lens = (
        (x * r2, y * r2),
        (x * r2**2, y * r2**2),
        (2 * x * y, r2 + 2 * y * y),
        (r2 + 2 * x * x, 2 * x * y),
        (x * r2**3, y * r2**3),
    )
    for k, (across, down) in enumerate(lens, start=5):
        own[:, 0, k] = camera.fx * across + camera.skew * down
        own[:, 1, k] = camera.fy * down

    z = inside[:, 2]
    perspective = np.zeros((n, 2, 3))
    perspective[:, 0, 0] = perspective[:, 1, 1] = 1.0 / z
    perspective[:, :, 2] = -inside[:, :2] / (z * z)[:, None]
    by_place = camera.matrix[:2, :2] @ camera.distortion_slope(ideal) @ perspective
    if view.camera == 1:
        shared[:, :, 2 * OWN : 2 * OWN + 3] = crossed(first @ camera.rotation.T, by_place)
        shared[:, :, 2 * OWN + 3 :] = by_place
        by_place = by_place @ camera.rotation
    pose = np.concatenate([crossed(turned, by_place), by_place], axis=2)
    return shared, pose


def camera_columns(camera: int) -> slice:
    """Columns of a camera's own parameters."""
    return slice(camera * OWN, (camera + 1) * OWN)
