"""Result folders of the commands on one shot: result, tables, page and figures, all written or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dic.processes import background, cores
from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.inverse.result import Identification
from kolsky.report.figures_alone import save_figures_alone
from kolsky.results.tables import write_csv
from kolsky.shot.recordings import ShotRecordings, shot_recordings

if TYPE_CHECKING:
    from dic.result import FullField
    from kolsky.bars.records import ReducedTest
    from kolsky.pictures.measurement import Measurement
    from kolsky.shot.optical_data import Surfaces
    from kolsky.shot.records import PicturedShot, Shot

RESULT_FILE = "identification.h5"
PAGE = "report.html"
MOST_DRAWING = 4
"""Largest number of processes that draw a page: the slowest figure takes a quarter of the time of all."""


def drawing_processes() -> int:
    """Return how many processes draw the figures of a page side by side: one a core, 2 to 4."""
    return min(max(cores(), 2), MOST_DRAWING)


def write_identify_results(
    folder: Path,
    found: Identification,
    shot: Shot,
    *,
    formats: Sequence[str] = (),
    processes: int = 1,
) -> None:
    """Write the results of `kolsky identify`: result file, tables, report and figures; all of them or none.

    Parameters
    ----------
    folder
        Folder; created if absent.
    found
        The identification.
    shot
        The shot, as `kolsky.shot.load.load_shot` gives it.
    formats
        Also save each figure alone, in any of "pdf", "svg", "png" and "csv".
    processes
        Processes that draw; see `dic.processes.run_parallel`. With several the result file is written in
        another process meanwhile.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    recordings = shot_recordings(shot, folder)
    whole = replace(found, image_correlation=recordings.numbers)

    def write(result: Path) -> None:
        from kolsky.results.hdf5 import write_identification  # HDF5 is loaded while the page is drawn

        write_identification(result, whole)

    with filling(folder) as partial:
        write_csv(partial, found)
        with background(lambda: write(partial / RESULT_FILE), fork=processes > 1) as written:
            write_identify_page(partial, found, recordings, formats, processes=processes)
            written()


def read_identify_results(folder: Path, shot: Shot) -> Identification:
    """Read the identification of a shot back from its folder.

    Parameters
    ----------
    folder
        The folder of the results.
    shot
        The shot.

    Raises
    ------
    InputError
        If there is none, it cannot be used, or it was made from other files than the shot's.
    """
    from kolsky.results.hdf5 import read_identification

    path = folder / RESULT_FILE
    found = read_identification(path)
    _refuse_other_files(path, found.provenance.get("inputs", {}), shot.inputs)
    return found


def write_identify_page(
    folder: Path,
    found: Identification,
    recordings: ShotRecordings,
    formats: Sequence[str] = (),
    *,
    processes: int = 1,
) -> None:
    """Write the page of an identification into a folder, and its figures alone if formats are given.

    ``folder``: an empty folder of `kolsky.base.files.filling`. ``found``: the identification. ``recordings``:
    recordings of the shot's own files. ``formats``: any of `kolsky.report.FIGURE_FORMATS`. ``processes``:
    processes that draw; see `dic.processes.run_parallel`.
    """
    from kolsky.report.pages.identification import write_report

    write_report(folder / PAGE, found, recordings, processes=processes)
    save_figures_alone(folder, recordings, formats)
    save_figures_alone(folder, found, formats)


def write_dic_results(
    folder: Path,
    shot: PicturedShot,
    found: Surfaces,
    *,
    formats: Sequence[str] = (),
    csv: bool = False,
    vtp: bool = False,
    processes: int = 1,
) -> None:
    """Write the results of `kolsky dic` beside dic.h5: dic.html, outline, flyer, reporting table, figures.

    Parameters
    ----------
    folder
        Where to; made if it is not there.
    shot
        The shot with its pictures, as `kolsky.shot.load.load_pictures` gives it.
    found
        What the pictures gave.
    formats
        Also save each figure alone, in any of "pdf", "svg", "png" and "csv".
    csv, vtp
        Also write every frame's points as CSV, and as VTP for ParaView.
    processes
        How many draw the page; see `dic.processes.run_parallel`.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.report.pages.surfaces import write_page
    from kolsky.report.picture_views import read_surface_view
    from kolsky.shot.dic_output import write_tables

    result = found.result
    shown = read_surface_view(shot.name, result, shot.pictures.series, found.flight)
    with filling(folder) as partial:
        write_tables(partial, found, shot.pictures.frames.frame)
        save_figures_alone(partial, shown, formats)
        if csv:
            from dic.output import write_frames

            write_frames(partial / "surface", result.specimen, strain=result.strain.value)
        if vtp:
            from kolsky.report.paraview import write_vtp

            write_vtp(partial / "vtp", result.specimen, "specimen")
            if result.flyer is not None:
                write_vtp(partial / "vtp", result.flyer, "flyer")
        write_page(partial / "dic.html", shown, shot.inputs, processes=processes)


def write_full_field_results(
    folder: Path,
    measurement: Measurement,
    result: FullField,
    *,
    formats: Sequence[str] = (),
    csv: bool = False,
    vtu: bool = False,
) -> None:
    """Write the results of `kolsky dic` for a dic.toml: dic.h5, dic.html, history.csv and figures.

    ``folder``, ``formats``: as of `write_identify_results`. ``measurement``: the measurement, as
    `kolsky.pictures.measurement.read_measurement` gives it. ``result``: the result. ``csv``, ``vtu``: also
    write every frame's points as CSV, and as VTU for ParaView. Raises InputError if the results cannot be
    written.
    """
    from dic.output import write_full_field_frames, write_full_field_history
    from kolsky.pictures.dic_file import write_full_field
    from kolsky.report.canvas import save_figures
    from kolsky.report.pages.full_field import write_page
    from kolsky.report.paraview import write_full_field_vtu
    from kolsky.report.picture_views import read_full_field_view

    shown = read_full_field_view(measurement.name, result, measurement.series[0])
    with filling(folder) as partial:
        write_full_field(partial / "dic.h5", result)
        write_full_field_history(partial / "history.csv", result)
        write_page(partial / "dic.html", shown, measurement.inputs)
        if formats:
            save_figures(partial / "figures", shown, formats=tuple(formats))
        if csv:
            write_full_field_frames(partial / "csv", result)
        if vtu:
            write_full_field_vtu(partial / "vtu", result)


def write_waves_results(folder: Path, result: ReducedTest, *, formats: Sequence[str] = ()) -> None:
    """Write the results of `kolsky waves`: waves.h5, waves.html, tables and figures.

    Parameters
    ----------
    folder, formats
        As of `write_identify_results`.
    result
        The reduced test.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.bars.records import WavesResult
    from kolsky.bars.reduction import output as waves_output
    from kolsky.bars.reduction.output import write_database
    from kolsky.report.pages.waves import write_page

    with filling(folder) as partial:
        waves_output.write_hdf5(partial / "waves.h5", result)
        waves_output.write_csv(partial, result)
        if isinstance(result, WavesResult):
            write_database(partial / "waves_database.csv", result)
        write_page(partial / "waves.html", result)
        save_figures_alone(partial, result, formats)


def _refuse_other_files(path: Path, then: Any, now: Mapping[str, str]) -> None:
    """Refuse a result made from other versions of the files: its page would mix both."""
    then = then if isinstance(then, dict) else {}
    differing = sorted(name for name in {*then, *now} if then.get(name) != now.get(name))
    if differing:
        more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
        raise InputError(
            path,
            f"was made from other files than those of the shot: {differing[0]}{more}",
            cure="run `kolsky identify` again, or put the files back",
        )
