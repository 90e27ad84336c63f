"""Quasi-static uniaxial test: nominal strain and nominal stress, with what is known of their uncertainty."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.table import Column, Table, read_table

MOST_MODES = 1000
"""Most columns of common uncertainties that are read."""


@dataclass(frozen=True)
class UniaxialTable:
    """Strain and stress with the signs of the file; row i is line i + 2."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    strain: FloatArray
    """Nominal strain [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty of each stress alone [Pa], shape [n]; None if there is no such column."""
    modes: FloatArray | None = None
    """Standard uncertainties that move all points together [Pa], shape [n_modes, n]; None likewise."""


def read(
    path: Path, *, strain: Column, stress: Column, sigma: Column | None = None, modes: Column | None = None
) -> UniaxialTable:
    """Read nominal strain and stress.

    Parameters
    ----------
    path
        The file.
    strain, stress, sigma
        Their columns.
    modes
        All columns whose names begin with this name.

    Raises
    ------
    InputError
        If the file is not such a table, or an uncertainty is negative.
    """
    table = read_table(path)
    return UniaxialTable(
        path=path,
        sha256=table.sha256,
        strain=table.values(strain),
        stress=table.values(stress),
        sigma=None if sigma is None else _sigma(table, sigma),
        modes=None if modes is None else _modes(table, modes),
    )


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
            line=1,
            cure="correct the beginning in the shot file, or leave it out",
        )
    return np.array([table.values(Column(name, beginning.factor)) for name in names])
