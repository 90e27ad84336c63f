"""What the figures of a stereo result show beside its numbers: some pictures, and one column of all."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.chain.speckle_report import Speckles, speckles_of
from dic.images import PictureError, Pictures
from dic.result import StereoResult
from kolsky.bars.flyer.flight_report import FlightOfSpecimen
from kolsky.base.arrays import FloatArray

SHOWN = 4
"""Pictures that are shown."""


@dataclass(frozen=True)
class SurfaceView:
    """A stereo result with pictures of camera 0."""

    shot: str
    """Name of the shot."""
    result: StereoResult
    """The result."""
    pictures: Mapping[int, NDArray[np.generic]]
    """Some pictures of camera 0 by frame, each of shape [rows, columns]."""
    kymograph: FloatArray
    """The centre line's column of every picture of camera 0, NaN where it cannot be read, [rows,
    n_frames]."""
    flight: FlightOfSpecimen | str = "not asked for"
    """The flyer's flight, or why it is not known."""
    speckles: tuple[Speckles | None, Speckles | None] = (None, None)
    """Both cameras' speckles at rest, None where they cannot be judged."""


def read_surface_view(
    shot: str,
    result: StereoResult,
    pictures: tuple[Pictures, Pictures],
    flight: FlightOfSpecimen | str = "not asked for",
) -> SurfaceView:
    """Read what the figures show of the pictures, most of it of camera 0's.

    The centre line is followed across the picture at the row where the specimen's points lie in the mean.
    """
    chosen, first = set(shown_frames(result)), pictures[0]
    column = _column(result, first.shape[1])
    kymograph = np.full((first.shape[0], first.n_frames), np.nan)
    kept = {}
    for frame in range(first.n_frames):
        try:
            picture = first.frame(frame)
        except PictureError:
            continue
        kymograph[:, frame] = picture[:, column]
        if frame in chosen:
            kept[frame] = np.array(picture)
    return SurfaceView(
        shot=shot,
        result=result,
        pictures=kept,
        kymograph=kymograph,
        flight=flight,
        speckles=speckles_of(result, pictures),
    )


def shown_frames(result: StereoResult) -> list[int]:
    """Frames at equal distances, of those with points: the first, the last and two between them."""
    usable = np.flatnonzero(result.specimen.n_valid > 0)
    if usable.size == 0:
        return []
    return sorted({int(usable[k]) for k in np.round(np.linspace(0, usable.size - 1, SHOWN)).astype(int)})


def _column(result: StereoResult, columns: int) -> int:
    """The column of camera 0 in which the centre line lies, from the points nearest to x = 0."""
    body = result.specimen
    nearest = np.argsort(np.abs(body.surface.X[:, 0]))[: max(3, body.surface.n_points // 20)]
    return int(np.clip(np.round(np.median(body.points[nearest, 0])), 0, columns - 1))
