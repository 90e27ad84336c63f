"""Keys and values in the lines above the samples of a text file."""

import re
from collections.abc import Iterable, Mapping, Sequence

from kolsky.readers.dialect import Dialect
from kolsky.readers.headerclock import INTERVAL_KEYS, START_KEYS, bare_key

COMMENTS = ("#", "%", "!", "//")
"""How commented lines above the samples usually begin."""

_PAIR = re.compile(r'"?([^:=;,\t"]+?)"?\s*[:=;,\t]\s*(.*)')
_BLANKS = re.compile(r"(\D.*?)\s+([-+.\d].*)")


def uncommented(line: str, comment: str | None) -> str:
    """A line without its sign of a comment."""
    for sign in (comment,) if comment else COMMENTS:
        if line.startswith(sign):
            return line.removeprefix(sign).lstrip()
    return line


def key_lines(dialect: Dialect, lines: Iterable[str]) -> dict[str, list[str]]:
    """Key -> fields of lines such as "Sample Interval,1e-7,s" or "tInc = 2e-9"; a key that comes again is
    numbered."""
    metadata: dict[str, list[str]] = {}
    separator = dialect.delimiter if dialect.delimiter != " " else None
    for line in lines:
        match = _PAIR.fullmatch(line.strip()) or _BLANKS.fullmatch(line.strip())
        if match is None:
            continue
        key, rest = match.groups()
        fields = [part.strip(' "') for part in (rest.split(separator) if separator else [rest])]
        add_key(metadata, key, [part for part in fields if part])
    return metadata


def add_key(metadata: dict[str, list[str]], key: str, fields: list[str]) -> None:
    """Add a key; one that is there already is numbered: "Date", "Date (2)"."""
    name, count = key, 1
    while name in metadata:
        count += 1
        name = f"{key} ({count})"
    metadata[name] = fields


def heading_keys(dialect: Dialect, lines: Sequence[str]) -> dict[str, list[str]]:
    """Start and increment that stand beside the column names: as columns of their own, or as "tInc = 2e-9".

    Parameters
    ----------
    dialect
        How the lines are taken apart.
    lines
        The line of the names, and the line of the units if there is one.
    """
    rows = [dialect.split(line) for line in lines]
    metadata: dict[str, list[str]] = {}
    for i, cell in enumerate(rows[0] if rows else []):
        if "=" in cell:
            key, _, value = cell.partition("=")
            metadata[key.strip()] = [value.strip()]
        elif bare_key(cell) in (*START_KEYS, *INTERVAL_KEYS) and len(rows) > 1 and i < len(rows[1]):
            metadata[cell] = [rows[1][i]]
    return metadata


def names_by_key(
    metadata: Mapping[str, Sequence[str]],
    columns: Sequence[int],
    names: tuple[str, ...],
    units: tuple[str | None, ...],
) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """Names and units where a header line gives them behind a key (Yokogawa: TraceName, VUnit)."""
    named, measured = list(names), list(units)
    for key, fields in metadata.items():
        bare = bare_key(key)
        if bare not in ("tracename", "vunit") or len(fields) != len(columns):
            continue
        for column, field in zip(columns, fields, strict=True):
            if bare == "tracename":
                named[column] = field
            else:
                measured[column] = field
    return tuple(named), tuple(measured)
