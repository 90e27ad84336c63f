"""Tables of measurements by column, in SI: frame tables of a shot, and tests of materials."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.units import DIMENSIONS, UnitError, dimension_of, unit_factor
from kolsky.readers.contents import Channel, Contents, find_column
from kolsky.readers.header import heading_unit, name_without_unit, si_unit, split_unit
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import check_finite, read_contents
from kolsky.readers.table import Column, read_table


@dataclass(frozen=True, kw_only=True)
class FrameTable:
    """Rows of a file. Each row belongs to one frame."""

    path: Path
    sha256: str
    first_line: int = 2
    """Line of the first row, counted from 1."""
    frame: IntArray
    """Frame number of each row, shape [n]."""
    time: FloatArray = field(default_factory=lambda: np.empty(0))
    """The times in the file's time column [s], shape [n]. Shape [0] if it has none."""
    digit: float = 0.0
    """The last printed digit of the times [s]; 0 without a time column."""
    columns: Mapping[str, FloatArray] = field(default_factory=dict)
    """Its other columns by quantity, sign as in the file, SI, shape [n] each."""

    def line(self, row: int) -> int:
        """Line of a row of data. Rows are counted from 0."""
        return self.first_line + row


def read_frame_table(
    path: Path,
    *,
    frame: Column,
    time: Column | None = None,
    columns: Mapping[str, Column | None] | None = None,
    clock: bool = False,
    points: bool = False,
    layout: Layout | None = None,
) -> FrameTable:
    """Read a table with frame numbers in its rows.

    ``frame``, ``time``: their columns. ``columns``: the other columns to read; None is left out. ``clock``:
    True if the times must increase. ``points``: True if a frame may have several rows. Raises InputError if
    the file is not such a table, if a frame number is not whole, or for numbers out of order.
    """
    table = read_table(path, layout=layout)
    numbers = table.integers(frame)
    back = np.flatnonzero(np.diff(numbers) < 0)
    if points and back.size:
        row = int(back[0]) + 1
        message = f"column '{frame.name}' is not sorted: {numbers[row]} after {numbers[row - 1]}"
        raise table.error(message, row=row, cure="export the points frame by frame")
    if not points:
        table.check_increasing(frame, numbers)
    times = np.empty(0) if time is None else table.values(time)
    if clock and time is not None:
        table.check_increasing(time, times)
    return FrameTable(
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
        frame=numbers,
        time=times,
        digit=0.0 if time is None else table.printed_digit(time),
        columns={name: table.values(column) for name, column in (columns or {}).items() if column},
    )


@dataclass(frozen=True)
class WantedColumn:
    """A column of a material test to read, in any format."""

    column: str
    """Its name, or its number counted from 1."""
    base: str
    """SI unit of its quantity."""
    unit: str | None = None
    """Its unit, if the file does not state it."""
    pure: bool = False
    """True if numbers without a unit are dimensionless ratios."""
    option: str = ""
    """How a unit is declared, for messages. Empty: `--unit 'COLUMN=UNIT'`."""


def read_columns(
    path: Path, wanted: Mapping[str, WantedColumn], layout: Layout | None = None
) -> tuple[dict[str, FloatArray], str]:
    """Read some columns of a text, a workbook or a file of arrays.

    Returns: key of ``wanted`` -> values in SI, shape [n] each; the hash of the file. Raises InputError if the
    file cannot be read, or if a column is missing, repeated or has values that are not finite. The same error
    is raised if its unit is unknown or of another quantity.
    """
    layout = layout or Layout()
    contents = read_contents(path, layout=layout)
    values: dict[str, FloatArray] = {}
    for quantity, one in wanted.items():
        channel = _channel(contents, one.column, quantity)
        values[quantity] = channel.values() * _factor(path, channel, one, quantity)
        check_finite(path, channel, values[quantity])
    return values, contents.sha256


QUANTITIES: Mapping[str, tuple[str, re.Pattern[str]]] = {
    "strain": ("1", re.compile(r"strain|dehnung|stauchung|d[ée]formation|epsilon|ε", re.IGNORECASE)),
    "stress": ("Pa", re.compile(r"stress|spannung|contrainte|σ", re.IGNORECASE)),
    "stretch": ("1", re.compile(r"stretch|streckung|λ", re.IGNORECASE)),
    "displacement": (
        "m",
        re.compile(
            r"displ|extension|elongation|travel|stroke|crosshead|compression|\b(standard)?weg|traverse"
            r"|d[ée]placement|allongement|verschiebung|verlängerung|deformation",
            re.IGNORECASE,
        ),
    ),
    "force": ("N", re.compile(r"force|load|kraft|\blast|fuerza|carga", re.IGNORECASE)),
}
"""Quantity of a test -> its SI unit and the words that identify it in column names."""
_NOT_THE_QUANTITY = re.compile(
    r"rate|true|wahre|hencky|sigma|std|uncert|unsich|incert|écart|geschw|speed|lateral", re.IGNORECASE
)
"""Words in names of related columns, such as rates and uncertainties. Such a column is not the quantity."""


def recognised_columns(path: Path, layout: Layout) -> dict[str, str]:
    """Quantity -> the column identified by name and unit. Quantities without a unique column are left out.

    ``layout``: its declared layout. Raises InputError if it cannot be read.
    """
    found: dict[str, str] = {}
    channels = read_contents(path, layout=layout).channels
    for quantity, (base, words) in QUANTITIES.items():
        fitting = []
        for channel in channels:
            name, unit = name_without_unit(channel.name), channel.unit or heading_unit(channel.name)
            named = words.search(name) is not None and _NOT_THE_QUANTITY.search(name) is None
            if named and (unit is None or dimension_of(unit, (base,))):
                fitting.append(channel.name)
        if len(fitting) == 1:
            found[quantity] = fitting[0]
    return found


def column_names(path: Path, layout: Layout) -> list[str]:
    """Names and numbers of the first twenty numeric columns, for messages.

    Raises InputError if the file cannot be read.
    """
    return _numbered(read_contents(path, layout=layout))


def _numbered(contents: Contents) -> list[str]:
    return [f"'{column.name}' ({column.number})" for column in contents.channels[:20]]


def _channel(contents: Contents, column: str, quantity: str) -> Channel:
    """The column with a heading, with a heading without its unit, or with a number."""
    channels = (*contents.channels, *contents.times)
    names = [c.name for c in channels]
    if column not in names and f"/{column}" not in names:
        for i, channel in enumerate(channels):
            bare = name_without_unit(channel.name)
            if column in (bare, f"{bare} ({channel.unit})", split_unit(channel.name)[0]):
                names[i] = column
    words = ", ".join(_numbered(contents)) + contents.without_numbers()
    numbers = [c.number for c in channels]
    return channels[
        find_column(
            contents.path, names, column, numbers=numbers, listed=words, purpose=f" for the {quantity}"
        )
    ]


def _factor(path: Path, channel: Channel, wanted: WantedColumn, quantity: str) -> float:
    text = wanted.unit or channel.unit or heading_unit(channel.name)
    if text is None and wanted.pure:
        return 1.0
    known = si_unit(text) if text is not None else None
    if known is not None and known[0] == wanted.base:
        return known[1]
    words, example = DIMENSIONS[wanted.base]
    try:
        if text is None:
            raise UnitError(channel.name, "has no unit", wanted.base)
        return unit_factor(text, wanted.base)
    except UnitError:
        problem = "has no unit" if text is None else f"is in {text!r}"
        sample = example.split(" ", 1)[1]
        option = f"{wanted.option} '{sample}'" if wanted.option else f"--unit '{channel.name}={sample}'"
        message = f"column '{channel.name}' for the {quantity} {problem}"
        allowed = f"in a unit of {words}"
        raise InputError(path, message, allowed=allowed, cure=f"declare it: {option}") from None
