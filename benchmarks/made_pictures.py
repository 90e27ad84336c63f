"""Time for rendering the pictures of a synthetic shot: `python -m benchmarks.made_pictures`.

With `--size 512 --frames 200 --device cuda`: larger pictures on a GPU. The surface is a barrelled cylinder. A
formula compresses it to half its length; no simulation is run. The time includes paint, rays, lens, noise and
rounding for both cameras, and the calibration series. It excludes the compilation of kernels.
"""

import argparse
import json
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from kolsky.virtual.pictures import expose_series, rig_of, scene_of, write_calibration
from kolsky.virtual.schema import Specification
from kolsky.virtual.truth import SurfaceHistory


def surface(frames: int, q: Specification) -> SurfaceHistory:
    """A specimen at rest for 12 frames, then compressed at constant speed to half its length; 129 nodes."""
    time = (np.arange(frames, dtype=np.float64) - 11.0) / q.frames.rate
    d = np.clip(time / time[-1], 0.0, 1.0) * 0.5 * q.specimen.length
    share = np.linspace(0.0, 1.0, 129)
    stretch = 1.0 - d[:, None] / q.specimen.length
    bulge = 1.5 * (1.0 / np.sqrt(stretch) - 1.0) * (1.0 - (2.0 * share - 1.0) ** 2)
    r = 0.5 * q.specimen.diameter * (1.0 + bulge)
    return SurfaceHistory(time, r, share * q.specimen.length * stretch, d, np.zeros(frames))


def timed(q: Specification, frames: int, device: str, threads: int) -> dict[str, float]:
    """Wall times of the parts of one shot [s]."""
    start = perf_counter()
    scene, rig = scene_of(q, surface(frames, q), shot=0), rig_of(q, shot=0)
    painted = perf_counter()
    for k in (0, 1):
        for _ in expose_series(q, scene, rig.camera(k), k, 0, device, threads):
            pass
    exposed = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        write_calibration(q, rig, Path(folder) / "c", shot=0, device=device, threads=threads)
    calibrated = perf_counter()
    return {
        "paint": painted - start,
        "both series": exposed - painted,
        "pictures": exposed - start,
        "calibration series": calibrated - exposed,
    }


def main() -> None:
    """Print the times as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--size", type=int, default=128, help="side of a picture [px]")
    parser.add_argument("--frames", type=int, default=186, help="pictures of a camera")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=2, help="threads on a CPU, and of the noise")
    parser.add_argument("--repeats", type=int, default=1, help="the least of so many times is printed")
    given = parser.parse_args()
    sensor = max(512, given.size)
    q = Specification.model_validate(
        {"cameras": {"write": True, "picture": [given.size] * 2, "sensor": [sensor] * 2}}
    )
    few = q.model_copy(update={"calibration": q.calibration.model_copy(update={"poses": 4})})
    timed(few, 14, given.device, given.threads)  # compiles
    runs = [timed(q, given.frames, given.device, given.threads) for _ in range(given.repeats)]
    best = {name: round(min(run[name] for run in runs), 3) for name in runs[0]}
    rays = 2 * given.frames * given.size**2 * q.optics.rays**2
    print(json.dumps({**vars(given), **best, "rays, 1e6": round(rays / 1e6, 1)}))


if __name__ == "__main__":
    main()
