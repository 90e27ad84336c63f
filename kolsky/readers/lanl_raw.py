"""Los Alamos .raw: metadata in columns 1 and 2, a signal in every further column.

The file is tab-separated. Line 1 names the signals, line 2 has the time of the first sample [s], line 3 the
interval [s]. The samples follow [V]. After https://github.com/lanl/HopPyBar (BSD-3-Clause).
"""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Clock, Contents, check_samples, head_of
from kolsky.readers.header import check_width, keys_beside
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet
from kolsky.readers.text import Dialect, read_text


def sniff(path: Path) -> bool:
    """True if a file ends in .raw and its first line has at least three fields between tabs."""
    return path.suffix.lower() == ".raw" and head_of(path, 2048).split(b"\n")[0].count(b"\t") >= 2


def read(path: Path, layout: Layout) -> Contents:
    """Read all signals, and the metadata as written.

    Raises InputError if a line has fewer fields than the first, or if a start or interval is not a number.
    """
    sha256, lines, encoding = read_text(path, layout)
    fields = lines[0].count("\t") + 1
    if fields < 3 or len(lines) < 5:
        raise InputError(
            path,
            f"has {fields} columns and {len(lines)} lines; two of metadata and a signal are needed",
            line=1,
            cure="is it a .raw file of this make? if not, give its format in the layout",
        )
    check_width(path, lines, "\t", fields)
    table = [line.split("\t") for line in lines[:3]]
    names = tuple(name.strip() or str(i + 1) for i, name in enumerate(table[0]))
    dialect = Dialect("\t", ".", fields, tuple(range(2, fields)))
    sheet = Sheet(path, dialect, lines[3:], 4, names, ("",) * 2 + ("V",) * (fields - 2))
    check_samples(path, names[2], len(sheet.rows))
    return Contents(
        path=path,
        sha256=sha256,
        channels=tuple(_channel(sheet, table, column, layout) for column in range(2, fields)),
        facts={"format": "lanl", "encoding": encoding, "delimiter": "tab", "decimal": ".", "header": "1"},
        metadata={
            key: ", ".join(values)
            for key, values in keys_beside([line.split("\t")[:2] for line in lines]).items()
        },
    )


def _channel(sheet: Sheet, table: list[list[str]], column: int, layout: Layout) -> Channel:
    def clock() -> Clock:
        numbers = [_number(sheet, table[line][column], line + 1, column) for line in (1, 2)]
        start = numbers[0] if layout.start is None else layout.start
        interval = numbers[1] if layout.interval is None else layout.interval
        if not interval > 0.0:
            raise InputError(sheet.path, f"has the interval {interval:g} s", line=3, allowed="> 0 s")
        stated = layout.start is not None or layout.interval is not None
        return Clock(start, interval, "lines 2 and 3" + (" and as stated" if stated else ""))

    return Channel(
        name=sheet.names[column],
        number=column + 1,
        unit="V",
        samples=len(sheet.rows),
        values=lambda: sheet.numbers(column),
        clock=clock,
        place=lambda sample: sheet.first_line + sample,
    )


def _number(sheet: Sheet, text: str, line: int, column: int) -> float:
    if not sheet.dialect.is_number(text.strip()):
        raise InputError(
            sheet.path,
            f"column '{sheet.names[column]}' is not a number: '{text[:60]}'",
            line=line,
            cure="line 2 holds the time of the first sample, line 3 the interval, both in seconds",
        )
    return float(text)
