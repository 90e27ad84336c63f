"""The two cameras of a specification and the pictures of their calibration: a target in many poses."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dic.basics import cv2
from dic.calibration.targets import Charuco, Chessboard, FiducialDots
from dic.camera import Camera, StereoRig
from dic.synthetic.paint import board_texture
from dic.synthetic.render import Sensor, board_series, write_numbered
from dic.synthetic.scene import Lens, RevolvedBody
from kolsky.base.arrays import FloatArray
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import stream

_ROLLS = {"up": 0.0, "right": 0.5 * np.pi, "down": np.pi, "left": -0.5 * np.pi}
"""Roll of the cameras that brings the flyer to that side of the picture [rad]."""
_PRINCIPAL_POINT = 3.0
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

    Raises ValueError if a picture does not fit on its sensor around the point that its camera looks at.
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
        rotation = _small(wrong) @ _about_z(_ROLLS[c.flyer_side]) @ _looking(-away)
        focal = c.along * distance / c.field
        cx, cy = 0.5 * (np.array(c.sensor) - 1.0) + _PRINCIPAL_POINT * rng.standard_normal(2)
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


MARGIN = 6.0
"""Least distance of the board from the edge of a picture [px]."""
TRIES = 2000
"""Poses that are drawn at the most for one that both cameras see whole."""

Pose = tuple[FloatArray, FloatArray]


def target_of(q: Specification) -> Any:
    """The target of a specification, `share` as wide as what a sensor shows at the distance of the axis."""
    c = q.calibration
    width = c.share * min(q.cameras.sensor) * q.cameras.pixel
    if c.target == "chessboard":
        return Chessboard(
            columns=c.columns, rows=c.rows, pitch=_rounded(width / (max(c.columns, c.rows) + 2.6))
        )
    if c.target == "charuco":
        pitch = _rounded(width / (max(c.columns, c.rows) + 0.7))
        return Charuco(columns=c.columns, rows=c.rows, pitch=pitch, marker=_rounded(0.7 * pitch))
    pitch = _rounded(width / (max(c.columns, c.rows) + 0.6))
    edge = 2 if min(c.columns, c.rows) >= 8 else 1  # of another length along rows than along columns
    far, high = c.columns - 1 - edge, c.rows - 1 - edge
    hollow = ((edge, edge), (far, edge), (edge, high))
    return FiducialDots(
        columns=c.columns, rows=c.rows, pitch=pitch, diameter=_rounded(0.5 * pitch), hollow=hollow
    )


def poses_of(q: Specification, rig: Rig, corners: FloatArray, *, shot: int) -> list[Pose]:
    """Poses R, t of the board from its own frame to the specimen's that both cameras see whole.

    ``q``, ``rig``: the specification and its cameras. ``corners``: of the board, in its frame [m], shape [4,
    2]. ``shot``: number of the shot. Raises ValueError if the board does not fit in both views.
    """
    rng = stream(q.seed, shot, "calibration")
    flat = np.concatenate([corners, np.zeros((4, 1))], axis=1)
    middle = flat.mean(axis=0)
    toward = rig.stereo.cameras[0].rotation.T  # board x, y as camera 0's picture has them
    reach = 0.5 * max(q.cameras.sensor) * q.cameras.pixel
    depth = 0.02 * min(q.cameras.distance_0, q.cameras.distance_1)
    found: list[Pose] = []
    for _ in range(TRIES):
        lean = rng.uniform(0.0, 2.0 * np.pi)
        tilt = q.calibration.tilt * np.sqrt(rng.uniform())
        vector = np.array([np.cos(lean), np.sin(lean), 0.0]) * tilt
        turn = cv2.Rodrigues(vector)[0] @ cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-0.6, 0.6)]))[0]
        R = toward @ turn
        off = toward @ (rng.uniform(-1.0, 1.0, 3) * [0.5 * reach, 0.5 * reach, depth])
        t = rig.middle + off - R @ middle
        if _in_view(flat @ R.T + t, rig):
            found.append((R, t))
            if len(found) == q.calibration.poses:
                return found
    raise ValueError(
        f"{len(found)} of {q.calibration.poses} poses of the target lie in both views after {TRIES} tries: "
        f"take a "
        "smaller calibration.share or calibration.tilt"
    )


def write_calibration(
    q: Specification, rig: Rig, folder: Path, *, shot: int, device: str, threads: int
) -> None:
    """Write calibration/cam0_00.png and so on."""
    texture, corners = board_texture(target_of(q), q.cameras.pixel / q.optics.rays)
    poses = poses_of(q, rig, corners, shot=shot)
    nodes = np.array([[0.0, 1.0]])
    board = RevolvedBody(y=nodes, r=nodes, along=nodes[0], radius=1.0, texture=texture)
    c, o = q.calibration, q.optics
    columns, rows = q.cameras.sensor
    # a shutter that stays open long: all noise is that of `noise`
    sensor = Sensor(bits=c.bits, full_well=1e9, read_noise=1e9 * c.noise, black=o.black, white=o.white)
    folder.mkdir()
    for k, camera in enumerate(rig.stereo.cameras):
        lens = Lens(spread=o.spread, rays=o.rays)
        pattern = sensor.pattern((rows, columns), stream(q.seed, shot, "calibration", "pixels", str(k)))
        light = board_series(board, poses, camera, (rows, columns), lens=lens, device=device, threads=threads)
        for i, picture in enumerate(one for batch in light for one in batch):
            rng = stream(q.seed, shot, "calibration", "noise", str(k), str(i))
            grey = sensor.expose(picture, pattern, 1.0, rng)
            write_numbered(folder / f"cam{k}_{i:02d}.png", grey, bits=c.bits)


def calibration_tables(q: Specification) -> dict[str, dict[str, Any]]:
    """[calibration] and [calibration.target] of the shot file."""
    target = target_of(q)
    given: dict[str, Any] = {
        "kind": q.calibration.target,
        "columns": target.columns,
        "rows": target.rows,
        "pitch": f"{target.pitch * 1e3:.9g} mm",
    }
    if isinstance(target, FiducialDots):
        given |= {"diameter": f"{target.diameter * 1e3:.9g} mm", "hollow": [list(p) for p in target.hollow]}
    if isinstance(target, Charuco):
        given |= {"marker": f"{target.marker * 1e3:.9g} mm", "dictionary": target.dictionary}
    return {
        "calibration": {
            "camera_0": "calibration/cam0_*.png",
            "camera_1": "calibration/cam1_*.png",
            "distortion": lens_model(q),
            "square_pixels": True,
        },
        "calibration.target": given,
    }


def lens_model(q: Specification) -> str:
    """The simplest lens model of the shot file that holds both true lenses."""
    lenses = np.abs(np.array([q.cameras.distortion_0, q.cameras.distortion_1])).max(axis=0) > 0.0
    k1, k2, p1, p2, k3 = (bool(used) for used in lenses)
    if p1 or p2:
        return "k1 k2 p1 p2 k3" if k3 else ("k1 k2 p1 p2" if k2 else "k1 p1 p2")
    if k3:
        return "k1 k2 k3"
    if k2:
        return "k1 k2"
    return "k1" if k1 else "none"


def _rounded(metres: float) -> float:
    """A length that a maker would print: whole hundredths of a millimetre, or of a tenth of that."""
    step = 1e-5 if metres > 2e-4 else 1e-6
    return float(np.round(metres / step)) * step


def _in_view(points: FloatArray, rig: Rig) -> bool:
    for camera in rig.stereo.cameras:
        at = camera.project(points)
        assert camera.sensor is not None  # `rig_of` gave it
        if not np.all((at > MARGIN) & (at < np.array(camera.sensor) - 1.0 - MARGIN)):
            return False
    return True
