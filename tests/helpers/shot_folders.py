"""Folders of shots to test on: where they are, copies of them, what is in a folder."""

import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OPEN_01 = ROOT / "runs" / "open-01"
OPEN_02 = ROOT / "tests" / "data" / "open-02"
FILES = ["shot.toml", "scope.csv", "frames.csv", "flyer.csv", "centreline.csv", "quasi_static.csv"]
TINY = ["--mesh", "8x11"]
QUICK = [*TINY, "--free", "stiffness_factor", "--refined-mesh", "16x22", "--replicates", "2"]


def shot_in(folder: Path) -> Path:
    """A copy of open-01 in a new folder."""
    folder.mkdir()
    for name in FILES:
        shutil.copy(OPEN_01 / name, folder)
    return folder


def state(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of change of everything in a folder."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.stat()
        found[str(path.relative_to(folder))] = (status.st_size, status.st_mtime_ns)
    return found
