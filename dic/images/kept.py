"""A series whose pictures are decoded once, as long as they are not too many to be kept."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.images.series import Grey, Pictures

MOST_KEPT = 128 * 2**20
"""Pictures of one series that are kept in memory [bytes]; those beyond are read again when asked for. A large
picture is decoded in a small part of the time in which its points are matched."""


def kept(pictures: Pictures) -> "KeptPictures":
    """A series with its pictures kept; itself if they are already."""
    return pictures if isinstance(pictures, KeptPictures) else KeptPictures(pictures)


class KeptPictures:
    """The same series, for those who look at its pictures more than once; see `dic.images.Pictures`.

    Parameters
    ----------
    pictures
        The series.
    most
        Memory that its pictures may take up [bytes].
    """

    def __init__(self, pictures: Pictures, *, most: int = MOST_KEPT) -> None:
        self.pictures, self.most = pictures, most
        self._kept: dict[int, Grey] = {}
        self._size = 0

    @property
    def path(self) -> Path:
        """The file, or the folder of a numbered series."""
        return self.pictures.path

    @property
    def n_frames(self) -> int:
        """Number of frames that the headers promise."""
        return self.pictures.n_frames

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns [px]."""
        return self.pictures.shape

    @property
    def bits(self) -> int:
        """Bits that carry the grey value."""
        return self.pictures.bits

    @property
    def crop_offset(self) -> tuple[float, float]:
        """Place of the top left pixel on the sensor (x, y) [px]."""
        return self.pictures.crop_offset

    @property
    def times(self) -> NDArray[np.float64] | None:
        """Times of the frames [s], shape [n_frames]; None if not recorded."""
        return self.pictures.times

    @property
    def held(self) -> Mapping[int, Grey]:
        """The pictures that are in memory, by frame."""
        return self._kept

    def hold(self, pictures: Mapping[int, Grey]) -> None:
        """Take over pictures by frame that another process has read from the same series (`held`)."""
        for index, picture in pictures.items():
            self._keep(index, picture)

    def _keep(self, index: int, picture: Grey) -> Grey:
        if index not in self._kept and self._size + picture.nbytes <= self.most:
            picture.flags.writeable = False
            self._size += picture.nbytes
            self._kept[index] = picture
        return picture

    def frame(self, index: int) -> Grey:
        """Grey values of one frame, not to be written to, shape [rows, columns].

        Raises
        ------
        PictureError
            As the series does; a frame that cannot be read is tried again when it is asked for again.
        """
        found = self._kept.get(index)
        if found is None:
            found = self.pictures.frame(index)
            if self._size + found.nbytes <= self.most:
                found = self._keep(index, found.copy())  # a memory map may change under the hand
        return found
