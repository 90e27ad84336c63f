"""The cameras of a shot: from a calibration file, or from its pictures of a target."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dic.camera import StereoRig
from dic.images import PictureError, Pictures
from dic.images.series import PictureSizeError
from kolsky.base.errors import InputError
from kolsky.shot.calibration_target import target_of
from kolsky.shot.picture_set import CAMERAS, PictureSet, fits_sensor
from kolsky.shot.schema.pictures import CalibrationSection
from kolsky.shot.schema.reading import TomlFile, parse_toml, shot_toml
from kolsky.shot.schema.section import Section

if TYPE_CHECKING:
    from dic.calibration import Calibration

Progress = Callable[[str, int, int], None]

LARGEST_RMS = 1.0
"""Largest residual of a calibration that is used [px]: a blurred target leaves a tenth of it."""


@dataclass(frozen=True)
class Calibrated:
    """The cameras, and what speaks for them."""

    rig: StereoRig
    """The cameras."""
    words: str
    """One sentence on where it is from and how well it fits."""


def calibrated(pictures: PictureSet, progress: Progress) -> Calibrated:
    """The rig for a shot's pictures.

    Raises
    ------
    InputError
        If the file holds no two cameras, the target is not found or cannot determine the cameras, or a crop
        lies outside the sensor that the calibration is for.
    """
    with calibrated_beside(pictures) as cameras:
        return cameras(progress)


@contextmanager
def calibrated_beside(pictures: PictureSet) -> Iterator[Callable[[Progress], Calibrated]]:
    """Begin to look for the target in other processes, if there are some, while this one works.

    Yields
    ------
    callable
        Gives what `calibrated` gives, and raises what that raises.

    Raises
    ------
    InputError
        If the target's pictures cannot be opened or do not go together, or the target is impossible.
    """
    toml, section = pictures.toml, pictures.toml.declared.calibration
    assert section is not None  # shots with pictures have it
    if section.file is not None:
        yield lambda progress: _cropped(pictures, Calibrated(*_from_file(toml, section)))
        return
    with calibration_begun(toml, section) as solved:

        def cameras(progress: Progress) -> Calibrated:
            found = solved(progress)
            return _cropped(pictures, Calibrated(rig=found.rig, words=_words(found)))

        yield cameras


def _cropped(pictures: PictureSet, found: Calibrated) -> Calibrated:
    """The rig of whole sensors for a shot's pictures."""
    for camera, series, name in zip(found.rig.cameras, pictures.series, CAMERAS, strict=True):
        problem = fits_sensor(series, camera.sensor)
        if problem:
            raise pictures.toml.error(
                f"pictures.{name}",
                f"crop_offset {problem}",
                cure="declare where the crop lies on the sensor, or calibrate with full pictures",
            )
    offsets = [series.crop_offset for series in pictures.series]
    return Calibrated(rig=found.rig.cropped(offsets[0], offsets[1]), words=found.words)


def rig_of(toml: TomlFile, section: CalibrationSection, progress: Progress) -> Calibrated:
    """The rig that a table [calibration] declares, for pictures of the whole sensors.

    Raises
    ------
    InputError
        If the file holds no two cameras, or as `calibration_of`.
    """
    if section.file is not None:
        return Calibrated(*_from_file(toml, section))
    found = calibration_of(toml, section, progress)
    return Calibrated(rig=found.rig, words=_words(found))


def _from_file(toml: TomlFile, section: CalibrationSection) -> tuple[StereoRig, str]:
    from dic.camera_files import CameraFileError, read_rig

    assert section.file is not None
    try:
        rig = read_rig(toml.path.parent / section.file, length_unit=section.length_unit)
    except CameraFileError as error:
        raise InputError(
            toml.path.parent / section.file,
            f"is no calibration that can be read: {error}",
            cure="export the calibration again, in one of the formats of docs/howto/pictures",
        ) from None
    return rig, f"from the file {section.file}"


def calibration_of(toml: TomlFile, section: CalibrationSection, progress: Progress) -> "Calibration":
    """The calibration from the pictures that a file names.

    Raises
    ------
    InputError
        If the pictures cannot be read or do not go together, the target is impossible, or what is seen of it
        does not determine the cameras.
    """
    with calibration_begun(toml, section) as solved:
        return solved(progress)


@contextmanager
def calibration_begun(
    toml: TomlFile, section: CalibrationSection
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
            return _solved(toml, section, series, views, targets[0], [str(number) for number in numbers[0]])

        yield solved


def _solved(
    toml: TomlFile,
    section: CalibrationSection,
    series: Sequence[Pictures],
    views: Sequence[Sequence[Any]],
    target: Any,
    names: list[str],
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


def _words(found: "Calibration") -> str:
    used = sum(pair.outcome.used for pair in found.pairs)
    rejected = "".join(f"; pair {pair.name} left out: {pair.reason}" for pair in found.rejected)
    missing = "".join(f"; pair {pair.name}: {pair.reason}" for pair in found.unusable)
    return (
        f"{used} of {len(found.pairs)} pairs of pictures, residual {found.rms:.3g} px rms{rejected}{missing}"
    )


def _series(toml: TomlFile, name: str, pattern: str) -> Pictures:
    from dic.images import open_pictures

    place = toml.path.parent / pattern
    try:
        return open_pictures(place.parent, pattern=place.name)
    except (PictureError, OSError) as error:
        raise toml.error(f"calibration.{name}", f"cannot be used: {error}") from None


NAMES = ("calibration.toml", "shot.toml")
"""Files that are looked for in a folder, in this order."""


class CalibrationFile(Section):
    """A whole calibration.toml."""

    calibration: CalibrationSection


def read_calibration_toml(source: Path) -> tuple[TomlFile, CalibrationSection]:
    """The description of calibration pictures and their target.

    Parameters
    ----------
    source
        A calibration.toml, a shot.toml, or a folder with one of them.

    Raises
    ------
    InputError
        If there is none, it declares anything unknown, incomplete or impossible, or it names a finished
        calibration in place of pictures.
    """
    path = Path(source)
    if path.is_dir():
        there = [path / name for name in NAMES if (path / name).is_file()]
        if not there:
            raise InputError(
                path,
                f"has neither {NAMES[0]} nor {NAMES[1]}",
                cure="describe pictures and target in one of them",
            )
        path = there[0]
    if path.name == NAMES[1]:
        shot = shot_toml(path)
        toml: TomlFile = shot
        section = shot.declared.calibration
        if section is None:
            raise InputError(path, "has no table [calibration]", cure="add it, with pictures and target")
    else:
        toml = parse_toml(path)
        section = toml.validated(CalibrationFile).calibration
    if section.file is not None:
        raise toml.error(
            "calibration.file", "is a calibration that is finished", cure="name pictures and target instead"
        )
    return toml, section
