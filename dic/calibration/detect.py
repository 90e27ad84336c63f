"""A target in a picture."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dic.calibration.targets.base import Detection, Target, TargetNotFound
from dic.forks import begun
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


Views = tuple[list[Detection | TargetNotFound | PictureError], ...]
"""Of each camera a list, one entry a picture: what was detected, why nothing was, or why the picture cannot
be used."""


@contextmanager
def detection_begun(series: Sequence[Pictures], targets: Sequence[Target]) -> Iterator[Callable[..., Views]]:
    """Begin to look for a target, in processes beside this one if there are some (`dic.forks.begun`).

    Parameters
    ----------
    series, targets
        As of `detect_series`.

    Yields
    ------
    callable
        Joins in the work and gives what `detect_series` gives; takes its `progress`.
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

    with begun([partial(one, job) for job in jobs]) as joined:

        def views(progress: Callable[[int, int], None] | None = None) -> Views:
            found: Views = tuple([] for _ in series)
            for (camera, _), view in zip(jobs, joined(progress), strict=True):
                found[camera].append(view)
            return found

        yield views


def detect_series(
    series: Sequence[Pictures],
    targets: Sequence[Target],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Views:
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
    with detection_begun(series, targets) as views:
        return views(progress)
