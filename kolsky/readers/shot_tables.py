"""The tables of a shot: frame times, displacement of the flyer, outline, quasi-static curve."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Layout
from kolsky.readers.table import Column, Table, read_table

MOST_MODES = 1000
"""Most columns of common uncertainties that are read."""


@dataclass(frozen=True, kw_only=True)
class ShotTable:
    """Columns of a file, row by row."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    first_line: int = 2
    """Line of the first row, counted from 1."""

    def line(self, row: int) -> int:
        """Line of a row of data that is counted from 0."""
        return self.first_line + row


@dataclass(frozen=True, kw_only=True)
class FrameTimes(ShotTable):
    """When each frame was taken, on the clock of the file."""

    frame: IntArray
    """Frame numbers, increasing, shape [n_frames]."""
    time: FloatArray
    """Frame times, increasing [s], shape [n_frames]."""
    digit: float
    """The last printed digit of the times [s]."""


@dataclass(frozen=True, kw_only=True)
class FlyerTable(ShotTable):
    """The flyer's displacement with the sign of the file."""

    frame: IntArray
    """Frame numbers, increasing, shape [n]."""
    displacement: FloatArray
    """Displacement, sign as in the file [m], shape [n]."""
    time: FloatArray | None
    """The file's own time column [s], shape [n]; None if it has none."""
    digit: float
    """The last printed digit of the times [s]; 0 without a time column."""


@dataclass(frozen=True, kw_only=True)
class OutlineTable(ShotTable):
    """Points of the specimen's outline in the coordinates of the file, frame by frame."""

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


@dataclass(frozen=True, kw_only=True)
class UniaxialTable(ShotTable):
    """Strain and stress of a quasi-static test with the signs of the file."""

    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty of each stress alone [Pa], shape [n]; None if there is no such column."""
    modes: FloatArray | None = None
    """Standard uncertainties that move all points together [Pa], shape [n_modes, n]; None likewise."""


def read_frame_times(path: Path, *, frame: Column, time: Column, layout: Layout | None = None) -> FrameTimes:
    """Frame numbers and times of the cameras.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole, or numbers or times do not increase.
    """
    table = read_table(path, layout=layout)
    numbers = _frames(table, frame)
    times = table.values(time)
    table.check_increasing(time, times)
    return FrameTimes(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=numbers,
        time=times,
        digit=table.printed_digit(time),
    )


def read_flyer(
    path: Path,
    *,
    frame: Column,
    displacement: Column,
    time: Column | None = None,
    layout: Layout | None = None,
) -> FlyerTable:
    """Frame numbers, displacements of the flyer and, if there is one, the time column.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole, or frame numbers do not increase.
    """
    table = read_table(path, layout=layout)
    return FlyerTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=_frames(table, frame),
        displacement=table.values(displacement),
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )


def read_outline(
    path: Path,
    *,
    frame: Column,
    y: Column,
    Z: Column,
    sigma: Column | None = None,
    time: Column | None = None,
    layout: Layout | None = None,
) -> OutlineTable:
    """Points (y, Z) of the specimen's outline; a frame may have any number of them.

    Raises
    ------
    InputError
        If the file is not such a table, a frame number is not whole or falls, or a sigma is not positive.
    """
    table = read_table(path, layout=layout)
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
    return OutlineTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=numbers,
        y=table.values(y),
        Z=table.values(Z),
        sigma=deviations,
        time=None if time is None else table.values(time),
        digit=0.0 if time is None else table.printed_digit(time),
    )


def read_uniaxial(
    path: Path,
    *,
    strain: Column,
    stress: Column,
    sigma: Column | None = None,
    modes: Column | None = None,
    layout: Layout | None = None,
) -> UniaxialTable:
    """Nominal strain and stress of a quasi-static test, with what is known of their uncertainty.

    Parameters
    ----------
    path
        The file.
    strain, stress, sigma
        Their columns.
    modes
        All columns whose names begin with this name.
    layout
        As in `kolsky.readers.table.read_table`.

    Raises
    ------
    InputError
        If the file is not such a table, or an uncertainty is negative.
    """
    table = read_table(path, layout=layout)
    return UniaxialTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        strain=table.values(strain),
        stress=table.values(stress),
        sigma=None if sigma is None else _sigma(table, sigma),
        modes=None if modes is None else _modes(table, modes),
    )


def _frames(table: Table, frame: Column) -> IntArray:
    numbers = table.integers(frame)
    table.check_increasing(frame, numbers)
    return numbers


def _sigma(table: Table, column: Column) -> FloatArray:
    values = table.values(column)
    bad = np.flatnonzero(values < 0.0)
    if bad.size:
        row = int(bad[0])
        raise table.error(
            f"column '{column.name}' is {table.field(column, row)}, a standard uncertainty is >= 0", row=row
        )
    return values


def _modes(table: Table, beginning: Column) -> FloatArray:
    """All columns whose names begin alike, shape [n_modes, n]."""
    names = [name for name in table.header if name.startswith(beginning.name)]
    if not 1 <= len(names) <= MOST_MODES:
        raise InputError(
            table.path,
            f"{len(names)} columns begin with '{beginning.name}', 1 to {MOST_MODES} are read",
            line=table.header_line,
            cure="correct the beginning in the shot file, or leave it out",
        )
    return np.array([table.values(Column(name, beginning.factor)) for name in names])
