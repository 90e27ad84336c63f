"""Coordinates of a measured surface: the plane that fits its points best, or its cylinder."""

import numpy as np

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.surfaces.cylinder import Cylinder
from dic.surfaces.frame import SpecimenFrame, test_frame


def plane_frame(X: FloatArray, rig: StereoRig) -> SpecimenFrame:
    """Frame on the plane that fits points best: Z along its normal toward the cameras, x as camera 0's
    pictures run to the right, y up in them, the origin in the middle of the points.

    Parameters
    ----------
    X
        Points in the rig's frame [m], shape [n, 3].
    rig
        The cameras.

    Raises
    ------
    ValueError
        Fewer than three points, or a plane that camera 0 sees edge on.
    """
    if len(X) < 3:
        raise ValueError(f"a plane needs three points, got {len(X)}")
    origin = X.mean(axis=0)
    Z = np.linalg.svd(X - origin, full_matrices=False)[2][2]
    middle = 0.5 * (rig.cameras[0].centre + rig.cameras[1].centre)
    Z = Z * (1.0 if (middle - origin) @ Z >= 0.0 else -1.0)
    right = rig.cameras[0].rotation[0]
    x = right - (right @ Z) * Z
    if np.linalg.norm(x) < 0.05:
        raise ValueError("camera 0 looks along the plane that fits the points best")
    x = x / np.linalg.norm(x)
    return SpecimenFrame(np.array([x, np.cross(Z, x), Z]), origin, np.zeros((6, 6)))


def cylinder_frame(cylinder: Cylinder, rig: StereoRig) -> SpecimenFrame:
    """Frame on a cylinder: y along its axis, up in camera 0's pictures, or to the right where the axis lies
    across them; Z from the axis toward the cameras, the origin on the axis beside the middle of the points.
    """
    ends = cylinder.point + np.outer([-0.1, 0.1], cylinder.radius * cylinder.axis)
    across, down = np.abs(np.diff(rig.cameras[0].project(ends), axis=0)[0])
    direction = (0.0, -1.0) if down >= across else (1.0, 0.0)
    return test_frame(cylinder, rig, toward_flyer=direction, zero=cylinder.point)
