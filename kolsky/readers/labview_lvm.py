"""LabVIEW measurement file (.lvm), versions 1 and 2, one segment.

Layout: "LabVIEW Measurement File Format Specification", National Instruments, white paper 4139. A file has
key-value lines to "***End_of_Header***". Each segment has a second such header with one value per channel, a
line of column names, and samples. The header names separator and decimal sign. X_Columns is No, One or Multi.
"""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, head_of
from kolsky.readers.header import add_key, keys_beside
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet, SignalTable
from kolsky.readers.text import Dialect, read_text

_END = "***End_of_Header***"


def sniff(path: Path) -> bool:
    """True if a file begins with the words "LabVIEW Measurement". Its name has no effect."""
    head = head_of(path, 64).replace(b"\0", b"").lstrip(b"\xef\xbb\xbf\xff\xfe")
    return head.startswith(b"LabVIEW Measurement")


def read(path: Path, layout: Layout) -> Contents:
    """Read the one segment of a file.

    Raises InputError if a header has no end, if there are no samples or several segments, or if X_Columns is
    none of the three.
    """
    sha256, lines, encoding = read_text(path, layout)
    ends = [i for i, line in enumerate(lines) if line.strip().startswith(_END)]
    if len(ends) < 2:
        raise InputError(
            path,
            f"has {len(ends)} lines {_END}, a file with samples has two",
            line=len(lines),
            cure="the file is cut off; copy or export it again",
        )
    if len(ends) > 2:
        raise InputError(
            path,
            "has a second segment",
            line=ends[2] + 1,
            cure="save each record in a separate file; one segment is read",
        )
    separator = "," if "Separator,Comma" in (line.strip() for line in lines[: ends[0]]) else "\t"
    file_keys, segment_keys = (
        keys_beside([line.split(separator) for line in part])
        for part in (lines[: ends[0]], lines[ends[0] + 1 : ends[1]])
    )
    count = len(segment_keys.get("Samples", segment_keys.get("X0", []))) or 1
    decimal = (file_keys.get("Decimal_Separator") or ["."])[0] or ","
    if ends[1] + 2 >= len(lines):
        raise InputError(path, "has a header but no data", line=len(lines), cure="export it again")
    names, columns, times = _columns(path, lines[ends[1] + 1], separator, file_keys, count, ends[1] + 2)
    rows = [_without_comment(line, separator, len(names)) for line in lines[ends[1] + 2 :]]
    units = [*segment_keys.get("Y_Unit_Label", []), *[None] * count]
    metadata = {**file_keys}
    for key, fields in segment_keys.items():
        add_key(metadata, key, fields)
    sheet = Sheet(
        path=path,
        dialect=Dialect(separator, decimal, len(names), (*times, *columns)),
        rows=rows,
        first_line=ends[1] + 3,
        names=names,
        units=tuple(units[columns.index(i)] if i in columns else "s" for i in range(len(names))),
        metadata={key: fields for key, fields in metadata.items() if key not in ("Time", "Date")},
    )
    facts = {
        "format": "lvm",
        "encoding": encoding,
        "delimiter": "comma" if separator == "," else "tab",
        "decimal": decimal,
        "header": str(ends[1] + 2),
        "first samples": str(ends[1] + 3),
        "counted in": "lines",
    }
    return Contents(
        path=path,
        sha256=sha256,
        channels=SignalTable(sheet, layout, times).channels(),
        facts=facts,
        metadata={key: ", ".join(fields) for key, fields in metadata.items()},
    )


def _columns(
    path: Path, line: str, separator: str, keys: dict[str, list[str]], count: int, number: int
) -> tuple[tuple[str, ...], tuple[int, ...], tuple[int, ...]]:
    """Names of all columns, the columns of the channels and those of the times, counted from 0."""
    kind = (keys.get("X_Columns") or ["One"])[0]
    names = [part.strip() for part in line.split(separator)]
    times: tuple[int, ...] = ()
    columns: tuple[int, ...]
    if kind == "One":
        width, columns, times = count + 1, tuple(range(1, count + 1)), (0,)
    elif kind == "Multi":
        width, columns, times = 2 * count, tuple(range(1, 2 * count, 2)), tuple(range(0, 2 * count, 2))
    elif kind == "No":
        # In most files the column of times exists, but is empty.
        empty = names[0] == "X_Value"
        width, columns = count + empty, tuple(range(int(empty), count + empty))
    else:
        raise InputError(path, f"says X_Columns = {kind}", allowed="No, One or Multi", cure="export it again")
    if len(names) < width:
        raise InputError(
            path,
            f"names {len(names)} columns, the header announces {width}",
            line=number,
            cure="the file is damaged or cut off; copy or export it again",
        )
    return tuple(name or str(i + 1) for i, name in enumerate(names[:width])), columns, times


def _without_comment(line: str, separator: str, width: int) -> str:
    """A line of samples without the last column of comments. Most lines do not have this column."""
    parts = line.split(separator)
    if len(parts) == width + 1:
        parts = parts[:width]
    return separator.join(part.strip() for part in parts)
