"""The two cameras of a specification, in the specimen's frame.

Its y runs along the axis from the transmission platen to the flyer, its z toward the cameras.
"""

from dataclasses import dataclass

import numpy as np

from dic.camera import Camera, StereoRig
from kolsky.base.arrays import FloatArray
from kolsky.virtual.schema import Specification
from kolsky.virtual.streams import stream

ROLLS = {"up": 0.0, "right": 0.5 * np.pi, "down": np.pi, "left": -0.5 * np.pi}
"""Roll of the cameras that brings the flyer to that side of the picture [rad]."""
PRINCIPAL_POINT = 3.0
"""Standard deviation of the principal point about the middle of the sensor [px]."""


@dataclass(frozen=True)
class Rig:
    """Both cameras, with where the pictures lie on their sensors."""

    stereo: StereoRig
    """The cameras for the whole sensors."""
    crops: tuple[tuple[int, int], tuple[int, int]]
    """Top left pixel of the pictures (x, y) on the sensors [px]."""
    middle: FloatArray
    """Point that they look at [m], shape [3]."""

    def camera(self, k: int) -> Camera:
        """Camera k for the cropped pictures."""
        return self.stereo.cameras[k].cropped(self.crops[k])


def rig_of(q: Specification, *, shot: int) -> Rig:
    """The cameras that a specification asks for.

    The view reaches from `flyer_share` of the picture's length beyond the specimen's face at rest
    downward, so the
    point looked at is ``y = L + (share - 1/2) field``. The focal lengths are such that `field` fills the
    picture.

    Raises
    ------
    ValueError
        If a picture does not fit on its sensor around the point that its camera looks at.
    """
    c = q.cameras
    middle = np.array([c.aside, q.specimen.length + (c.flyer_share - 0.5) * c.field, 0.0])
    cameras, crops = [], []
    for k, distance in enumerate((c.distance_0, c.distance_1)):
        rng = stream(q.seed, shot, "camera", str(k))
        half = (-0.5 if k == 0 else 0.5) * c.angle
        across, up = (half, c.elevation) if c.baseline == "across" else (0.0, c.elevation + half)
        away = np.array([np.sin(across) * np.cos(up), np.sin(up), np.cos(across) * np.cos(up)])
        wrong = c.misalignment * rng.standard_normal(3)
        rotation = _small(wrong) @ _about_z(ROLLS[c.flyer_side]) @ _looking(-away)
        focal = c.along * distance / c.field
        cx, cy = 0.5 * (np.array(c.sensor) - 1.0) + PRINCIPAL_POINT * rng.standard_normal(2)
        camera = Camera(
            fx=focal, fy=focal, cx=float(cx), cy=float(cy),
            distortion=tuple((c.distortion_0, c.distortion_1)[k]),  # type: ignore[arg-type]  # five numbers
            rotation=rotation, translation=-rotation @ (middle + distance * away), sensor=c.sensor,
        )  # fmt: skip
        cameras.append(camera)
        crops.append(_crop(camera.project(middle), c.picture, c.sensor, k))
    return Rig(StereoRig((cameras[0], cameras[1])), (crops[0], crops[1]), middle)


def _crop(at: FloatArray, picture: tuple[int, int], sensor: tuple[int, int], camera: int) -> tuple[int, int]:
    """Whole pixels of the offset that brings `at` to the picture's middle; kept on the sensor if nearly."""
    wanted = np.rint(at - 0.5 * (np.array(picture) - 1.0))
    most = np.array(sensor) - np.array(picture)
    found = np.clip(wanted, 0, most)
    if np.any(np.abs(found - wanted) > 0.25 * np.array(picture)):
        raise ValueError(
            f"camera {camera}: a picture of {picture[0]} x {picture[1]} px around {np.round(at)} px does "
            f"not lie on "
            f"its sensor of {sensor[0]} x {sensor[1]} px: take less cameras.misalignment, or a larger sensor"
        )
    return int(found[0]), int(found[1])


def _looking(view: FloatArray) -> FloatArray:
    """Rotation to a camera that looks along `view`, its y (down) as near as can be to -y of the specimen."""
    right = np.cross(view, np.array([0.0, 1.0, 0.0]))
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(view, right), view])


def _about_z(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _small(vector: FloatArray) -> FloatArray:
    """Rotation by a vector [rad], Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)
