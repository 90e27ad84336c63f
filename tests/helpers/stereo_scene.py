"""Two cameras in front of a rendered cylinder, the common scene of the tests of the stereo match."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from speckle_pictures import RenderedCylinder, Speckles, facing

from dic.camera import Camera, StereoRig

FloatArray = NDArray[np.float64]

SHAPE = (128, 128)
RADIUS = 4.75e-3
CYLINDER = RenderedCylinder(RADIUS)
NOISE = 0.004  # noise of a grey value, with 0 for black and 1 for white
LENS = (-0.17, 0.0, 1e-3, -5e-4, 0.0)
FOCAL = 5400.0
DISTANCE = 0.3


def rig(angle: float = 12.5) -> StereoRig:
    """Cameras side by side that look at the axis from `DISTANCE`, `angle` [°] apart, with lens distortion."""
    return facing(np.radians(angle), DISTANCE, FOCAL, SHAPE, distortion=LENS)


def turned_pair(cx: float, cy: tuple[float, float]) -> StereoRig:
    """Two cameras 12.5° apart that look along -Z of the test frame, y up in their pictures."""
    first, second = (
        Camera(
            fx=FOCAL,
            fy=FOCAL,
            cx=cx,
            cy=middle,
            rotation=Rotation.from_euler("y", pan, degrees=True).as_matrix() @ np.diag([1.0, -1.0, -1.0]),
            translation=np.array([0.0, 3e-3, 0.305]),
        )
        for pan, middle in zip((6.25, -6.25), cy, strict=True)
    )
    return StereoRig((first, second))


@cache
def pictures(angle: float = 12.5, seed: int = 3) -> tuple[FloatArray, FloatArray]:
    """Pictures of the cylinder by both cameras, including noise."""
    rng = np.random.default_rng(seed)
    first, second = (
        CYLINDER.picture(camera, SHAPE, Speckles(3.5e-4, seed=seed)) + rng.normal(0.0, NOISE, SHAPE)
        for camera in rig(angle).cameras
    )
    return first, second


def grid(step: int = 8, border: int = 16) -> FloatArray:
    """Points of the material picture [px], shape [n, 2]."""
    x, y = (np.arange(border, n - border + 1.0, step) for n in (SHAPE[1], SHAPE[0]))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def truth(points: FloatArray, angle: float = 12.5) -> FloatArray:
    """Positions in camera 1 of the points that camera 0 sees at `points` [px], shape [n, 2]."""
    cameras = rig(angle).cameras
    return cameras[1].project(CYLINDER.hit(cameras[0], points))
