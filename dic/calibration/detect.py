"""A target in a picture."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dic.calibration.targets.base import Detection, Target, TargetNotFound
from dic.forks import side_by_side
from dic.images import PictureError, Pictures


def detect(picture: NDArray[np.generic], target: Target) -> Detection:
    """Points of a target in a picture.

    Parameters
    ----------
    picture
        Grey values of any depth, shape [rows, columns].
    target
        One of `dic.calibration.TARGETS`.

    Raises
    ------
    TargetNotFound
        If it is not seen, or not well enough to number its points.
    ValueError
        If the picture is not one grey picture.
    """
    return target.detect(picture)


def detect_series(
    series: Sequence[Pictures],
    targets: Sequence[Target],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[Detection | TargetNotFound | PictureError], ...]:
    """Points of a target in all pictures of several cameras, as `calibrate` takes them.

    Parameters
    ----------
    series
        Of each camera its pictures.
    targets
        As each camera is to look for it.
    progress
        Told of the pictures done and their number, as `dic.forks.side_by_side` does.

    Returns
    -------
    tuple
        Of each camera a list, one entry a picture: what was detected, why nothing was, or why the picture
        cannot be used. It does not depend on the number of threads or processes.

    Raises
    ------
    ValueError
        If a picture is not one grey picture.
    """
    jobs = [
        (camera, index)
        for index in range(max(pictures.n_frames for pictures in series))
        for camera, pictures in enumerate(series)
        if index < pictures.n_frames
    ]

    def one(job: tuple[int, int]) -> Detection | TargetNotFound | PictureError:
        camera, index = job
        try:
            return detect(series[camera].frame(index), targets[camera])
        except (TargetNotFound, PictureError) as error:
            return error

    found: tuple[list[Detection | TargetNotFound | PictureError], ...] = tuple([] for _ in series)
    views = side_by_side([partial(one, job) for job in jobs], progress=progress)
    for (camera, _), view in zip(jobs, views, strict=True):
        found[camera].append(view)
    return found
