"""Quasi-static uniaxial test: nominal strain and nominal stress."""

from dataclasses import dataclass
from pathlib import Path

from kolsky.readers.table import Column, FloatArray, read_table


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


def read(path: Path, *, strain: Column, stress: Column) -> UniaxialTable:
    """Read nominal strain and stress.

    Raises
    ------
    InputError
        If the file is not such a table.
    """
    table = read_table(path)
    return UniaxialTable(
        path=path, sha256=table.sha256, strain=table.values(strain), stress=table.values(stress)
    )
