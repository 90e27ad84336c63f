"""`kolsky calibrate`: from pictures of a target to two cameras, with all that speaks for and against them."""

import csv
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from dic.calibration import Calibration
from dic.camera_files import FORMATS, CameraFileError, write_rig
from dic.cells import text_cell
from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder
from kolsky.base.process import single_threaded_libraries
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report.formats import FIGURES
from kolsky.shot.rig import calibration_of, read_calibration_toml

RIG_FILE = "rig.yml"
"""The cameras with their covariance, in OpenCV's storage format."""


def calibrate(
    source: Path, *, out: Path | None, exports: Sequence[str], formats: Sequence[str], as_json: bool
) -> None:
    """Calibrate, write and print.

    Parameters
    ----------
    source
        A calibration.toml, a shot.toml, or a folder with one of them.
    out
        Where results go; by default the folder "results" beside the file.
    exports
        Also write the cameras in these formats of `dic.camera_files`.
    formats
        Also save each figure alone, in these formats.
    as_json
        Print one JSON object instead of tables.

    Raises
    ------
    InputError
        If the description or the pictures cannot be used, or results cannot be written.
    """
    started = perf_counter()
    known = {known.name: known for known in FORMATS}
    for name in exports:
        options.one_of("--export", name, tuple(known))
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    toml, section = read_calibration_toml(source)
    folder = usable_folder(out or toml.path.parent / "results")
    with bars() as progress, single_threaded_libraries():
        found = calibration_of(toml, section, progress)
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import CALIBRATION
    from kolsky.report.pages.calibration import summary, warnings, write_page

    with filling(folder) as partial:
        try:
            write_rig(partial / RIG_FILE, found.rig, "opencv")
            for name in exports:
                write_rig(partial / f"rig-{name}{known[name].suffix}", found.rig, name)
        except CameraFileError as error:
            raise InputError(folder, str(error)) from None
        _write_points(partial / "calibration.csv", found)
        write_page(partial / "calibration.html", toml.path.parent.resolve().name, found)
        if formats:
            save_figures(partial / "figures", found, formats=tuple(formats), registry=CALIBRATION)
    tell(
        [] if as_json else _pairs(found),
        summary(found),
        as_object(found) if as_json else None,
        rest={
            "cameras": folder / RIG_FILE,
            "page": folder / "calibration.html",
            "wall time": f"{perf_counter() - started:.1f} s",
        },
        warnings=warnings(found),
    )


def as_object(found: Calibration) -> dict[str, Any]:
    """The calibration as one JSON object, in SI and px."""
    from kolsky.report.pages.calibration import warnings

    R, t = found.rig.relative
    checks = {name: value if value == value else None for name, value in vars(found.checks).items()}
    return {
        "cameras": [
            {
                "matrix": camera.matrix.tolist(),
                "distortion": list(camera.distortion),
                "sensor": list(camera.sensor or ()),
            }
            for camera in found.rig.cameras
        ],
        "rotation": R.tolist(),
        "translation": t.tolist(),
        "sigma": found.sigma,
        "unit": found.unit,
        "clustering": found.clustering,
        "checks": checks,
        "pairs": [
            {"name": pair.name, "outcome": pair.outcome.name, "reason": pair.reason, "rms": _number(pair.rms)}
            for pair in found.pairs
        ],
        "warnings": warnings(found),
    }


def _pairs(found: Calibration) -> list[str]:
    """A line for each pair: residuals of the two cameras, and what became of it."""
    lines = ["  pair        camera 0    camera 1    points"]
    for pair in found.pairs:
        rms = [f"{view.rms:9.4f} px" if view is not None else "         -  " for view in pair.views]
        points = " + ".join(str(int(view.used.sum())) for view in pair.views if view is not None)
        word = "" if pair.outcome.value == 0 else f"  {pair.outcome.name.lower().replace('_', ' ')}"
        lines.append(f"  {pair.name:<8}{rms[0]}{rms[1]}  {points}{word}")
    return lines


def _number(value: float) -> float | None:
    return value if value == value else None


def _write_points(path: Path, found: Calibration) -> None:
    """Every point of every picture as one row of a table."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(
            [
                "pair",
                "camera",
                "point",
                "x (px)",
                "y (px)",
                "sigma (px)",
                "residual x (px)",
                "residual y (px)",
                "used",
            ]
        )
        for pair in found.pairs:
            for camera, view in enumerate(pair.views):
                if view is None:
                    continue
                rows = zip(view.ids, view.pixels, view.sigma, view.residual, view.used, strict=True)
                for point, (x, y), sigma, (dx, dy), used in rows:
                    numbers = [f"{value:.5f}" for value in (x, y, sigma, dx, dy)]
                    table.writerow([text_cell(pair.name), camera, int(point), *numbers, int(used)])
