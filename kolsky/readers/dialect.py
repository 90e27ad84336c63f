"""Delimiter, decimal sign and columns of a text file of unknown make."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from kolsky.base.errors import InputError

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blanks": " "}
"""Name -> character, in the order in which they are tried; "blanks" is any run of blanks and tabs."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)", re.IGNORECASE)
_SAMPLED = 60
"""Lines at the end of the file that the choice rests on."""
_MOST = 0.8
"""Share of them that must agree: one damaged line shall be named by its number, not change the choice."""


_SHOWN = 60
"""Most characters of a line that a message shows."""


@dataclass(frozen=True)
class Dialect:
    """Delimiter, decimal sign and columns of a file's lines."""

    delimiter: str
    """The character between columns; " " stands for any run of blanks and tabs."""
    decimal: str
    """"." or ","."""
    fields: int
    """Fields in a line of samples."""
    numeric: tuple[int, ...]
    """Which of them hold numbers, counted from 0."""
    empty: tuple[int, ...] = ()
    """Which of them hold nothing: behind a last delimiter, or below the keys of the header."""
    quoted: bool = True
    """Whether quotes around a field are taken off; else they belong to it."""

    def split(self, line: str) -> list[str]:
        """The fields of a line, without quotes and outer blanks."""
        if self.delimiter == " ":
            return (line.replace('"', "") if self.quoted else line).split()
        if self.quoted and '"' in line:
            cells = csv.reader([line], delimiter=self.delimiter, skipinitialspace=True)
            try:
                return [part.strip() for part in next(cells, [])]
            except csv.Error:  # a field of more than 131 072 characters: no number, whatever it is
                pass
        return [part.strip() for part in line.split(self.delimiter)]

    def is_number(self, field: str) -> bool:
        """True if a field is a number in this dialect, NaN and infinity included."""
        return bool((_NUMBER if self.decimal == "." else _COMMA_NUMBER).fullmatch(field))

    def is_samples(self, line: str) -> bool:
        """True if a line has the form of a line of samples."""
        parts = self.split(line)
        if len(parts) != self.fields or any(parts[i] for i in self.empty):
            return False
        return all(self.is_number(parts[i]) for i in self.numeric)

    @property
    def facts(self) -> dict[str, str]:
        """Delimiter and decimal sign in words."""
        name = next(name for name, character in DELIMITERS.items() if character == self.delimiter)
        return {"delimiter": name, "decimal": self.decimal}


def find_dialect(
    path: Path, lines: Sequence[str], *, delimiter: str | None = None, decimal: str | None = None
) -> Dialect:
    """The dialect in which the most columns at the end of a file are numbers.

    Parameters
    ----------
    path
        The file, for messages.
    lines
        Its lines.
    delimiter, decimal
        What has been stated; the rest is found.

    Raises
    ------
    InputError
        If something stated is not allowed, or no column is numeric.
    """
    characters: tuple[str, ...] = () if delimiter is None else (stated(path, "delimiter", delimiter),)
    decimals: tuple[str, ...] = () if decimal is None else (stated(path, "decimal", decimal),)
    filled = [line for line in lines[-4 * _SAMPLED :] if line.strip()][-_SAMPLED:]
    found = [
        dialect
        for character in characters or DELIMITERS.values()
        for sign in decimals or (".", ",")
        if sign != character and (dialect := _columns(filled, character, sign)) is not None
    ]
    several = [d for d in found if d.fields > 1] or found
    if delimiter is not None and found and found[0].fields == 1:
        better = _other(filled, characters[0])
        if better is not None:
            name = better.facts["delimiter"]
            raise InputError(
                path,
                f"has one field a line with the delimiter {delimiter!r}, {better.fields} with {name}",
                line=len(lines),
                cure=f'say delimiter = "{name}", or leave it out',
            )
    if not several:
        line, word = _last_word(lines, characters or tuple(DELIMITERS.values()), decimals or (".", ","))
        raise InputError(
            path,
            "has no column of numbers"
            + (f" with the delimiter {delimiter!r}" if delimiter is not None else "")
            + (f" and the decimal sign {decimal!r}" if decimal is not None else "")
            + (f": {word[:_SHOWN]!r} is none" if line > 1 else ", or too few below its header"),
            line=line,
            cure="is it the right file? if so, mend the line, or say delimiter and decimal in a layout",
        )
    # max() keeps the first of equals: the order of DELIMITERS.
    return max(several, key=lambda d: (len(d.numeric) / d.fields, len(d.numeric)))


def _columns(lines: Sequence[str], delimiter: str, decimal: str) -> Dialect | None:
    """The columns that most of the lines have, if one of them is numeric."""
    bare = Dialect(delimiter, decimal, 0, ())
    rows = [bare.split(line) for line in lines]
    counts = Counter(map(len, rows))
    if not counts:
        return None
    fields, agreeing = counts.most_common(1)[0]
    if agreeing < _MOST * len(rows):
        return None
    rows = [row for row in rows if len(row) == fields]
    shares = [sum(bare.is_number(row[i]) for row in rows) / len(rows) for i in range(fields)]
    filled = [sum(bool(row[i]) for row in rows) for i in range(fields)]
    numeric = tuple(i for i, share in enumerate(shares) if share >= _MOST)
    if not numeric:
        return None
    empty = tuple(i for i, count in enumerate(filled) if count == 0)
    mostly = len(numeric) + len(empty) > fields / 2  # empty ones speak neither for nor against
    return Dialect(delimiter, decimal, fields, numeric, empty) if mostly else None


def _last_word(lines: Sequence[str], characters: Sequence[str], decimals: Sequence[str]) -> tuple[int, str]:
    """The last line, counted from 1, with a field that is no number, and that field; by the best dialect."""
    kinds = [Dialect(c, sign, 0, ()) for c in characters for sign in decimals if sign != c]
    tail = range(max(0, len(lines) - 4 * _SAMPLED), len(lines))
    best = max(kinds, key=lambda kind: sum(kind.is_number(f) for i in tail for f in kind.split(lines[i])))
    for i in reversed(tail):
        for field in best.split(lines[i]):
            if field and not best.is_number(field):
                return i + 1, field
    return len(lines), lines[-1]


def _other(lines: Sequence[str], stated: str) -> Dialect | None:
    """The dialect of the lines with another delimiter than the stated one."""
    for character in DELIMITERS.values():
        for decimal in (".", ","):
            if character not in (stated, decimal):
                dialect = _columns(lines, character, decimal)
                if dialect is not None and dialect.fields > 1:
                    return dialect
    return None


def stated(path: Path, what: Literal["delimiter", "decimal"], value: str) -> str:
    """The character that a layout names as delimiter or decimal sign.

    Raises
    ------
    InputError
        If it is none that is known.
    """
    allowed = {**DELIMITERS, **{c: c for c in "\t;, "}} if what == "delimiter" else {".": ".", ",": ","}
    if value not in allowed:
        names = ", ".join(f'"{name}"' for name in allowed if name.strip())
        raise InputError(path, f"is said to have the {what} {value!r}", allowed=f"one of {names}")
    return allowed[value]
