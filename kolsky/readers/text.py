"""Read a text file of unknown origin. Its characters, lines and fields are detected."""

import codecs
import csv
import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from kolsky.base.errors import InputError
from kolsky.base.files import read_bytes
from kolsky.readers.layout import Layout

ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1", "cp932", "gb18030")
"""Encodings that may be declared. The first three and cp1252 are also detected."""

LONGEST_FIELD = 200
"""Longest field searched for name and unit [characters]; the time grows with a power of the length."""
LONGEST_PAIR = 4000
"""Longest line of a header in which a key and its values are searched [characters]."""

_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


def full_match(pattern: re.Pattern[str], field: str, *, longest: int = LONGEST_FIELD) -> re.Match[str] | None:
    """The match of a pattern with a whole field. None for a field with more than `longest` characters."""
    return pattern.fullmatch(field) if len(field) <= longest else None


def read_text(path: Path, layout: Layout) -> tuple[str, list[str], str]:
    """Hash, lines and encoding of a text file. Raises InputError if it cannot be read."""
    data = read_bytes(path)
    text, encoding = decode_text(path, data, layout.encoding)
    return hashlib.sha256(data).hexdigest(), lines_of(path, text), encoding


def decode_text(path: Path, data: bytes, encoding: str | None = None) -> tuple[str, str]:
    """The text of a file and the words for its encoding.

    A byte order mark determines the encoding. Without one, many zero bytes indicate UTF-16. Other text that
    is not valid UTF-8 is cp1252, the code page of Windows in western Europe and America.

    ``path``: the file, for messages. ``data``: its bytes. ``encoding``: one of `ENCODINGS`, or None to detect
    it. Raises InputError with line and offset if it is unknown or a byte invalid in it.
    """
    if encoding is not None and encoding not in ENCODINGS:
        message = f"is declared to be encoded as '{encoding}'"
        cure = "leave encoding out: UTF-8, UTF-16 and cp1252 are found"
        raise InputError(path, message, allowed=f"one of {', '.join(ENCODINGS)}", cure=cure)
    mark, marked = next(((m, name) for m, name in _MARKS if data.startswith(m)), (b"", None))
    body = data[len(mark) :]
    if encoding is not None:
        bare = "utf-16-le" if encoding == "utf-16" and marked is None else encoding
        chosen, words = (marked or bare) if bare.startswith("utf") else bare, f"{encoding} (stated)"
    elif marked is not None:
        chosen, words = marked, f"{marked} with a byte order mark"
    else:
        chosen = _without_mark(body)
        words = chosen
    try:
        text = body.decode(chosen)
    except UnicodeDecodeError as error:
        raise InputError(
            path,
            f"is not {chosen} text: byte 0x{body[error.start]:02x} at byte offset {error.start + len(mark)}",
            line=body.count(b"\n", 0, error.start) + 1,
            cure="give the encoding in the layout, or convert the file to UTF-8",
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        message = "has a zero byte: it is not a text, or was cut off"
        raise InputError(path, message, line=line, cure="copy it again, or give its format in the layout")
    return text, words


def _without_mark(data: bytes) -> str:
    sample = data[:4000]
    even, odd = sample[0::2].count(0), sample[1::2].count(0)
    if max(even, odd) > 0.4 * (len(sample) // 2) and len(data) % 2 == 0:
        return "utf-16-le" if odd > even else "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines_of(path: Path, text: str, *, strict: bool = False) -> list[str]:
    """The lines of a text without empty lines at its end. Lines end with LF, CR LF or, unless strict, CR.

    Raises InputError if there are only blanks, or if a strict line contains a carriage return.
    """
    # Not splitlines(), because it also splits at characters that do not end a line of a text file.
    text = text.replace("\r\n", "\n")
    lines = (text.removesuffix("\r") if strict else text.replace("\r", "\n")).split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError(path, "is empty", cure="export it again")
    broken = next((number for number, line in enumerate(lines, start=1) if "\r" in line), None)
    if broken is not None:
        message = "has a carriage return inside the line"
        cure = "end lines with a line feed (Unix) or with both (Windows)"
        raise InputError(path, message, line=broken, cure=cure)
    return _quoted_commas_apart(_whole_lines_unquoted(lines))


def _quoted_commas_apart(lines: list[str]) -> list[str]:
    """Replace commas between fields such as "0,12","3,5" by semicolons, if most last lines have them."""
    filled = [line for line in lines[-4 * _LINES_COMPARED :] if line.strip()][-_LINES_COMPARED:]
    apart = [
        _QUOTED_COMMA.search(line) is not None
        and "," in (bare := _QUOTED_LINE.sub("", line))
        and _OTHER.search(bare) is None
        for line in filled
    ]
    tails = [apart[-count:] for count in (_LINES_COMPARED, *_FEWER_LINES)]
    if not any(sum(tail) >= _AGREEING_SHARE * len(tail) for tail in tails):
        return lines
    return [line if _BARE_COMMA.search(_QUOTED_LINE.sub("", line)) else _semicolons(line) for line in lines]


def _semicolons(line: str) -> str:
    """A line with semicolons instead of its commas, except in quoted fields."""
    try:
        cells = next(csv.reader([line], skipinitialspace=True), [])
    except csv.Error:  # a field of more than 131 072 characters
        return line
    return ";".join(f'"{cell}"' if ";" in cell else cell.replace('"', "") for cell in cells)


def _whole_lines_unquoted(lines: list[str]) -> list[str]:
    """Remove quotes around whole lines, which a spreadsheet writes if each line was in one cell."""
    filled = [line.strip() for line in lines if line.strip()]
    quoted = [line for line in filled if _QUOTED_LINE.fullmatch(line) and _DIVIDED.search(line)]
    if len(quoted) < _AGREEING_SHARE * len(filled):
        return lines
    return [
        line.strip()[1:-1].replace('""', '"') if _QUOTED_LINE.fullmatch(line.strip()) else line
        for line in lines
    ]


class Delimiter(NamedTuple):
    """A separator of the fields of a line: its name in a layout, character, and name in messages."""

    name: str
    character: str
    plural: str


BLANKS = Delimiter("blanks", " ", "blanks")
"""Any run of blanks and tabs."""
COMMA = Delimiter("comma", ",", "commas")
DELIMITERS = (Delimiter("tab", "\t", "tabs"), Delimiter("semicolon", ";", "semicolons"), COMMA, BLANKS)
"""All delimiters, in the order of their trials. Add a new delimiter here."""


_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_ALMOST = re.compile(r"[+-]?\d[\d.,'’ \u00a0\u202f]*(?:[eE][+-]?\d+)?")
"""A number with any decimal sign, with or without thousands separators."""
_WHOLE, _FRACTION = re.compile(r"[+-]?\d+"), re.compile(r"\d+(?:[eE][+-]?\d+)?")
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)", re.IGNORECASE)
_LINES_COMPARED = 60
"""Number of lines at the end of the file that are used to detect the dialect."""
_FEWER_LINES = (20, 8, 3)
"""Smaller numbers of lines. They are tried in turn for a short table below many lines of other text."""
_QUOTED_LINE = re.compile(r'"(?:[^"]|"")*"')
_QUOTED_COMMA = re.compile(r'"[+-]?\d+,\d+(?:[eE][+-]?\d+)?"')
_BARE_COMMA = re.compile(r"\d,\d")
_OTHER = re.compile(r"[\t;]")
_OTHER_OR_COMMA = re.compile(r"[\t;,]")
_DIVIDED = re.compile(r"[\t;,]|\S[ ]+\S")
_AGREEING_SHARE = 0.8
"""Share of the lines that must agree. One damaged line then causes an error and not another dialect."""


_SHOWN = 60
"""Maximum number of characters of a line in a message."""
_REMARK_CURE = (
    "are there remarks, a mean or a second table below the numbers? keep the lines of one table; else "
    "correct the line"
)
_CURES = {
    r"": "the field is empty: give its value, or leave the line out; a formula that was never calculated is "
    "empty too: open the workbook and save it",
    r"[-–—*?.#]+|n\.?/?a\.?|null|none|over(?:flow|load)?|under(?:flow)?": "it marks a missing value: leave "
    "the line out, or export without gaps",
    r"\d{1,4}([-./])\d{1,2}\1\d{1,4}(?:[ T].*)?|\d{1,2}:\d\d.*": "it is a date or a time of day: export "
    "seconds as plain numbers (a spreadsheet makes dates of numbers such as 3.4)",
    r"[+-]?[1-9]\d{0,2}(?:[ \u00a0\u202f'’.,]\d{3})+(?:[.,]\d+)?": "it has signs between thousands, or "
    "another decimal sign than the other numbers: export numbers without the former and with one decimal "
    "sign",
    r"[+-]?\d*[.,]\d+(?:e[+-]?\d+)?": "its decimal sign is not that of the other numbers: export all with "
    "one decimal sign; in a workbook, make numbers of the cells that are text",
    r"[+-]?[\d.,]+d[+-]?\d+": "write the exponent with E, not with D",
    r"[−–]\s*[\d.,].*": "its minus sign is a longer dash: export with the plain sign -",
    r"[+-]?[\d.,]+\s*[^\W\d_%°]?[%°]?[^,;]{0,12}": "export numbers without a unit behind them: it belongs in "
    "the heading",
}
"""Pattern of a field that is not a number -> the advice. The first match is used."""


def cure_of(field: str) -> str:
    """The advice for a field that should be a number but is not."""
    forms = ((re.compile(pattern, re.IGNORECASE), cure) for pattern, cure in _CURES.items())
    return next((cure for form, cure in forms if full_match(form, field) is not None), _REMARK_CURE)


@dataclass(frozen=True)
class Dialect:
    """Delimiter, decimal sign and columns of the lines of a file."""

    delimiter: str
    """The character between columns. " " means any sequence of blanks and tabs."""
    decimal: str
    """"." or ","."""
    fields: int
    """Fields in a line of samples."""
    numeric: tuple[int, ...]
    """Indices of the numeric fields, counted from 0."""
    empty: tuple[int, ...] = ()
    """Indices of the empty fields: after a last delimiter, or below the keys of the header."""
    quoted: bool = True
    """True if quotes around a field are removed. Otherwise they are part of the field."""

    def split(self, line: str) -> list[str]:
        """The fields of a line, without quotes and outer blanks."""
        if self.delimiter == " ":
            return (line.replace('"', "") if self.quoted else line).split()
        if self.quoted and '"' in line:
            cells = csv.reader([line], delimiter=self.delimiter, skipinitialspace=True)
            try:
                return [part.strip() for part in next(cells, [])]
            except csv.Error:  # a field of more than 131 072 characters is not a number
                pass
        return [part.strip() for part in line.split(self.delimiter)]

    def is_number(self, field: str) -> bool:
        """True if a field is a number in this dialect. NaN and infinity are numbers."""
        return bool((_NUMBER if self.decimal == "." else _COMMA_NUMBER).fullmatch(field))

    def is_samples(self, line: str) -> bool:
        """True if a line has the form of a line of samples."""
        parts = self.split(line)
        if len(parts) != self.fields or any(parts[i] for i in self.empty):
            return False
        return all(self.is_number(parts[i]) for i in self.numeric)

    @property
    def sign(self) -> Delimiter:
        """The delimiter with its names."""
        return next(d for d in DELIMITERS if d.character == self.delimiter)

    @property
    def facts(self) -> dict[str, str]:
        """Delimiter and decimal sign in words."""
        return {"delimiter": self.sign.name, "decimal": self.decimal}


def find_dialect(
    path: Path,
    lines: Sequence[str],
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    word: str = "line",
) -> Dialect:
    """The dialect in which the most columns at the end of a file are numbers.

    ``path``: the file, for messages. ``lines``: its lines. ``delimiter``, ``decimal``: the declared values;
    None: detected. ``word``: name of a line in messages. Raises InputError if a declared value is not
    allowed, or if no column is numeric.
    """
    every = tuple(d.character for d in DELIMITERS)
    characters = every if delimiter is None else (declared_delimiter(path, delimiter),)
    decimals = (".", ",") if decimal is None else (declared_decimal(path, decimal),)
    filled = [line for line in lines[-4 * _LINES_COMPARED :] if line.strip()][-_LINES_COMPARED:]
    dialects: list[Dialect] = []
    for count in (_LINES_COMPARED, *_FEWER_LINES):
        tail = [
            dialect
            for character in characters
            for sign in decimals
            if sign != character and (dialect := _columns(filled[-count:], character, sign)) is not None
        ]
        # Comments of two words look like columns between blanks. Fewer lines may give another delimiter.
        least = max(map(_share_of_numbers, dialects), default=(0.0, 0))
        others = [d for d in tail if d.delimiter != BLANKS.character and _share_of_numbers(d) >= least]
        dialects = others if dialects and others else dialects or tail
        if any(d.delimiter != BLANKS.character for d in dialects):
            break
    if decimal is None and delimiter is None and any(_is_one_number(filled, lines, d) for d in dialects):
        tab = DELIMITERS[0].character
        dialects = [_columns(filled[-_FEWER_LINES[-1] :], tab, ",") or Dialect(tab, ",", 1, (0,))]
    several = [d for d in dialects if d.fields > 1] or dialects
    if delimiter is not None and dialects and dialects[0].fields == 1:
        pairs = [
            (d.character, sign) for d in DELIMITERS for sign in ".," if d.character not in (*characters, sign)
        ]
        tried = (_columns(filled, *other) for other in pairs)
        better = next((one for one in tried if one is not None and one.fields > 1), None)
        if better is not None:
            name = better.facts["delimiter"]
            message = f"has one field a line with the delimiter {delimiter!r}, {better.fields} with {name}"
            cure = f'declare delimiter = "{name}", or leave it out'
            raise InputError(path, message, line=len(lines), cure=cure)
    if not several:
        raise _no_numbers(path, lines, characters, decimals, word)
    # max() returns the first of equal items, in the order of `DELIMITERS`.
    best = max(several, key=_share_of_numbers)
    # Lines of settings above a short table have words in its first column. The last lines have numbers in
    # this column.
    for count in _FEWER_LINES:
        last = _columns(filled[-count:], best.delimiter, best.decimal)
        if last is not None and last.fields == best.fields and {*last.numeric} > {*best.numeric}:
            best = last
    if delimiter is None and best.delimiter == BLANKS.character:
        best = _tabs_for_blanks(filled, best)
    if delimiter is None and best.delimiter in (COMMA.character, BLANKS.character):
        _check_stronger_delimiter(path, lines, filled)
    return best


def _no_numbers(
    path: Path, lines: Sequence[str], characters: Sequence[str], decimals: Sequence[str], word: str
) -> InputError:
    """The error for lines without a numeric column. It shows a field of the last such line."""
    line, text = _last_word(lines, characters, decimals)
    said = [
        *(f"the delimiter '{d.name}'" for d in DELIMITERS if (d.character,) == tuple(characters)),
        *([f"the decimal sign {decimals[0]!r}"] if len(decimals) == 1 else []),
    ]
    under = f" with {' and '.join(said)}" if said and word == "line" else ""
    cure, problem = "is it the right file, and exported whole?", f": {text[:_SHOWN]!r} is not a number"
    if line > _FEWER_LINES[-1]:
        cured = cure_of(text)
        cure += " " + (cure_of(_OTHER_OR_COMMA.split(text)[0]) if cured is _REMARK_CURE else cured)
    else:
        problem = f", or fewer than {_FEWER_LINES[-1]} {word}s of numbers below its header"
    if word == "line":
        return InputError(path, f"has no column of numbers{under}{problem}", line=line, cure=cure)
    return InputError(path, f"row {line}: has no column of numbers{problem}", cure=cure)


def _check_stronger_delimiter(path: Path, lines: Sequence[str], filled: Sequence[str]) -> None:
    """Raise InputError if tabs or semicolons would divide lines of commas or blanks into numbers."""
    tail = filled[-_FEWER_LINES[0] :]
    for delimiter in DELIMITERS[:2]:
        parts = [line.split(delimiter.character) for line in tail]
        numbers = [p for p in parts if len(p) > 1 and all(_ALMOST.fullmatch(cell.strip()) for cell in p)]
        if len(numbers) >= _AGREEING_SHARE * len(tail):
            raise _no_plain_numbers(path, delimiter, lines)


def _share_of_numbers(dialect: Dialect) -> tuple[float, int]:
    """Share of numeric columns among the nonempty columns, and the number of numeric columns."""
    return len(dialect.numeric) / (dialect.fields - len(dialect.empty)), len(dialect.numeric)


def _columns(lines: Sequence[str], delimiter: str, decimal: str) -> Dialect | None:
    """The dialect with the columns that most lines have. None if no column is numeric."""
    bare = Dialect(delimiter, decimal, 0, ())
    rows = [bare.split(line) for line in lines]
    counts = Counter(map(len, rows))
    if not counts:
        return None
    fields, agreeing = counts.most_common(1)[0]
    if agreeing < _AGREEING_SHARE * len(rows):
        return None
    rows = [row for row in rows if len(row) == fields]
    shares = [sum(bare.is_number(row[i]) for row in rows) / len(rows) for i in range(fields)]
    filled = [sum(bool(row[i]) for row in rows) for i in range(fields)]
    numeric = tuple(i for i, share in enumerate(shares) if share >= _AGREEING_SHARE)
    if not numeric:
        return None
    empty = tuple(i for i, count in enumerate(filled) if count == 0)
    mostly = len(numeric) + len(empty) > fields / 2  # empty fields are not evidence
    return Dialect(delimiter, decimal, fields, numeric, empty) if mostly else None


def _tabs_for_blanks(filled: Sequence[str], dialect: Dialect) -> Dialect:
    """The dialect with tabs if tabs and blanks divide the samples in the same way; names may have blanks."""
    tab = DELIMITERS[0].character
    samples = [line for line in filled if dialect.is_samples(line)]
    same = [
        tab in line and [part.strip() for part in line.split(tab) if part.strip()] == dialect.split(line)
        for line in samples
    ]
    if not samples or sum(same) < _AGREEING_SHARE * len(samples):
        return dialect
    return _columns(samples, tab, dialect.decimal) or dialect


def _is_one_number(filled: Sequence[str], lines: Sequence[str], dialect: Dialect) -> bool:
    """True if two integers around a comma are one decimal number, such as "-0,128" below "Kraft [N]"."""
    if dialect.delimiter != COMMA.character or dialect.fields != 2 or len(dialect.numeric) != 2:
        return False
    rows = [dialect.split(line) for line in filled if dialect.is_samples(line)]
    if not rows or not all(_WHOLE.fullmatch(a) and _FRACTION.fullmatch(b) for a, b in rows):
        return False
    first = next((i for i, line in enumerate(lines) if dialect.is_samples(line)), 0)
    above = [line for line in lines[:first] if line.strip()]
    named = bool(above) and "," not in above[-1] and above[-1].lstrip()[:1] not in ("#", "%", "!", "/")
    counted = all(int(b) - int(a) == 1 for (a, _), (b, _) in pairwise(rows))
    return not counted and (named or any(a == "-0" or (len(b) > 1 and b[0] == "0") for a, b in rows))


def _last_word(lines: Sequence[str], characters: Sequence[str], decimals: Sequence[str]) -> tuple[int, str]:
    """Number of the last line with a field that is not a number in the best dialect, and that field."""
    kinds = [Dialect(c, sign, 0, ()) for c in characters for sign in decimals if sign != c]
    tail = range(max(0, len(lines) - 4 * _LINES_COMPARED), len(lines))
    best = max(kinds, key=lambda kind: sum(kind.is_number(f) for i in tail for f in kind.split(lines[i])))
    for i in reversed(tail):
        for field in best.split(lines[i]):
            if field and not best.is_number(field):
                return i + 1, field
    return len(lines), lines[-1]


def declared_delimiter(path: Path, value: str) -> str:
    """The character of a delimiter declared by name or by character. Raises InputError if it is unknown."""
    found = next((d for d in DELIMITERS if value in (d.name, d.character)), None)
    if found is None:
        allowed = [d.name for d in DELIMITERS] + [d.character for d in DELIMITERS if d.character.strip()]
        names = ", ".join(f'"{name}"' for name in allowed)
        raise InputError(path, f"is declared to have the delimiter {value!r}", allowed=f"one of {names}")
    return found.character


def declared_decimal(path: Path, value: str) -> str:
    """The decimal sign that a layout declares. Raises InputError if it is neither "." nor ","."""
    if value not in (".", ","):
        raise InputError(path, f"is declared to have the decimal {value!r}", allowed='one of ".", ","')
    return value


def check_one_column(path: Path, lines: Sequence[str]) -> None:
    """Check that another delimiter does not divide lines without commas into numbers of another form.

    Raises InputError with the delimiter and the last line.
    """
    for delimiter in (d for d in reversed(DELIMITERS) if d not in (COMMA, BLANKS)):
        cells = lines[-1].split(delimiter.character)
        plain = any(
            all(Dialect(delimiter.character, sign, 0, ()).is_number(cell.strip()) for cell in cells)
            for sign in ".,"
        )
        if not plain and all(delimiter.character in line for line in lines[:9]):
            raise _no_plain_numbers(path, delimiter, lines)


def _no_plain_numbers(path: Path, delimiter: Delimiter, lines: Sequence[str]) -> InputError:
    return InputError(
        path,
        f"most fields between its {delimiter.plural} are not plain numbers: '{lines[-1][:_SHOWN]}'",
        line=len(lines),
        cure="export numbers without units and without signs between thousands, with one decimal sign, or "
        "declare a layout",
    )
