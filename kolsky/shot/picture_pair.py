"""One pair of a shot's pictures with the points that were followed in them, for the report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.images import PictureError
from dic.outcome import FrameOutcome
from dic.result import StereoResult
from kolsky.base.errors import InputError
from kolsky.readers import frame_times
from kolsky.readers.table import Column
from kolsky.shot.picture_set import open_pictures
from kolsky.shot.schema.reading import ShotToml

ALIVE = 0.5
"""Least share of the points that the pair shows, if there is such a frame."""


@dataclass(frozen=True)
class PicturePair:
    """What two cameras saw at one time, and the result that it belongs to."""

    result: StereoResult
    """The surfaces of the whole shot."""
    frame: int
    """Which frame, counted from 0."""
    pictures: tuple[NDArray[np.generic], NDArray[np.generic]]
    """The pictures of both cameras, each of shape [rows, columns]."""


def picture_pair(toml: ShotToml, result: StereoResult) -> PicturePair | str:
    """The latest pair that still shows half of the points, or why there is none.

    Parameters
    ----------
    toml
        The shot's file, with [pictures].
    result
        What its pictures gave.
    """
    declared = toml.declared
    try:
        frames = frame_times.read(
            toml.path.parent / declared.frames.file,
            frame=Column(declared.frames.frame),
            time=declared.frames.time.as_column(),
        )
        first, second = open_pictures(toml, frames).pictures
    except InputError as error:
        return str(error)
    alive = np.where(result.outcome == FrameOutcome.VALID, result.specimen.alive, 0)
    if alive.size != first.n_frames:
        return f"there are {first.n_frames} pictures and surfaces of {alive.size} frames"
    enough = np.flatnonzero(alive >= max(1, ALIVE * result.specimen.surface.n_points))
    best = [int(np.argmax(alive))] if alive.any() else []
    for frame in [*enough[::-1].tolist(), *best]:
        try:
            pictures = np.array(first.frame(frame)), np.array(second.frame(frame))
        except PictureError:
            continue
        return PicturePair(result, frame, pictures)
    return "no frame with points can be read"
