"""Small inputs of `benchmarks.kills` and `benchmarks.soak`: leaks and failures depend on the number of
calls."""

import shutil
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
END = "250 us"
"""End of the simulated time of a small shot; open-01 has 1.4 ms."""
FRAMES = 8
"""One frame in this number of frames of its moving outline is kept."""


def small_shot(folder: Path) -> Path:
    """Make a folder with the shot open-01, shorter and with fewer points, without results."""
    shutil.copytree(ROOT / "runs" / "open-01", folder, ignore=shutil.ignore_patterns("results"))
    declared = folder / "shot.toml"
    declared.write_text(declared.read_text().replace('# end = "1.4 ms"', f'end = "{END}"'))
    outline = folder / "centreline.csv"
    heading, *rows = outline.read_text().splitlines()
    frames = [int(row.partition(",")[0]) for row in rows]
    kept = [row for row, frame in zip(rows, frames, strict=True) if frame < 12 or frame % FRAMES == 0]
    outline.write_text("\n".join([heading, *kept[::2]]) + "\n")
    return folder


def write_pictures(folder: Path, *, frames: int = 24, size: tuple[int, int] = (160, 220)) -> None:
    """Write the pictures of a plane measurement, moving speckles of a height and width [px], and its file of
    settings."""
    speckles = cv2.GaussianBlur(np.random.default_rng(4).normal(128.0, 400.0, size), (0, 0), 2.0)
    for number in range(frames):
        moved = np.array([[1, 0, 0.25 * number], [0, 1, -0.1 * number]], dtype=np.float32)
        picture = cv2.warpAffine(
            speckles, moved, size[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        )
        cv2.imwrite(str(folder / f"cam_{number:03d}.png"), np.clip(picture, 0, 255).astype(np.uint8))
    (folder / "dic.toml").write_text(
        '[dic]\nkind = "plane"\nscale = "0.1 mm"\n[pictures]\ncamera_0 = { pattern = "cam_*.png" }\n'
    )
