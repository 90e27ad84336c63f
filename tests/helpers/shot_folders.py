"""Folders of shots for tests: their paths, copies, and contents."""

import os
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OPEN_01 = ROOT / "runs" / "open-01"
OPEN_02 = ROOT / "tests" / "data" / "open-02"
FILES = ["shot.toml", "scope.csv", "frames.csv", "flyer.csv", "centreline.csv", "quasi_static.csv"]
TINY = ["--mesh", "8x11"]
QUICK = [*TINY, "--free", "stiffness_factor", "--refined-mesh", "12x16", "--replicates", "2"]


def shot_in(folder: Path, *changes: tuple[str, str]) -> Path:
    """A copy of open-01 in a new folder, with some texts of its file replaced, each where it is first."""
    folder.mkdir(parents=True)
    for name in FILES:
        shutil.copy(OPEN_01 / name, folder)
    text = (folder / "shot.toml").read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "shot.toml").write_text(text, "utf-8")
    return folder


OVERRIDE = (1, 2)  # CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH: with them the administrator writes anywhere


def ordinary_rights() -> None:
    """Drop the administrator's capability to write into closed folders, for the next program."""
    import ctypes

    for capability in OVERRIDE if os.geteuid() == 0 else ():
        ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP


def state(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of change of all files in a folder."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.stat()
        found[str(path.relative_to(folder))] = (status.st_size, status.st_mtime_ns)
    return found
