"""A table of text lines with whatever stands above it: names, units, metadata, columns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import LARGEST_SAMPLE, ColumnId, Layout
from kolsky.readers.dialect import Dialect
from kolsky.readers.header import KEYS, bare_key
from kolsky.readers.signalunits import si_unit, split_unit


@dataclass(frozen=True)
class Sheet:
    """Lines taken apart; line i of `rows` is line `first + i` of the file."""

    path: Path
    """The file."""
    dialect: Dialect
    """How its lines are taken apart."""
    rows: Sequence[str]
    """The lines of samples."""
    first: int
    """Line of the first of them, counted from 1."""
    names: tuple[str, ...]
    """Column names; "1", "2", ... without a header."""
    units: tuple[str | None, ...]
    """Units as written, or None."""
    metadata: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Key -> the fields behind it."""
    word: str = "line"
    """What a row is called: "line", or "row" of a workbook."""
    counted: str = "the other lines have"
    """What has as many fields as there must be, in words."""
    _checked: list[bool] = field(default_factory=list, compare=False, repr=False)
    """Not empty once the fields of all rows have been counted."""

    def values(self, column: int, *, gaps: bool = False) -> FloatArray:
        """The numbers of a column, counted from 0, as the file gives them, shape [n].

        Parameters
        ----------
        column
            Which column.
        gaps
            Whether NaN is allowed, as in tables of points of which some were lost.

        Raises
        ------
        InputError
            If a line has another number of fields than the first, or a field is no finite number.
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
            raise self._first_bad_number(column, str(error)) from None
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
                "a recorder gives every sample a value; export again without gaps",
            )
        return np.asarray(numbers, dtype=np.float64)

    def field(self, column: int, row: int) -> str:
        """The text of one field, with a decimal point."""
        text = self.dialect.split(self.rows[row])[column]
        return text.replace(",", ".") if self.dialect.decimal == "," else text

    def column(self, wanted: ColumnId, what: str) -> int:
        """The index of a column, counted from 0: by its name, else by its number.

        Raises
        ------
        InputError
            If there is none, or several have the name.
        """
        found = [i for i, name in enumerate(self.names) if name == wanted]
        if len(found) > 1:
            numbers = ", ".join(str(i + 1) for i in found)
            raise InputError(
                self.path,
                f"has {len(found)} columns '{wanted}'",
                cure=f"ask for one by its number: {numbers}",
            )
        if found:
            return found[0]
        number = int(wanted) if str(wanted).isdecimal() else 0
        if 1 <= number <= len(self.names):
            return number - 1
        names = ", ".join(f"'{name}'" for name in self.names)
        raise InputError(
            self.path,
            f"{what} '{wanted}' is missing; the columns are {names}",
            line=max(1, self.first - 1) if self.word == "line" else None,
            cure="correct its name, or give its number; `kolsky channels FILE` lists them",
        )

    def error(self, message: str, row: int | None, cure: str) -> InputError:
        """An error about this file; `row` counts rows of samples from 0."""
        line = None if row is None else self.first + row
        if self.word != "line" and line is not None:
            return InputError(self.path, f"row {line}: {message}", cure=cure)
        return InputError(self.path, message, line=line, cure=cure)

    def check_fields(self) -> None:
        """Refuse an empty line, and one with more or fewer fields than there are columns.

        Raises
        ------
        InputError
            For the first such line.
        """
        count = self.dialect.fields
        character = self.dialect.delimiter
        # The usual case in one pass: delimiters alone, no quotes, more than one column.
        plain = character != " " and count > 1 and '"' not in self.rows[0]
        if self._checked or (plain and all(row.count(character) == count - 1 for row in self.rows)):
            self._checked.append(True)
            return
        for number, row in enumerate(self.rows):
            if character == " ":
                fields = len(row.split())
            elif '"' in row:
                fields = len(self.dialect.split(row))
            else:
                fields = row.count(character) + 1
            if fields == count and row.strip():
                continue
            last = number == len(self.rows) - 1
            raise self.error(
                f"has {fields} fields, {self.counted} {count}"
                + ("; the file seems to be cut off" if last and fields < count else "")
                if row.strip()
                else "is an empty line between samples",
                number,
                "copy or export the file again" if last else "correct the line or export again",
            )
        self._checked.append(True)

    def _first_bad_number(self, column: int, fallback: str) -> InputError:
        """Slow, line by line; only after the fast path has failed."""
        for row in range(len(self.rows)):
            text = self.dialect.split(self.rows[row])[column]
            if not self.dialect.is_number(text):
                return self.error(
                    f"column '{self.names[column]}' is not a number: '{text[:60]}'",
                    row,
                    "correct the line or export again (no unit behind a number, one decimal sign)",
                )
        return self.error(f"column '{self.names[column]}' cannot be read: {fallback}", None, "export again")


def first_samples(path: Path, lines: Sequence[str], dialect: Dialect, layout: Layout) -> int:
    """Index of the first line of samples.

    Raises
    ------
    InputError
        If the stated line is outside the file, or no line has the form of samples.
    """
    if layout.first_line is not None:
        if not 1 <= layout.first_line <= len(lines):
            raise InputError(
                path, f"first_line = {layout.first_line}", allowed=f"in [1, {len(lines)}], the file's lines"
            )
        return layout.first_line - 1
    above = max(layout.header_line or 0, layout.units_line or 0)
    for index in range(above, len(lines)):
        if dialect.is_samples(lines[index]):
            return index
    raise InputError(
        path, "has a header but no data", line=len(lines), cure="export it again, or say first_line"
    )


def names_and_units(
    path: Path, lines: Sequence[str], first: int, dialect: Dialect, layout: Layout
) -> tuple[tuple[str, ...], tuple[str | None, ...], dict[str, str], set[int]]:
    """Names and units of the columns, how they were found, and the lines (from 0) that they stand on.

    The header is the last line above the samples with as many fields as they have; where that line holds
    nothing but units ("(ms)", "Volt"), the names are on such a line above it.

    Raises
    ------
    InputError
        If a stated line does not fit, or the line above the samples is a damaged line of samples.
    """
    fitting = [i for i in range(first) if _fits(dialect, lines[i])]
    for stated in (layout.header_line, layout.units_line):
        if stated and stated - 1 not in fitting:
            found = len(dialect.split(lines[stated - 1])) if stated <= first else 0
            raise InputError(
                path,
                f"has {found} fields here, the samples below have {dialect.fields}",
                line=stated,
                cure="correct header_line and units_line in the layout",
            )
    units_line = -1 if layout.units_line is None else layout.units_line - 1
    if layout.units_line is None and fitting and _only_units(dialect, lines[fitting[-1]]):
        units_line = fitting[-1] if layout.header_line != fitting[-1] + 1 else -1
    if layout.header_line is None:
        above = [i for i in fitting if units_line < 0 or i < units_line]
        header_line = above[-1] if above else -1
        if header_line >= 0:
            _check_heading(path, dialect, lines[header_line], header_line)
    else:
        header_line = layout.header_line - 1
    count = dialect.fields
    headings = _cells(dialect, lines[header_line]) if header_line >= 0 else [""] * count
    split = [split_unit(heading) for heading in headings]
    names = tuple(heading or str(i + 1) for i, heading in enumerate(headings))
    units: list[str | None] = [unit for _, unit in split]
    if units_line >= 0:
        for i, text in enumerate(_cells(dialect, lines[units_line])):
            plain = text.strip("()[] ")
            units[i] = plain if plain and not dialect.is_number(plain) else units[i]
    facts = {"header": str(header_line + 1) if header_line >= 0 else "none; columns have numbers"}
    if units_line >= 0:
        facts["units"] = str(units_line + 1)
    return names, tuple(units), facts, {i for i in (header_line, units_line) if i >= 0}


def _cells(dialect: Dialect, line: str) -> list[str]:
    return dialect.split(line)[: dialect.fields]


def _fits(dialect: Dialect, line: str) -> bool:
    """True if a line can name or measure every numeric column."""
    cells = dialect.split(line)
    if len(cells) < dialect.fields or not all(cells[i] for i in dialect.numeric):
        return False
    return bare_key(cells[0]) not in KEYS


def _only_units(dialect: Dialect, line: str) -> bool:
    cells = [cell for cell in _cells(dialect, line) if cell]
    known = [si_unit(c) is not None or c.lower() == "sequence" or dialect.is_number(c) for c in cells]
    return all(known) and any(not dialect.is_number(cell) for cell in cells)


def _check_heading(path: Path, dialect: Dialect, line: str, number: int) -> None:
    """A heading has words; channels may be called 1, 2, 3, but not 0.0125."""
    cells = _cells(dialect, line)
    numbers = [cells[i] for i in dialect.numeric if dialect.is_number(cells[i])]
    if numbers and not all(text.isdecimal() for text in numbers):
        wrong = next((cell for cell in cells if not dialect.is_number(cell)), "")
        raise InputError(
            path,
            f"is neither a header nor samples: '{wrong[:60]}' beside the number {numbers[0]}",
            line=number + 1,
            cure="correct the line, or say header_line in the layout",
        )
