"""A design somebody else chose: a CSV file of parameter values, units in the header."""

import csv
import re
from io import StringIO
from pathlib import Path

import numpy as np

from doe import Box, Design, from_points
from kolsky.base.errors import InputError
from kolsky.base.units import UnitError, quantity
from kolsky.inverse.parameters import checked_value, parameter
from kolsky.readers.text import decode, matched, read_bytes

MOST_RUNS = 1_000_000
"""Most runs of a sweep; their histories must fit into memory."""
HEADER = re.compile(r"\s*([a-z_]+)\s*(?:\(\s*([^()]+?)\s*\))?\s*")


def read_design(path: Path) -> Design:
    """Read a design from a CSV file: a header "stiffness_factor (1), damping (us)", then one point a line.

    A name without a unit is in SI. The design's box spans the values of each column.

    Raises
    ------
    InputError
        If the file cannot be read, a name or unit is unknown or stands twice, a value is not a number or
        outside its allowed range, a column holds one value only, or there are too many points.
    """
    text = decode(path, read_bytes(path))
    rows = csv.reader(StringIO(text, newline=""), strict=True)
    points: list[list[float]] = []
    try:
        columns = _header(path, next(rows, []))
        for row in rows:
            if not row:
                continue
            if len(points) == MOST_RUNS:
                raise InputError(path, "has too many points", allowed=f"at most {MOST_RUNS}")
            points.append(_point(path, rows.line_num, row, columns))
    except csv.Error as error:
        raise InputError(
            path,
            f"cannot be read as a CSV file: {error}",
            line=rows.line_num,
            cure="give a text file with commas and a header",
        ) from None
    if len(points) < 2:
        raise InputError(path, f"holds {len(points)} points", allowed="2 or more", cure="a point a line")
    values = np.array(points)
    for (name, _), column in zip(columns, values.T, strict=True):
        if column.min() == column.max():
            raise InputError(
                path, f"{name} has one value only", cure=f"leave it out and hold it with -p {name}="
            )
    box = Box(tuple(name for name, _ in columns), tuple(values.min(axis=0)), tuple(values.max(axis=0)))
    return from_points(box, values)


def _header(path: Path, cells: list[str]) -> list[tuple[str, float]]:
    """Name and SI value of the unit of each column."""
    columns: list[tuple[str, float]] = []
    for cell in cells:
        match = matched(HEADER, cell)
        if match is None:
            raise InputError(
                path, f"{cell[:60]!r} is no column", line=1, cure='write NAME (UNIT), e.g. "damping (us)"'
            )
        name, unit = match[1], match[2]
        try:
            si = parameter(name).unit
            factor = 1.0 if unit is None or unit == si else quantity(f"1 {unit}", si)
        except (ValueError, UnitError) as error:
            raise InputError(
                path,
                str(error),
                line=1,
                cure='write NAME (UNIT), e.g. "damping (us)"; the names are those of --vary',
            ) from None
        if name in dict(columns):
            raise InputError(path, f"{name} stands twice", line=1, cure="keep one of the columns")
        columns.append((name, factor))
    if not columns:
        raise InputError(path, "has no header", cure='write NAME (UNIT), e.g. "damping (us)"')
    return columns


def _point(path: Path, line: int, row: list[str], columns: list[tuple[str, float]]) -> list[float]:
    if len(row) != len(columns):
        raise InputError(
            path,
            f"has {len(row)} values where the header has {len(columns)}",
            line=line,
            cure="give every point a value of each parameter",
        )
    point = []
    for cell, (name, factor) in zip(row, columns, strict=True):
        try:
            number = float(cell)
        except ValueError:
            raise InputError(
                path, f"{cell[:60]!r} is not a number ({name})", line=line, cure="mend it"
            ) from None
        try:
            point.append(checked_value(name, number * factor))  # refuses NaN too
        except ValueError as error:
            raise InputError(path, str(error), line=line, cure="correct the value or its unit") from None
    return point
