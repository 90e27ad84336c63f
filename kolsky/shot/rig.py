"""The cameras of a shot: from a calibration file, or from its pictures of a target."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from dic.camera import StereoRig
from dic.forks import allowed, beside, cores
from kolsky.base.errors import InputError
from kolsky.shot.calibration_pictures import Progress, calibration_begun, calibration_of
from kolsky.shot.picture_set import CAMERAS, PictureSet, fits_sensor
from kolsky.shot.schema.pictures import CalibrationSection
from kolsky.shot.schema.reading import TomlFile

if TYPE_CHECKING:
    from dic.calibration import Calibration


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
    with calibration_begun(toml, section, predict=False) as solved:

        def cameras(progress: Progress) -> Calibrated:
            found = solved(progress)
            return _cropped(pictures, Calibrated(rig=found.rig, words=_words(found)))

        if not allowed() or cores() <= ENOUGH:
            yield cameras  # this process joins in
            return
        with beside(partial(cameras, _untold)) as later:
            yield lambda progress: later()


ENOUGH = 3
"""Cores with which this process takes part in the search for the target; with more another one does, and
works out the cameras too."""


def _untold(stage: str, done: int, total: int) -> None:
    """Progress of another process."""


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
    found = calibration_of(toml, section, progress, predict=False)
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


def _words(found: "Calibration") -> str:
    used = sum(pair.outcome.used for pair in found.pairs)
    rejected = "".join(f"; pair {pair.name} left out: {pair.reason}" for pair in found.rejected)
    missing = "".join(f"; pair {pair.name}: {pair.reason}" for pair in found.unusable)
    return (
        f"{used} of {len(found.pairs)} pairs of pictures, residual {found.rms:.3g} px rms{rejected}{missing}"
    )
