"""Numbered series of TIFF, PNG, JPEG and BMP pictures, one file per frame.

The number in the name gives the frame. The first number is frame 0. The step is the largest one that fits all
numbers (0002, 0004, 0008: step 2). A missing number is a missing frame. OpenCV decodes truncated files and
accepts any size stated in a header. Therefore size and completeness are checked in the bytes first.
"""

import re
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images import tiff
from dic.images.series import (
    Grey,
    PictureError,
    PictureSizeError,
    checked_bits,
    checked_frame,
    checked_index,
    checked_shape,
)

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG_END_WITHIN = 65_536
"""Largest distance of a JPEG's end mark from the end of the file [bytes]. Cameras append notes after the
mark."""


def _missing_end(data: bytes) -> str:
    """Missing or damaged part of a PNG, JPEG or BMP file, in words; empty if none is found."""
    if data.startswith(_PNG):
        return _png(data)
    if data.startswith(b"\xff\xd8"):
        whole = b"\xff\xd9" in data[max(2, len(data) - _JPEG_END_WITHIN) :]
        return "" if whole else "the JPEG file is cut off: its end mark is missing"
    if data.startswith(b"BM"):
        return _bmp(data)
    return ""


def _stated_size(data: bytes) -> tuple[int, int] | None:
    """Rows and columns stated in the header; None for another kind of file or an incomplete header."""
    if data.startswith(_PNG) and len(data) >= 24:
        columns, rows = struct.unpack_from(">II", data, 16)
        return rows, columns
    if data.startswith(b"BM") and len(data) >= 26:
        oldest = data[14:18] == b"\x0c\0\0\0"
        columns, rows = struct.unpack_from("<HH" if oldest else "<ii", data, 18)
        return abs(rows), columns
    return _jpeg_size(data) if data.startswith(b"\xff\xd8") else None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Rows and columns in the first frame header of a JPEG; the blocks before it are skipped."""
    place = 2
    while place + 9 <= len(data):
        if data[place] != 0xFF or data[place + 1] == 0xFF:
            place += 1  # fill bytes
            continue
        kind, (length,) = data[place + 1], struct.unpack_from(">H", data, place + 2)
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            rows, columns = struct.unpack_from(">HH", data, place + 5)
            return rows, columns
        place += 2 if kind == 0x01 or 0xD0 <= kind <= 0xD9 else 2 + length
    return None


def _png(data: bytes) -> str:
    place = len(_PNG)
    while place + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + length
        if end > len(data):
            break
        (check,) = struct.unpack_from(">I", data, end - 4)
        if zlib.crc32(data[place + 4 : end - 4]) != check:
            return f"the PNG file is damaged: the check sum of its block at byte {place} is wrong"
        if kind == b"IEND":
            return ""
        place = end
    return f"the PNG file is cut off: its block at byte {place} is not whole"


def _bmp(data: bytes) -> str:
    if len(data) < 34:
        return "the BMP file is cut off in its header"
    start, header, width, height, _, bits, compression = struct.unpack_from("<IIiiHHI", data, 10)
    if header < 40 or compression != 0:
        return ""  # an older header or run lengths: the decoder checks them
    need = start + (abs(width) * bits + 31) // 32 * 4 * abs(height)
    return f"the BMP file is cut off: {len(data)} of {need} bytes are there" if len(data) < need else ""


SUFFIXES = (".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp")
"""File name endings that are searched in a folder; a pattern may name others."""
MOST_MISSING = 20
"""Largest span of the numbers over the number of pictures. A larger span suggests time stamps."""
WEIGHTS = "0.299 R + 0.587 G + 0.114 B"
"""Grey value of a colour pixel (ITU-R BT.601), with OpenCV's weights; a TIFF with colours is rejected."""
LARGEST_FILE = 2**29
"""Largest picture file that is read [bytes]."""


@dataclass(frozen=True)
class NumberedPictures:
    """Frames stored in separate files; see `dic.images.Pictures`."""

    path: Path
    files: tuple[Path | None, ...]
    """The file of each frame, None where the number is missing."""
    numbers: tuple[int, ...]
    """The numbers in the files' names."""
    shape: tuple[int, int]
    bits: int
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: NDArray[np.float64] | None = None
    coloured: bool = False
    """Whether the first picture has pixels whose three colours differ."""
    stored: int = 0
    """Bits in which each grey value is stored, 8 or 16; 0: not checked."""
    tripled: bool = False
    """Whether the first picture has three equal colour channels. Then one of them is used."""

    @property
    def n_frames(self) -> int:
        """Number of frames, including missing ones."""
        return len(self.files)

    def frame(self, index: int) -> Grey:
        """Grey values of one file. A JPEG is rotated as stated in its EXIF; three colours are combined by
        `WEIGHTS`.
        """
        file = self.files[checked_index(self.n_frames, index)]
        if file is None:
            raise PictureError(
                self.path, f"no file has the number {self.numbers[index]}", frame=index, cure="copy it again"
            )
        picture = _decode(file, index)[0]
        stored = 8 * picture.dtype.itemsize
        if self.stored and stored != self.stored:
            raise PictureSizeError(
                file,
                f"has grey values of {stored} bits, the series {self.stored}",
                frame=index,
                cure="export all pictures with the same bits",
            )
        return checked_frame(file, index, picture, self.shape, self.bits)


def read_folder(path: Path, pattern: str | None = None) -> NumberedPictures:
    """Open the series in a folder.

    ``pattern``: names of the series with one `*` for the number, e.g. ``"cam0_*.png"``. Without it all
    pictures of the folder must belong to one series. The last number in a name is then the frame's number.
    """
    candidates = _matching(path, pattern) if pattern is not None else _only_series(path)
    by_number: dict[int, Path] = {}
    for number, file in candidates:
        if number in by_number:
            raise PictureError(
                path,
                f"{by_number[number].name} and {file.name} have one number, {number}",
                cure="remove or rename one of them",
            )
        by_number[number] = file
    first, last = min(by_number), max(by_number)
    step = gcd(*(number - first for number in by_number)) or 1
    n_frames = (last - first) // step + 1
    if n_frames > MOST_MISSING * len(by_number):
        raise PictureError(
            path,
            f"{len(by_number)} pictures are numbered from {first} to {last}: these are not frame numbers",
            cure="rename them, or open a list of files in the wanted order",
        )
    numbers = range(first, last + 1, step)
    return _opened(path, [by_number.get(number) for number in numbers], tuple(numbers))


def read_files(files: Sequence[Path]) -> NumberedPictures:
    """Open picture files in the given order. Frame i is file i. A file that does not exist is a missing
    frame."""
    if not files:
        raise PictureError("list of files", "it is empty", cure="name a file at least")
    return _opened(files[0].parent, list(files), tuple(range(len(files))))


def _opened(path: Path, files: list[Path | None], numbers: tuple[int, ...]) -> NumberedPictures:
    """The series, with shape and depth of its first picture that can be decoded."""
    failures: list[PictureError] = []
    for index, file in enumerate(files):
        if file is None:
            continue
        try:
            picture, bits = _decode(file, index)
        except PictureError as error:
            failures.append(error)
            continue
        shape = checked_shape(file, *picture.shape)
        data = file.read_bytes()
        used = checked_bits(file, bits, 16)
        three, differ = (False, False) if tiff.sniff(file, data) else _colours(data)
        return NumberedPictures(
            path,
            tuple(files),
            numbers,
            shape,
            used,
            coloured=differ,
            stored=8 * picture.dtype.itemsize,
            tripled=three and not differ,
        )
    raise PictureError(
        path,
        f"none of {len(failures)} pictures can be decoded, the first: {failures[0]}",
        cure="copy or export them again",
    )


def _only_series(path: Path) -> list[tuple[int, Path]]:
    """Number and file of the one series in a folder."""
    series: dict[str, list[tuple[int, Path]]] = {}
    for file in path.iterdir():
        numbered = re.fullmatch(r"(.*?)(\d{1,18})(\D*)", file.stem, re.DOTALL)
        if file.suffix.lower() in SUFFIXES and numbered:
            before, number, after = numbered.groups()
            series.setdefault(f"{before}*{after}{file.suffix}", []).append((int(number), file))
    if not series:
        raise PictureError(
            path,
            f"holds no numbered pictures ({', '.join(SUFFIXES)})",
            cure="name the folder of the pictures, or a pattern",
        )
    if len(series) > 1:
        names = ", ".join(f'"{name}"' for name in sorted(series)[:6])
        raise PictureError(path, f"holds {len(series)} series: {names}", cure="name one with pattern=")
    return next(iter(series.values()))


def _matching(path: Path, pattern: str) -> list[tuple[int, Path]]:
    """Number and file of the names that match a pattern."""
    if pattern.count("*") != 1 or "/" in pattern:
        raise PictureError(
            path,
            f'pattern "{pattern}" must have one * for the number, and no /',
            cure='write it as "cam0_*.png"',
        )
    before, after = pattern.split("*")
    fits = re.compile(re.escape(before) + r"(\d{1,18})" + re.escape(after))
    matches = [(int(hit[1]), file) for file in path.iterdir() if (hit := fits.fullmatch(file.name))]
    if not matches:
        raise PictureError(
            path,
            f'no file fits the pattern "{pattern}", with a whole number for *',
            cure="look at the names in the folder",
        )
    return matches


def _decode(file: Path, index: int) -> tuple[NDArray[np.generic], int]:
    """Grey values of one file, and the bits that carry them."""
    try:
        size = regular(file).stat().st_size
        data = file.read_bytes() if size <= LARGEST_FILE else b""
    except OSError as error:
        raise PictureError(
            file,
            f"cannot be read ({error.strerror})",
            frame=index,
            cure="copy it again, and see that it may be read",
        ) from None
    if not data:
        raise PictureError(
            file, f"has {size} bytes, allowed are 1 to {LARGEST_FILE}", frame=index, cure="export it again"
        )
    if tiff.sniff(file, data):
        return _page(file, index)
    fault = _missing_end(data)
    if fault:
        raise PictureError(file, fault, frame=index)
    size_given = _stated_size(data)
    if size_given is None:
        raise PictureError(
            file,
            "is not a TIFF, PNG, JPEG or BMP file, or its header is incomplete",
            frame=index,
            cure="is it a picture? if so, export it as TIFF",
        )
    checked_shape(file, *size_given)
    return _by_opencv(file, index, data)


def _page(file: Path, index: int) -> tuple[NDArray[np.generic], int]:
    pages = tiff.read(file)
    if pages.n_frames != 1:
        raise PictureError(
            file,
            f"has {pages.n_frames} pages",
            frame=index,
            cure="open the file itself: it is a separate series",
        )
    return pages.frame(0), pages.bits


def _by_opencv(file: Path, index: int, data: bytes) -> tuple[NDArray[np.generic], int]:
    from dic.basics import cv2

    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
    before = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error as error:
        why = " ".join(error.err.split())
        raise PictureError(file, f"cannot be decoded ({why})", frame=index) from error
    finally:
        cv2.utils.logging.setLogLevel(before)
    if picture is None:
        raise PictureError(file, "cannot be decoded: damaged, or no picture", frame=index)
    return np.asarray(picture), picture.dtype.itemsize * 8


def _colours(data: bytes) -> tuple[bool, bool]:
    """Whether a PNG, JPEG or BMP has three colours, and whether they differ in any pixel."""
    from dic.basics import cv2

    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    if picture is None or picture.ndim != 3:
        return False, False
    return True, bool((picture != picture[..., :1]).any())
