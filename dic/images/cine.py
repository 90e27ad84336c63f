"""Phantom `.cine`: uncompressed 8 and 16-bit pictures, and the packed P10 and P12L.

Vision Research's "Cine File Format" defines the parts of a file. These are a file header, a bitmap header,
the SETUP block, tagged blocks with the time stamps, and a table of the pictures' offsets. Uncompressed
pictures are stored bottom row first, packed ones top row first. The display settings in SETUP (flips, gain,
gamma) are not applied. SETUP does not contain the position of a crop on the sensor. The user must declare it.
"""

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images.series import (
    Grey,
    PictureError,
    checked_bits,
    checked_count,
    checked_frame,
    checked_index,
    checked_shape,
    packed_size,
    unpack,
)

_HEADER = struct.Struct("<2sHHHiIiIIIIII")
_BITMAP = struct.Struct("<IiiHHIIiiII")
_NUMBER = struct.Struct("<I")
_TIMES_BLOCK = 1002
_MARK, _RATE, _CFA, _REAL_BITS = 140, 768, 808, 896
"""Offsets of the fields of SETUP that are read [bytes]."""
_LARGEST_HEADER = 2**30
_DAMAGED = "the file is cut off or damaged: copy or export it again"
_PACKED = {256: 10, 1024: 12}
"""Values of biCompression for packed pictures, and their bits: P10 and P12L."""


@dataclass(frozen=True)
class CinePictures:
    """Frames of a Phantom cine; see `dic.images.Pictures`."""

    path: Path
    n_frames: int
    shape: tuple[int, int]
    bits: int
    times: NDArray[np.float64] | None
    table: int
    """Offset of the table of picture positions [bytes]."""
    entry: int
    """Size of one position in that table [bytes]: 4 or 8."""
    stored: int
    """Bits of a grey value in the file: 8, 16, or 10 and 12 packed."""
    bottom_up: bool
    """True if the bottom row is stored first."""
    crop_offset: tuple[float, float] = (0.0, 0.0)

    def frame(self, index: int) -> Grey:
        """Grey values of one picture, shape [rows, columns]; P10 is converted to linear 12-bit values
        (`p10_to_linear`).

        Raises PictureError if the picture's size is wrong, or if the picture or its entry in the table lies
        beyond the end of the file.
        """
        index = checked_index(self.n_frames, index)
        rows, columns = self.shape
        need = packed_size(rows * columns, self.stored)
        with open(self.path, "rb") as file:
            place = self._bytes(file, index, self.table + self.entry * index, self.entry)
            (start,) = struct.unpack("<q" if self.entry == 8 else "<I", place)
            (notes,) = _NUMBER.unpack(self._bytes(file, index, start, 4))
            if notes < 8:
                raise PictureError(
                    self.path,
                    f"its annotation has {notes} bytes, must have 8 or more",
                    frame=index,
                    cure=_DAMAGED,
                )
            (size,) = _NUMBER.unpack(self._bytes(file, index, start + notes - 4, 4))
            if size < need:
                raise PictureError(
                    self.path, f"it has {size} bytes, {need} are needed", frame=index, cure=_DAMAGED
                )
            self._bytes(file, index, start + notes + need - 1, 1)
        raw = np.memmap(self.path, dtype=np.uint8, mode="r", offset=start + notes, shape=(need,))
        return checked_frame(self.path, index, self._grey(raw), self.shape, self.bits)

    def _grey(self, raw: NDArray[np.uint8]) -> NDArray[np.generic]:
        rows, columns = self.shape
        if self.stored in (10, 12):
            values = unpack(raw, self.stored, rows * columns)
            grey: NDArray[np.generic] = p10_to_linear()[values] if self.stored == 10 else values
        else:
            grey = np.array(raw.view("<u2") if self.stored == 16 else raw)
        grey = grey.reshape(rows, columns)
        return np.ascontiguousarray(grey[::-1]) if self.bottom_up else grey

    def _bytes(self, file: BinaryIO, index: int, start: int, count: int) -> bytes:
        """Read bytes of a picture; raises PictureError if the file ends before them."""
        size = file.seek(0, 2)
        if not 0 <= start <= size - count:
            raise PictureError(
                self.path,
                f"bytes {start} to {start + count} of {size} are needed",
                frame=index,
                cure=_DAMAGED,
            )
        file.seek(start)
        return file.read(count)


def sniff(path: Path, start: bytes) -> bool:
    """True if a file with these first bytes is a cine."""
    return start[:2] == b"CI" and len(start) >= _HEADER.size and _HEADER.unpack_from(start)[1] == _HEADER.size


def read(path: Path) -> CinePictures:
    """Open a cine.

    The bits are SETUP's RealBPP for pictures stored in 16 bits, and 12 for P10 and P12L. The times are the
    time stamps relative to the trigger. Without stamps they follow from the frame rate and the first image
    number. If the number of stamps differs from that of the pictures, there are no times.

    Raises PictureError if its headers are cut off or contradictory, or if its pictures are compressed or have
    colours.
    """
    size = path.stat().st_size
    with open(regular(path), "rb") as file:
        head = file.read(_HEADER.size)
        _, _, compression, version, _, _, first, count, at_bitmap, at_setup, table, fraction, second = (
            _HEADER.unpack(head)
        )
        bitmap = _BITMAP.unpack(_piece(file, path, "bitmap header", at_bitmap, _BITMAP.size))
        mark, length = struct.unpack("<2sH", _piece(file, path, "SETUP", at_setup + _MARK, 4))
        if mark != b"ST":
            raise PictureError(
                path, f"its SETUP block at byte {at_setup} has the mark {mark!r}, not b'ST'", cure=_DAMAGED
            )
        setup = _piece(file, path, "SETUP", at_setup, length)
        if table >= size:
            raise PictureError(
                path, f"its table of pictures should lie at byte {table} of {size}", cure=_DAMAGED
            )
        stamps = _stamps(_piece(file, path, "tagged blocks", at_setup + length, table - at_setup - length))
    _, columns, height, _, container, packing, *_ = bitmap
    colours = _field(setup, _CFA)
    for unread, what in (
        (colours & 0xFFFF, f"was taken with a colour filter ({colours & 0xFFFF}), one colour a pixel"),
        (container in (24, 48), f"holds colour pictures of {container} bits a pixel"),
        (compression != 0, f"holds compressed pictures (compression {compression})"),
        (container not in (8, 16), f"holds pictures of {container} bits a pixel, not 8 or 16"),
        (packing not in (0, *_PACKED), f"holds pictures of an unknown packing ({packing})"),
    ):
        if unread:
            cure = "export grey pictures: a cine without compression or packed as P10 or P12L, or TIFF files"
            raise PictureError(path, what, cure=cure)
    stored = _PACKED.get(packing, container)
    real = _field(setup, _REAL_BITS)
    bits = 12 if packing else (real or container) if container == 16 else 8
    count = checked_count(path, count)
    return CinePictures(
        path=path,
        n_frames=count,
        shape=checked_shape(path, abs(height), columns),
        bits=checked_bits(path, bits, 16),
        times=_times(stamps, (fraction, second), first, count, _field(setup, _RATE)),
        table=table,
        entry=8 if version else 4,
        stored=stored,
        bottom_up=packing == 0 and height > 0,
    )


def _piece(file: BinaryIO, path: Path, part: str, start: int, count: int) -> bytes:
    """Read part of the headers; raises PictureError if the file ends before it."""
    size = file.seek(0, 2)
    if not 0 <= count <= _LARGEST_HEADER or start + count > size:
        raise PictureError(
            path, f"its {part} should lie at bytes {start} to {start + count} of {size}", cure=_DAMAGED
        )
    file.seek(start)
    return file.read(count)


def _field(setup: bytes, place: int) -> int:
    """An unsigned field of SETUP; 0 if this version of SETUP does not contain it."""
    return int(_NUMBER.unpack_from(setup, place)[0]) if len(setup) >= place + 4 else 0


def _stamps(blocks: bytes) -> NDArray[np.uint32] | None:
    """The time stamps among the tagged blocks, fractions and seconds, shape [n, 2]."""
    place = 0
    while place + 8 <= len(blocks):
        size, kind = struct.unpack_from("<IH", blocks, place)
        if size < 8 or place + size > len(blocks):
            return None
        if kind == _TIMES_BLOCK:
            return np.frombuffer(blocks[place + 8 : place + size - size % 8], dtype="<u4").reshape(-1, 2)
        place += size
    return None


def _times(
    stamps: NDArray[np.uint32] | None, trigger: tuple[int, int], first: int, count: int, rate: int
) -> NDArray[np.float64] | None:
    """Times relative to the trigger [s]; the two lowest bits of a stamp's fraction are flags."""
    if stamps is None:
        return (first + np.arange(count)) / rate if rate else None
    if len(stamps) != count:
        return None
    since = stamps.astype(np.int64) & [~3, -1]
    since -= [trigger[0] & ~3, trigger[1]]
    return np.asarray(since[:, 1] + since[:, 0] / 2.0**32)


@cache
def p10_to_linear() -> NDArray[np.uint16]:
    """Linear 12-bit grey values (proportional to light) of the 1024 values of P10, shape [1024].

    P10 stores grey values through the transfer curve of ITU-R BT.709, V = 4.5 L below L = 0.018 and V = 1.099
    L^0.45 - 0.099 above, with V = (value - 63.25)/954.57 and grey value 63.7 + 4033.7 L. The two ranges are
    fitted to the manufacturer's printed table; from 1 to 1014 the deviation is at most one grey value. Values
    above 1014 are saturated and become 4095.
    """
    V = (np.arange(1024) - 63.253) / 954.569
    with np.errstate(invalid="ignore"):
        L = np.where(V < 0.081, V / 4.5, ((V + 0.09872) / 1.09872) ** (1.0 / 0.45))
    grey = np.rint(63.731 + 4033.710 * L)
    grey[1015:] = 4095.0
    return np.asarray(grey, dtype=np.uint16)
