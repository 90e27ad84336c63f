"""Usable pictures of a series."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.images.series import PictureError, Pictures
from dic.opencv import cv2
from dic.outcome import FrameOutcome

Picture = NDArray[Any]
Series = Pictures | Sequence[Picture] | Picture
"""A series of pictures: of a file, or arrays [rows, columns] in memory."""

CONTRAST = 0.1
"""A picture with less than this share of the material picture's contrast is black."""
ROUGHNESS = 0.8
"""Noise alone has neighbouring pixels that differ as much as any two: this share of it is noise."""
THINNED = 4
"""Every so many rows and columns are enough to see whether neighbours differ."""
CLIPPED = 0.5
"""Share of the pixels at the largest grey value from which a picture is saturated."""


def count(pictures: Series) -> int:
    """Number of frames."""
    return pictures.n_frames if isinstance(pictures, Pictures) else len(pictures)


def read(pictures: Series, index: int) -> Picture | None:
    """One frame, shape [rows, columns]; None if it cannot be read."""
    frame = getattr(pictures, "frame", None)  # whether it has all of `Pictures` takes longer than to read it
    if frame is None:
        return np.asarray(pictures[index])  # type: ignore[index]  # no series of a file
    try:
        return np.asarray(frame(index))
    except (PictureError, OSError):
        return None


def _mean_and_spread(grey: NDArray[np.float32]) -> tuple[float, float]:
    """Mean and standard deviation of the grey values, in one pass."""
    mean, spread = cv2.meanStdDev(grey)
    return float(mean[0, 0]), float(spread[0, 0])


@dataclass(frozen=True)
class Scene:
    """Mean and contrast by which a picture of the specimen is recognised, from the material picture."""

    mean: float
    """Mean grey value [grey]."""
    contrast: float
    """Standard deviation of the grey values [grey]."""

    @classmethod
    def of(cls, picture: Picture) -> "Scene":
        """That of a picture, shape [rows, columns]."""
        return cls(*_mean_and_spread(np.asarray(picture, dtype=np.float32)))

    def judge(self, picture: Picture | None) -> FrameOutcome:
        """Outcome of a picture: whether it shows a scene.

        A picture is saturated if at least half of its pixels lie within 2 % of its largest grey value and
        that lies above the mean of the material picture. It is black if its contrast is below a tenth of the
        material picture's, or if neighbouring pixels differ as much as distant ones do.

        Parameters
        ----------
        picture
            The frame, shape [rows, columns]; None if it could not be read.
        """
        if picture is None or picture.ndim != 2 or picture.size == 0:
            return FrameOutcome.UNREADABLE
        grey = np.asarray(picture, dtype=np.float32)
        mean, contrast = _mean_and_spread(grey)
        if not np.isfinite(mean):
            return FrameOutcome.UNREADABLE
        top = float(grey.max())
        if np.count_nonzero(grey >= 0.98 * top) >= CLIPPED * grey.size and top > self.mean:
            return FrameOutcome.SATURATED
        if contrast <= CONTRAST * self.contrast:
            return FrameOutcome.BLACK
        lines = (grey[::THINNED], grey[:, ::THINNED].T)
        rough = min(float(np.diff(some, axis=1).std()) for some in lines) / (np.sqrt(2.0) * contrast)
        return FrameOutcome.BLACK if rough > ROUGHNESS else FrameOutcome.VALID
