"""Facts declared by the caller that a series' file does not hold, or holds wrongly."""

from collections.abc import Sequence
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.images.numbered import WEIGHTS
from dic.images.series import MOST_FRAMES, Grey, PictureError, Pictures, checked_frame, checked_index
from dic.outcome import Remark


@dataclass(frozen=True)
class DeclaredPictures:
    """A series with some of its facts declared; see `dic.images.Pictures`."""

    pictures: Pictures
    """The series as its file has it."""
    n_frames: int
    bits: int
    crop_offset: tuple[float, float]
    times: NDArray[np.float64] | None

    @property
    def path(self) -> Path:
        """The file, or the folder of a numbered series."""
        return self.pictures.path

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns [px]."""
        return self.pictures.shape

    def frame(self, index: int) -> Grey:
        """Grey values of one frame as recorded, shape [rows, columns].

        Raises
        ------
        PictureError
            If the file has no such frame, it cannot be read, or a grey value needs more than `bits`.
        """
        if checked_index(self.n_frames, index) >= self.pictures.n_frames:
            raise PictureError(
                self.path,
                f"the file holds {self.pictures.n_frames} of {self.n_frames} declared frames",
                frame=index,
                cure="export the pictures again",
            )
        return checked_frame(self.path, index, self.pictures.frame(index), self.shape, self.bits)


def declared(
    pictures: Pictures,
    *,
    bits: int | None = None,
    crop_offset: tuple[float, float] | None = None,
    times: Sequence[float] | NDArray[np.float64] | None = None,
    n_frames: int | None = None,
) -> DeclaredPictures:
    """A series with facts declared that its file does not hold.

    Parameters
    ----------
    pictures
        The series.
    bits
        Bits that carry the grey value: 12 for a 12-bit camera whose values lie in 16 bits.
    crop_offset
        Where the top left pixel lies on the sensor (x, y) [px].
    times
        Times of the frames [s], rising; one a frame.
    n_frames
        How many frames there should be, if the file was cut off: those missing raise a PictureError each.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """
    count = pictures.n_frames if n_frames is None else int(n_frames)
    if not pictures.n_frames <= count <= MOST_FRAMES:
        raise ValueError(
            f"{pictures.path}: n_frames = {count}, must be from the {pictures.n_frames} that the file has "
            f"to {MOST_FRAMES}"
        )
    used = pictures.bits if bits is None else int(bits)
    if not 1 <= used <= 16:
        raise ValueError(f"{pictures.path}: bits = {used}, must be from 1 to 16")
    offset = pictures.crop_offset if crop_offset is None else (float(crop_offset[0]), float(crop_offset[1]))
    if not np.all(np.isfinite(offset)):
        raise ValueError(f"{pictures.path}: crop_offset = {offset} px must be finite")
    clock = pictures.times if count == pictures.n_frames else None
    if times is not None:
        clock = np.array(times, dtype=np.float64)
        if clock.shape != (count,) or not np.all(np.isfinite(clock)) or np.any(np.diff(clock) <= 0.0):
            raise ValueError(
                f"{pictures.path}: times must be {count} finite and rising seconds, one a frame, "
                f"got {clock.size} from {clock.min(initial=np.inf)} to {clock.max(initial=-np.inf)}"
            )
    if is_dataclass(pictures) and not isinstance(pictures, type):
        pictures = replace(pictures, bits=used)  # the reader holds its frames to this and not to its header
    return DeclaredPictures(pictures, count, used, offset, clock)


def of_colours(series: Sequence[Pictures]) -> tuple[Remark, ...]:
    """Remarks on series whose pictures have colours, which became grey by a rule.

    Parameters
    ----------
    series
        The pictures of each camera.
    """
    return tuple(
        Remark(
            name="colour pictures",
            text=f"the pictures of camera {camera} have colours; a grey value is {WEIGHTS} of them",
            cure="export grey values as they were recorded: a colour sensor's neighbours are interpolated",
        )
        for camera, pictures in enumerate(series)
        if getattr(getattr(pictures, "pictures", pictures), "coloured", False)
    )
