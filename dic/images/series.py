"""A series of pictures of one camera: from a file, from memory, or decoded once; limits for all readers.

Limits are checked before memory is allocated. Grey values of 10 and 12 bits may be packed without gaps, most
significant bit first: four values of 10 bits in five bytes, two of 12 bits in three. Such formats are TIFF
(12 bits), Photron's `.mraw` and Phantom's P10 and P12L.
"""

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dic.files import one_line


class PictureError(ValueError):
    """A picture file or one frame of it that cannot be read.

    Its text names the file, the frame (if only one is affected), the fault and the cure.
    """

    def __init__(
        self, path: Path | str, fault: str, *, frame: int | None = None, cure: str = "copy or export it again"
    ) -> None:
        where = f"{path}" if frame is None else f"{path}, frame {frame}"
        super().__init__(one_line(f"{where}: {fault}" + (f"; {cure}" if cure else "")))
        self.path, self.frame, self.what, self.cure = Path(path), frame, fault, cure

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), frame=self.frame, cure=self.cure), (self.path, self.what)


class PictureSizeError(PictureError):
    """A picture whose size or bits differ from those of its series."""


@runtime_checkable
class Pictures(Protocol):
    """Protocol of a picture series. Opening reads the headers only; each frame is read on request."""

    @property
    def path(self) -> Path:
        """The file, or the folder of a numbered series."""

    @property
    def n_frames(self) -> int:
        """Number of frames stated in the headers."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns [px]."""

    @property
    def bits(self) -> int:
        """Bits that carry the grey value: the largest possible value is 2**bits - 1."""

    @property
    def crop_offset(self) -> tuple[float, float]:
        """Position of the top left pixel on the sensor (x, y) [px]; (0, 0) if the file does not state it."""

    @property
    def times(self) -> NDArray[np.float64] | None:
        """Times of the frames as recorded by the camera [s], shape [n_frames]; None if not recorded."""

    def frame(self, index: int) -> NDArray[np.uint16] | NDArray[np.uint8]:
        """Grey values of one frame as recorded, shape [rows, columns].

        Raises
        ------
        PictureError
            If the frame is missing, cut short or of another shape; other frames are not affected.
        """


Bytes = NDArray[np.uint8]
Words = NDArray[np.uint16]
Grey = Words | Bytes

LARGEST_SIDE = 32_768
"""Largest number of rows or columns of a picture [px]."""
MOST_PIXELS = 2**27
"""Largest number of pixels of a picture."""
MOST_FRAMES = 10_000_000
"""Largest number of frames of a series."""


def checked_shape(path: Path, rows: object, columns: object) -> tuple[int, int]:
    """Rows and columns, if they are within the limits.

    Raises PictureError if either is not a whole number from 1 to `LARGEST_SIDE`, or their product exceeds
    `MOST_PIXELS`.
    """
    if (
        not isinstance(rows, int)
        or not isinstance(columns, int)
        or not (1 <= rows <= LARGEST_SIDE and 1 <= columns <= LARGEST_SIDE)
        or rows * columns > MOST_PIXELS
    ):
        raise PictureError(
            path,
            f"its header gives {rows} rows and {columns} columns, allowed are 1 to {LARGEST_SIDE} of each "
            f"and {MOST_PIXELS} pixels",
            cure="export the pictures again",
        )
    return rows, columns


def checked_count(path: Path, frames: int) -> int:
    """The number of frames, if it is from 1 to `MOST_FRAMES`. Raises PictureError if it is not."""
    if not 1 <= frames <= MOST_FRAMES:
        raise PictureError(
            path,
            f"its header gives {frames} frames, allowed are 1 to {MOST_FRAMES}",
            cure="export the pictures again",
        )
    return int(frames)


def checked_bits(path: Path, bits: int, container: int) -> int:
    """The bits that carry the grey value, at most the `container` bits.

    Raises PictureError if there are more.
    """
    if not 1 <= bits <= container:
        raise PictureError(
            path,
            f"bits = {bits}, allowed are 1 to {container} for grey values stored in {container} bits",
            cure="leave bits out, or give those that carry the grey value",
        )
    return int(bits)


def checked_index(n_frames: int, index: int) -> int:
    """A frame number from 0 to `n_frames` - 1. Raises IndexError if it is outside."""
    index = operator.index(index)
    if not 0 <= index < n_frames:
        raise IndexError(f"frame {index} of {n_frames}: must be from 0 to {n_frames - 1}")
    return index


def checked_frame(
    path: Path, index: int, picture: NDArray[np.generic], shape: tuple[int, int], bits: int
) -> Grey:
    """One decoded frame with the series' shape and 8 or 16-bit grey values within the series' bits.

    Raises PictureError if the frame differs.
    """
    if picture.shape != shape:
        size = " x ".join(str(side) for side in picture.shape)
        raise PictureSizeError(
            path, f"is {size}, the series {shape[0]} x {shape[1]} (rows x columns)", frame=index, cure=""
        )
    if picture.dtype not in (np.uint8, np.uint16):
        raise PictureError(
            path,
            f"holds numbers of type {picture.dtype}, grey values are 8 or 16-bit whole numbers",
            frame=index,
            cure="export them as they were recorded, without scaling",
        )
    largest = int(picture.max())
    if largest >= 2**bits:
        raise PictureError(
            path,
            f"its largest grey value is {largest}, {bits} bits hold {2**bits - 1}",
            frame=index,
            cure=f"declare bits={largest.bit_length()} or more",
        )
    if picture.dtype == np.uint8:
        return np.asarray(picture, dtype=np.uint8)
    return np.asarray(picture, dtype=np.uint16)


@dataclass(frozen=True)
class PicturesInMemory:
    """Arrays as a series; see `dic.images.Pictures`.

    Floating-point pictures are converted to 16-bit whole numbers, with the same scale for all. Values from 0
    to 1 are multiplied by 65 535. For any other range the smallest value becomes 1 and the largest 65 534; no
    pixel counts as saturated.

    Raises ValueError if there are no pictures, if one is not of shape [rows, columns], or if a floating-point
    value is not finite.
    """

    pictures: Sequence[NDArray[np.generic]] | NDArray[np.generic]
    """Grey values, 8 or 16-bit whole numbers or floating-point ones, each of shape [rows, columns]."""
    bits: int = 0
    """Bits that carry the grey value; 0: those of the arrays' type."""
    crop_offset: tuple[float, float] = (0.0, 0.0)
    """Place of the top left pixel on the sensor (x, y) [px]."""
    times: NDArray[np.float64] | None = None
    """Times of the frames [s], shape [n_frames]; None if not known."""

    def __post_init__(self) -> None:
        if not len(self.pictures) or np.ndim(self.pictures[0]) != 2:
            raise ValueError("pictures in memory must be one array [rows, columns] or more")
        if any(np.issubdtype(np.asarray(picture).dtype, np.floating) for picture in self.pictures):
            object.__setattr__(self, "pictures", whole_numbers(self.pictures))
        if not self.bits:
            object.__setattr__(self, "bits", 8 * np.asarray(self.pictures[0]).dtype.itemsize)

    @property
    def path(self) -> Path:
        """Name used in messages in place of a file."""
        return Path("arrays in memory")

    @property
    def n_frames(self) -> int:
        """Number of arrays."""
        return len(self.pictures)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the first array [px]."""
        rows, columns = np.shape(self.pictures[0])
        return rows, columns

    def frame(self, index: int) -> Grey:
        """Grey values of one frame, shape [rows, columns]; a PictureError if it does not fit the first."""
        array = np.asarray(self.pictures[checked_index(self.n_frames, index)])
        return checked_frame(self.path, index, array, self.shape, self.bits)


def whole_numbers(pictures: Iterable[NDArray[np.generic]]) -> tuple[Words, ...]:
    """Floating-point pictures as 16-bit whole numbers by the rule of `PicturesInMemory`.

    Raises ValueError if a value is not finite.
    """
    arrays = [np.asarray(picture, dtype=np.float64) for picture in pictures]
    for frame, array in enumerate(arrays):
        if not np.all(np.isfinite(array)):
            row, column = np.argwhere(~np.isfinite(array))[0]
            raise ValueError(
                f"picture {frame}, row {row}, column {column} is {array[row, column]}: grey values must be "
                "finite"
            )
    low, high = min(array.min() for array in arrays), max(array.max() for array in arrays)
    if low >= 0.0 and high <= 1.0:
        return tuple(np.rint(65_535.0 * array).astype(np.uint16) for array in arrays)
    slope = 65_533.0 / (high - low) if high > low else 0.0
    return tuple(np.rint(1.0 + slope * (array - low)).astype(np.uint16) for array in arrays)


MOST_DECODED = 128 * 2**20
"""Largest memory for the pictures of one series [bytes]. Pictures beyond this limit are read again on each
request. Decoding a large picture takes much less time than matching its points."""


def decode_once(pictures: Pictures) -> "DecodedPictures":
    """A series that keeps its decoded pictures. A series that already does so is returned unchanged."""
    return pictures if isinstance(pictures, DecodedPictures) else DecodedPictures(pictures)


class DecodedPictures:
    """A series that keeps decoded pictures in memory, for repeated use; see `dic.images.Pictures`.

    ``most``: memory that its pictures may take up [bytes].
    """

    def __init__(self, pictures: Pictures, *, most: int = MOST_DECODED) -> None:
        self.pictures, self.most = pictures, most
        self.path, self.n_frames, self.shape = pictures.path, pictures.n_frames, pictures.shape
        self.bits, self.crop_offset, self.times = pictures.bits, pictures.crop_offset, pictures.times
        self._kept: dict[int, Grey] = {}
        self._size = 0

    def frame(self, index: int) -> Grey:
        """Grey values of one frame, read-only, shape [rows, columns].

        Raises PictureError as the series does. After an error the next request reads the frame again.
        """
        picture = self._kept.get(index)
        if picture is None:
            picture = self.pictures.frame(index)
            if self._size + picture.nbytes <= self.most:
                picture = self._kept[index] = picture.copy()  # the data of a memory map may change
                picture.flags.writeable = False
                self._size += picture.nbytes
        return picture


def packed_size(values: int, bits: int) -> int:
    """Number of bytes of packed grey values; the last byte is padded with zeros."""
    return (values * bits + 7) // 8


def unpack(raw: Bytes, bits: int, values: int) -> Words:
    """The first `values` grey values of packed bytes, shape [values].

    ``raw``: the bytes, at least `packed_size` of them, shape [n]. ``bits``: bits of a grey value: 10 or 12.
    ``values``: number of grey values to read. Raises ValueError if `bits` is another number, or if there are
    fewer bytes than the values need.
    """
    if bits not in (10, 12):
        raise ValueError(f"bits = {bits}: packed grey values have 10 or 12")
    need = packed_size(values, bits)
    if raw.size < need:
        raise ValueError(f"{values} grey values of {bits} bits need {need} bytes, there are {raw.size}")
    group = 5 if bits == 10 else 3  # smallest number of bytes with a whole number of values
    groups = -(-need // group)
    padded = np.zeros(groups * group, dtype=np.uint8)
    padded[:need] = raw[:need]
    byte = padded.reshape(groups, group).astype(np.uint16).T
    if bits == 10:
        a, b, c, d, e = byte
        columns = [a << 2 | b >> 6, (b & 0x3F) << 4 | c >> 4, (c & 0x0F) << 6 | d >> 2, (d & 0x03) << 8 | e]
    else:
        a, b, c = byte
        columns = [a << 4 | b >> 4, (b & 0x0F) << 8 | c]
    return np.stack(columns, axis=1).reshape(-1)[:values]
