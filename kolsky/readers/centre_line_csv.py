"""Centre-line export of a DIC program: points (y, Z) of the specimen's outline, frame by frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.readers.table import Column, read_table


@dataclass(frozen=True)
class CentreLineTable:
    """Outline points in the coordinates of the file; row i is line i + 2."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    frame: IntArray
    """Frame number of each point, never falling, shape [n]."""
    y: FloatArray
    """Coordinate along the compression axis [m], shape [n]."""
    Z: FloatArray
    """Out-of-plane coordinate [m], shape [n]."""
    sigma: FloatArray | None
    """Standard deviation of Z [m], shape [n]; None if the file gives none."""
    time: FloatArray | None
    """The file's own time column [s], shape [n]; None if it has none."""
    digit: float
    """The last printed digit of the times [s]; 0 without a time column."""


def read(
    path: Path,
    *,
    frame: Column,
    y: Column,
    Z: Column,
    sigma: Column | None = None,
    time: Column | None = None,
) -> CentreLineTable:
    """Read outline points; a frame may have any number of them.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole or falls, or a sigma is not positive.
    """
    table = read_table(path)
    numbers = table.integers(frame)
    back = np.flatnonzero(np.diff(numbers) < 0)
    if back.size:
        row = int(back[0]) + 1
        raise table.error(
            f"column '{frame.name}' is not sorted: {numbers[row]} after {numbers[row - 1]}",
            row=row,
            cure="export the points frame by frame",
        )
    deviations = None if sigma is None else table.values(sigma)
    if sigma is not None and deviations is not None and deviations.min() <= 0.0:
        row = int(np.argmin(deviations))
        raise table.error(
            f"column '{sigma.name}' is '{table.field(sigma, row)}'; it must be > 0",
            row=row,
            cure="give every point its standard deviation, or declare one for all: centre_line.sigma",
        )
    return CentreLineTable(
        path=path,
        sha256=table.sha256,
        frame=numbers,
        y=table.values(y),
        Z=table.values(Z),
        sigma=deviations,
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )
