"""Piece of an epipolar curve that camera 1's picture can show.

With s the distance along a ray d from camera 0's centre C, camera 1 sees ``(q e + v) / z`` in its own frame,
where q = 1/s, ``v = R_1 d`` and ``e = R_1 C + t_1``. Each side of a box of ideal image points, and that the
place lies in front of the camera, is a linear inequality of q. So the piece is known before the curve is
walked, however short it is: the crop of a long lens shows a small part of a curve.
"""

import numpy as np

from dic.arrays import FloatArray
from dic.camera import Camera, StereoRig

BORDER = 33
"""Places on each side of a picture through which its border is followed."""
ROOM = 0.02
"""What the box of ideal points is enlarged by, as a share of its size: the border bends between places."""


def visible_piece(
    rig: StereoRig, rays: FloatArray, shape1: tuple[int, int], limits: tuple[float, float]
) -> FloatArray:
    """Inverse distances along camera 0's rays between which camera 1's picture can show them [1/m].

    Parameters
    ----------
    rig
        The cameras.
    rays
        Unit vectors from camera 0's centre, in the rig's frame, shape [n, 3].
    shape1
        Rows and columns of camera 1's picture.
    limits
        Nearest and farthest distance [m].

    Returns
    -------
    array
        Least and largest inverse distance, shape [n, 2]; twice the least one for a ray that is not seen.
    """
    first, second = rig.cameras
    v = rays @ second.rotation.T
    e = second.rotation @ first.centre + second.translation
    low = np.full(len(rays), 1.0 / limits[1])
    high = np.full(len(rays), 1.0 / limits[0])
    sides = [(e[2], v[:, 2])]  # a q + b >= 0
    box = ideal_box(second, shape1)
    for axis, bounds in enumerate(() if box is None else box):
        for sign, bound in zip((1.0, -1.0), bounds, strict=True):
            sides.append((sign * (e[axis] - bound * e[2]), sign * (v[:, axis] - bound * v[:, 2])))
    for a, b in sides:
        if a > 0.0:
            low = np.maximum(low, -b / a)
        elif a < 0.0:
            high = np.minimum(high, -b / a)
        else:
            high = np.where(b < 0.0, low, high)
    seen = high > low
    least = np.where(seen, low, 1.0 / limits[1])
    return np.stack([least, np.where(seen, high, least)], axis=1)


def ideal_box(camera: Camera, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray] | None:
    """Least and largest x, and y, of the ideal points that a picture shows [-].

    Parameters
    ----------
    camera
        The camera.
    shape
        Rows and columns of its picture.

    Returns
    -------
    tuple or None
        None where its lens cannot be undone on the whole border.
    """
    along = np.linspace(0.0, 1.0, BORDER)
    ends = np.zeros(BORDER), np.ones(BORDER)
    border = np.concatenate([np.stack(p, axis=1) for end in ends for p in ((along, end), (end, along))])
    try:
        ideal = camera.undistort(border * (shape[1] - 1.0, shape[0] - 1.0))
    except ValueError:
        return None
    low, high = ideal.min(axis=0), ideal.max(axis=0)
    room = ROOM * (high - low)
    return np.array([low[0] - room[0], high[0] + room[0]]), np.array([low[1] - room[1], high[1] + room[1]])
