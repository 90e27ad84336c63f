"""CSV of Tektronix TDS, TPS and MDO oscilloscopes: keys in columns 1 to 3, then time and volts.

A line is "Record Length,2.500000e+03,,-0.00050000,0.10400,". The first lines have keys, the others begin with
three empty fields. Several channels of one capture are several such blocks beside each other.
"""

from pathlib import Path

from kolsky.readers.contents import Channel, Contents, head_of
from kolsky.readers.header import bare_key, check_width, keys_beside
from kolsky.readers.layout import Layout
from kolsky.readers.sheet import Sheet, SignalTable
from kolsky.readers.text import Dialect, read_text

_BLOCK = 5
"""Columns of a block: key, value, unit, time, volts. A line of a block may end with a comma."""

_KEYED = 40
"""Number of lines that may have keys."""


def sniff(path: Path) -> bool:
    """True if the first line has the key "Record Length" followed by time and volts."""
    line = head_of(path, 1024).split(b"\n")[0].decode("latin-1")
    cells = [part.strip() for part in line.split(",")]
    named = line.lower().lstrip('"').startswith("record length") and len(cells) >= _BLOCK
    return named and all(map(Dialect(",", ".", 0, ()).is_number, cells[3:5]))


def read(path: Path, layout: Layout) -> Contents:
    """Read all blocks of a file. Raises InputError if a line has fewer fields than the first block needs."""
    sha256, lines, encoding = read_text(path, layout)
    fields = lines[0].count(",") + 1
    check_width(path, lines, ",", fields)
    cells = [[part.strip() for part in line.split(",")] for line in lines[:_KEYED]]
    channels: list[Channel] = []
    metadata: dict[str, str] = {}
    starts = [i for i, cell in enumerate(cells[0]) if bare_key(cell) == "recordlength"]
    blocks = [start for start in starts if start + _BLOCK <= fields]
    for number, start in enumerate(blocks):
        keys = keys_beside([row[start : start + 3] for row in cells])
        metadata |= {f"{key} [{number + 1}]" if number else key: ", ".join(v) for key, v in keys.items()}
        bare = {bare_key(key): values[0] for key, values in keys.items() if values}
        names = [str(i + 1) for i in range(fields)]
        units: list[str | None] = [None] * fields
        time, volts = start + 3, start + 4
        names[volts] = bare.get("source", f"CH{number + 1}")
        names[time] = f"{names[volts]} time"
        units[time], units[volts] = bare.get("horizontalunits", "s"), bare.get("verticalunits")
        dialect = Dialect(",", ".", fields, (time, volts))
        sheet = Sheet(path, dialect, lines, 1, tuple(names), tuple(units), keys)
        channels += SignalTable(sheet, layout, (time,)).channels()
    facts = {"format": "tektronix", "encoding": encoding, "delimiter": "comma", "header": "beside samples"}
    return Contents(path=path, sha256=sha256, channels=tuple(channels), facts=facts, metadata=metadata)
