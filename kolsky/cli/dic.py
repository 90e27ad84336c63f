"""`kolsky dic`: from the pictures of a shot to surfaces, files, tables and a page."""

from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.process import infrequent_gc
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Out, ShotPath

if TYPE_CHECKING:
    from dic.result import StereoResult


@infrequent_gc()
def dic(
    shot: ShotPath,
    out: Out = None,
    device: Annotated[
        str, typer.Option(help='Where pictures are correlated: "cpu" or a CUDA device such as "cuda:0".')
    ] = "cpu",
    again: Annotated[bool, typer.Option("--again", help="Correlate even if the result is there.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the points of every frame as CSV.")] = False,
    vtp: Annotated[
        bool, typer.Option("--vtp", help="Also write the surfaces for ParaView (VTU files for a dic.toml).")
    ] = False,
    regions: Annotated[
        bool,
        typer.Option(
            "--regions",
            help="Draw the regions by hand in a page on this computer, which saves them into the file.",
        ),
    ] = False,
    grid: Annotated[
        bool,
        typer.Option(
            "--grid",
            help="Write pictures with a grid and the lines to fill in: regions by hand without a page.",
        ),
    ] = False,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Correlate a shot's pictures: surfaces, outline and the flyer's displacement, each with its sigma.

    Writes dic.h5, dic.html, centreline.csv, flyer.csv and the reporting table into SHOT/results. `kolsky
    identify` does the same by itself for a shot without exports. A folder with a dic.toml in place of a
    shot.toml is a measurement by image correlation alone: a plane by one camera, a surface or a cylinder by
    two.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.shot.measurement_path import measurement_file

    if regions or grid:
        _draw_regions(shot, out, grid=grid)
        return
    if (alone := measurement_file(shot)) is not None:
        _measure_alone(alone, out, device, started, formats, csv=csv, vtu=vtp, as_json=as_json)
        return
    from dic.forks import forking
    from kolsky.base.files import usable_folder
    from kolsky.base.process import keep_freed_memory, single_threaded_libraries
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.shot.load import load_pictures
    from kolsky.shot.rig import calibrated_beside

    keep_freed_memory()
    loaded = load_pictures(shot)
    folder = usable_folder(out or loaded.folder / "results")
    kept = not again and (folder / "dic.h5").exists()  # may be read back; the cameras are found if not
    with progress_bars() as progress, forking(), single_threaded_libraries(), ExitStack() as stack:
        began = perf_counter()
        cameras = None if kept else stack.enter_context(calibrated_beside(loaded.pictures))
        # imported while others look at the target
        from kolsky.report.page_process import drawers, load_surface_page, surface_page_process
        from kolsky.report.result_folder import write_dic_results
        from kolsky.report.surface_view import read_surface_view
        from kolsky.shot.optical_data import RESULT_FILE, surfaces

        page = stack.enter_context(surface_page_process(drawers()))  # forked with what both need

        def draw_ahead(result: "StereoResult") -> None:
            if page is not None:
                page.draw_ahead(read_surface_view(loaded.name, result, loaded.pictures.series))

        found = surfaces(
            loaded.pictures, folder, device=device, again=again, progress=progress, cameras=cameras,
            idle=load_surface_page if page is None else lambda: None, known=draw_ahead,
        )  # fmt: skip
        result, now = found.result, perf_counter()
        times = {name: result.seconds[name] for name in ("calibration", "correlation")} if found.fresh else {}
        times["surfaces file"] = now - began - sum(times.values())
        now = perf_counter()
        write_dic_results(
            folder, loaded, found, formats=formats, csv=csv, vtp=vtp, processes=drawers(), page=page
        )
        times["files and page"] = perf_counter() - now
    print_result(
        found.rows(),
        {"shot": loaded.name, **found.summary()} if as_json else None,
        rest={
            "result": f"{folder / RESULT_FILE}" + ("" if found.fresh else " (as it was)"),
            "page": folder / "dic.html",
            "stages": ", ".join(f"{name} {value:.1f} s" for name, value in times.items()),
            "wall time": since(started),
        },
        warnings=found.warnings,
    )


def _measure_alone(
    path: Path,
    out: Path | None,
    device: str,
    started: float,
    formats: tuple[str, ...],
    *,
    csv: bool,
    vtu: bool,
    as_json: bool,
) -> None:
    """The measurement that a dic.toml describes."""
    from dic.forks import forking
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.shot.measurement import measure_file, read_measurement

    measurement = read_measurement(path)
    folder = usable_folder(out or path.parent / "results")
    with progress_bars() as progress, forking():
        result = measure_file(measurement, device=device, progress=progress)
    from kolsky.report.pages.full_field import printed, summary, warnings
    from kolsky.report.result_folder import write_full_field_results

    said = warnings(result)
    write_full_field_results(folder, measurement, result, formats=formats, csv=csv, vtu=vtu)
    print_result(
        printed(result),
        {"measurement": measurement.name, **summary(result), "warnings": said} if as_json else None,
        rest={"result": folder / "dic.h5", "page": folder / "dic.html", "wall time": since(started)},
        warnings=said,
    )


def _draw_regions(source: Path, out: Path | None, *, grid: bool) -> None:
    """Regions by hand: with a grid, or in the page."""
    from kolsky.base.files import usable_folder
    from kolsky.shot.drawn_regions import frames_to_show, open_session
    from kolsky.shot.regions.grid_picture import write_grids
    from kolsky.shot.regions.server import RegionServer

    session = open_session(source)
    if grid:
        folder = usable_folder(out or session.path.parent / "results" / "regions")
        for path in write_grids(folder, session, frames_to_show(session)):
            typer.echo(path)
        return
    server = RegionServer(session)
    typer.echo(f"Draw the regions at {server.url}")
    typer.echo("The page is on this computer alone; End on the page, or Ctrl+C here, ends it.", err=True)
    server.run()
    saved = ", ".join(session.saved)
    typer.echo(f"saved into {session.path}: {saved}" if saved else f"{session.path} was left as it is")
