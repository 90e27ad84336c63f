"""`kolsky dic`: from the pictures of a shot to surfaces, files, tables and a page."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from dic.output import reporting
from dic.output.csv import MM, write_frames, write_history
from dic.result import StereoResult
from kolsky.bars.flyer import flight_report
from kolsky.base.files import filling, usable_folder
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report.formats import FIGURES
from kolsky.shot import dic_summary
from kolsky.shot.load import load_pictures
from kolsky.shot.optical_data import RESULT_FILE, surfaces


def correlate(
    shot: Path,
    *,
    out: Path | None,
    device: str,
    again: bool,
    csv: bool,
    vtp: bool,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """Correlate, write and print.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    device
        "cpu" or a CUDA device.
    again
        Correlate even if the result of the same inputs and settings is there.
    csv, vtp
        Also write every frame's points as CSV, and as VTP.
    formats
        Also save each figure alone, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If the shot, its pictures or its cameras cannot be used, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    loaded = load_pictures(shot)
    folder = usable_folder(out or loaded.folder / "results")
    with bars() as progress:
        began = perf_counter()
        found = surfaces(loaded.pictures, folder, device=device, again=again, progress=progress)
    result, now = found.result, perf_counter()
    times = {name: result.seconds[name] for name in ("calibration", "correlation")} if found.fresh else {}
    times["surfaces file"] = now - began - sum(times.values())
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import SURFACES
    from kolsky.report.pages.surfaces import write_page
    from kolsky.report.paraview import write_vtp
    from kolsky.report.surface_view import read_surface_view

    shown = read_surface_view(loaded.name, result, loaded.pictures.series, found.flight)
    with filling(folder) as partial:
        _tables(partial, result, loaded.pictures.frames.frame)
        if not isinstance(found.flight, str):
            write_history(partial / "flight.csv", flight_report.columns(found.flight))
        now = perf_counter()
        write_page(partial / "dic.html", shown, loaded.inputs, processes=2)
        times["page"] = perf_counter() - now
        if formats:
            save_figures(partial / "figures", shown, formats=tuple(formats), registry=SURFACES)
        if csv:
            write_frames(partial / "surface", result.specimen, strain=result.strain.value)
        if vtp:
            write_vtp(partial / "vtp", result.specimen, "specimen")
            if result.flyer is not None:
                write_vtp(partial / "vtp", result.flyer, "flyer")
    tell(
        [],
        {**dic_summary.printed(result), **flight_report.printed(found.flight)},
        {
            "shot": loaded.name,
            **dic_summary.summary(result),
            **flight_report.summary(found.flight),
            "remarks": dic_summary.warnings(result),
        }
        if as_json
        else None,
        rest={
            "result": f"{folder / RESULT_FILE}" + ("" if found.fresh else " (as it was)"),
            "page": folder / "dic.html",
            "stages": ", ".join(f"{name} {value:.1f} s" for name, value in times.items()),
            "wall time": f"{perf_counter() - started:.1f} s",
        },
        warnings=dic_summary.warnings(result),
    )


def _tables(folder: Path, result: StereoResult, number: np.ndarray) -> None:
    """Outline and flyer as the exports that a shot can declare, and the reporting table."""
    line = result.centre
    write_history(
        folder / "centreline.csv",
        {
            "frame": number[line.frame],
            "time (s)": line.t,
            "y (mm)": MM * line.y,
            "Z (mm)": MM * line.Z,
            "sigma_Z (mm)": MM * line.sigma,
        },
    )
    if result.travel is not None:
        travel = result.travel
        write_history(
            folder / "flyer.csv",
            {
                "frame": number[travel.frame],
                "time (s)": travel.t,
                "flyer displacement toward the specimen (mm)": MM * travel.displacement,
                "sigma (mm)": MM * travel.sigma,
            },
        )
    table = reporting.reporting_table(result)
    (folder / "dic_reporting.csv").write_text(reporting.as_csv(table), encoding="utf-8")
    (folder / "dic_reporting.md").write_text(reporting.as_markdown(table), encoding="utf-8")
