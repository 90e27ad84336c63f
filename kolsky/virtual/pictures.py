"""Pictures of a synthetic shot and its calibration: painted specimen, flyer and platen; a target."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from dic.basics import cv2
from dic.calibration.targets import Charuco, Chessboard, FiducialDots
from dic.camera import Camera, StereoRig
from dic.processes import cores
from dic.synthetic.paint import (
    Area,
    Paint,
    Texture,
    board_texture,
    flaked,
    painted,
    plain,
    printed_dots,
    scratched,
    sprayed_drops,
)
from dic.synthetic.render import WRITERS, Sensor, board_series, picture_series, write_numbered
from dic.synthetic.scene import Instants, Lamp, Lens, RevolvedBody, Scene, closed, cylinder, exposures, haze
from kolsky.base.arrays import FloatArray
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import stream
from kolsky.virtual.truth import SurfaceHistory

_ROLLS = {"up": 0.0, "right": 0.5 * np.pi, "down": np.pi, "left": -0.5 * np.pi}
"""Roll of the cameras that brings the flyer to that side of the picture [rad]."""
_PRINCIPAL_POINT = 3.0
"""Standard deviation of the principal point about the middle of the sensor [px]."""


@dataclass(frozen=True)
class Rig:
    """Both cameras, with the position of the pictures on their sensors."""

    stereo: StereoRig
    """The cameras for the whole sensors."""
    crops: tuple[tuple[int, int], tuple[int, int]]
    """Top left pixel of the pictures (x, y) on the sensors [px]."""
    middle: FloatArray
    """Point at which they look [m], shape [3]."""

    def camera(self, k: int) -> Camera:
        """Camera k for the cropped pictures."""
        return self.stereo.cameras[k].cropped(self.crops[k])


def rig_of(q: Specification, *, shot: int) -> Rig:
    """The cameras of a specification.

    The upper end of the view is `flyer_share` of the picture's length above the specimen's face at rest. The
    cameras therefore look at ``y = L + (share - 1/2) field``. The focal lengths are chosen for a picture
    filled by `field`.

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
    """Whole pixels of the offset that brings `at` to the picture's middle, as far as the sensor allows."""
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
    """Rotation to a camera looking along `view`, with its y axis (down) as close as possible to -y."""
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
"""Smallest distance of the board from the edge of a picture [px]."""
TRIES = 2000
"""Maximum number of drawn poses until one is fully visible in both cameras."""

Pose = tuple[FloatArray, FloatArray]


def target_of(q: Specification) -> Any:
    """The target of a specification. Its width is `share` of the sensor's field at the distance of the
    axis."""
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
    edge = 2 if min(c.columns, c.rows) >= 8 else 1  # different lengths along rows and columns
    far, high = c.columns - 1 - edge, c.rows - 1 - edge
    hollow = ((edge, edge), (far, edge), (edge, high))
    return FiducialDots(
        columns=c.columns, rows=c.rows, pitch=pitch, diameter=_rounded(0.5 * pitch), hollow=hollow
    )


def poses_of(q: Specification, rig: Rig, corners: FloatArray, *, shot: int) -> list[Pose]:
    """Poses R, t of the board, from its frame to the specimen's, fully visible in both cameras.

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
    # long exposure: all noise is that of `noise`
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
    """The simplest lens model of the shot file that includes both true lenses."""
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
    """A length rounded in the way of a manufacturer: to 0.01 mm, or to 0.001 mm if small."""
    step = 1e-5 if metres > 2e-4 else 1e-6
    return float(np.round(metres / step)) * step


def _in_view(points: FloatArray, rig: Rig) -> bool:
    for camera in rig.stereo.cameras:
        at = camera.project(points)
        assert camera.sensor is not None  # `rig_of` gave it
        if not np.all((at > MARGIN) & (at < np.array(camera.sensor) - 1.0 - MARGIN)):
            return False
    return True


GRAIN = 0.012
"""Standard deviation of the reflectance of bare material, texel by texel [-]."""
SHARP = 0.05
"""Smaller motion than this during an exposure is neglected [px]. Its blur would widen the point spread by
4e-4 px."""


def scene_of(q: Specification, surface: SurfaceHistory, *, shot: int) -> Scene:
    """The scene at the instants of all frames.

    ``surface``: specimen and flyer at the true times of the frames. ``shot``: number of the shot.
    """
    instants = instants_of(q, surface)
    at = _at(surface, instants.time)
    reach = _reach(q, surface)
    bodies = (
        _specimen(q, surface, at, instants, reach, shot),
        _flyer(q, at, reach, shot),
        _platen(q, at, reach, shot),
    )
    o = q.optics
    toward = (
        np.sin(o.lamp_side) * np.cos(o.lamp_height),
        np.sin(o.lamp_height),
        np.cos(o.lamp_side) * np.cos(o.lamp_height),
    )
    return Scene(instants, bodies, lamp=Lamp(toward, o.ambient, o.gloss), background=0.05)


def instants_of(q: Specification, surface: SurfaceHistory) -> Instants:
    """Instants of the exposures. There is one if the motion is below `SHARP`, otherwise two or more,
    depending on the blur."""
    speed = np.abs(np.gradient(surface.displacement, surface.time))
    blur = speed * q.optics.exposure / q.cameras.pixel
    points = np.where(blur > SHARP, 1 + np.maximum(1, np.ceil(blur)), 1).astype(np.int64)
    return exposures(surface.time, q.optics.exposure, points)


class _At(NamedTuple):
    """Surface and flyer at the instants."""

    y: FloatArray
    r: FloatArray
    flyer: FloatArray
    tilt: FloatArray


def _at(surface: SurfaceHistory, time: FloatArray) -> _At:
    """Interpolate between frames by monotone cubics. They do not overshoot at the start of the motion."""
    inside = np.clip(time, surface.time[0], None)
    y, r, d, tilt = (
        PchipInterpolator(surface.time, values, axis=0, extrapolate=True)(inside)
        for values in (surface.y, surface.r, surface.displacement, surface.tilt)
    )
    return _At(y, np.maximum(r, 0.0), d, tilt)


def _reach(q: Specification, surface: SurfaceHistory) -> float:
    """Largest distance from the axis, across it, that the pictures show [m], with a margin."""
    c = q.cameras
    across = c.picture[0] if c.along == c.picture[1] and c.flyer_side in ("up", "down") else c.picture[1]
    return abs(c.aside) + (0.5 * across + 0.02 * max(c.sensor)) * c.pixel * 1.1 + 0.2e-3


def _around(radius: float, reach: float) -> tuple[float, float]:
    """Range of arc length of a cylinder that can become visible [m]: 1.8 rad at most."""
    angle = 1.8 if reach >= 0.95 * radius else float(np.arcsin(reach / radius)) + 0.3
    return -min(angle, 1.8) * radius, min(angle, 1.8) * radius


def _specimen(
    q: Specification, surface: SurfaceHistory, at: _At, instants: Instants, reach: float, shot: int
) -> RevolvedBody:
    s, pixel = q.speckle, q.cameras.pixel
    radius, length = 0.5 * q.specimen.diameter, q.specimen.length
    area = Area(_around(radius, reach), (-2.0 * pixel, length + 2.0 * pixel))
    rng = stream(q.seed, shot, "damage")
    texture = _paint(q, area, stream(q.seed, shot, "speckles", "specimen"))
    spots = rng.uniform([-0.5, 0.2], [0.5, 0.8], (3, 2)) * [min(radius, reach), length]
    if s.scratch > 0.0:
        lean = rng.uniform(-0.3, 0.3) * length
        start, end = (area.around[0], spots[0, 1] - lean), (area.around[1], spots[0, 1] + lean)
        texture = scratched(texture, start=start, end=end, width=s.scratch, level=s.bare)
    if s.flake > 0.0:
        texture = flaked(texture, middle=tuple(spots[1]), radius=s.flake, level=s.bare, rng=rng)
    y, r, along = closed(at.y, at.r, surface.y[0] - surface.y[0, 0])
    share = at.flyer / max(float(surface.displacement.max()), 1e-12)
    slip = np.zeros((len(instants.time), 2))
    slip[:, 1] = s.loose_slip * np.clip(share, 0.0, 1.0)
    return RevolvedBody(
        y=y, r=r, along=along, radius=radius, texture=texture, shine=q.optics.highlight,
        patch=(*spots[2], s.loose), slip=slip,
    )  # fmt: skip


def _flyer(q: Specification, at: _At, reach: float, shot: int) -> RevolvedBody:
    radius = 0.5 * q.motion.flyer_diameter
    height = max(q.cameras.field, float(at.flyer.max()) + q.cameras.field)
    texture = _covered(q, radius, reach, (0.0, height), q.speckle.flyer, "flyer", shot)
    place = np.zeros((len(at.flyer), 3))
    place[:, 1] = q.specimen.length - at.flyer
    place[:, 2] = -q.imperfections.off_centre
    c, s, zero, one = np.cos(at.tilt), np.sin(at.tilt), np.zeros_like(at.tilt), np.ones_like(at.tilt)
    turn = np.stack([one, zero, zero, zero, c, s, zero, -s, c], axis=1).reshape(-1, 3, 3)
    return cylinder(radius, height, texture, place=place, turn=turn, shine=q.optics.highlight)


def _platen(q: Specification, at: _At, reach: float, shot: int) -> RevolvedBody:
    """The transmission platen: a cylinder that ends at the specimen's first node."""
    radius, height = 0.5 * q.motion.flyer_diameter, q.cameras.field
    texture = _covered(q, radius, reach, (0.0, height), q.speckle.platen, "platen", shot)
    place = np.zeros((len(at.flyer), 3))
    place[:, 1] = at.y[:, 0] - height
    place[:, 2] = -q.imperfections.off_centre
    return cylinder(radius, height, texture, place=place, shine=q.optics.highlight)


def _covered(
    q: Specification,
    radius: float,
    reach: float,
    along: tuple[float, float],
    speckled: bool,
    name: str,
    shot: int,
) -> Texture:
    """Paint or bare material on the side of a rigid body. Its faces are bare."""
    rim = 2.0 * q.cameras.pixel
    area = Area(_around(radius, reach), (along[0] - rim, along[1] + rim))
    if not speckled:
        seed = int(stream(q.seed, shot, "bare", name).integers(2**32))
        return plain(area, 0.5 * q.cameras.pixel, level=q.speckle.bare, grain=GRAIN, seed=seed)
    texture = _paint(q, area, stream(q.seed, shot, "speckles", name))
    _, v = area.grid(texture.pitch)
    face = (v < along[0] - texture.pitch) | (v > along[1] + texture.pitch)
    grey = np.where(face[:, None], np.float32(q.speckle.bare), texture.grey)
    return replace(texture, grey=grey)


def _paint(q: Specification, area: Area, rng: np.random.Generator) -> Texture:
    """Speckles of the specification. The texel pitch equals the distance of the rays."""
    s, pixel = q.speckle, q.cameras.pixel
    size = s.size * pixel
    if s.kind == "sprayed":
        centres, diameters = sprayed_drops(
            area, size=size, spread=s.size_spread, coverage=s.coverage, rng=rng
        )
    else:
        centres, diameters = printed_dots(area, size=size, coverage=s.coverage, jitter=s.jitter, rng=rng)
    pitch = pixel / q.optics.rays
    return painted(area, pitch, centres, diameters, Paint(s.dark, s.bright, s.softness))


STRIP = 0.6e-3
"""Half width of the outline strip in the shot file [m]."""


def write_pictures(
    q: Specification,
    surface: SurfaceHistory,
    folder: Path,
    *,
    shot: int = 0,
    device: str = "cpu",
    threads: int | None = None,
) -> tuple[dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """Write both picture series and the calibration series of a shot into its folder.

    ``surface``: specimen and flyer at the true times of the frames. ``shot``: its number in the population.
    ``threads``: threads on a CPU; default: all available to the process. Returns: tables of shot.toml
    ([pictures], [calibration], [calibration.target] and [dic]); the true cameras for the whole sensors, K,
    dist, R, t (X_c = R X + t, from the specimen's frame) and crop. Raises ValueError if a picture does not
    fit on its sensor, or the target does not fit in both cameras' views.
    """
    rig = rig_of(q, shot=shot)
    workers = threads or cores()
    scene = scene_of(q, surface, shot=shot)
    suffix, write = WRITERS[q.cameras.format]
    bits = q.optics.bits
    for k in (0, 1):
        pictures = np.stack(list(expose_series(q, scene, rig.camera(k), k, shot, device, workers)))
        times = surface.time - q.frames.clock_offset
        write(folder / f"cam{k}{suffix}", pictures, bits=bits, times=times, rate=q.frames.rate)
    write_calibration(q, rig, folder / "calibration", shot=shot, device=device, threads=workers)
    return {**_tables(q, rig, suffix), **calibration_tables(q)}, _camera_answer(rig)


def expose_series(
    q: Specification, scene: Scene, camera: Camera, k: int, shot: int, device: str, threads: int
) -> Iterable[NDArray[np.uint16]]:
    """Grey values of the frames of one camera, in order. Every frame of every camera has a separate random
    stream. The pictures therefore do not depend on the distribution of the work."""
    o, shape = q.optics, (q.cameras.picture[1], q.cameras.picture[0])
    n = scene.instants.n_frames
    sensor = Sensor(
        bits=o.bits, full_well=o.full_well, read_noise=o.read_noise, black=o.black, white=o.white,
        fixed_pattern=o.fixed_pattern, flicker=o.flicker, gradient=o.lamp_gradient,
    )  # fmt: skip
    distance = (q.cameras.distance_0, q.cameras.distance_1)[k]
    lens = Lens(spread=o.spread, aperture=o.aperture, focus=distance + o.defocus, rays=o.rays)
    name = str(k)
    pattern = sensor.pattern(shape, stream(q.seed, shot, "pixels", name))
    lamp = 1.0 + o.flicker * stream(q.seed, shot, "flicker").standard_normal(n)
    air = None
    if o.haze > 0.0:
        air = haze(
            n, (shape[0] + 80, shape[1] + 80), size=o.haze, length=o.haze_length,
            memory=o.haze_memory * q.frames.rate, rng=stream(q.seed, shot, "haze", name),
        )  # fmt: skip
    light = picture_series(
        scene, camera, shape, lens=lens, haze=air, haze_pitch=o.haze_length, device=device, threads=threads
    )

    def exposed(item: tuple[int, NDArray[np.float32]]) -> NDArray[np.uint16]:
        i, picture = item
        return sensor.expose(picture, pattern, lamp[i], stream(q.seed, shot, "noise", name, str(i)))

    numbered = enumerate(picture for batch in light for picture in batch)
    if threads == 1:
        yield from map(exposed, numbered)
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(exposed, numbered)


def _tables(q: Specification, rig: Rig, suffix: str) -> dict[str, dict[str, Any]]:
    c = q.cameras
    series: dict[str, Any] = {
        f"camera_{k}": {
            **({"pattern": f"cam{k}/*.png"} if suffix == "" else {"file": f"cam{k}{suffix}"}),
            "crop_offset": list(rig.crops[k]),
        }
        for k in (0, 1)
    }
    subset = int(np.clip(2 * round(2.0 * q.speckle.size) + 1, 15, 41))
    return {
        "pictures": {**series, "bits": 8 if c.format == "png" else q.optics.bits},
        "dic": {
            "flyer_side": c.flyer_side,
            "strip_half_width": f"{STRIP * 1e3:g} mm",
            "subset": subset,
            "shape": "quadratic",
        },
    }


def _camera_answer(rig: Rig) -> list[dict[str, Any]]:
    return [
        {
            "K": camera.matrix.tolist(),
            "dist": list(camera.distortion),
            "R": camera.rotation.tolist(),
            "t": camera.translation.tolist(),
            "crop_offset": list(crop),
        }
        for camera, crop in zip(rig.stereo.cameras, rig.crops, strict=True)
    ]
