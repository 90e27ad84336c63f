"""Layout of a table that nobody declared: what a spreadsheet in German or French settings writes is found.

UTF-8 with commas, decimal points and one header line is read strictly, as it always was. Only a file that is
plainly something else (other characters, another delimiter, lines above the header) is read as it is written,
and `kolsky check` says how.
"""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.units import UnitError, unit_factor
from kolsky.readers.contents import Layout
from kolsky.readers.dialect import find_dialect
from kolsky.readers.sheet import first_samples, names_and_units
from kolsky.readers.text import decode_text, lines_of, read_bytes

PLAIN = Layout(delimiter="comma", decimal=".", header_line=1)
"""UTF-8, commas, decimal points, one line of column names, then data."""
_KINDS = ("s", "m", "V", "Pa", "N", "1")
"""SI units of what such a table holds."""
_WORDS = {"tab": "tabs", "semicolon": "semicolons", "comma": "commas", "blanks": "blanks"}


def found_layout(path: Path, data: bytes) -> Layout:
    """The layout of a table; `PLAIN` if it is that, or nothing better can be told.

    Parameters
    ----------
    path
        The file, for messages.
    data
        Its bytes.
    """
    try:
        text, encoding = decode_text(path, data)
        lines = lines_of(path, text)
        dialect = find_dialect(path, lines)
        bare = Layout()
        if dialect.delimiter == " ":
            lines = [line.strip() for line in lines]
        first = first_samples(path, lines, dialect, bare)
        _, _, facts, _ = names_and_units(path, lines[:first], first, dialect, bare)
    except InputError:
        return PLAIN  # the strict reader says what is wrong, and where
    if not facts["header"].isdecimal():
        return PLAIN
    header = int(facts["header"])
    units = int(facts["units"]) if "units" in facts else None
    if units is None and header > 1 and _all_units(dialect.split(lines[header - 1])):
        header, units = header - 1, header
    utf8 = encoding.startswith("utf-8")
    if utf8 and dialect.delimiter == "," and header == 1 and units is None:
        return PLAIN
    return Layout(
        encoding=None if utf8 else encoding.split()[0],
        delimiter=dialect.facts["delimiter"],
        decimal=dialect.decimal,
        header_line=header,
        units_line=units,
        first_line=first + 1,
    )


def _all_units(cells: list[str]) -> bool:
    """True if every cell is a unit of something that a table of a shot holds."""
    return all(any(_is_unit(cell.strip("()[] "), kind) for kind in _KINDS) for cell in cells)


def _is_unit(cell: str, kind: str) -> bool:
    try:
        unit_factor("1" if cell in ("", "-") else cell, kind)
    except UnitError:
        return False
    return True


def layout_in_words(path: Path) -> str:
    """How a table is read where no layout is declared; empty if it is plain text, or no table of text.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    found = found_layout(path, read_bytes(path))
    if found is PLAIN:
        return ""
    words = [_WORDS[str(found.delimiter)], "decimal commas" if found.decimal == "," else "decimal points"]
    words += [found.encoding] if found.encoding is not None else []
    words += [f"header in line {found.header_line}"] if found.header_line != 1 else []
    words += [f"units in line {found.units_line}"] if found.units_line is not None else []
    return ", ".join(words)
