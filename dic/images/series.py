"""A series of pictures of one camera, of whatever file format."""

from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray


class PictureError(ValueError):
    """A picture file or one frame of it that cannot be read.

    Its text names file, frame (if it is about one), what is wrong and the cure.
    """

    def __init__(self, path: Path | str, what: str, *, frame: int | None = None, cure: str = "") -> None:
        where = f"{path}" if frame is None else f"{path}, frame {frame}"
        super().__init__(f"{where}: {what}" + (f"; {cure}" if cure else ""))
        self.path, self.frame, self.what, self.cure = Path(path), frame, what, cure


@runtime_checkable
class Pictures(Protocol):
    """What every picture format offers. Opening reads the headers; a frame is read when it is asked for."""

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
        """Where the top left pixel lies on the sensor (x, y) [px]; (0, 0) if the file does not say."""

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
