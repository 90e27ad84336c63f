"""A homogeneous test: two columns of any table, nominal stress and stretch, strain or amount of shear."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Contents, Layout
from kolsky.readers.recordings import read_contents
from kolsky.readers.signalunits import si_unit, split_unit


@dataclass(frozen=True)
class HomogeneousTable:
    """Deformation and stress with the signs of the file."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    deformation: FloatArray
    """Stretch, nominal strain or amount of shear, as the column holds it [-], shape [n]."""
    stress: FloatArray
    """Nominal stress [Pa], shape [n]."""


def read(
    path: Path,
    *,
    deformation: str,
    stress: str,
    deformation_unit: str | None = None,
    stress_unit: str | None = None,
    layout: Layout | None = None,
) -> HomogeneousTable:
    """Read two columns of a table of text or a workbook.

    Parameters
    ----------
    path
        The file.
    deformation, stress
        Its columns, by name or by number counted from 1.
    deformation_unit, stress_unit
        Their units where the file does not say them, e.g. "%" and "kPa".
    layout
        What has to be said of the file; found in it if not given.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing, not of numbers, or its unit is missing or of another
        kind.
    """
    contents = read_contents(path, layout=layout or Layout())
    columns = [_column(contents, wanted) for wanted in (deformation, stress)]
    units = [
        _factor(contents, columns[0], deformation_unit, "1", '"1" or "%"', "--strain-unit"),
        _factor(contents, columns[1], stress_unit, "Pa", '"kPa" or "MPa"', "--stress-unit"),
    ]
    values = [column.values() * unit for column, unit in zip(columns, units, strict=True)]
    for column, value in zip(columns, values, strict=True):
        bad = np.flatnonzero(~np.isfinite(value))
        if bad.size:
            raise InputError(
                path,
                f"column '{column.name}' is not a finite number",
                line=column.place(int(bad[0])),
                cure="mend or remove the row",
            )
    return HomogeneousTable(path, contents.sha256, *values)


def column_names(path: Path, layout: Layout) -> list[str]:
    """Names and numbers of the columns of numbers, the first twenty, as messages show them.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    return _named(read_contents(path, layout=layout))


def _named(contents: Contents) -> list[str]:
    return [f"'{column.name}' ({column.number})" for column in contents.channels[:20]]


def _column(contents: Contents, wanted: str) -> Channel:
    found: Sequence[Channel] = [c for c in contents.channels if wanted in (c.name, split_unit(c.name)[0])]
    if not found and wanted.isdecimal():
        found = [c for c in contents.channels if c.number == int(wanted)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(_named(contents))
    problem = "is missing" if not found else f"is there {len(found)} times"
    raise InputError(
        contents.path,
        f"column '{wanted}' {problem}; the columns of numbers are {names}",
        cure="correct the name, or give its number",
    )


def _factor(
    contents: Contents, column: Channel, stated: str | None, base: str, allowed: str, option: str
) -> float:
    text = stated if stated is not None else column.unit
    if text is None and base == "1":
        return 1.0  # a column of strains or stretches without a unit is a pure number
    if text is None:
        raise InputError(
            contents.path,
            f"does not say the unit of column '{column.name}'",
            cure=f"say it: {option} {allowed}",
        )
    known = si_unit(text)
    if known is None or known[0] != base:
        raise InputError(
            contents.path,
            f"column '{column.name}' has the unit '{text}'",
            allowed=f"a unit such as {allowed}",
            cure=f"say it with {option}, or choose another column",
        )
    return known[1]
