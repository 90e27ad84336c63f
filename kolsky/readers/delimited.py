"""Delimited text of any oscilloscope or recorder: metadata, names, units, samples."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from kolsky.readers.contents import Contents, head_of
from kolsky.readers.header import heading_keys, key_lines, names_by_key
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import find_table, signal_table
from kolsky.readers.text import read_text

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".xls", "")
"""Endings of text files. Many programs use .xls for tab-separated text."""


def sniff(path: Path) -> bool:
    """True if a file may be delimited text, by its ending. It must have no zero bytes except in UTF-16."""
    head = head_of(path)
    if path.suffix.lower() not in SUFFIXES or not head.strip():
        return False
    return head.count(0) == 0 or 0.4 < head.count(0) / len(head) < 0.6


def read(path: Path, layout: Layout) -> Contents:
    """Read a text file with any metadata above its samples.

    Raises InputError if it cannot be read, if it has no samples, or if a declared layout does not fit.
    """
    sha256, lines, encoding = read_text(path, layout)
    return read_lines(path, sha256, lines, layout, {"format": "delimited", "encoding": encoding})


def read_lines(
    path: Path, sha256: str, lines: list[str], layout: Layout, facts: Mapping[str, str], *, word: str = "line"
) -> Contents:
    """Channels and metadata of the lines of a text.

    ``path``, ``sha256``: the file and its hash. ``lines``: its lines; for a workbook, its rows with tabs
    between their cells. ``layout``: the declared layout. ``facts``: the layout detected so far. ``word``: the
    name of a line in messages: "line" or "row". Raises InputError for the reasons of `read`.
    """
    found = find_table(path, lines, layout, word=word)
    dialect, above, headings = found.dialect, found.above, found.headings
    metadata = key_lines(dialect, [line for i, line in enumerate(above) if i not in headings])
    metadata |= heading_keys(dialect, [above[i] for i in sorted(headings)])
    names, units = names_by_key(metadata, dialect.numeric, found.names, found.units)
    sheet = replace(found, names=names, units=units, metadata=metadata)
    first = {"first samples": str(found.first_line), "counted in": f"{word}s"}
    others = [
        f"'{name}'" for i, name in enumerate(names) if i not in dialect.numeric and not name.isdecimal()
    ]
    if others:
        first["without numbers"] = ", ".join(others)
    table = signal_table(sheet, layout)
    return Contents(
        path=path,
        sha256=sha256,
        channels=table.channels(),
        times=table.time_channels(),
        facts={**facts, **dialect.facts, **found.facts, **first},
        metadata={key: ", ".join(fields) for key, fields in metadata.items()},
    )
