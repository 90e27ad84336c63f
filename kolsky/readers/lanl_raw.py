"""Los Alamos .raw: metadata in columns 1 and 2, a signal in every further column.

The file is tab-separated. Line 1 names the signals, line 2 has the time of the first sample [s], line 3 the
interval [s]. The samples follow [V]. After https://github.com/lanl/HopPyBar (BSD-3-Clause).
"""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Contents, head_of
from kolsky.readers.header import check_width, keys_beside
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet, SignalTable
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
        message = f"has {fields} columns and {len(lines)} lines; two of metadata and a signal are needed"
        cure = "is it a .raw file of this make? if not, give its format in the layout"
        raise InputError(path, message, line=1, cure=cure)
    check_width(path, lines, "\t", fields)
    keys, clock = keys_beside([line.split("\t")[:2] for line in lines]), {}
    dialect = Dialect("\t", ".", fields, tuple(range(2, fields)))
    names = tuple(name or str(i + 1) for i, name in enumerate(dialect.split(lines[0])))
    for number, key in ((2, "X0"), (3, "Delta_X")):
        clock[key] = dialect.split(lines[number - 1])[2:]
        for name, text in zip(names[2:], clock[key], strict=True):
            if not dialect.is_number(text):
                message = f"column '{name}' is not a number: '{text[:60]}'"
                cure = "line 2 holds the time of the first sample, line 3 the interval, both in seconds"
                raise InputError(path, message, line=number, cure=cure)
    sheet = Sheet(path, dialect, lines[3:], 4, names, (None, None) + ("V",) * (fields - 2), clock)
    channels = SignalTable(sheet, layout, ()).channels()
    facts = {"format": "lanl", "encoding": encoding, "delimiter": "tab", "decimal": ".", "header": "1"}
    metadata = {key: ", ".join(values) for key, values in keys.items()}
    return Contents(path=path, sha256=sha256, channels=channels, facts=facts, metadata=metadata)
