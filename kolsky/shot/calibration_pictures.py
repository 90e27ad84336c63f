"""A calibration from a shot's pictures of a target."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from dic.images import PictureError, Pictures
from dic.images.series import PictureSizeError
from kolsky.shot.calibration_target import target_of
from kolsky.shot.picture_set import CAMERAS
from kolsky.shot.schema.pictures import CalibrationSection
from kolsky.shot.schema.reading import TomlFile

if TYPE_CHECKING:
    from dic.calibration import Calibration

Progress = Callable[[str, int, int], None]
LARGEST_RMS = 1.0
"""Largest residual of a calibration that is used [px]: a blurred target leaves a tenth of it."""


def calibration_of(
    toml: TomlFile, section: CalibrationSection, progress: Progress, *, predict: bool = True
) -> "Calibration":
    """The calibration from the pictures that a file names.

    Parameters
    ----------
    toml, section
        The file and its table.
    progress
        Told of the pictures done.
    predict
        As of `dic.calibration.calibrate`: False if the cameras alone are wanted.

    Raises
    ------
    InputError
        If the pictures cannot be read or do not go together, the target is impossible, or what is seen of it
        does not determine the cameras.
    """
    with calibration_begun(toml, section, predict=predict) as solved:
        return solved(progress)


@contextmanager
def calibration_begun(
    toml: TomlFile, section: CalibrationSection, *, predict: bool = True
) -> "Iterator[Callable[[Progress], Calibration]]":
    """Begin to look for the target, as `calibrated_beside`, for pictures of the whole sensors.

    Yields
    ------
    callable
        Gives what `calibration_of` gives, and raises what that raises.
    """
    from dic.calibration import detection_begun

    assert section.target is not None  # the schema saw to it
    assert section.distortion is not None
    targets = target_of(section.target, toml)
    series = [_series(toml, name, getattr(section, name)) for name in CAMERAS]
    counts = [pictures.n_frames for pictures in series]
    numbers = [
        getattr(pictures, "numbers", tuple(range(n))) for pictures, n in zip(series, counts, strict=True)
    ]
    if numbers[0] != numbers[1]:
        spans = [f"{n} pictures numbered {of[0]} to {of[-1]}" for n, of in zip(counts, numbers, strict=True)]
        raise toml.error(
            "calibration",
            f"has {spans[0]} of camera 0 and {spans[1]} of camera 1, so it is not known which are pairs"
            f"{_alone(numbers)}",
            cure="export the pairs with one number each",
        )
    with detection_begun(series, targets) as joined:

        def solved(progress: Progress) -> "Calibration":
            views = joined(lambda done, total: progress("calibration", done, total))
            names = [str(number) for number in numbers[0]]
            return _solved(toml, section, series, views, targets[0], names, predict)

        yield solved


def _solved(
    toml: TomlFile,
    section: CalibrationSection,
    series: Sequence[Pictures],
    views: Sequence[Sequence[Any]],
    target: Any,
    names: list[str],
    predict: bool,
) -> "Calibration":
    """The calibration from what was seen of the target."""
    from dic.calibration import Undetermined, calibrate
    from dic.calibration.pair_order import find_order

    _refuse_odd_size(toml, series, views)
    sensors = [(pictures.shape[1], pictures.shape[0]) for pictures in series]

    def solved(second: Sequence[Any]) -> "Calibration":
        return calibrate(
            views[0],
            second,
            target,
            sensors=(sensors[0], sensors[1]),
            distortion=section.distortion or "none",
            square_pixels=section.square_pixels,
            names=names,
            predict=predict,
        )

    try:
        found = solved(views[1])
    except (Undetermined, ValueError) as error:
        raise toml.error("calibration", f"does not determine the cameras: {error}") from None
    if found.rms <= LARGEST_RMS:
        return found
    order = find_order((views[0], views[1]), [target] * len(names), (sensors[0], sensors[1]))
    fits = ""
    if order is not None and order != list(range(len(names))):
        try:
            residual = solved([views[1][k] for k in order]).rms
        except (Undetermined, ValueError):
            residual = np.inf
        if residual <= LARGEST_RMS:
            fits = (
                f"; beside {', '.join(names)} of camera 0, {', '.join(names[k] for k in order)} of camera 1 "
                f"would fit with {residual:.2g} px"
            )
    raise toml.error(
        "calibration",
        f"has pairs that do not fit two cameras: residual {found.rms:.3g} px rms, at most "
        f"{LARGEST_RMS:g} px is a calibration{fits}",
        cure="number the pictures so that pairs were taken at one time"
        if fits
        else "check the pairs' order, the target's dimensions and the distortion model",
    )


def _alone(numbers: Sequence[Sequence[int]]) -> str:
    """Which pictures have no partner, if that says more than the spans do."""
    said = [
        f"camera {1 - camera} has none numbered {', '.join(map(str, alone[:6]))}"
        + (f" and {len(alone) - 6} more" if len(alone) > 6 else "")
        for camera in (0, 1)
        if (alone := sorted(set(numbers[camera]) - set(numbers[1 - camera])))
    ]
    return f": {'; '.join(said)}" if set(numbers[0]) & set(numbers[1]) else ""


def _refuse_odd_size(toml: TomlFile, series: Sequence[Pictures], views: Sequence[Sequence[Any]]) -> None:
    """Refuse a series whose first picture, which gives its size, is of another size than most others."""
    for name, pictures, own in zip(CAMERAS, series, views, strict=True):
        other = sum(isinstance(view, PictureSizeError) for view in own)
        same = sum(not isinstance(view, PictureError) for view in own)
        if other > same:
            rows, columns = pictures.shape
            raise toml.error(
                f"calibration.{name}",
                f"begins with a picture of {columns} x {rows} px, {other} of the others have another size",
                cure="export the first picture with the size of the others",
            )


def _series(toml: TomlFile, name: str, pattern: str) -> Pictures:
    from dic.images import open_pictures

    place = toml.path.parent / pattern
    try:
        return open_pictures(place.parent, pattern=place.name)
    except (PictureError, OSError) as error:
        raise toml.error(f"calibration.{name}", f"cannot be used: {error}") from None
