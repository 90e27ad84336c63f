"""A table of text lines with names, units and metadata, and its channels with clocks."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.units import DIMENSIONS, dimension_of
from kolsky.readers.contents import (
    LARGEST_SAMPLE,
    Channel,
    Clock,
    check_samples,
    column_clock,
    column_digits,
    find_column,
    stated_clock,
)
from kolsky.readers.header import (
    KEYS,
    HeaderClock,
    bare_key,
    header_clock,
    si_unit,
    split_unit,
    stated_samples,
    time_factor,
    time_unit,
    uncommented,
)
from kolsky.readers.layout import ColumnId, Layout
from kolsky.readers.text import COMMA, Dialect, cure_of, find_dialect, full_match


@dataclass(frozen=True)
class Sheet:
    """Lines divided into fields. Line i of `rows` is line `first_line + i` of the file."""

    path: Path
    dialect: Dialect
    """Division of its lines into fields."""
    rows: Sequence[str]
    """The lines of samples."""
    first_line: int
    """Line number of the first row, counted from 1."""
    names: tuple[str, ...]
    """Column names. Without a header they are "1", "2", ..."""
    units: tuple[str | None, ...]
    """Units as written, or None."""
    metadata: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Key -> the fields after it."""
    word: str = "line"
    """Name of a row in messages: "line", "row" of a workbook, or "entry" of arrays."""
    counted: str = "the other lines have"
    """Text for messages: the reference with the correct number of fields."""
    _checked: list[bool] = field(default_factory=list, compare=False, repr=False)
    """It is not empty after the fields of all rows have been counted."""

    def numbers(self, column: int, *, gaps: bool = False) -> FloatArray:
        """The numbers of a column in the unit of the file, shape [n].

        ``column``: index of the column, counted from 0. ``gaps``: True if NaN is allowed, as in tables with
        lost points. Raises InputError for another number of fields than in the first line, or a field that is
        no finite number.
        """
        self.check_fields()
        rows: Sequence[str] = self.rows
        if self.dialect.decimal == ",":
            rows = [row.replace(",", ".") for row in rows]
        if self.dialect.quoted and '"' in rows[0]:
            rows = [row.replace('"', "") for row in rows]
        delimiter = None if self.dialect.delimiter == " " else self.dialect.delimiter
        try:
            numbers = np.loadtxt(rows, delimiter=delimiter, usecols=column, comments=None, ndmin=1)
        except ValueError as error:
            for row in range(len(self.rows)):  # the fast method does not tell which number is bad
                text = self.dialect.split(self.rows[row])[column]
                if not self.dialect.is_number(text):
                    message = f"column '{self.names[column]}' is not a number: '{text[:60]}'"
                    raise self.error(message, row, cure_of(text)) from None
            message = f"column '{self.names[column]}' cannot be read: {error}"
            raise self.error(message, None, "export again") from None
        bad = np.flatnonzero(~(np.abs(numbers) <= LARGEST_SAMPLE) & ~(np.isnan(numbers) & gaps))
        if bad.size:
            row = int(bad[0])
            problem = (
                f"larger than {LARGEST_SAMPLE:g}" if np.isfinite(numbers[row]) else "not a finite number"
            )
            raise self.error(
                f"column '{self.names[column]}' is {problem}: '{self.field(column, row)[:60]}'"
                + (f", the first of {bad.size}" if bad.size > 1 else ""),
                row,
                "leave the line out, or export again without gaps",
            )
        return np.asarray(numbers, dtype=np.float64)

    def field(self, column: int, row: int) -> str:
        """The text of one field, with a decimal point."""
        text = self.dialect.split(self.rows[row])[column]
        return text.replace(",", ".") if self.dialect.decimal == "," else text

    def column(self, wanted: ColumnId, what: str = "column") -> int:
        """The index of a column, see `find_column`."""
        line = max(1, self.first_line - 1) if self.word == "line" else None
        return find_column(
            self.path, self.names, wanted, what, numbers=range(1, len(self.names) + 1), line=line
        )

    def error(self, message: str, row: int | None = None, cure: str | None = None) -> InputError:
        """An error about this file. `row` counts rows of samples from 0."""
        line = None if row is None else self.first_line + row
        if self.word != "line" and line is not None:
            return InputError(self.path, f"{self.word} {line}: {message}", cure=cure)
        return InputError(self.path, message, line=line, cure=cure)

    def check_fields(self) -> None:
        """Check the number of fields of every line. No line may be empty.

        Raises InputError for the first such line.
        """
        count = self.dialect.fields
        character = self.dialect.delimiter
        # The usual case is checked in one pass: delimiters without quotes, more than one column.
        plain = character != " " and count > 1 and '"' not in self.rows[0]
        if self._checked or (plain and all(row.count(character) == count - 1 for row in self.rows)):
            self._checked.append(True)
            return
        for number, row in enumerate(self.rows):
            fields = len(self.dialect.split(row))
            if fields == count and row.strip():
                continue
            last, cure = number == len(self.rows) - 1, "correct the line or export again"
            if not row.strip():
                cure = "is there a second table below? keep one table in a file, without empty lines"
            elif fields == 2 * count and character == ",":
                cure = "are the commas decimal signs too? export with semicolons between the columns"
            elif last:
                cure = "copy or export the file again, without remarks below the numbers"
            raise self.error(
                f"has {fields} fields, {self.counted} {count}"
                + ("; the file seems to be cut off" if last and fields < count else "")
                if row.strip()
                else "is an empty line between samples",
                number,
                cure,
            )
        self._checked.append(True)


def _first_samples(path: Path, lines: Sequence[str], dialect: Dialect, layout: Layout) -> int:
    """Index of the first line of samples: the declared one, else the first that has their form."""
    if layout.first_line is not None:
        if not 1 <= layout.first_line <= len(lines):
            message = f"first_line = {layout.first_line}"
            raise InputError(path, message, allowed=f"in [1, {len(lines)}], the file's lines")
        return layout.first_line - 1
    above = max(layout.header_line or 0, layout.units_line or 0)
    for index in range(above, len(lines)):
        if dialect.is_samples(lines[index]):
            return index
    message = "has a header but no data"
    raise InputError(path, message, line=len(lines), cure="export it again, or declare first_line")


def _heading_lines(
    path: Path, lines: Sequence[str], first: int, dialect: Dialect, layout: Layout
) -> tuple[int, int]:
    """Indices of the lines of names (the last with as many fields as the samples) and of units, or -1."""
    fitting = [i for i in range(first) if _fits(dialect, lines[i])]
    if not fitting and first:
        _check_decimal_commas(path, lines, first, dialect)
        fitting = [first - 1] if _fits_mostly(dialect, lines[first - 1]) else []
    for stated in (layout.header_line, layout.units_line):
        if stated and stated - 1 not in fitting:
            found = len(dialect.split(lines[stated - 1])) if stated <= first else 0
            message = f"has {found} fields here, the samples below have {dialect.fields}"
            cure = "correct header_line and units_line in the layout"
            raise InputError(path, message, line=stated, cure=cure)
    units_line = -1 if layout.units_line is None else layout.units_line - 1
    if layout.units_line is None and fitting and _only_units(dialect, lines[fitting[-1]], len(fitting) > 1):
        units_line = fitting[-1] if layout.header_line != fitting[-1] + 1 else -1
    if layout.header_line is None:
        above = [i for i in fitting if units_line < 0 or i < units_line]
        header_line = above[-1] if above else -1
        if header_line >= 0:
            _check_heading(path, dialect, lines[header_line], header_line)
    else:
        header_line = layout.header_line - 1
    return header_line, units_line


def _cells(dialect: Dialect, line: str) -> list[str]:
    return dialect.split(line)[: dialect.fields]


def _fits(dialect: Dialect, line: str) -> bool:
    """True if a line can contain names or units of all numeric columns."""
    cells = dialect.split(line)
    if len(cells) <= max(dialect.numeric) or not all(cells[i] for i in dialect.numeric):
        return False
    short = set(range(len(cells), dialect.fields))  # only a last delimiter of the samples may have no name
    return short <= set(dialect.empty) and bare_key(cells[0]) not in KEYS


def _fits_mostly(dialect: Dialect, line: str) -> bool:
    """True if the line above the samples names most numeric columns; merged cells name only the first."""
    cells = dialect.split(line)
    if len(cells) < dialect.fields or any(dialect.is_number(cells[i]) for i in dialect.numeric):
        return False
    named = sum(bool(cells[i]) for i in dialect.numeric)
    return 2 * named > len(dialect.numeric) and bare_key(cells[0]) not in KEYS


def _check_decimal_commas(path: Path, lines: Sequence[str], first: int, dialect: Dialect) -> None:
    """Raise InputError if integers are twice as many as names. Example: "0,12,3,5" below "Strain,Stress"."""
    names = [cell for cell in dialect.split(lines[first - 1]) if cell]
    twice = len(names) > 1 and 2 * len(names) == dialect.fields == len(dialect.numeric)
    if twice and dialect.delimiter == COMMA.character and not any(map(dialect.is_number, names)):
        message = f"has {dialect.fields} numbers between commas, and {len(names)} names"
        cure = "are the commas decimal signs too? export with semicolons between the columns"
        raise InputError(path, message, line=first + 1, cure=cure)


def _only_units(dialect: Dialect, line: str, below: bool) -> bool:
    """True for a line of units. Without a line above it, units that are not of signals may be names: "m"."""
    cells = [cell for cell in _cells(dialect, line) if cell]
    units = [
        si_unit(cell) is not None
        or cell.lower() == "sequence"
        or dialect.is_number(cell)
        or (below and dimension_of(cell.strip("()[] ") or "-", DIMENSIONS) != "")
        for cell in cells
    ]
    return all(units) and any(not dialect.is_number(cell) for cell in cells)


def _check_heading(path: Path, dialect: Dialect, line: str, number: int) -> None:
    """Check that a heading has words. Channels may have the names 1, 2, 3, but not 0.0125."""
    cells = _cells(dialect, line)
    numbers = [cells[i] for i in dialect.numeric if dialect.is_number(cells[i])]
    other = replace(dialect, decimal="," if dialect.decimal == "." else ".")
    commas = [c for i in dialect.numeric if other.is_number(c := cells[i]) and not dialect.is_number(c)]
    if commas:
        raise InputError(
            path,
            f"has the number '{commas[0][:60]}', the lines below have the decimal sign '{dialect.decimal}'",
            line=number + 1,
            cure="export all numbers with one decimal sign",
        )
    if numbers and not all(text.isdecimal() for text in numbers):
        wrong = next((cell for cell in cells if not dialect.is_number(cell)), "")
        message = f"cannot be read as a header or as samples: '{wrong[:60]}' next to the number {numbers[0]}"
        cure = "correct the line, or give header_line in the layout"
        raise InputError(path, message, line=number + 1, cure=cure)


LONGEST_HEADER = 5000
"""Maximum number of lines above the samples."""


@dataclass(frozen=True, kw_only=True)
class FoundTable(Sheet):
    """Lines of unknown origin, recognized as a table."""

    above: list[str]
    """The lines above the samples, without comment signs."""
    facts: dict[str, str]
    """Lines of names and units, counted from 1, in words."""
    headings: set[int]
    """Indices of the lines with names and units."""


def find_table(
    path: Path, lines: list[str], layout: Layout, *, sparse: bool = False, word: str = "line"
) -> FoundTable:
    """Recognize a table in the lines of a text: delimiter, decimal sign, samples, names and units.

    ``layout``: the declared layout; other properties are detected. ``sparse``: True if a numeric column may
    be empty in most rows. ``word``: name of a line in messages. Raises InputError if no column is numeric, if
    no line has the form of samples, or if a declaration does not fit.
    """
    dialect = find_dialect(path, lines, delimiter=layout.delimiter, decimal=layout.decimal, word=word)
    if dialect.delimiter == " ":
        lines = [line.strip() for line in lines]
    first = _first_samples(path, lines, replace(dialect, empty=()) if sparse else dialect, layout)
    if first > LONGEST_HEADER:
        message = f"has {first} {word}s above its samples, more than the {LONGEST_HEADER} that are read"
        cure = "is it the right file? if so, export the samples alone"
        raise InputError(path, message, line=first + 1, cure=cure)
    above = [uncommented(line, layout.comment) for line in lines[:first]]
    header_line, units_line = _heading_lines(path, above, first, dialect, layout)
    headings = _cells(dialect, above[header_line]) if header_line >= 0 else []
    headings += [""] * (dialect.fields - len(headings))
    units = [split_unit(heading)[1] for heading in headings]
    facts = {"header": str(header_line + 1) if header_line >= 0 else "none; columns have numbers"}
    if units_line >= 0:
        facts["units"] = str(units_line + 1)
        for i, text in enumerate(_cells(dialect, above[units_line])):
            plain = text.strip("()[] ")
            units[i] = plain if plain and not dialect.is_number(plain) else units[i]
    return FoundTable(
        path=path,
        dialect=dialect,
        rows=lines[first:],
        first_line=first + 1,
        names=tuple(heading or str(i + 1) for i, heading in enumerate(headings)),
        units=tuple(units),
        word=word,
        above=above,
        facts=facts,
        headings={i for i in (header_line, units_line) if i >= 0},
    )


_TIME_NAME = re.compile(
    r"(elapsed[\s_])?(time|timestamp|zeit|temps|tiempo|tempo|t|x_?value|x-axis|x axis|seconds?|secs?)\b.*",
    re.IGNORECASE,
)
FEWEST_STEPS = 100
"""Smallest number of rows of a time column from which its unit is found by the header's interval."""
SAME_STEP = 1e-3
"""Largest relative difference between the column's mean step and the header's interval [-]."""


@dataclass(frozen=True)
class SignalTable:
    """Columns of a sheet as signals and their times."""

    sheet: Sheet
    layout: Layout
    times: tuple[int, ...]
    """The time columns, counted from 0."""
    _read: dict[int, tuple[FloatArray, FloatArray]] = field(default_factory=dict, compare=False, repr=False)
    """Cache of the time columns, which channels share."""

    def channels(self) -> tuple[Channel, ...]:
        """The numeric columns that are not times.

        Raises InputError if there are fewer samples than the header declares, too many, or too few.
        """
        sheet, rows, promised = self.sheet, len(self.sheet.rows), stated_samples(self.sheet.metadata)
        if promised is not None and rows < promised[1]:
            message = f"ends after {rows} samples; its header promises {promised[0]} = {promised[1]}"
            raise sheet.error(message, rows - 1, "the file is cut off; copy or export it again")
        columns = [i for i in sheet.dialect.numeric if i not in (*self.times, *self.counts)]
        if not columns:
            raise sheet.error("has a time column but no signal", None, "export a channel, or correct time")
        check_samples(sheet.path, sheet.names[columns[0]], len(sheet.rows))
        return tuple(self._channel(column, order, len(columns)) for order, column in enumerate(columns))

    def time_channels(self) -> tuple[Channel, ...]:
        """The time columns, as signals."""
        return tuple(self._channel(column, 0, 1) for column in self.times)

    @property
    def counts(self) -> tuple[int, ...]:
        """Columns of sample counts, such as Rigol's with the unit "Sequence"."""
        return tuple(i for i, unit in enumerate(self.sheet.units) if unit and unit.lower() == "sequence")

    def _channel(self, column: int, order: int, count: int) -> Channel:
        sheet = self.sheet
        return Channel(
            name=sheet.names[column],
            number=column + 1,
            unit=sheet.units[column],
            samples=len(sheet.rows),
            values=lambda: sheet.numbers(column),
            clock=lambda: self._clock(column, order, count),
            place=lambda sample: sheet.first_line + sample,
        )

    def _clock(self, column: int, order: int, count: int) -> Clock:
        sheet, layout = self.sheet, self.layout
        header = header_clock(
            sheet.path, sheet.metadata, channel=order, channels=count, decimal=sheet.dialect.decimal
        )
        if layout.start is None:
            header = replace(header, start=self._first_time(header))
        header = header.declared(sheet.path, layout)
        interval, start = header.interval, header.start
        number = self._time_column(column)
        if number is not None and interval is not None and start is not None and not self._time_unit(number):
            number = None  # the header has all data, and the unit of the column is unknown
        if number is None:
            if interval is None:
                raise sheet.error(
                    "has no time column that is recognised and no interval in its header"
                    + (f" that is clear: {header.doubt}" if header.doubt else ""),
                    None,
                    'give in the layout time = "NAME", or interval = "100 ns"',
                )
            return stated_clock(interval, start, header.source)
        values, digit = self._times(number)
        return column_clock(values, digit, header, name=sheet.names[number], fault=sheet.error)

    def _first_time(self, header: HeaderClock) -> float | None:
        """Time of the first sample [s]; a count that does not begin at 1 is the number of missing samples."""
        sheet = self.sheet
        if header.start is None or header.interval is None or not self.counts:
            return header.start
        count = sheet.numbers(self.counts[0])
        steps = np.flatnonzero(np.diff(count) != 1.0)
        if steps.size:
            row = int(steps[0]) + 1
            message = f"column '{sheet.names[self.counts[0]]}' counts {count[row]:g} after {count[row - 1]:g}"
            raise sheet.error(message, row, "export every sample once, in order")
        return header.start + (0.0 if count[0] == 1.0 else float(count[0])) * header.interval

    def _time_column(self, column: int) -> int | None:
        """The time column of a signal: the declared one, else the nearest to its left, else the first."""
        stated = self.layout.time
        if isinstance(stated, Mapping):
            for channel, time in stated.items():
                if self.sheet.column(channel, "channel") == column:
                    return self.sheet.column(time, "time column")
            return None
        if not self.times:
            return None
        left = [time for time in self.times if time < column]
        return left[-1] if left else self.times[0]

    def _times(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Times and their last printed digits [s]."""
        if number in self._read:
            return self._read[number]
        sheet = self.sheet
        what = f"the time column '{sheet.names[number]}'"
        factor = time_factor(sheet.path, self._time_unit(number), what)
        values = sheet.numbers(number)
        digits = column_digits(values, lambda row: sheet.field(number, row))
        # Division by 1e6 rounds once, multiplication by 1e-6 rounds twice: 25 us is 2.5e-5 s.
        inverse = round(1.0 / factor)
        seconds = values / inverse if factor < 1.0 else values * factor
        self._read[number] = seconds, digits * factor
        return self._read[number]

    def _time_unit(self, number: int) -> str | None:
        """The unit of a time column: declared, in the header, of its name, or by the header's interval."""
        name = self.sheet.names[number]
        named = name if len(name) > 1 and si_unit(name) == ("s", 1.0) else None
        said = self.layout.time_unit or self.sheet.units[number] or named or time_unit(self.sheet.metadata)
        rows = len(self.sheet.rows)
        if said or rows < FEWEST_STEPS:
            return said
        header = header_clock(self.sheet.path, self.sheet.metadata, decimal=self.sheet.dialect.decimal)
        if header.interval is None:
            return None
        # seconds, if the column's steps equal the header's interval in seconds
        first, last = (float(self.sheet.field(number, row)) for row in (0, rows - 1))
        return "s" if abs((last - first) / (rows - 1) / header.interval - 1.0) < SAME_STEP else None


def signal_table(sheet: Sheet, layout: Layout) -> SignalTable:
    """A table with its declared time columns, otherwise those named time or with a unit of time.

    Raises InputError if a declared time column is missing.
    """
    stated = layout.time
    if isinstance(stated, Mapping):
        times = tuple(sorted({sheet.column(time, "time column") for time in stated.values()}))
    elif stated is not None:
        times = (sheet.column(stated, "time column"),)
    else:
        columns = [(i, sheet.names[i], sheet.units[i]) for i in sheet.dialect.numeric]
        times = tuple(
            i
            for i, name, unit in columns
            if (full_match(_TIME_NAME, split_unit(name)[0]) if unit is None else "s" in (si_unit(unit) or ()))
        )
    return SignalTable(sheet, layout, times)
