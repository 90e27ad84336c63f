"""A full-field result with the pictures that its figures show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.full_field.result import FullField
from dic.images import PictureError, Pictures

ALIVE = 0.5
"""Least share of the points that a shown frame has, if there is one."""


@dataclass(frozen=True)
class FullFieldView:
    """A full-field result, with a picture of camera 0."""

    name: str
    """Name of the measurement."""
    result: FullField
    """The result."""
    frame: int
    """Frame of the picture: the last one with at least half of the points."""
    picture: NDArray[np.generic] | None
    """Camera 0's picture of it, shape [rows, columns]; None if it cannot be read."""


def read_full_field_view(name: str, result: FullField, pictures: Pictures) -> FullFieldView:
    """Choose the frame to show and read its picture.

    Parameters
    ----------
    name
        Name of the measurement.
    result
        The result.
    pictures
        Camera 0's series.
    """
    count = result.n_valid
    enough = np.flatnonzero(count >= max(1.0, ALIVE * count.max()))
    frame = int(enough[-1]) if enough.size else int(result.facts.get("reference", 0))
    try:
        picture = np.array(pictures.frame(frame))
    except PictureError:
        picture = None
    return FullFieldView(name, result, frame, picture)
