"""Large pictures, many points: `python -m benchmarks.dic_large --side 2000 --points 30000 --frames 200`.

A speckled plane in front of two cameras is shortened uniformly. The steps are those of `kolsky dic`: match
between the cameras, tracking in both series, reconstruction, and the gate of the residual map. The command
prints the wall time without the time for making the pictures. It also prints the points of all frames and
cameras per second, the kernel launches, and the peak memory of the process. `--curves` times only the search
along epipolar curves, on one core or a GPU.
"""

import argparse
import json
import resource
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time, thread_time
from typing import Any

import cv2
import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.bodies.follow import follow_bodies, match_body
from dic.bodies.region import Region
from dic.camera import Camera
from dic.chain.outliers import gate_residual
from dic.correlation import Correlation, Noise, Shape
from dic.correlation.subsets import identity
from dic.outcome import FrameOutcome, PointOutcome
from dic.stereo.epipolar_search import search, subsets
from dic.tracking import Tracking
from tests.helpers.speckle_pictures import facing

PIXEL, DISTANCE, ANGLE = 50e-6, 0.4, np.radians(15.0)
NOISE, SUBSET, SHORTENING = 2.0, 21, 0.2


@dataclass
class PlaneSeries:
    """Pictures of the plane by one camera, made on request."""

    camera: Camera
    side: int
    n_frames: int
    path: Path = Path()
    bits: int = 8
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: None = None
    seconds: float = 0.0
    """Time spent on making pictures [s]."""
    processor: float = 0.0
    """Processor time spent on making pictures, in the requesting thread [s]."""
    texture: NDArray[np.float32] = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(0)
        grain = cv2.GaussianBlur(rng.standard_normal((4096, 4096)).astype(np.float32), (0, 0), 2.2)
        self.texture = np.asarray(120.0 + 45.0 * grain / float(grain.std()), np.float32)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.side, self.side

    def frame(self, index: int) -> NDArray[np.uint8]:
        """The picture of one frame."""
        started, work = perf_counter(), thread_time()
        stretch = 1.0 - SHORTENING * index / max(self.n_frames - 1, 1)
        R, t = self.camera.rotation, self.camera.translation
        # from the plane's (x, y, 1) to the picture, and from the texture to the plane: 1 texel is a pixel
        plane = self.camera.matrix @ np.column_stack([R[:, 0], R[:, 1], t])
        size = PIXEL * np.diag([1.0, stretch, 1.0 / PIXEL])
        size[:2, 2] = -2048.0 * PIXEL * np.array([1.0, stretch])
        grey = cv2.warpPerspective(
            self.texture, plane @ size, (self.side, self.side), flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_WRAP,
        )  # fmt: skip
        noise = np.random.default_rng([index, 7]).standard_normal(self.shape, dtype=np.float32)
        found = np.clip(np.rint(grey + NOISE * noise), 0, 255).astype(np.uint8)
        self.seconds += perf_counter() - started
        self.processor += thread_time() - work
        return found


def whole(side: int, points: int, frames: int, device: str) -> dict[str, Any]:
    """Match, track, reconstruct and gate; returns times, launches and memory."""
    rig = facing(ANGLE, DISTANCE, DISTANCE / PIXEL, (side, side))
    series = PlaneSeries(rig.cameras[0], side, frames), PlaneSeries(rig.cameras[1], side, frames)
    step = max(1, int(0.84 * side / np.sqrt(points)))
    rim = (
        0.5 * (side - 1 - step * np.sqrt(points)) - 0.5 * SUBSET
    )  # a point is at least half a subset from the edge
    corners = ((rim, rim), (side - rim, rim), (side - rim, side - rim), (rim, side - rim))
    fine = np.full(frames, int(FrameOutcome.VALID), dtype=np.int64)
    launches, launch = [0], wp.launch

    def counted(*given: Any, **options: Any) -> Any:
        launches[0] += 1
        return launch(*given, **options)

    wp.launch = counted
    started, work = perf_counter(), process_time()
    try:
        stereo = Correlation(subset=SUBSET, shape=Shape.AFFINE)
        matched = match_body(
            series,
            rig,
            Region(corners, 0),
            step=step,
            margin=0.5 * SUBSET,
            tracking=Tracking(correlation=Correlation(subset=SUBSET)),
            stereo=stereo,
            noise=(Noise(NOISE), Noise(NOISE)),
            health=(fine, fine),
            device=device,
        )
        body = gate_residual(follow_bodies([matched], rig, stereo)[0])
    finally:
        wp.launch = launch
    made = max(one.seconds for one in series)  # the cameras' pictures are made in parallel
    seconds = perf_counter() - started - made
    processor = process_time() - work - sum(one.processor for one in series)
    n = len(body.points)
    return {
        "picture": [side, side],
        "frames": frames,
        "points": n,
        "device": device,
        "valid": float(np.mean(body.reconstruction.outcome == PointOutcome.VALID)),
        "seconds": round(seconds, 2),
        "processor_seconds": round(processor, 3),
        "seconds_of_making_pictures": round(made, 2),
        "points_per_second": round(2 * n * frames / seconds),
        "launches": launches[0],
        "largest_memory_GB": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, 2),
    }


def curves(side: int, points: int, device: str) -> dict[str, Any]:
    """Points per second of the search along epipolar curves, on one core or a GPU."""
    rig = facing(ANGLE, DISTANCE, DISTANCE / PIXEL, (side, side))
    first, second = (PlaneSeries(camera, side, 1).frame(0).astype(np.float32) for camera in rig.cameras)
    rng = np.random.default_rng(1)
    places: FloatArray = np.rint(rng.uniform(0.1 * side, 0.9 * side, (points, 2)))
    wanted = subsets(first, places, identity(points), SUBSET, None)
    A = np.broadcast_to(np.diag([1.0, 1.0]), (points, 2, 2))
    reach = 60.0 * PIXEL / np.sin(ANGLE)  # 60 px of the curve
    limits = (DISTANCE - reach, DISTANCE + reach)
    best = np.inf
    clock = process_time if device == "cpu" else perf_counter
    for _ in range(4):  # the first call compiles
        started = clock()
        found = search(rig, wanted, second, limits=limits, gradients=A, device=device, threads=1)
        best = min(best, clock() - started)
    return {
        "points": points,
        "device": device,
        "points_per_second": round(points / best),
        "zncc": round(float(np.median(found.zncc)), 3),
    }


def main() -> None:
    """Time it and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=1000, help="rows and columns of a picture [px]")
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--curves", action="store_true", help="the search along epipolar curves alone")
    parser.add_argument("--json", type=Path, help="write the result here, beside those of other sizes")
    o = parser.parse_args()
    if not o.curves and o.device != "cpu":
        whole(256, 300, 3, o.device)  # compiles or loads
    found = curves(o.side, o.points, o.device) if o.curves else whole(o.side, o.points, o.frames, o.device)
    print(json.dumps(found))
    if o.json:
        put(o.json, found)


def put(path: Path, found: dict[str, Any]) -> None:
    """Store a result in a file; it replaces a result of the same size and device."""
    kept = json.loads(path.read_text()) if path.exists() else []
    like = ("picture", "frames", "points", "device")
    kept = [one for one in kept if any(one.get(name) != found.get(name) for name in like)]
    lines = ",\n ".join(json.dumps(one) for one in [*kept, found])
    path.write_text(f"[{lines}]\n")


if __name__ == "__main__":
    main()
