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

    Raises InputError for a header without end, no samples, several segments, or another X_Columns.
    """
    sha256, lines, encoding = read_text(path, layout)
    ends = [i for i, line in enumerate(lines) if line.strip().startswith(_END)]
    if len(ends) < 2:
        message = f"has {len(ends)} lines {_END}, a file with samples has two"
        raise InputError(path, message, line=len(lines), cure="the file is cut off; copy or export it again")
    if len(ends) > 2:
        message = "has a second segment"
        cure = "save each record in a separate file; one segment is read"
        raise InputError(path, message, line=ends[2] + 1, cure=cure)
    separator = "," if "Separator,Comma" in (line.strip() for line in lines[: ends[0]]) else "\t"
    file_keys, segment_keys = (
        keys_beside([line.split(separator) for line in part])
        for part in (lines[: ends[0]], lines[ends[0] + 1 : ends[1]])
    )
    count = len(segment_keys.get("Samples", segment_keys.get("X0", []))) or 1
    decimal = (file_keys.get("Decimal_Separator") or ["."])[0] or ","
    if ends[1] + 2 >= len(lines):
        raise InputError(path, "has a header but no data", line=len(lines), cure="export it again")
    headings = [part.strip() for part in lines[ends[1] + 1].split(separator)]
    kind = (file_keys.get("X_Columns") or ["One"])[0]
    times: tuple[int, ...] = ()
    if kind == "One":
        columns, times = range(1, count + 1), (0,)
    elif kind == "Multi":
        columns, times = range(1, 2 * count, 2), tuple(range(0, 2 * count, 2))
    elif kind == "No":  # in most files the column of times exists, but is empty
        empty = int(headings[0] == "X_Value")
        columns = range(empty, count + empty)
    else:
        raise InputError(path, f"says X_Columns = {kind}", allowed="No, One or Multi", cure="export it again")
    width = columns[-1] + 1
    if len(headings) < width:
        message = f"names {len(headings)} columns, the header announces {width}"
        cure = "the file is damaged or cut off; copy or export it again"
        raise InputError(path, message, line=ends[1] + 2, cure=cure)
    names = tuple(name or str(i + 1) for i, name in enumerate(headings[:width]))
    rows = []
    for parts in (line.split(separator) for line in lines[ends[1] + 2 :]):
        parts = parts[:width] if len(parts) == width + 1 else parts  # without a last column of comments
        rows.append(separator.join(part.strip() for part in parts))
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
