"""A series of pictures of one camera, of whatever file format, and the bounds that every reader checks
before anything is allocated."""

import operator
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dic.files import one_line


class PictureError(ValueError):
    """A picture file or one frame of it that cannot be read.

    Its text names file, frame (if it is about one), what is wrong and the cure.
    """

    def __init__(self, path: Path | str, what: str, *, frame: int | None = None, cure: str = "") -> None:
        where = f"{path}" if frame is None else f"{path}, frame {frame}"
        super().__init__(one_line(f"{where}: {what}" + (f"; {cure}" if cure else "")))
        self.path, self.frame, self.what, self.cure = Path(path), frame, what, cure

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), frame=self.frame, cure=self.cure), (self.path, self.what)


class PictureSizeError(PictureError):
    """A picture of another size than those of its series."""


@runtime_checkable
class Pictures(Protocol):
    """Protocol of a picture series. Opening reads the headers; a frame is read when it is asked for."""

    @property
    def path(self) -> Path:
        """The file, or the folder of a numbered series."""

    @property
    def n_frames(self) -> int:
        """Number of frames that the headers promise."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns [px]."""

    @property
    def bits(self) -> int:
        """Bits that carry the grey value: the largest possible value is 2**bits - 1."""

    @property
    def crop_offset(self) -> tuple[float, float]:
        """Place of the top left pixel on the sensor (x, y) [px]; (0, 0) if the file does not say."""

    @property
    def times(self) -> NDArray[np.float64] | None:
        """Times of the frames as the camera recorded them [s], shape [n_frames]; None if it did not."""

    def frame(self, index: int) -> NDArray[np.uint16] | NDArray[np.uint8]:
        """Grey values of one frame as recorded, shape [rows, columns].

        Raises
        ------
        PictureError
            If the frame is missing, cut short or of another shape; other frames are not affected.
        """


Grey = NDArray[np.uint16] | NDArray[np.uint8]

LARGEST_SIDE = 32_768
"""Most rows or columns of a picture that are read [px]."""
MOST_PIXELS = 2**27
"""Most pixels of a picture."""
MOST_FRAMES = 10_000_000
"""Most frames of a series."""


def checked_shape(path: Path, rows: object, columns: object) -> tuple[int, int]:
    """Rows and columns, if a camera can have made them.

    Raises
    ------
    PictureError
        If either is not a whole number from 1 to `LARGEST_SIDE`, or they are more than `MOST_PIXELS`.
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
    """The number of frames, if it is from 1 to `MOST_FRAMES`.

    Raises
    ------
    PictureError
        If it is not.
    """
    if not 1 <= frames <= MOST_FRAMES:
        raise PictureError(
            path,
            f"its header gives {frames} frames, allowed are 1 to {MOST_FRAMES}",
            cure="export the pictures again",
        )
    return int(frames)


def checked_bits(path: Path, bits: int, container: int) -> int:
    """The bits that carry the grey value, if they fit into a `container` of so many bits.

    Raises
    ------
    PictureError
        If they do not.
    """
    if not 1 <= bits <= container:
        raise PictureError(
            path,
            f"bits = {bits}, allowed are 1 to {container} for grey values stored in {container} bits",
            cure="leave bits out, or say those that carry the grey value",
        )
    return int(bits)


def checked_index(n_frames: int, index: int) -> int:
    """A frame number from 0 to `n_frames` - 1.

    Raises
    ------
    IndexError
        If it is outside.
    """
    index = operator.index(index)
    if not 0 <= index < n_frames:
        raise IndexError(f"frame {index} of {n_frames}: must be from 0 to {n_frames - 1}")
    return index


def checked_frame(
    path: Path, index: int, picture: NDArray[np.generic], shape: tuple[int, int], bits: int
) -> Grey:
    """One decoded frame, if it has the series' shape and holds 8 or 16-bit grey values of so many bits.

    Raises
    ------
    PictureError
        If it does not.
    """
    if picture.shape != shape:
        size = " x ".join(str(side) for side in picture.shape)
        raise PictureSizeError(
            path, f"is {size}, the series {shape[0]} x {shape[1]} (rows x columns)", frame=index
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
