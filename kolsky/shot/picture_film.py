"""A few of a shot's pictures, cut to the specimen and made small, for the report's slider."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dic.opencv import cv2
from dic.outcome import FrameOutcome
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.shot.frames import read_frames
from kolsky.shot.picture_set import open_pictures
from kolsky.shot.schema.reading import ShotToml

if TYPE_CHECKING:  # a shot without pictures loads nothing that follows them
    from dic.result import StereoResult

COUNT = 24
"""Most pictures that are kept."""
WIDTH = 260
"""Width of each [px]."""
BESIDE = 0.2
"""Share of the specimen's size that is kept around it."""
QUALITY = 75
"""Of JPEG, 0 to 100: a picture to look at, from which nothing is measured."""


@dataclass(frozen=True, eq=False)
class PictureFilm:
    """Small pictures of camera 0 with their times."""

    time: FloatArray
    """Frame times on the shot's clock [s], shape [n]."""
    jpeg: tuple[bytes, ...]
    """The pictures, all of one size."""


def picture_film(toml: ShotToml, result: StereoResult) -> PictureFilm | None:
    """Pictures at equal intervals of time, as far as frames have points; None if none can be read.

    Parameters
    ----------
    toml
        The shot's file, with [pictures].
    result
        What its pictures gave.
    """
    from dic.images import PictureError  # for shots with pictures only

    valid = np.flatnonzero(result.outcome == FrameOutcome.VALID)
    try:
        series = open_pictures(toml, read_frames(toml)).series[0]
    except InputError:
        return None
    if not valid.size or series.n_frames != result.outcome.size:
        return None
    chosen = valid[np.unique(np.round(np.linspace(0, valid.size - 1, COUNT)).astype(int))]
    rows, columns = part_of_picture(result.specimen.pixels[0][chosen], series.shape)
    full = float(2**series.bits - 1)
    times, pictures = [], []
    for frame in chosen:
        try:
            picture = np.asarray(series.frame(int(frame)), dtype=np.float64)[rows, columns]
        except PictureError:
            continue
        height = max(1, round(picture.shape[0] * WIDTH / picture.shape[1]))
        grey = np.asarray(np.clip(picture * (255.0 / full), 0.0, 255.0), dtype=np.uint8)
        small = cv2.resize(grey, (WIDTH, height), interpolation=cv2.INTER_AREA)
        pictures.append(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes())
        times.append(result.t[frame])
    return PictureFilm(np.array(times), tuple(pictures)) if times else None


def part_of_picture(pixels: NDArray[np.float64], shape: tuple[int, int]) -> tuple[slice, slice]:
    """Rows and columns around all places of the points, `BESIDE` of their extent more on each side.

    Parameters
    ----------
    pixels
        Places (column, row) [px], shape [..., 2]; NaN where a point has none.
    shape
        Rows and columns of the picture.
    """
    cuts = []
    for axis, size in ((1, shape[0]), (0, shape[1])):
        low, high = np.nanmin(pixels[..., axis]), np.nanmax(pixels[..., axis])
        margin = BESIDE * (high - low)
        cuts.append(slice(max(0, int(low - margin)), min(size, int(np.ceil(high + margin)) + 1)))
    return cuts[0], cuts[1]
