"""Strict reading of a table with declared columns. No number is guessed or left out.

Without a declared layout, a plain table (UTF-8, commas, decimal points, one header line) is expected. A table
may clearly have another layout: other delimiter, decimal commas, lines above the header. That layout is then
detected, and `kolsky check` reports it.
"""

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.files import decode, read_bytes
from kolsky.readers import delimited, hdf5, matlab
from kolsky.readers.contents import check_name, find_column
from kolsky.readers.excel import EXCEL, EXCEL_97
from kolsky.readers.header import uncommented
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet, find_table
from kolsky.readers.text import (
    BLANKS,
    Dialect,
    check_one_column,
    cure_of,
    declared_decimal,
    declared_delimiter,
    decode_text,
    lines_of,
)

PLAIN = Layout(delimiter="comma", decimal=".", header_line=1)
"""UTF-8, commas, decimal points, one line of column names, then data."""
TEXT_SUFFIXES = tuple(suffix for suffix in delimited.SUFFIXES if suffix != ".xls")
"""Endings of files that are always read as text."""


def detect_layout(path: Path, data: bytes) -> Layout:
    """The detected layout of a table. It is `PLAIN` if the table is plain or no better layout is found."""
    try:
        text, encoding = decode_text(path, data)
        return _layout_of(path, lines_of(path, text), encoding)
    except InputError:
        return PLAIN  # the strict reader reports the error and its line


def _layout_of(path: Path, lines: list[str], encoding: str = "utf-8") -> Layout:
    table = find_table(path, lines, Layout())
    dialect, facts = table.dialect, table.facts
    if not facts["header"].isdecimal():
        return PLAIN
    header = int(facts["header"])
    units = int(facts["units"]) if "units" in facts else None
    utf8 = encoding.startswith("utf-8")
    plain = dialect.delimiter == "," or (dialect.fields == 1 and dialect.decimal == ".")
    if utf8 and plain and header == 1 and units is None:
        return PLAIN
    return Layout(
        encoding=None if utf8 else encoding.split()[0],
        delimiter=dialect.facts["delimiter"],
        decimal=dialect.decimal,
        header_line=header,
        units_line=units,
        first_line=table.first_line,
    )


def layout_in_words(path: Path) -> str:
    """The detected layout of a table in words; empty for plain or binary files.

    Raises InputError if the file cannot be read.
    """
    found = detect_layout(path, read_bytes(path))
    if found is PLAIN:
        return ""
    words = [Dialect(declared_delimiter(path, str(found.delimiter)), ".", 0, ()).sign.plural]
    words += ["decimal commas" if found.decimal == "," else "decimal points"]
    words += [found.encoding] if found.encoding is not None else []
    words += [f"header in line {found.header_line}"] if found.header_line != 1 else []
    words += [f"units in line {found.units_line}"] if found.units_line is not None else []
    return ", ".join(words)


@dataclass(frozen=True)
class Column:
    """A declared column of a text file."""

    name: str
    """Its name in the header line. Without a header, its number."""
    factor: float = 1.0
    """SI units per unit of the file, e.g. 1e-3 for "mm"."""
    bound: Literal["", "> 0", ">= 0"] = ""
    """Allowed range of its numbers."""
    cure: str | None = None
    """Advice if a number is out of range."""


@dataclass(frozen=True, kw_only=True)
class Table(Sheet):
    """A sheet with declared columns."""

    sha256: str
    header_line: int | None
    """Line of the column names, counted from 1. None if the file has none."""
    division: str
    """Its division into columns, and the declaration that changes it, in words."""

    def values(self, column: Column) -> FloatArray:
        """A column in SI units, shape [n_rows].

        Raises InputError if the column is missing or repeated, or if a value is not finite or out of bound.
        """
        index = self.index(column)
        if self.dialect.decimal == ",":
            # points could only separate thousands beside decimal commas
            for row, text in enumerate(self.rows):
                if "." in text and "." in (written := self.dialect.split(text)[index]):
                    message = f"column '{column.name}' is not a number: '{written[:60]}'"
                    raise self.error(message, row=row, cure=cure_of(written))
        numbers = self.numbers(index)
        least = float(numbers.min()) if column.bound else 1.0
        if least < 0.0 or (least == 0.0 and column.bound == "> 0"):
            row = int(np.argmin(numbers))
            message = f"column '{column.name}' is '{self.field(index, row)}'; it must be {column.bound}"
            raise self.error(message, row=row, cure=column.cure)
        return np.asarray(numbers * column.factor, dtype=np.float64)

    def integers(self, column: Column) -> IntArray:
        """A column of whole numbers (frame numbers), shape [n_rows].

        Raises InputError as `values`, and if a number is not whole or is too large to be exact.
        """
        numbers = self.values(column)
        bad = np.flatnonzero((numbers != np.floor(numbers)) | (np.abs(numbers) > 2**53))
        if bad.size:
            row = int(bad[0])
            message = f"column '{column.name}' is not a frame number: '{self.field(self.index(column), row)}'"
            raise self.error(message, row=row, cure="frame numbers are whole; are two columns swapped?")
        return numbers.astype(np.int64)

    def printed_digit(self, column: Column) -> float:
        """The coarsest last printed digit of a column, in SI units, e.g. 1e-11 for "-1.9950000e-04" s."""
        index, last = self.index(column), len(self.rows) - 1
        step = max(1, (last + 1) // 1000)
        fields = [self.field(index, row) for row in (*range(0, last + 1, step), last)]
        decimals = [Decimal(field) for field in fields]
        nonzero = [d for d in decimals if d != 0]
        if nonzero and any("e" in field.lower() for field in fields):
            figures = max(len(d.as_tuple().digits) for d in nonzero)
            exponent = max(d.adjusted() for d in nonzero) - figures + 1
        else:
            exponent = min(int(d.as_tuple().exponent) for d in decimals)
        return float(Decimal(1).scaleb(exponent)) * column.factor

    def check_increasing(self, column: Column, values: FloatArray | IntArray) -> None:
        """Check that a column increases from row to row.

        Raises InputError with the first line that has an equal or smaller value.
        """
        steps = np.diff(values)
        bad = np.flatnonzero(steps <= 0)
        if not bad.size:
            return
        row, index = int(bad[0]) + 1, self.index(column)
        word = "repeats" if steps[row - 1] == 0 else "is not sorted:"
        # A voltage or a displacement that was declared as time decreases often.
        swapped = bad.size > 0.05 * steps.size and bad.size > 2
        raise self.error(
            f"column '{column.name}' {word} '{self.field(index, row)}' after '{self.field(index, row - 1)}'"
            + (f" ({bad.size} such lines)" if bad.size > 1 else ""),
            row=row,
            cure="are two columns swapped? the shot file names each column"
            if swapped
            else "every sample needs a later time than the one before; export again with all digits, in "
            "order",
        )

    def index(self, column: Column) -> int:
        """The index of a column, see `find_column`."""
        cure = f"correct the column's name in the shot file ({self.division})"
        return find_column(self.path, self.names, column.name, line=self.header_line, cure=cure)


def read_table(path: Path, *, layout: Layout | None = None) -> Table:
    """Read a text, the sheet of a workbook, or the arrays of equal length of a MATLAB or HDF5 file.

    A text has commas, decimal points and one header line, unless another layout is declared or detected.

    ``path``: the file. ``layout``: encoding, delimiter, decimal sign, comment sign of header lines, header
    line and first line. Defaults are UTF-8, a comma, a point, the first line and the line after it. None: a
    clearly different layout is detected, see `kolsky.readers.table`. Raises InputError if the file cannot be
    read (see `kolsky.readers.text`) or has no data. The same error is raised if a line is empty or has
    another number of fields than the header, or if the layout is impossible or does not fit.
    """
    source: Any = None  # the format of a workbook or a file of arrays; None for text
    if path.suffix.lower() in TEXT_SUFFIXES:
        check_name(path)
    else:
        source = next((form for form in (EXCEL, EXCEL_97, matlab, hdf5) if form.sniff(path)), None)
    if source is not None:
        named = layout or Layout()
        sha256, lines = source.table_lines(path, named.sheet)
        with suppress(InputError):  # without a layout that is found, this reader reports the error
            named = _layout_of(path, lines) if named == Layout(sheet=named.sheet) else named
        layout = replace(named, encoding=None, delimiter="tab", decimal=".")
    else:
        if layout is not None and layout.sheet is not None:
            message = f"is declared with the sheet '{layout.sheet}', and it is text"
            raise InputError(path, message, cure="leave sheet out")
        data = read_bytes(path)
        sha256 = hashlib.sha256(data).hexdigest()
        layout = layout or detect_layout(path, data)
        text = decode(path, data) if layout.encoding is None else decode_text(path, data, layout.encoding)[0]
        lines = lines_of(path, text, strict=True)
    delimiter = declared_delimiter(path, layout.delimiter or "comma")
    decimal = declared_decimal(path, layout.decimal or ".")
    if delimiter == decimal:
        message = f"is declared to have {decimal!r} as delimiter and as decimal sign"
        raise InputError(path, message, cure='give the other one too, e.g. delimiter = ";"')
    dialect = Dialect(delimiter, decimal, 0, (), quoted=layout is not PLAIN)
    header_line = 1 if layout.header_line is None else layout.header_line
    first = layout.first_line or max(header_line, layout.units_line or 0) + 1
    for name, line in (("header_line", header_line), ("first_line", first)):
        if line > len(lines) and not (name == "first_line" and layout.first_line is None):
            raise InputError(path, f"{name} = {line}", allowed=f"at most {len(lines)}, the file's lines")
    if first <= header_line:
        raise InputError(path, f"first_line = {first}", allowed=f"below the header in line {header_line}")
    rows = lines[first - 1 :]
    if dialect.delimiter == " ":
        rows = [row.strip() for row in rows]
    if not rows:
        raise InputError(path, "has a header but no data", cure="export it again")
    if header_line:
        heading = lines[header_line - 1]
        heading = uncommented(heading, layout.comment) if layout.comment else heading
        names = tuple(replace(dialect, quoted=True).split(heading))
    else:
        names = tuple(str(i + 1) for i in range(len(dialect.split(rows[0]))))
    names = _names_of_rows(names, rows, dialect)
    if layout is PLAIN and len(names) == 1:
        check_one_column(path, lines)
    dialect = replace(dialect, fields=len(names), numeric=tuple(range(len(names))))
    word, start = ("line" if source is None else "row"), first
    if source in (matlab, hdf5):
        word, start = "entry", 1  # arrays have no line of names
    division = f"columns are separated by {dialect.sign.plural}; a layout may declare others"
    if source in (EXCEL, EXCEL_97):
        division = f"names were taken from row {header_line}; header_line and sheet in a layout change that"
    elif source is not None:
        division = "the arrays as long as the longest are its columns; `kolsky channels FILE` lists all"
    table = Table(
        path=path,
        dialect=dialect,
        rows=rows,
        first_line=start,
        names=names,
        units=(None,) * len(names),
        word=word,
        counted="the header has" if header_line else "the first line has",
        sha256=sha256,
        header_line=header_line or None,
        division=division,
    )
    try:
        table.check_fields()
    except InputError:
        if layout is PLAIN and len(names) == 1:
            find_table(path, lines, Layout())  # the error names the dialect that the lines almost have
        raise
    return table


def _names_of_rows(names: tuple[str, ...], rows: Sequence[str], dialect: Dialect) -> tuple[str, ...]:
    """Names without an empty last one: only the names or only the rows may end with a delimiter."""
    if dialect.delimiter == BLANKS.character or not names:
        return names
    ends = [row.rstrip().endswith(dialect.delimiter) for row in rows]
    if all(ends) and names[-1] and all(len(dialect.split(row)) == len(names) + 1 for row in rows):
        return (*names, "")
    if len(names) > 1 and not names[-1] and all(len(dialect.split(row)) == len(names) - 1 for row in rows):
        return names[:-1]
    return names
