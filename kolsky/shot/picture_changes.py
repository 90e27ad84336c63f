"""When the pictures of a shot begin to change, and what three of them show, before any correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray

if TYPE_CHECKING:
    from dic.images import Pictures

MOST = 400
"""Most frames that are compared with the first; of a longer series as many at equal distances."""


@dataclass(frozen=True, eq=False)
class PictureChanges:
    """How far the pictures of both cameras differ from their first one."""

    time: FloatArray
    """Times of the frames that were compared, on the shot's clock [s], shape [n]."""
    change: FloatArray
    """Mean absolute difference from the first picture, relative to white (2**bits - 1), shape [2, n]; NaN
    where a picture cannot be read."""
    rest_end: float
    """Time of the last frame that is declared static [s]."""
    shown: tuple[tuple[float, FloatArray], ...]
    """Time [s] and picture of camera 0, relative to white, shape [rows, columns]: of the first frame, of the
    last static one, and of the last; those that can be read."""


def picture_changes(series: Sequence[Pictures], time: FloatArray, static: int) -> PictureChanges:
    """Compare the pictures of both cameras with their first ones.

    Parameters
    ----------
    series
        Pictures of each camera.
    time
        Frame times on the shot's clock [s], shape [n_frames].
    static
        Number of first frames that are declared static.
    """
    compared = np.unique(np.round(np.linspace(0, time.size - 1, min(time.size, MOST))).astype(int))
    change = np.full((len(series), compared.size), np.nan)
    for camera, pictures in enumerate(series):
        first = None
        for place, frame in enumerate(compared):
            picture = _relative(pictures, int(frame))
            if picture is None:
                continue
            first = picture if first is None else first
            change[camera, place] = np.abs(picture - first).mean()
    shown = ((i, _relative(series[0], i)) for i in dict.fromkeys((0, static - 1, time.size - 1)))
    return PictureChanges(
        time=time[compared],
        change=change,
        rest_end=float(time[static - 1]),
        shown=tuple((float(time[i]), picture) for i, picture in shown if picture is not None),
    )


def _relative(pictures: Pictures, frame: int) -> NDArray[np.float64] | None:
    """A picture relative to white; None if it cannot be read."""
    from dic.images import PictureError  # for shots with pictures only

    try:
        return np.asarray(pictures.frame(frame), dtype=np.float64) / float(2**pictures.bits - 1)
    except PictureError:
        return None
