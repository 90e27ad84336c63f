"""What text files have in common whose metadata stand beside the samples, in columns of their own."""

import hashlib
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.delimited import lines_of
from kolsky.readers.encoding import decode_text
from kolsky.readers.layout import Layout
from kolsky.readers.metalines import add_key
from kolsky.readers.table import read_bytes


def read_text(path: Path, layout: Layout) -> tuple[str, list[str], str]:
    """Hash, lines and encoding of a text file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    data = read_bytes(path)
    text, encoding = decode_text(path, data, layout.encoding)
    return hashlib.sha256(data).hexdigest(), lines_of(path, text), encoding


def keys_beside(rows: list[list[str]]) -> dict[str, list[str]]:
    """Keys of the first column and what stands behind them."""
    metadata: dict[str, list[str]] = {}
    for row in rows:
        key = row[0].strip().rstrip(":")
        if key:
            add_key(metadata, key, [part.strip() for part in row[1:] if part.strip()])
    return metadata


def check_width(path: Path, lines: list[str], separator: str, least: int) -> None:
    """Refuse a line with too few fields.

    Raises
    ------
    InputError
        With its number.
    """
    for number, line in enumerate(lines):
        fields = line.count(separator) + 1
        if fields < least:
            last = number == len(lines) - 1
            raise InputError(
                path,
                f"has {fields} fields, {least} are needed"
                + ("; the file seems to be cut off" if last else ""),
                line=number + 1,
                cure="copy or export the file again",
            )
