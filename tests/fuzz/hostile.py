"""Hostile files: huge unpacked data, endless expressions, and paths that are no regular files.

Each is written and read in a separate process with limits on time and memory. It must be rejected, or read if
it is valid. None is large on the disk: large files are sparse.
"""

import io
import os
import random
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from tests.fuzz.targets import Target, all_targets

SPARSE = 20_000_000_000  # size of a file that has no blocks on the disk [bytes]


@dataclass(frozen=True)
class Trap:
    """A file made to do harm."""

    target: str  # name of the target that reads it
    name: str

    def __str__(self) -> str:
        return f"{self.target} | {self.name}"


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


def _sparse(path: Path) -> None:
    head = path.read_bytes()[:600]
    with path.open("wb") as file:
        file.write(head)
        file.truncate(SPARSE)


def _empty(path: Path) -> None:
    path.write_bytes(b"")


ANYWHERE: dict[str, Callable[[Path], None]] = {
    "a pipe": _pipe, "a link to a device": _device, "a folder": _folder, "a link to itself": _loop,
    "20 GB of nothing": _sparse, "an empty file": _empty,
}  # fmt: skip
"""What may stand in the place of any file."""


def _before(words: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(words + b"\n" + path.read_bytes())


def _heading(words: bytes) -> Callable[[Path], None]:
    def put(path: Path) -> None:
        first, _, rest = path.read_bytes().partition(b"\n")
        path.write_bytes(first.rstrip(b"\r") + words + b"\n" + rest)

    return put


IN_TEXT: dict[str, Callable[[Path], None]] = {
    "300 000 blanks behind a bracket": _before(b"[" + b" " * 300_000),
    "300 000 brackets": _before(b"(" * 300_000),
    "a unit of 300 000 letters": _heading(b" (" + b"m" * 300_000 + b")"),
    "blanks behind a bracket in the heading": _heading(b" [" + b" " * 30_000),
    "a line of 300 000 blanks": _before(b" " * 300_000),
    "100 000 empty lines": _before(b"\n" * 100_000),
    "a field of 200 000 characters in quotes": _heading(b',"' + b"x" * 200_000 + b'"'),
    "5 MB without an end of line": _before(b"1" * 5_000_000),
    "100 000 keys": _before(b"\n".join(b"k%d,1" % i for i in range(100_000))),
}
"""What may stand in any text."""


def _workbook(rows: str, dimension: str = "A1:B2") -> Callable[[Path], None]:
    """A workbook of one sheet with these rows."""

    def put(path: Path) -> None:
        import openpyxl

        book = openpyxl.Workbook()
        book.active.append(["Time/s", "CH1/V", "CH2/V"])  # type: ignore[union-attr]
        held = io.BytesIO()
        book.save(held)
        with zipfile.ZipFile(held) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
            for part in old.infolist():
                data = old.read(part)
                if part.filename.endswith("sheet1.xml"):
                    data = (
                        '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">'
                        f'<dimension ref="{dimension}"/><sheetData>{rows}</sheetData></worksheet>'
                    ).encode()
                new.writestr(part, data)

    return put


def _cell(place: str, row: int) -> str:
    return f'<row r="{row}"><c r="{place}{row}"><v>1</v></c></row>'


def _zeros_packed(head: bytes, megabytes: int) -> bytes:
    """A zlib stream of `head` and so many MB of zeros, made by repeating one packed block."""
    packer = zlib.compressobj(9)
    begun = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(bytes(1_000_000)) + packer.flush(zlib.Z_FULL_FLUSH)
    low, high = zlib.adler32(head) & 0xFFFF, zlib.adler32(head) >> 16
    high = (high + megabytes * 1_000_000 * low) % 65521  # Adler-32: zeros add the low sum again and again
    return begun + megabytes * block + packer.flush()[:-4] + struct.pack(">I", high << 16 | low)


def _matlab(path: Path) -> None:
    """Thirty variables, each of which unpacks to 390 MB: 12 GB in 12 MB."""
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    megabytes = 390
    plain = struct.pack("<II", 14, 48 + megabytes * 1_000_000) + struct.pack("<IIII", 6, 8, 6, 0)
    plain += struct.pack("<IIii", 5, 8, megabytes * 125_000, 1) + struct.pack("<HH4s", 1, 4, b"CH1\0")
    packed = _zeros_packed(plain + struct.pack("<II", 9, megabytes * 1_000_000), megabytes)
    element = struct.pack("<II", 15, len(packed)) + packed
    path.write_bytes(header + 30 * element)


def _strips(path: Path) -> None:
    """A TIFF of 6 x 16 pixels whose strip unpacks to 2 GB."""
    packed = _zeros_packed(b"", 2000)
    _write_tiff(path, packed, len(packed))


def _long_strip(path: Path) -> None:
    """A TIFF of 6 x 16 pixels that declares a strip of 4 GB."""
    _write_tiff(path, bytes(192), 0xFFFFFFF0)


def _write_tiff(path: Path, strip: bytes, stated: int) -> None:
    tags = [
        (256, 4, 16), (257, 4, 6), (258, 3, 16), (259, 3, 8), (262, 3, 1), (273, 4, 8), (277, 3, 1),
        (278, 4, 6), (279, 4, stated),
    ]  # fmt: skip
    place = 8 + len(strip) + len(strip) % 2
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    body = strip + bytes(len(strip) % 2) + struct.pack("<H", len(tags)) + entries + bytes(4)
    path.write_bytes(b"II*\0" + struct.pack("<I", place) + body)


def _declared_times(path: Path) -> None:
    """A billion times are declared beside the pictures, and none is stored."""
    with h5py.File(path, "r+") as file:
        del file["times"]
        file.create_dataset("times", shape=(1_000_000_000,), dtype="f8", chunks=(1024,))
        grey = file["a"][()]
        del file["a"]
        size = grey.shape[1:]
        file.create_dataset("a", shape=(1_000_000_000, *size), dtype=grey.dtype, chunks=(1, *size))


def _zeros(path: Path) -> None:
    """160 GB of zeros in datasets each of which may be read."""
    with h5py.File(path, "r+") as file:
        for number in range(1000):
            file.create_dataset(f"scope/Z{number}", shape=(19_000_000,), dtype="f8", chunks=(19_000,))


def _wide(path: Path) -> None:
    """Every large dataset of a result is declared at the most that one may have."""
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        for name in names:
            old = file[name]
            if old.ndim and old.dtype.kind == "f":
                unit, shape = dict(old.attrs), (12_000_000, *old.shape[1:])
                del file[name]
                made = file.create_dataset(name, shape=shape, dtype="<f8", chunks=(4096, *old.shape[1:]))
                made.attrs.update(unit)


def _entities(path: Path) -> None:
    laughs = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12))
    text = f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "ha">{laughs}]><cih><x>&a11;</x></cih>'
    path.write_text(text)


def _comments(path: Path) -> None:
    path.write_bytes(b"<cih>" + b"<!--" * 900_000 + b"</cih>")


def _noise(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:16] + random.Random(5).randbytes(2_000_000))


OWN: dict[str, tuple[str, Callable[[Path], None]]] = {
    "a row of the number 2 000 000 000": ("recorder excel", _workbook(_cell("A", 1) + _cell("A", 2 * 10**9))),
    "a sheet that declares 2 000 000 000 rows": (
        "recorder excel",
        _workbook(_cell("A", 1) + _cell("A", 2 * 10**9), "A1:C2000000000"),
    ),
    "a cell at XFD1048576": ("recorder excel", _workbook(_cell("XFD", 1_048_576), "A1:XFD1048576")),
    "12 GB of MATLAB variables": ("recorder mat", _matlab),
    "2 GB in a strip": ("picture a.tif", _strips),
    "a strip of 4 GB": ("picture a.tif", _long_strip),
    "a billion declared times": ("picture a.h5", _declared_times),
    "160 GB of zeros": ("recorder hdf5", _zeros),
    "an identification of zeros": ("result identification.h5", _wide),
    "surfaces of zeros": ("result dic.h5", _wide),
    "entities of a camera's header": ("picture a.cihx", _entities),
    "comments that do not end": ("picture a.cihx", _comments),
    "entities of a scope": ("recorder rohde_schwarz", _entities),
    "entities of a calibration": ("camera dice", _entities),
    "noise behind a LeCroy's header": ("recorder lecroy_trc", _noise),
    "noise behind a TDMS header": ("recorder tdms", _noise),
}  # fmt: skip
"""What is made for one reader: name -> target and what spoils the file."""
MAY_BE_READ = ("100 000 keys", "100 000 empty lines", "a line of 300 000 blanks", "160 GB of zeros")
"""Odd, but nothing is wrong with them: they may be read, within the limits."""


def traps() -> list[Trap]:
    """All of them: the general ones in the place of every file, the others where they belong."""
    found = []
    for name, target in all_targets().items():
        found += [Trap(name, what) for what in ANYWHERE]
        if target.form in ("text", "toml"):
            found += [Trap(name, what) for what in IN_TEXT]
    return found + [Trap(target, what) for what, (target, _) in OWN.items()]


def spoil(trap: Trap, target: Target, folder: Path) -> Path:
    """The spoilt file in an empty folder, with what belongs to it."""
    path = target.write(folder)
    spoiling: Any = {**ANYWHERE, **IN_TEXT}.get(trap.name) or OWN[trap.name][1]
    spoiling(path)
    return path


def harm(trap: Trap, target: Target, content: Any) -> str:
    """What is wrong with having accepted a trap; empty if nothing is."""
    if trap.name in MAY_BE_READ or trap.name in IN_TEXT:
        return ""
    if target.told_values and trap.name == "an empty file":  # a new ledger: no run is found in it
        return "" if all(run is None for run in content) else "runs were found in it"
    return "it was read"
