"""Pictures that are arrays in memory, as a series."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.images.series import Grey, checked_frame, checked_index


@dataclass(frozen=True)
class PicturesInMemory:
    """Arrays as a series; see `dic.images.Pictures`.

    Raises
    ------
    ValueError
        No pictures, or one that is not of shape [rows, columns].
    """

    pictures: Sequence[NDArray[np.generic]]
    """Grey values, 8 or 16-bit whole numbers, each of shape [rows, columns]."""
    bits: int = 0
    """Bits that carry the grey value; 0: those of the arrays' type."""
    crop_offset: tuple[float, float] = (0.0, 0.0)
    """Place of the top left pixel on the sensor (x, y) [px]."""
    times: NDArray[np.float64] | None = None
    """Times of the frames [s], shape [n_frames]; None if not known."""

    def __post_init__(self) -> None:
        if not len(self.pictures) or np.ndim(self.pictures[0]) != 2:
            raise ValueError("pictures in memory must be one array [rows, columns] or more")
        if not self.bits:
            object.__setattr__(self, "bits", 8 * np.asarray(self.pictures[0]).dtype.itemsize)

    @property
    def path(self) -> Path:
        """Stands for a file in messages."""
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
