"""Declared layout of a recorder's file or of a table. The command line makes its options from it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from kolsky.base.options import Option

FOUND = "found in the file"
ColumnId = str | int
"""A column by its name in the file, or by its number, counted from 1."""


@dataclass(frozen=True)
class Layout:
    """Declared layout of a recorder's file. Fields that are None are detected in the file.

    Declared fields take precedence over the file. The detected layout is in `Contents.facts`.
    """

    format: Annotated[str | None, Option("Format of the file.", show_default=FOUND)] = None
    """Name of the format, a key of `kolsky.readers.recordings.FORMATS`."""
    encoding: Annotated[str | None, Option("Encoding of a text file.", show_default=FOUND)] = None
    """Of a text file: one of `kolsky.readers.text.ENCODINGS`."""
    delimiter: Annotated[str | None, Option("comma, semicolon, tab or blanks.", show_default=FOUND)] = None
    """Of a text file: name or character of one of `kolsky.readers.text.DELIMITERS`."""
    decimal: Annotated[str | None, Option('Decimal sign: "." or ",".', show_default=FOUND)] = None
    """Decimal sign of a text file: "." or ","."""
    comment: str | None = None
    """Start of comment lines, e.g. "#". They may be at any place in the file."""
    header_line: Annotated[
        int | None, Option("Line of the column names; 0: none.", min=0, show_default=FOUND)
    ] = None
    """Line of the column names, counted from 1; 0 if the file has none."""
    units_line: int | None = None
    """Line of the columns' units, counted from 1; 0 if the file has none."""
    first_line: int | None = None
    """Line of the first samples, counted from 1. The lines above are metadata."""
    sheet: Annotated[str | None, Option("Sheet of a workbook.", metavar="NAME", show_default="found")] = None
    """Sheet of a workbook."""
    time: Annotated[
        ColumnId | Mapping[str, ColumnId] | None,
        Option("The time column, by name or number.", read=lambda option, text: text),
    ] = None
    """The time column, or one for each channel: channel -> its time column."""
    time_unit: Annotated[str | None, Option("Unit of the time column, e.g. ms.")] = None
    """Unit of the time columns, e.g. "ms"."""
    interval: Annotated[
        float | None, Option('Time between samples, e.g. "100 ns".', unit="s", show_default=FOUND)
    ] = None
    """Sampling interval [s]."""
    start: float | None = None
    """Time of the first sample on the instrument's clock [s]."""
    unit: str | None = None
    """Unit of the samples, e.g. "mV"."""
    full_scale: float | None = None
    """Largest magnitude of the recorder, in the samples' SI unit; None: a flat top is clipping."""
