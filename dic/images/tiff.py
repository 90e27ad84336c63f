"""Multi-page TIFF and BigTIFF: 8, 12 and 16-bit grey values, one page per frame.

Opening reads the chain of page headers; each frame is decoded on request. In a truncated file the pages
before the cut are readable. The number of lost pages is known only from a description by tifffile or ImageJ.
Both programs write uncompressed pages in one block. Their grey values can be read without page headers.
"""

import logging
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images.series import (
    MOST_FRAMES,
    Grey,
    PictureError,
    checked_bits,
    checked_frame,
    checked_index,
    checked_shape,
    packed_size,
    unpack,
)

if TYPE_CHECKING:
    import tifffile

logging.getLogger("tifffile").addHandler(logging.NullHandler())  # its findings become a `PictureError`
_MAGIC = {b"II*\0": "<", b"MM\0*": ">", b"II+\0": "<", b"MM\0+": ">"}
_MOST_TAGS = 4096
_OWN_DECODERS = {1, 8, 32773, 32946}
"""Compressions decoded without another library: none, Deflate (two codes), PackBits; OpenCV decodes the
others."""
_DEFLATE = (8, 32946)
_SLACK = 1_000_000
"""Allowed size of a page's strips beyond its grey values [bytes]. Tiles extend past the edges of a page."""
_HARMLESS = 200_000_000
"""Strips are checked only if their unpacked size may exceed this [bytes]. Deflate expands one byte to at most
1032."""
_MIN_IS_WHITE, _MIN_IS_BLACK = 0, 1
_FLOATING = 3
"""`SampleFormat` of floating-point numbers."""


@dataclass(frozen=True)
class TiffPictures:
    """Frames of a multi-page TIFF; see `dic.images.Pictures`."""

    path: Path
    n_frames: int
    shape: tuple[int, int]
    bits: int
    offsets: tuple[int, ...]
    """Offsets of the pages' headers in the file [bytes]."""
    stack: tuple[int, str] | None = None
    """Offset of the grey values of all pages [bytes] and their type, if only the first page has a header."""
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: NDArray[np.float64] | None = None

    def frame(self, index: int) -> Grey:
        """Grey values of one page, larger is brighter, shape [rows, columns].

        Raises PictureError if the page lies beyond a cut, cannot be decoded or has another shape.
        """
        index = checked_index(self.n_frames, index)
        if self.stack is not None:
            return checked_frame(self.path, index, self._of_stack(index, *self.stack), self.shape, self.bits)
        if index >= len(self.offsets):
            raise PictureError(
                self.path,
                f"the file is cut off, {len(self.offsets)} of {self.n_frames} frames or more are there",
                frame=index,
            )
        try:
            picture = _decode(self.path, index, self.offsets[index])
        except PictureError:
            raise
        except Exception as error:  # every exception of a decoder means a damaged page
            raise PictureError(
                self.path, f"cannot be decoded ({error})", frame=index, cure="copy or export the file again"
            ) from error
        return checked_frame(self.path, index, picture, self.shape, self.bits)

    def _of_stack(self, index: int, start: int, kind: str) -> NDArray[np.generic]:
        dtype = np.dtype(kind)
        need = self.shape[0] * self.shape[1] * dtype.itemsize
        size = self.path.stat().st_size
        if start + (index + 1) * need > size:
            raise PictureError(
                self.path,
                f"the file has {size} bytes, {max(size - start, 0) // need} of {self.n_frames} frames",
                frame=index,
            )
        page = np.memmap(self.path, dtype=dtype, mode="r", offset=start + index * need, shape=self.shape)
        return np.array(page, dtype=dtype.newbyteorder("="))


def sniff(path: Path, start: bytes) -> bool:
    """True if a file with these first bytes is a TIFF."""
    return start[:4] in _MAGIC


def read(path: Path) -> TiffPictures:
    """Open a TIFF.

    The grey range is that of the stored numbers. The first page may state a smaller range, in the
    `MaxSampleValue` tag or as `SignificantBits` in an OME description.

    Raises PictureError if it is not a TIFF of grey pictures, or if the header of its first page is
    incomplete.
    """
    import tifffile

    offsets, beyond = _chain(path)
    if not offsets:
        raise PictureError(path, "it is cut off before its first page")
    try:
        with tifffile.TiffFile(path) as file:
            file.filehandle.seek(offsets[0])
            page = tifffile.TiffPage(file, 0)
            stored, rows, columns = page.bitspersample, page.imagelength, page.imagewidth
            largest, description, form = page.tags.valueof(281), page.description, page.sampleformat
            stack = _stack(file, page, beyond) if len(offsets) == 1 else None
    except Exception as error:  # see TiffPictures.frame
        raise PictureError(path, f"its first page cannot be read ({error})") from error
    if form == _FLOATING:
        raise PictureError(
            path,
            "its grey values are floating-point numbers, whose range only the whole series has",
            cure="read the pictures with tifffile.imread and give their arrays to measure_plane, which "
            "scales them together, or export grey values of 8 to 16 bits",
        )
    if not isinstance(stored, int) or not 8 <= stored <= 16:
        raise PictureError(
            path,
            f"its grey values have {str(stored)[:60]} bits, 8 to 16 can be read",
            cure="export grey values of 8 to 16 bits",
        )
    stated = _stated_bits(largest, description, stored)
    cut = beyond is not None
    promised = max(len(offsets) + cut, _promised(description) if cut or stack else 0)
    return TiffPictures(
        path=path,
        n_frames=promised,
        shape=checked_shape(path, rows, columns),
        bits=checked_bits(path, stated, 16),
        offsets=offsets,
        stack=stack,
    )


def _chain(path: Path) -> tuple[tuple[int, ...], int | None]:
    """Offsets of the complete page headers, and of the next one if the chain is truncated."""
    offsets: dict[int, None] = {}
    with open(regular(path), "rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        magic = file.read(4)
        order, big = _MAGIC[magic], magic in (b"II+\0", b"MM\0+")
        first, count, entry, link = (16, "Q", 20, "Q") if big else (8, "H", 12, "I")
        file.seek(first // 2)
        raw = file.read(struct.calcsize(link))
        while len(raw) == struct.calcsize(link):
            (offset,) = struct.unpack(order + link, raw)
            if offset == 0:
                return tuple(offsets), None if offsets else size
            if offset < first or offset in offsets or len(offsets) >= MOST_FRAMES:
                raise PictureError(
                    path, f"page {len(offsets)} starts at byte {offset}, which is not possible"
                )
            if offset + struct.calcsize(count) > size:
                return tuple(offsets), offset
            file.seek(offset)
            (tags,) = struct.unpack(order + count, file.read(struct.calcsize(count)))
            if not 1 <= tags <= _MOST_TAGS:
                raise PictureError(
                    path, f"page {len(offsets)} has {tags} tags, allowed are 1 to {_MOST_TAGS}"
                )
            file.seek(tags * entry, 1)
            raw = file.read(struct.calcsize(link))
            if len(raw) == struct.calcsize(link):
                offsets[offset] = None
    return tuple(offsets), size


def _stack(
    file: "tifffile.TiffFile", page: "tifffile.TiffPage", beyond: int | None
) -> tuple[int, str] | None:
    """Offset and type of the grey values if all pages follow a single header."""
    pages, bits = _promised(page.description), page.bitspersample
    if pages < 2 or page.compression != 1 or page.photometric != _MIN_IS_BLACK or bits not in (8, 16):
        return None
    start = page.dataoffsets[0]
    end = start + pages * page.imagelength * page.imagewidth * bits // 8
    if "ImageJ=" not in page.description if beyond is None else beyond < end:
        return None
    return start, f"{file.byteorder}u{bits // 8}"


def _promised(description: str) -> int:
    """Number of pages stated in the description of the first page; 0 if it states none."""
    shaped = re.search(r'"shape": ?\[(\d+), ?\d+, ?\d+\]', description)
    imagej = re.search(r"^images=(\d+)$", description, re.MULTILINE) if "ImageJ=" in description else None
    counts = [int(match[1][:12]) for match in (shaped, imagej) if match]
    return counts[0] if counts and counts[0] <= MOST_FRAMES else 0


def _stated_bits(largest: object, description: str, stored: int) -> int:
    """Bits that carry the grey value according to the header, at most those stored."""
    significant = re.search(r'SignificantBits="(\d{1,2})"', description)
    if significant and 1 <= int(significant[1]) <= stored:
        return int(significant[1])
    if isinstance(largest, int) and 1 <= largest < 2**stored:
        return largest.bit_length()
    return stored


def _decode(path: Path, index: int, offset: int) -> NDArray[np.generic]:
    import tifffile

    with tifffile.TiffFile(path) as file:
        file.filehandle.seek(offset)
        page = tifffile.TiffPage(file, index)
        shape = checked_shape(path, page.imagelength, page.imagewidth)
        if page.samplesperpixel != 1 or page.photometric not in (_MIN_IS_WHITE, _MIN_IS_BLACK):
            raise PictureError(
                path, "is a colour picture", frame=index, cure="export grey values as they were recorded"
            )
        for start, length in zip(page.dataoffsets, page.databytecounts, strict=True):
            if length < 1 or start + length > file.filehandle.size:
                raise PictureError(
                    path,
                    f"its grey values lie at bytes {start} to {start + length} of {file.filehandle.size}",
                    frame=index,
                    cure="the file is cut off or damaged: copy or export it again",
                )
        _check_strips(file, page)
        if page.bitspersample == 12 and page.compression == 1 and not page.is_tiled:
            picture: NDArray[np.generic] = _unpacked(file, page, shape)
        elif page.bitspersample in (8, 16) and page.compression in _OWN_DECODERS:
            picture = page.asarray()
        else:
            picture = _by_opencv(path, index, page.bitspersample)
        if page.photometric == _MIN_IS_WHITE:
            picture = (2**page.bitspersample - 1 - picture.astype(np.int64)).astype(picture.dtype)
    return picture


def _check_strips(file: "tifffile.TiffFile", page: "tifffile.TiffPage") -> None:
    """Reject strips with more data than the page, packed or unpacked: a small file may unpack to any size."""
    most = page.imagelength * page.imagewidth * 2 + _SLACK
    if sum(page.databytecounts) > 2 * most:
        raise ValueError(f"its strips have {sum(page.databytecounts)} bytes, the page needs at most {most}")
    if page.compression not in _DEFLATE or 1032 * sum(page.databytecounts) < _HARMLESS:
        return
    remaining = 2 * most
    for segment in _segments(file, page):
        remaining -= len(zlib.decompressobj().decompress(segment, remaining + 1))
        if remaining < 0:
            raise ValueError(f"its strips unpack to more than the {most} bytes that the page needs")


def _unpacked(file: "tifffile.TiffFile", page: "tifffile.TiffPage", shape: tuple[int, int]) -> Grey:
    """An uncompressed page of 12 bits; each row starts at a whole byte."""
    rows, columns = shape
    length = packed_size(columns, 12)
    raw = b"".join(
        segment[:count] for segment, count in zip(_segments(file, page), page.databytecounts, strict=True)
    )
    if len(raw) < rows * length:
        raise ValueError(f"{rows} rows of {length} bytes are {rows * length}, there are {len(raw)}")
    table = np.frombuffer(raw, dtype=np.uint8, count=rows * length).reshape(rows, length)
    even = np.zeros((rows, packed_size(columns + columns % 2, 12)), dtype=np.uint8)
    even[:, :length] = table
    return unpack(even.reshape(-1), 12, even.size * 2 // 3).reshape(rows, -1)[:, :columns]


def _segments(file: "tifffile.TiffFile", page: "tifffile.TiffPage") -> Iterator[bytes]:
    for start, length in zip(page.dataoffsets, page.databytecounts, strict=True):
        file.filehandle.seek(start)
        yield file.filehandle.read(length)


def _by_opencv(path: Path, index: int, bits: int) -> NDArray[np.generic]:
    from dic.basics import cv2

    try:
        success, pictures = cv2.imreadmulti(str(path), index, 1, flags=cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ValueError(" ".join(error.err.split())) from None
    if not success or len(pictures) != 1:
        raise ValueError("its compression is not supported by tifffile or OpenCV")
    picture = np.asarray(pictures[0])
    if picture.dtype == np.uint16 and bits < 16:  # OpenCV shifts values of fewer bits to the top
        return np.right_shift(picture, 16 - bits)
    return picture
