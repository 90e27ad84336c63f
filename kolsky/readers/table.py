"""What all readers share: strict reading of comma-separated text with one header line."""

import csv
import hashlib
import stat
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError

SIZE_LIMIT = 200_000_000
"""Largest text export that is read [bytes]."""


@dataclass(frozen=True)
class Column:
    """A declared column of a text file."""

    name: str
    """Its name in the header line."""
    factor: float = 1.0
    """SI units per unit of the file, e.g. 1e-3 for "mm"."""


@dataclass(frozen=True)
class Table:
    """A text file as it was read: row i of the data is line i + 2 of the file."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of its bytes, hex."""
    header: tuple[str, ...]
    """Column names."""
    rows: tuple[str, ...]
    """The data lines, text."""

    def values(self, column: Column) -> FloatArray:
        """A column in SI units, shape [n_rows].

        Raises
        ------
        InputError
            If the column is missing or named twice, or holds anything but finite numbers.
        """
        index = self._index(column)
        try:
            numbers = np.loadtxt(self.rows, delimiter=",", usecols=index, comments=None, ndmin=1)
        except ValueError as error:
            raise self._first_bad_number(column, index, str(error)) from None
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise self.error(
                f"column '{column.name}' is not a finite number: '{self.field(column, int(bad[0]))}'",
                row=int(bad[0]),
                cure="a sample that was not measured has no row; remove the line or export again",
            )
        return np.asarray(numbers * column.factor, dtype=np.float64)

    def integers(self, column: Column) -> IntArray:
        """A column of whole numbers (frame numbers), shape [n_rows].

        Raises
        ------
        InputError
            As `values`, and if a number is not whole or is too large to be exact.
        """
        numbers = self.values(column)
        bad = np.flatnonzero((numbers != np.floor(numbers)) | (np.abs(numbers) > 2**53))
        if bad.size:
            row = int(bad[0])
            raise self.error(
                f"column '{column.name}' is not a frame number: '{self.field(column, row)}'",
                row=row,
                cure="frame numbers are whole; are two columns swapped?",
            )
        return numbers.astype(np.int64)

    def field(self, column: Column, row: int) -> str:
        """The text of one field."""
        return self.rows[row].split(",")[self._index(column)].strip()

    def printed_digit(self, column: Column) -> float:
        """The last digit that the file prints of a column, in SI units, e.g. 1e-11 for "-1.9950000e-04" s.

        With an exponent the last digit depends on the size of the number; the coarsest one counts.
        """
        index = self._index(column)
        step = max(1, len(self.rows) // 1000)
        sampled = (*self.rows[::step], self.rows[-1])
        fields = [row.split(",")[index].strip() for row in sampled]
        decimals = [Decimal(field) for field in fields]
        nonzero = [d for d in decimals if d != 0]
        if nonzero and any("e" in field.lower() for field in fields):
            figures = max(len(d.as_tuple().digits) for d in nonzero)
            exponent = max(d.adjusted() for d in nonzero) - figures + 1
        else:
            exponent = min(int(d.as_tuple().exponent) for d in decimals)
        return float(Decimal(1).scaleb(exponent)) * column.factor

    def check_increasing(self, column: Column, values: FloatArray | IntArray) -> None:
        """Refuse a column that does not increase from row to row.

        Raises
        ------
        InputError
            With the first line that repeats a value or steps back.
        """
        steps = np.diff(values)
        bad = np.flatnonzero(steps <= 0)
        if not bad.size:
            return
        row = int(bad[0]) + 1
        word = "repeats" if steps[row - 1] == 0 else "is not sorted:"
        # A voltage or a displacement read as a time goes back and forth all the time.
        swapped = bad.size > 0.05 * steps.size and bad.size > 2
        raise self.error(
            f"column '{column.name}' {word} '{self.field(column, row)}' after '{self.field(column, row - 1)}'"
            + (f" ({bad.size} such lines)" if bad.size > 1 else ""),
            row=row,
            cure="are two columns swapped? the shot file names each column"
            if swapped
            else "every sample has its own, later time; export again with all digits, in order",
        )

    def error(self, message: str, *, row: int | None = None, cure: str | None = None) -> InputError:
        """An error about this file; `row` counts data rows from 0."""
        return InputError(self.path, message, line=None if row is None else row + 2, cure=cure)

    def _index(self, column: Column) -> int:
        found = [i for i, name in enumerate(self.header) if name == column.name]
        if len(found) == 1:
            return found[0]
        names = ", ".join(f"'{name}'" for name in self.header)
        if found:
            raise InputError(
                self.path,
                f"column '{column.name}' is there {len(found)} times",
                line=1,
                cure="give each column its own name",
            )
        raise InputError(
            self.path,
            f"column '{column.name}' is missing; the columns are {names}",
            line=1,
            cure="correct the column's name in the shot file (columns are separated by commas)",
        )

    def _first_bad_number(self, column: Column, index: int, fallback: str) -> InputError:
        """Slow, line by line; only after the fast path has failed."""
        for number, row in enumerate(self.rows):
            field = row.split(",")[index].strip()
            try:
                if "_" in field:  # float() reads "1_000", the fast path does not
                    raise ValueError
                float(field)
            except ValueError:
                return self.error(
                    f"column '{column.name}' is not a number: '{field[:60]}'",
                    row=number,
                    cure="correct the line or export again (decimal point, no unit)",
                )
        return self.error(f"column '{column.name}' cannot be read: {fallback}")


def read_bytes(path: Path, *, limit: int = SIZE_LIMIT) -> bytes:
    """The bytes of a regular file of sensible size.

    Raises
    ------
    InputError
        If there is no such file, it is a folder or a device, it is empty, larger than `limit` bytes
        (found without reading it), or may not be read.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(path, "is a folder, not a file", cure="name the file inside it")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(path, "is not a regular file", cure="copy the data into a file")
        if status.st_size > limit:
            raise InputError(
                path,
                f"has {status.st_size / 1e6:.0f} MB, more than the {limit / 1e6:.0f} MB that are read",
                cure="export the time span of the test only",
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(path, "there is no such file", cure="put it there or correct its name") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    if not data.strip():
        raise InputError(path, "is empty", cure="export it again")
    return data


def decode(path: Path, data: bytes) -> str:
    """UTF-8 text of a file, with or without a byte order mark.

    Raises
    ------
    InputError
        If the bytes are not UTF-8, with the offset of the first that is not.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        offset = error.start + (3 if data.startswith(b"\xef\xbb\xbf") else 0)
        raise InputError(
            path,
            f"is not UTF-8 text: byte 0x{data[offset]:02x} at byte offset {offset}",
            line=data.count(b"\n", 0, offset) + 1,
            cure="convert it to UTF-8, e.g. `iconv -f latin1 -t utf-8`",
        ) from None


def read_table(path: Path, *, limit: int = SIZE_LIMIT) -> Table:
    """Read a comma-separated text file with one header line.

    Raises
    ------
    InputError
        If the file cannot be read (see `read_bytes`, `decode`), has no data, or a line that is empty
        or has another number of fields than the header.
    """
    data = read_bytes(path, limit=limit)
    # Not splitlines(): it also splits at characters that are no line ends in a text file.
    lines = [line.removesuffix("\r") for line in decode(path, data).split("\n")]
    while not lines[-1].strip():
        lines.pop()
    broken = next((number for number, line in enumerate(lines) if "\r" in line), None)
    if broken is not None:
        raise InputError(
            path,
            "has a carriage return inside the line",
            line=broken + 1,
            cure="end lines with a line feed (Unix) or with both (Windows)",
        )
    header = tuple(name.strip() for name in next(csv.reader(lines[:1]), []))
    rows = tuple(lines[1:])
    if not rows:
        raise InputError(path, "has a header but no data", cure="export it again")
    commas = len(header) - 1
    for number, row in enumerate(rows):
        if row.count(",") != commas or not row.strip():
            found = f"has {row.count(',') + 1} fields, the header has {commas + 1}"
            raise InputError(
                path,
                found if row.strip() else "is an empty line",
                line=number + 2,
                cure="correct the line or export again",
            )
    return Table(path=path, sha256=hashlib.sha256(data).hexdigest(), header=header, rows=rows)
