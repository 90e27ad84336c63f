"""Pictures of a made shot: two series with their calibration, written as cameras write them."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.camera import Camera
from dic.forks import cores
from dic.synthetic.lens import Lens, haze
from dic.synthetic.picture_files import WRITERS
from dic.synthetic.render import picture_series
from dic.synthetic.scene import Scene
from dic.synthetic.sensor import Sensor
from kolsky.virtual.calibration_series import calibration_tables, write_calibration
from kolsky.virtual.cameras_rig import Rig, rig_of
from kolsky.virtual.pictures_scene import scene_of
from kolsky.virtual.records import SurfaceHistory
from kolsky.virtual.schema import Specification
from kolsky.virtual.streams import stream

STRIP = 0.6e-3
"""Half the width of the strip of the outline that the shot file asks for [m]."""


@dataclass(frozen=True)
class PictureFiles:
    """What was written."""

    tables: dict[str, dict[str, Any]]
    """Tables of shot.toml: [pictures], [calibration], [calibration.target] and [dic]."""
    answer: list[dict[str, Any]]
    """The true cameras for the whole sensors: K, dist, R, t (X_c = R X + t, from the specimen's frame), and
    the crop."""


def write_pictures(
    q: Specification,
    surface: SurfaceHistory,
    folder: Path,
    *,
    shot: int = 0,
    device: str = "cpu",
    threads: int | None = None,
) -> PictureFiles:
    """Write both picture series and the calibration series of a shot into its folder.

    Parameters
    ----------
    q
        The specification.
    surface
        Specimen and flyer at the true times of the frames.
    folder
        The shot's folder.
    shot
        Its number in the population.
    device
        "cpu" or a GPU, "cuda:0".
    threads
        Threads on a CPU; those the process may use if left out.

    Raises
    ------
    ValueError
        If a picture does not fit on its sensor, or the target does not fit in both cameras' views.
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
    return PictureFiles({**_tables(q, rig, suffix), **calibration_tables(q)}, _answer(rig))


def expose_series(
    q: Specification, scene: Scene, camera: Camera, k: int, shot: int, device: str, threads: int
) -> Iterable[NDArray[np.uint16]]:
    """Grey values of the frames of one camera, in their order.

    Every frame of every camera has its own random stream, so that the pictures do not depend on how the
    work is
    shared out.
    """
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


def _answer(rig: Rig) -> list[dict[str, Any]]:
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
