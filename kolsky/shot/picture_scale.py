"""The specimen's declared length beside the scale of the calibrated pictures, before anything is correlated.

What lies at a pixel of camera 0 lies on its ray; where camera 1 sees it too, on that part of the ray that
camera 1's picture holds. The distances of the two ends of that part bound the scale of the picture there, and
with the drawn region the specimen's length.
"""

from typing import Literal

import numpy as np

from dic.camera import Camera, StereoRig
from kolsky.base.arrays import FloatArray
from kolsky.shot.schema.reading import ShotToml

LEAST_SHARE = 0.2
"""Least share of the specimen's length that its region shows; as of an exported outline."""
LARGEST_SHARE = 1.5
"""Largest extent of the region over the length: a region may reach onto the platens."""
DISTANCES = 20_001
"""Distances of the ray that are looked at, each larger than the one before by the same factor."""
NEAREST, FURTHEST = 1e-3, 1e3
"""Distances between which a specimen may be [m]."""


def lengths_seen(
    rig: StereoRig,
    corners: FloatArray,
    toward: Literal["up", "down", "left", "right"],
    shapes: tuple[tuple[int, int], tuple[int, int]],
) -> tuple[float, float] | None:
    """Smallest and largest length that the extent of a region can have [m].

    Parameters
    ----------
    rig
        The calibrated cameras.
    corners
        Corners (x, y) of the region in camera 0's picture [px], shape [n, 2].
    toward
        Direction of the bars' axis in that picture.
    shapes
        Rows and columns of both cameras' pictures.

    Returns
    -------
    tuple of float, or None
        None where camera 1's picture holds no part of the ray through the region's middle.
    """
    first, second = rig.cameras
    along = 1 if toward in ("up", "down") else 0
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    ends = np.stack([middle, middle])
    ends[:, along] = corners[:, along].min(), corners[:, along].max()
    extent = float(np.linalg.norm(np.diff(first.undistort(ends), axis=0)))  # on the plane z = 1
    distances = distances_seen(first, second, middle, shapes[1])
    if distances.size == 0:
        return None
    return extent * float(distances.min()), extent * float(distances.max())


def distances_seen(first: Camera, second: Camera, pixel: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Distances from camera 0 at which camera 1 sees what lies at a pixel [m], shape [n].

    Parameters
    ----------
    first, second
        The cameras.
    pixel
        Of camera 0, (x, y) [px].
    shape
        Rows and columns of camera 1's picture.
    """
    distances = np.geomspace(NEAREST, FURTHEST, DISTANCES)
    ray = np.append(first.undistort(pixel), 1.0)
    points = (distances[:, None] * ray - first.translation) @ first.rotation
    seen = second.project(points)
    with np.errstate(invalid="ignore"):
        inside = np.all((seen >= 0.0) & (seen <= np.array(shape[::-1]) - 1.0), axis=-1)
    return distances[inside]


def length_contradicts(length: float, seen: tuple[float, float] | None) -> bool:
    """Whether a region of one of these lengths [m] cannot be of a specimen of that length [m]."""
    if seen is None:
        return False
    return seen[1] < LEAST_SHARE * length or seen[0] > LARGEST_SHARE * length


def check_length(toml: ShotToml, seen: tuple[float, float] | None) -> None:
    """Refuse a declared length that the pictures contradict.

    Parameters
    ----------
    toml
        The shot file.
    seen
        As `lengths_seen` gives it for the specimen's region.

    Raises
    ------
    InputError
        If `length_contradicts`.
    """
    length = toml.declared.specimen.length
    if seen is not None and length_contradicts(length, seen):
        raise toml.error(
            "specimen.length",
            f"contradicts the pictures: the specimen's region in them is {seen[0] * 1e3:.4g} to"
            f" {seen[1] * 1e3:.4g} mm long by the cameras' calibration",
            allowed=f"{seen[0] / LARGEST_SHARE * 1e3:.4g} to {seen[1] / LEAST_SHARE * 1e3:.4g} mm",
            cure="is the unit of specimen.length right, and that of the calibration target?",
        )
