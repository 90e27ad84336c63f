"""Picture series as cameras write them: TIFF stacks, numbered PNG files, Phantom cine, Photron mraw."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

from dic.files import replacing
from dic.opencv import cv2

Stack = NDArray[np.uint16]
"""Grey values, shape [n_frames, rows, columns]."""

_SETUP = 0x1AF8
"""Length of SETUP in a cine of version 1 [bytes]."""


def write_tiff(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a stack of 16-bit pages."""
    with replacing(path) as partial:
        tifffile.imwrite(partial, pictures, photometric="minisblack")


def write_png(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a folder with a numbered series of 8-bit files; further bits are cut off."""
    path.mkdir()
    shift = max(bits - 8, 0)
    for number, picture in enumerate(pictures):
        if not cv2.imwrite(str(path / f"{number:04d}.png"), (picture >> shift).astype(np.uint8)):
            raise OSError(f"{path}: picture {number} cannot be written")


def write_numbered(path: Path, picture: NDArray[np.uint16], *, bits: int) -> None:
    """Write one PNG file, of 8 bits if the grey values have no more, else of 16."""
    if not cv2.imwrite(str(path), picture.astype(np.uint8) if bits <= 8 else picture):
        raise OSError(f"{path} cannot be written")


def write_cine(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a Phantom cine of 16-bit values, with time stamps from its trigger at t = 0 on.

    After Vision Research's "Cine File Format": file header, bitmap header, SETUP, one tagged block of time
    stamps,
    table of positions, pictures, bottom row first.
    """
    n, rows, columns = pictures.shape
    trigger = 1 << 31  # half a second: stamps before it need no borrowing from the seconds
    setup = bytearray(_SETUP)
    struct.pack_into("<H", setup, 0, min(round(rate), 65535))  # FrameRate16
    struct.pack_into("<2sH", setup, 140, b"ST", _SETUP)
    struct.pack_into("<HH", setup, 737, columns, rows)  # ImWidth, ImHeight
    struct.pack_into("<I", setup, 768, round(rate))  # FrameRate
    struct.pack_into("<I", setup, 896, bits)  # RealBPP
    struct.pack_into("<II", setup, 5732, 0, 2**bits - 1)  # BlackLevel, WhiteLevel
    ticks = np.rint(times * 2.0**32).astype(np.int64) + trigger
    stamps = np.stack([(ticks & 0xFFFFFFFF) & ~np.int64(3), ticks >> 32], axis=1).astype("<u4")
    block = struct.pack("<IHH", 8 + stamps.nbytes, 1002, 0) + stamps.tobytes()
    at_setup = 44 + 40
    table = at_setup + len(setup) + len(block)
    size = rows * columns * 2
    first = table + 8 * n
    places = first + np.arange(n) * (8 + size)
    number = int(np.rint(times[0] * rate))
    header = struct.pack(
        "<2sHHHiIiIIIIII", b"CI", 44, 0, 1, number, n, number, n, 44, at_setup, table, trigger, 0
    )
    bitmap = struct.pack("<IiiHHIIiiII", 40, columns, rows, 1, 16, 0, size, 10_000, 10_000, 0, 2**bits)
    note = struct.pack("<II", 8, size)
    with replacing(path) as partial, partial.open("wb") as file:
        for part in (header, bitmap, bytes(setup), block, places.astype("<i8").tobytes()):
            file.write(part)
        for picture in pictures:
            file.write(note)
            file.write(picture[::-1].astype("<u2").tobytes())


def write_mraw(path: Path, pictures: Stack, *, bits: int, times: NDArray[np.float64], rate: float) -> None:
    """Write a Photron recording of 16-bit values: `path` (.mraw) and its .cihx beside it."""
    n, rows, columns = pictures.shape
    start = int(np.rint(times[0] * rate))
    text = (
        '<?xml version="1.0" encoding="utf-8"?>\n<cih><fileInfo><date>2026/01/01</date></fileInfo>'
        "<basicInfo><comment>made</comment></basicInfo><deviceInfo><deviceName>virtual</deviceName></deviceInfo>"
        f"<recordInfo><recordRate>{rate:.10g}</recordRate><shutterSpeed>{rate:.10g}</shutterSpeed></recordInfo>"
        f"<frameInfo><recordedFrame>{n}</recordedFrame><totalFrame>{n}</totalFrame><startFrame>{start}</startFrame>"
        "<skipFrame>1</skipFrame></frameInfo><imageFileInfo><fileFormat>MRaw</fileFormat></imageFileInfo>"
        f"<imageDataInfo><resolution><width>{columns}</width><height>{rows}</height></resolution>"
        "<colorInfo><type>Mono</type><bit>16</bit></colorInfo>"
        f"<effectiveBit><depth>{bits}</depth><side>Lower</side></effectiveBit></imageDataInfo></cih>\n"
    )
    with replacing(path.with_suffix(".cihx")) as partial:
        partial.write_text(text, encoding="utf-8")
    with replacing(path) as partial, partial.open("wb") as file:
        for picture in pictures:
            file.write(picture.astype("<u2").tobytes())


Writer = Callable[..., None]
WRITERS: dict[str, tuple[str, Writer]] = {
    "tiff": (".tif", write_tiff),
    "png": ("", write_png),
    "cine": (".cine", write_cine),
    "mraw": (".mraw", write_mraw),
}
"""Name of a format -> suffix of its file, "" for a folder, and its writer."""
