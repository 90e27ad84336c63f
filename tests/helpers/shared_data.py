"""Other people's pictures and records in the folder `shared` beside the repository."""

import gzip
from pathlib import Path

import cv2
import numpy as np
import pytest

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def data(*names: str) -> Path:
    """A folder of these data; the test is skipped where they are not shipped."""
    folder = DATA.joinpath(*names)
    if not folder.is_dir():
        pytest.skip(f"no {folder}: other people's data are not shipped")
    return folder


def grey(path: Path) -> np.ndarray:
    """Grey values of a picture with all their bits, refused if it is not there."""
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    assert picture is not None, path
    return picture


def named(path: Path) -> np.ndarray:
    """A table of text, compressed or not, with its columns by name."""
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as file:
        return np.genfromtxt(file, delimiter=",", names=True)


def columns(table: np.ndarray, *names: str) -> np.ndarray:
    """Columns of such a table side by side."""
    return np.stack([table[name] for name in names], axis=-1)
