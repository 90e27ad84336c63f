"""Time of `kolsky dic` on a shot with pictures, by stage.

The shot is open-01 or a similar one: 2 x 186 pictures of 128² px and 20 pairs of a dot grid. The time is that
of the command's work in one process on all cores. It excludes the start of Python, the imports and the first
compilation by Warp.
"""

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PICTURES = """
[pictures]
camera_0 = { file = "cam0.tif", crop_offset = [192, 192] }
camera_1 = { file = "cam1.tif", crop_offset = [192, 192] }
bits = 12

[calibration]
camera_0 = "calibration/cam0_*.png"
camera_1 = "calibration/cam1_*.png"
distortion = "k1"
square_pixels = true

[calibration.target]
kind = "fiducial_dots"
columns = 14
rows = 10
pitch = "1.2 mm"
diameter = "0.6 mm"
hollow = [[2, 2], [11, 2], [2, 7]]

[dic]
specimen = { x = [0, 127], y = [6, 121] }
flyer = { x = [0, 127], y = [0, 69], frame = 185 }
flyer_side = "up"
transmission_edge = [60, 122]
strip_half_width = "0.6 mm"
largest_sigma = "10 um"
subset = 25
step = 6
shape = "quadratic"

"""


@dataclass(frozen=True)
class Whole:
    """One run of the command."""

    wall: float
    """Wall time of the run [s]."""
    processor: float
    """Processor time of all threads and of the other processes of the run [s]."""
    stages: Mapping[str, float]
    """Wall time of the stages of the correlation and of the other parts [s]; the stages of the correlation
    overlap."""


def shot_of(folder: Path, raw: Path) -> Path:
    """Make a shot in an existing folder with links to open-01's raw pictures in place of its exports."""
    for path in raw.iterdir():
        (folder / path.name).symlink_to(path.resolve())
    text = (ROOT / "runs" / "open-01" / "shot.toml").read_text()
    before, after = text[: text.index("[flyer]")], text[text.index("[curve]") :]
    (folder / "shot.toml").write_text(before + PICTURES + after)
    return folder


def runs(raw: Path, repeats: int, *, device: str = "cpu", say: Callable[[str], Any] = print) -> list[Whole]:
    """Run the command `repeats` times on open-01's raw files. One more run before compiles and warms up."""
    from kolsky.cli.dic import dic
    from kolsky.pictures.dic_file import read_stereo_result

    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for sub in ("shot", "out"):
            (folder / sub).mkdir()
        shot = shot_of(folder / "shot", raw)
        for run in range(repeats + 1):
            wall, processor = time.perf_counter(), sum(os.times()[:4])
            told = StringIO()
            with redirect_stdout(told), redirect_stderr(StringIO()):
                dic(shot, out=folder / "out", repeat=True, device=device)
            whole = Whole(
                wall=time.perf_counter() - wall,
                processor=sum(os.times()[:4]) - processor,
                stages=read_stereo_result(folder / "out" / "dic.h5").seconds,
            )
            shutil.rmtree(folder / "out")
            (folder / "out").mkdir()
            if run:
                found.append(whole)
                say(line(whole))
    return found


def line(whole: Whole) -> str:
    """One run as text."""
    parts = ", ".join(f"{name} {seconds:.2f}" for name, seconds in whole.stages.items())
    rest = whole.wall - whole.stages["calibration"] - whole.stages["correlation"]
    return (
        f"wall {whole.wall:.2f} s, processor {whole.processor:.2f} s: {parts}, files and page {rest:.2f} "
        f"(on {os.cpu_count() or 1} cores)"
    )


def as_json(found: list[Whole]) -> dict[str, Any]:
    """The fastest run, for `benchmarks/results`."""
    best = min(found, key=lambda whole: whole.wall)
    return {
        "shot": "open-01, 2 x 186 pictures of 128 x 128 px, 20 pairs of a dot grid",
        "cores": os.cpu_count() or 1,
        "runs": len(found),
        "wall_seconds": round(best.wall, 2),
        "processor_seconds": round(best.processor, 2),
        "stages": {name: round(seconds, 2) for name, seconds in best.stages.items()},
    }


def put(path: Path, **parts: Any) -> None:
    """Store parts in a file of results; its other parts are kept."""
    kept = json.loads(path.read_text()) if path.exists() else {}
    path.write_text(json.dumps({**kept, **parts}, indent=1) + "\n")
