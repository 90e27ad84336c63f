"""`kolsky calibrate`: from pictures of a target to two cameras, with all that speaks for and against them."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures

if TYPE_CHECKING:
    from dic.calibration import Calibration

RIG_FILE = "rig.yml"
"""The cameras with their covariance, in OpenCV's storage format."""


def calibrate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A calibration.toml, a shot.toml with a table calibration, or the folder of one.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="results")
    ] = None,
    export: Annotated[
        str,
        typer.Option(
            metavar="FORMATS",
            help="Also write the cameras for other programs; an unknown name lists the formats.",
        ),
    ] = "",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Calibrate two cameras from pictures of a target, with the covariance of all parameters.

    Writes rig.yml, calibration.html and calibration.csv.
    """
    started = perf_counter()
    from dic.camera_files import FORMATS, CameraFileError, write_rig

    known = {known.name: known for known in FORMATS}
    exports = [texts.one_of("--export", name, tuple(known)) for name in texts.listed(export)]
    formats = texts.figure_formats(figures)
    from kolsky.base.files import filling, usable_folder
    from kolsky.base.process import single_threaded_libraries
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.report.pages.calibration import summary, warnings
    from kolsky.shot.calibration_file import read_calibration_toml
    from kolsky.shot.calibration_output import to_json, write_points
    from kolsky.shot.calibration_pictures import calibration_of

    toml, section = read_calibration_toml(source)
    folder = usable_folder(out or toml.path.parent / "results")
    with progress_bars() as progress, single_threaded_libraries():
        found = calibration_of(toml, section, progress)
    from kolsky.report.canvas import save_figures
    from kolsky.report.pages.calibration import write_page

    with filling(folder) as partial:
        try:
            write_rig(partial / RIG_FILE, found.rig, "opencv")
            for name in exports:
                write_rig(partial / f"rig-{name}{known[name].suffix}", found.rig, name)
        except CameraFileError as error:
            raise InputError(
                folder,
                str(error),
                cure="is it the folder of a calibration series of this target? look at the pictures named",
            ) from None
        write_points(partial / "calibration.csv", found)
        write_page(partial / "calibration.html", toml.path.parent.resolve().name, found)
        if formats:
            save_figures(partial / "figures", found, formats=formats)
    print_result(
        summary(found),
        {**to_json(found), "warnings": warnings(found)} if as_json else None,
        answers=[] if as_json else _pairs(found),
        rest={
            "cameras": folder / RIG_FILE,
            "page": folder / "calibration.html",
            "wall time": since(started),
        },
        warnings=warnings(found),
    )


def _pairs(found: "Calibration") -> list[str]:
    """A line for each pair: residuals of the two cameras, and what became of it."""
    lines = ["  pair        camera 0    camera 1    points"]
    for pair in found.pairs:
        rms = [f"{view.rms:9.4f} px" if view is not None else "         -  " for view in pair.views]
        points = " + ".join(str(int(view.used.sum())) for view in pair.views if view is not None)
        word = "" if pair.outcome.value == 0 else f"  {pair.outcome.name.lower().replace('_', ' ')}"
        lines.append(f"  {pair.name:<8}{rms[0]}{rms[1]}  {points}{word}")
    return lines
