"""`kolsky dic` and `calibrate`: from pictures of a shot to surfaces, and from a target to two cameras."""

from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from kolsky.base.errors import refused
from kolsky.base.files import usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.base.process import infrequent_gc
from kolsky.cli import texts
from kolsky.cli.options import Figures, Out, ShotPath, Vtu
from kolsky.cli.terminal import print_result, progress_bars
from kolsky.report.figures_alone import figure_files


@infrequent_gc()
def dic(
    shot: ShotPath,
    out: Out = None,
    device: Annotated[
        str, Option('Device of the correlation: "cpu" or a CUDA device such as "cuda:0".')
    ] = "cpu",
    repeat: Annotated[bool, Option("Correlate even if a result exists.", name="again")] = False,
    csv: Annotated[bool, Option("Also write the points of every frame as CSV.")] = False,
    vtu: Vtu = False,
    regions: Annotated[
        bool, Option("Draw the regions by hand in the page of `kolsky open`, and save them in the file.")
    ] = False,
    figures: Figures = (),
) -> None:
    """Correlate a shot's pictures: surfaces, outline and the flyer's displacement, each with its sigma.

    Writes dic.h5, dic.html, centreline.csv, flyer.csv and the reporting table into SHOT/results. `kolsky
    identify` does this automatically for a shot without exports. A folder with a dic.toml instead of a
    shot.toml is a measurement by image correlation only: a plane by one camera, a surface or a cylinder by
    two cameras.
    """
    from kolsky.schema.pictures import find_measurement_file

    if regions:
        from kolsky.schema.shot_file import folder_of
        from kolsky.shot.dic import open_region_session

        open_region_session(shot)  # bad input is refused before a page is opened
        from kolsky.app.server import serve

        serve(folder_of(shot), first="/pictures?shot=.")
        return
    if (measurement := find_measurement_file(shot)) is not None:
        _measure_pictures(measurement, out, device, figures, csv=csv, vtu=vtu)
        return
    from dic.processes import allow_forks
    from kolsky.base.process import keep_freed_memory, single_threaded_libraries
    from kolsky.report.result_folder import drawing_processes, write_dic_results
    from kolsky.shot.load import load_pictures
    from kolsky.shot.optical_data import RESULT_FILE, surfaces

    keep_freed_memory()
    loaded = load_pictures(shot)
    folder = usable_folder(out or loaded.folder / "results")
    with progress_bars() as progress, allow_forks(), single_threaded_libraries():
        began = perf_counter()
        surfaces_of_shot = surfaces(loaded.pictures, folder, device=device, again=repeat, progress=progress)
        result, now = surfaces_of_shot.result, perf_counter()
        times = (
            {name: result.seconds[name] for name in ("calibration", "correlation")}
            if surfaces_of_shot.fresh
            else {}
        )
        times["surfaces file"] = now - began - sum(times.values())
        now = perf_counter()
        write_dic_results(
            folder, loaded, surfaces_of_shot, formats=figures, csv=csv, vtu=vtu, processes=drawing_processes()
        )
        times["files and page"] = perf_counter() - now
    print_result(
        surfaces_of_shot.rows(),
        {"shot": loaded.name, **surfaces_of_shot.summary()},
        files={
            "result": f"{folder / RESULT_FILE}" + ("" if surfaces_of_shot.fresh else " (as it was)"),
            "page": folder / "dic.html",
            "stages": ", ".join(f"{name} {value:.1f} s" for name, value in times.items()),
        },
        warnings=surfaces_of_shot.warnings,
    )


def _measure_pictures(
    path: Path, out: Path | None, device: str, figures: tuple[str, ...], *, csv: bool, vtu: bool
) -> None:
    """The measurement that a dic.toml describes."""
    from dic.processes import allow_forks
    from kolsky.pictures.measurement import measure_file, read_measurement

    measurement = read_measurement(path)
    folder = usable_folder(out or path.parent / "results")
    with progress_bars() as progress, allow_forks():
        result = measure_file(measurement, device=device, progress=progress)
    from dic.output import write_full_field_frames, write_full_field_history
    from kolsky.pictures.dic_file import write_full_field
    from kolsky.report.pages.surfaces import printed, render_field, summary, warnings
    from kolsky.report.picture_views import read_full_field_view

    remarks = warnings(result)
    shown = read_full_field_view(measurement.name, result, measurement.series[0])
    files: dict[str, Any] = {
        "dic.h5": lambda path: write_full_field(path, result),
        "history.csv": lambda path: write_full_field_history(path, result),
        "dic.html": render_field(shown, measurement.inputs),
    }
    if csv:
        files["csv"] = lambda path: write_full_field_frames(path, result)
    if vtu:
        from kolsky.report.paraview import write_full_field_vtu

        files["vtu"] = lambda path: write_full_field_vtu(path, result)
    write_folder(folder, files | figure_files(figures, shown))
    print_result(
        printed(result),
        {"measurement": measurement.name, **summary(result), "warnings": remarks},
        files={"result": folder / "dic.h5", "page": folder / "dic.html"},
        warnings=remarks,
    )


_RIG_FILE = "rig.yml"
"""The cameras with their covariance, in OpenCV's storage format."""


def calibrate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A calibration.toml, a shot.toml with a table calibration, or the folder of one.",
        ),
    ],
    out: Annotated[Path | None, Option("Where results go.", metavar="FOLDER", show_default="results")] = None,
    export: Annotated[
        str,
        Option(
            "Also write the cameras for other programs; an unknown name lists the formats.", metavar="FORMATS"
        ),
    ] = "",
    figures: Figures = (),
) -> None:
    """Calibrate two cameras from pictures of a target, with the covariance of all parameters.

    Writes rig.yml, calibration.html and calibration.csv.
    """
    from dic.camera_files import FORMATS, CameraFileError, write_rig

    formats = {one.name: one for one in FORMATS}
    exports = [texts.one_of("--export", name, tuple(formats)) for name in texts.listed(export)]
    from kolsky.base.process import single_threaded_libraries
    from kolsky.pictures.calibration import (
        calibration_json,
        calibration_of,
        read_calibration_toml,
        write_calibration_points,
    )
    from kolsky.report.pages.surfaces import (
        calibration_summary,
        calibration_warnings,
        pair_row,
        render_calibration,
    )
    from kolsky.results.numbers import table_lines

    toml, section = read_calibration_toml(source)
    folder = usable_folder(out or toml.path.parent / "results")
    with progress_bars() as progress, single_threaded_libraries():
        calibration = calibration_of(toml, section, progress)
    name = toml.path.parent.resolve().name
    files = {
        _RIG_FILE: lambda path: write_rig(path, calibration.rig, "opencv"),
        **{
            f"rig-{form}{formats[form].suffix}": partial(write_rig, rig=calibration.rig, format=form)
            for form in exports
        },
        "calibration.csv": lambda path: write_calibration_points(path, calibration),
        "calibration.html": render_calibration(name, calibration),
        **figure_files(figures, calibration),
    }
    cure = "is it the folder of a calibration series of this target? look at the pictures named"
    with refused(folder, cure=cure, errors=(CameraFileError,)):
        write_folder(folder, files)
    print_result(
        calibration_summary(calibration),
        {**calibration_json(calibration), "warnings": calibration_warnings(calibration)},
        lines=table_lines(map(pair_row, calibration.pairs)),
        files={"cameras": folder / _RIG_FILE, "page": folder / "calibration.html"},
        warnings=calibration_warnings(calibration),
    )
