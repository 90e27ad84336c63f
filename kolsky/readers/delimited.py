"""Delimited text of any oscilloscope or recorder: metadata, names, units, samples."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.files import read_bytes
from kolsky.readers.contents import Contents, Layout, head_of
from kolsky.readers.header import heading_keys, key_lines, names_by_key, uncommented
from kolsky.readers.sheet import Sheet, first_samples, names_and_units, signal_table
from kolsky.readers.text import decode_text, find_dialect, lines_of

BINARY = False

LONGEST_HEADER = 5000
"""Most lines above the samples."""
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".xls", "")
"""Endings of text; many programs write it with tabs and call it .xls."""


def sniff(path: Path) -> bool:
    """True for what may be delimited text: by its ending, and no zero bytes but those of UTF-16."""
    head = head_of(path)
    if path.suffix.lower() not in SUFFIXES or not head.strip():
        return False
    return head.count(0) == 0 or 0.4 < head.count(0) / len(head) < 0.6


def read(path: Path, layout: Layout) -> Contents:
    """Read a text file with any metadata above its samples.

    Raises
    ------
    InputError
        If it cannot be read, has no samples, or a stated layout does not fit.
    """
    data = read_bytes(path)
    text, encoding = decode_text(path, data, layout.encoding)
    facts = {"format": "delimited", "encoding": encoding}
    return read_lines(path, hashlib.sha256(data).hexdigest(), lines_of(path, text), layout, facts)


def read_lines(
    path: Path,
    sha256: str,
    lines: list[str],
    layout: Layout,
    facts: Mapping[str, str],
    *,
    word: str = "line",
) -> Contents:
    """Channels and metadata of the lines of a text.

    ``path``, ``sha256``: the file and its hash. ``lines``: its lines; a workbook's rows with tabs between
    their cells. ``layout``: what has been said of it. ``facts``: what has been found so far. ``word``: what a
    line is called in messages: "line" or "row". Raises InputError as `read`.
    """
    dialect = find_dialect(path, lines, delimiter=layout.delimiter, decimal=layout.decimal)
    if dialect.delimiter == " ":
        lines = [line.strip() for line in lines]
    first = first_samples(path, lines, dialect, layout)
    if first > LONGEST_HEADER:
        raise InputError(
            path,
            f"has {first} {word}s above its samples, more than the {LONGEST_HEADER} that are read",
            line=first + 1,
            cure="is it the right file? if so, export the samples alone",
        )
    above = [uncommented(line, layout.comment) for line in lines[:first]]
    names, units, found, headings = names_and_units(path, above, first, dialect, layout)
    metadata = key_lines(dialect, [line for i, line in enumerate(above) if i not in headings])
    metadata |= heading_keys(dialect, [above[i] for i in sorted(headings)])
    names, units = names_by_key(metadata, dialect.numeric, names, units)
    sheet = Sheet(path, dialect, lines[first:], first + 1, names, units, metadata, word)
    return Contents(
        path=path,
        sha256=sha256,
        channels=signal_table(sheet, layout).channels(),
        facts={**facts, **dialect.facts, **found, "first samples": str(first + 1), "counted in": f"{word}s"},
        metadata={key: ", ".join(fields) for key, fields in metadata.items()},
    )
