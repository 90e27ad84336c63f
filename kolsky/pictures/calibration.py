"""Calibration of the cameras from pictures of a target: declared target, solution, tables and JSON output."""

import csv
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from dic.calibration.views import Calibration
from dic.files import text_cell
from dic.images import PictureError, Pictures
from dic.images.series import PictureSizeError
from kolsky.base.errors import InputError
from kolsky.base.files import jsonable
from kolsky.base.toml import TomlFile, read_toml
from kolsky.pictures.picture_set import CAMERAS, Progress, open_source
from kolsky.schema.fields import Section
from kolsky.schema.pictures import CalibrationSection, TargetSection
from kolsky.schema.shot_file import shot_toml

EXAMPLES = {
    "pitch": '"4 mm"',
    "step": '"4 mm"',
    "diameter": '"2 mm"',
    "hollow": "[[2, 2], [11, 2], [2, 7]]",
    "radius": '"8 mm"',
    "arc": '"2 mm"',
    "size": '"1 mm"',
    "marker": '"3 mm"',
}
"""Keys of [calibration.target] that each kind of target needs, as in a shot file."""


def target_of(section: TargetSection, toml: TomlFile) -> tuple[Any, Any]:
    """The target described in a file, for the detection by camera 0 and by camera 1.

    Raises InputError if its kind is unknown, or if a dimension is missing, has no effect or is impossible.
    """
    from dic.calibration.targets import TARGETS

    key = "calibration.target"
    if section.kind not in TARGETS:
        known = ", ".join(f'"{name}"' for name in TARGETS)
        raise toml.error(f"{key}.kind", "is not a known target", allowed=f"one of {known}")
    kind = TARGETS[section.kind]
    wanted = {field.name: field for field in fields(kind)}
    given = section.model_dump(exclude={"kind", "anchors_0", "anchors_1"}, exclude_none=True)
    by_hand = {"anchors_0": section.anchors_0, "anchors_1": section.anchors_1}
    for name in by_hand if "anchors" not in wanted else ():
        if by_hand[name]:
            why = f"is given, but a target of kind {section.kind} needs no anchors"
            raise toml.error(f"{key}.{name}", why, cure="remove it")
    for name in given:
        if name not in wanted:
            raise toml.error(
                f"{key}.{name}",
                f"is given, but a target of kind {section.kind} has no such dimension",
                cure=f"remove it; the keys are {', '.join(wanted)}",
            )
    try:
        target = kind(**given)
        if "anchors" not in wanted:
            return target, target
        first, second = (replace(target, anchors=anchors or ()) for anchors in by_hand.values())
        return first, second
    except TypeError:
        missing = [
            name
            for name, field in wanted.items()
            if name not in given and field.default is MISSING and field.default_factory is MISSING
        ]
        raise toml.error(
            f"{key}.{missing[0]}",
            f'is missing; the target "{section.kind}" needs it'
            + (f", and {', '.join(missing[1:])}" if missing[1:] else ""),
            cure=f"add it as measured on the target, e.g. {missing[0]} = {EXAMPLES[missing[0]]}",
        ) from None
    except ValueError as error:
        raise toml.error(key, f"is impossible: {error}") from None


LARGEST_RMS = 1.0
"""Largest accepted residual of a calibration [px]. Even a blurred target gives only a tenth of it."""


def calibration_of(
    toml: TomlFile, section: CalibrationSection, progress: Progress, *, predict: bool = True
) -> "Calibration":
    """The calibration from the pictures named in a file.

    ``toml``, ``section``: the file and its table. ``progress``: called with the number of pictures done.
    ``predict``: as for `dic.calibrate`; False if only the cameras are needed. Raises InputError if the
    pictures cannot be read or do not match. The same error is raised if the target is impossible, or if its
    points do not determine the cameras.
    """
    with calibration_in_background(toml, section, predict=predict) as solved:
        return solved(progress)


@contextmanager
def calibration_in_background(
    toml: TomlFile, section: CalibrationSection, *, predict: bool = True
) -> "Iterator[Callable[[Progress], Calibration]]":
    """Start the detection of the target in the background, for pictures of the whole sensors.

    Yields: a function that returns the result of `calibration_of` or raises its errors.
    """
    from dic.calibration.views import detect_in_background

    assert section.target is not None  # the schema saw to it
    assert section.distortion is not None
    targets = target_of(section.target, toml)
    series = calibration_pictures(toml, section)
    counts = [pictures.n_frames for pictures in series]
    numbers = [
        getattr(pictures, "numbers", tuple(range(n))) for pictures, n in zip(series, counts, strict=True)
    ]
    if numbers[0] != numbers[1]:
        spans = [f"{n} pictures numbered {of[0]} to {of[-1]}" for n, of in zip(counts, numbers, strict=True)]
        raise toml.error(
            "calibration",
            f"has {spans[0]} of camera 0 and {spans[1]} of camera 1, so it is not known which are pairs"
            f"{_pictures_without_partner(numbers)}",
            cure="export the pairs with one number each",
        )
    with detect_in_background(series, targets) as joined:

        def solved(progress: Progress) -> "Calibration":
            views = joined(lambda done, total: progress("calibration", done, total))
            names = [str(number) for number in numbers[0]]
            return _solve(toml, section, series, views, targets[0], names, predict)

        yield solved


def _solve(
    toml: TomlFile,
    section: CalibrationSection,
    series: Sequence[Pictures],
    views: Sequence[Sequence[Any]],
    target: Any,
    names: list[str],
    predict: bool,
) -> "Calibration":
    """The calibration from the detected points of the target."""
    from dic.calibration.bundle import Undetermined
    from dic.calibration.refine import find_order
    from dic.calibration.solve import calibrate

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


def _pictures_without_partner(numbers: Sequence[Sequence[int]]) -> str:
    """Pictures without a partner, in words, if some pictures have one."""
    said = [
        f"camera {1 - camera} has none numbered {', '.join(map(str, alone[:6]))}"
        + (f" and {len(alone) - 6} more" if len(alone) > 6 else "")
        for camera in (0, 1)
        if (alone := sorted(set(numbers[camera]) - set(numbers[1 - camera])))
    ]
    return f": {'; '.join(said)}" if set(numbers[0]) & set(numbers[1]) else ""


def _refuse_odd_size(toml: TomlFile, series: Sequence[Pictures], views: Sequence[Sequence[Any]]) -> None:
    """Reject a series if its first picture, which defines the size, differs from most others."""
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


def calibration_pictures(toml: TomlFile, section: CalibrationSection) -> list[Pictures]:
    """The pictures of the target by camera. Raises InputError if a series cannot be opened."""
    found = []
    for name in CAMERAS:
        try:
            found.append(open_source(toml.path.parent, "pattern", getattr(section, name)))
        except (PictureError, OSError) as error:
            raise toml.error(f"calibration.{name}", f"cannot be used: {error}") from None
    return found


CALIBRATION_FILE_NAMES = ("calibration.toml", "shot.toml")
"""Names of the files that are searched in a folder, in this order."""


class CalibrationFile(Section):
    """A whole calibration.toml."""

    calibration: CalibrationSection


def read_calibration_toml(source: Path) -> tuple[TomlFile, CalibrationSection]:
    """Read the description of calibration pictures and their target.

    ``source``: a calibration.toml, a shot.toml, or a folder with one of them. Raises InputError if there is
    none, or if it declares anything unknown, incomplete or impossible. The same error is raised if it names a
    finished calibration instead of pictures.
    """
    path = Path(source)
    if path.is_dir():
        there = [path / name for name in CALIBRATION_FILE_NAMES if (path / name).is_file()]
        if not there:
            raise InputError(
                path,
                f"has neither {CALIBRATION_FILE_NAMES[0]} nor {CALIBRATION_FILE_NAMES[1]}",
                cure="describe pictures and target in one of them",
            )
        path = there[0]
    toml: TomlFile
    if path.name == CALIBRATION_FILE_NAMES[1]:
        toml = shot = shot_toml(path)
        section = shot.declared.calibration
        if section is None:
            raise InputError(path, "has no table [calibration]", cure="add it, with pictures and target")
    else:
        toml, declared = read_toml(path, CalibrationFile)
        section = declared.calibration
    if section.file is not None:
        raise toml.error(
            "calibration.file", "is a calibration that is finished", cure="name pictures and target instead"
        )
    return toml, section


def has_calibration_pictures(folder: Path) -> bool:
    """True if a folder's shot.toml or calibration.toml names pictures of a target."""
    try:
        read_calibration_toml(folder)
    except InputError:
        return False
    return True


def calibration_json(found: Calibration) -> dict[str, Any]:
    """The calibration as one JSON object, in SI and px."""
    R, t = found.rig.relative
    content = {
        "cameras": [
            {"matrix": camera.matrix, "distortion": camera.distortion, "sensor": camera.sensor or ()}
            for camera in found.rig.cameras
        ],
        "rotation": R,
        "translation": t,
        "sigma": found.sigma,
        "unit": found.unit,
        "clustering": found.clustering,
        "checks": vars(found.checks),
        "pairs": [
            {"name": pair.name, "outcome": pair.outcome.name, "reason": pair.reason, "rms": pair.rms}
            for pair in found.pairs
        ],
    }
    return dict(jsonable(content, "calibration"))


def write_calibration_points(path: Path, found: Calibration) -> None:
    """Write every point of every picture as one row of a table."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        numbers = ("x", "y", "sigma", "residual x", "residual y")
        table.writerow(["pair", "camera", "point", *(f"{name} (px)" for name in numbers), "used"])
        for pair in found.pairs:
            for camera, view in enumerate(pair.views):
                if view is None:
                    continue
                rows = zip(view.ids, view.pixels, view.sigma, view.residual, view.used, strict=True)
                for point, (x, y), sigma, (dx, dy), used in rows:
                    values = [f"{value:.5f}" for value in (x, y, sigma, dx, dy)]
                    table.writerow([text_cell(pair.name), camera, int(point), *values, int(used)])
