"""Size and wholeness of a PNG, JPEG or BMP file by its bytes, before it is decoded.

OpenCV decodes a file that was cut off and makes the rest up, and it decodes whatever size a header gives:
hence the look at the bytes.
"""

import struct
import zlib

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG_END_WITHIN = 65_536
"""Largest distance of a JPEG's end mark from its end: cameras append notes [bytes]."""


def missing_end(data: bytes) -> str:
    """Missing or damaged part of the bytes of a PNG, JPEG or BMP file; empty if none is seen."""
    if data.startswith(_PNG):
        return _png(data)
    if data.startswith(b"\xff\xd8"):
        whole = b"\xff\xd9" in data[max(2, len(data) - _JPEG_END_WITHIN) :]
        return "" if whole else "the JPEG file is cut off: its end mark is missing"
    if data.startswith(b"BM"):
        return _bmp(data)
    return ""


def stated_size(data: bytes) -> tuple[int, int] | None:
    """Rows and columns that the header gives; None if the file is of another kind or has no whole header."""
    if data.startswith(_PNG) and len(data) >= 24:
        columns, rows = struct.unpack_from(">II", data, 16)
        return rows, columns
    if data.startswith(b"BM") and len(data) >= 26:
        oldest = data[14:18] == b"\x0c\0\0\0"
        columns, rows = struct.unpack_from("<HH" if oldest else "<ii", data, 18)
        return abs(rows), columns
    return _jpeg_size(data) if data.startswith(b"\xff\xd8") else None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Of the first frame header: the blocks before it are stepped over."""
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
        return ""  # an older header or run lengths: the decoder has to see
    need = start + (abs(width) * bits + 31) // 32 * 4 * abs(height)
    return f"the BMP file is cut off: {len(data)} of {need} bytes are there" if len(data) < need else ""
