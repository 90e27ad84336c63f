"""The cameras of a shot, from a calibration file or pictures of a target; the speckles can refine them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dic.bodies.region import grid_points
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.images import PictureError, Pictures
from dic.processes import background, cores, may_fork
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile
from kolsky.pictures.calibration import calibration_in_background, calibration_of
from kolsky.pictures.picture_set import CAMERAS, PictureSet, Progress
from kolsky.schema.pictures import CalibrationSection

if TYPE_CHECKING:
    from dic.calibration.views import Calibration


@dataclass(frozen=True)
class Calibrated:
    """The cameras and a description of their calibration."""

    rig: StereoRig
    """The cameras."""
    words: str
    """One sentence on its source and its residuals."""


@contextmanager
def calibrate_in_background(pictures: PictureSet) -> Iterator[Callable[[Progress], Calibrated]]:
    """Start the detection of the target in other processes, if possible; this process continues meanwhile.

    Yields: a function that returns the rig for a shot's pictures. Both raise InputError: at once if the
    target's pictures cannot be opened or do not match, or if the target is impossible; then if the file does
    not contain two cameras, if a crop lies outside the calibrated sensor, or if the target is not found or
    does not determine the cameras.
    """
    toml, section = pictures.toml, pictures.toml.declared.calibration
    assert section is not None  # shots with pictures have it
    if section.file is not None:
        yield lambda progress: cropped(toml, _from_file(toml, section), pictures.series)
        return
    with calibration_in_background(toml, section, predict=False) as solved:

        def cameras(progress: Progress) -> Calibrated:
            return cropped(toml, _from_pictures(solved(progress)), pictures.series)

        if not may_fork() or cores() <= LEAST_CORES:
            yield cameras  # this process joins in
            return
        with background(partial(cameras, lambda stage, done, total: None)) as later:
            yield lambda progress: later()


LEAST_CORES = 3
"""Largest number of cores with which this process takes part in the detection of the target. With more cores,
another process does this, and also solves for the cameras."""


def cropped(toml: TomlFile, found: Calibrated, series: Sequence[Pictures]) -> Calibrated:
    """The cameras of the whole sensors, adapted to the crop of some pictures.

    Raises InputError if a crop lies outside the calibrated sensor.
    """
    for camera, pictures, name in zip(found.rig.cameras, series, CAMERAS, strict=True):
        if camera.sensor is None:
            continue
        (x, y), (rows, columns) = pictures.crop_offset, pictures.shape
        width, height = camera.sensor
        if not (x >= 0.0 and y >= 0.0 and x + columns <= width and y + rows <= height):
            raise toml.error(
                f"pictures.{name}",
                f"crop_offset puts {columns} x {rows} px at ({x:g}, {y:g}) of the {width} x {height} px that "
                "the calibration is for",
                cure="declare where the crop lies on the sensor, or calibrate with full pictures",
            )
    first, second = (pictures.crop_offset for pictures in series)
    return replace(found, rig=found.rig.cropped(first, second))


def rig_of(toml: TomlFile, section: CalibrationSection, progress: Progress) -> Calibrated:
    """The rig declared in a table [calibration], for pictures of the whole sensors.

    Raises InputError if the file does not contain two cameras, or for the reasons of `calibration_of`.
    """
    if section.file is not None:
        return _from_file(toml, section)
    return _from_pictures(calibration_of(toml, section, progress, predict=False))


def _from_file(toml: TomlFile, section: CalibrationSection) -> Calibrated:
    from dic.camera_files import CameraFileError, read_rig

    assert section.file is not None
    try:
        rig = read_rig(toml.path.parent / section.file, length_unit=section.length_unit)
    except CameraFileError as error:
        raise InputError(
            toml.path.parent / section.file,
            f"is not a calibration that can be read: {error}",
            cure="export the calibration again, in one of the formats of docs/howto/pictures",
        ) from None
    return Calibrated(rig, f"from the file {section.file}")


def _from_pictures(found: "Calibration") -> Calibrated:
    used = sum(pair.outcome.used for pair in found.pairs)
    rejected = "".join(f"; pair {pair.name} left out: {pair.reason}" for pair in found.rejected)
    missing = "".join(f"; pair {pair.name}: {pair.reason}" for pair in found.unusable)
    count = f"{used} of {len(found.pairs)} pairs of pictures"
    return Calibrated(found.rig, f"{count}, residual {found.rms:.3g} px rms{rejected}{missing}")


def refine_rig(
    section: CalibrationSection,
    rig: StereoRig,
    pictures: Sequence[Pictures],
    frame: int,
    mask: NDArray[np.bool_],
    settings: Correlation,
    *,
    step: int,
    noise: float | None = None,
    device: str = "cpu",
) -> tuple[StereoRig, dict[str, Any]]:
    """The cameras, refined from one pair of pictures if [calibration] requests it.

    Facts on the refinement are returned too. With ``refine = true``, the refined pose is used. With
    ``"auto"``, it is used if it reduces the distances of points that were left out of the fit
    (`dic.calibration.refine`). Otherwise nothing is done. If too few points are matched, the cameras do not
    change, and the facts state this.

    ``rig``: the cameras, for the cropped pictures. ``frame``: the frame of the matched pair. ``mask``: pixels
    of the body in camera 0's picture, shape [rows, columns]. ``step``: distance of the points [px].
    ``noise``: standard deviation of a grey value [grey]; None: 1 % of the picture's contrast.
    """
    if section.refine is False:
        return rig, {}
    from dic.calibration.refine import refine_from_pictures

    asked = {"asked": "auto" if section.refine == "auto" else "yes"}
    try:
        pair = (pictures[0].frame(frame), pictures[1].frame(frame))
        sigma = [0.01 * float(np.std(one)) if noise is None else noise for one in pair]
        points, _ = grid_points(mask, step, margin=2.0)
        found = refine_from_pictures(
            pair, rig, points, settings, noise=(Noise(sigma[0]), Noise(sigma[1])), mask=mask, device=device
        )
    except (PictureError, ValueError) as error:
        return rig, {**asked, "used": False, "why": str(error)}
    used = section.refine is True or found.helps
    return (found.rig if used else rig), {**asked, "used": used, **found.words}


def refinement_words(facts: Mapping[str, Any]) -> str:
    """A line on the refinement for terminal and report. Empty if not requested."""
    if not facts:
        return ""
    if "why" in facts:
        return f"not possible: {facts['why']}"
    before, after = facts["epipolar_median_before_px"], facts["epipolar_median_after_px"]
    return (
        f"{'used' if facts['used'] else 'not used'}: epipolar median {before:.4f} px by the calibration, "
        f"{after:.4f} px refined ({facts['held_out_before_px']:.4f} and {facts['held_out_after_px']:.4f} px "
        "on points left out)"
    )
