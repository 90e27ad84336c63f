"""Flyer export of a DIC program: the displacement of the flyer frame by frame."""

from dataclasses import dataclass
from pathlib import Path

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.readers.table import Column, read_table


@dataclass(frozen=True)
class FlyerTable:
    """The flyer's displacement with the sign of the file; row i is line i + 2."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    frame: IntArray
    """Frame numbers, increasing, shape [n]."""
    displacement: FloatArray
    """Displacement, sign as in the file [m], shape [n]."""
    time: FloatArray | None
    """The file's own time column [s], shape [n]; None if it has none."""
    digit: float
    """The last printed digit of the times [s]; 0 without a time column."""


def read(path: Path, *, frame: Column, displacement: Column, time: Column | None = None) -> FlyerTable:
    """Read frame numbers, displacements and, if there is one, the time column.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole, or frame numbers do not increase.
    """
    table = read_table(path)
    numbers = table.integers(frame)
    table.check_increasing(frame, numbers)
    return FlyerTable(
        path=path,
        sha256=table.sha256,
        frame=numbers,
        displacement=table.values(displacement),
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )
