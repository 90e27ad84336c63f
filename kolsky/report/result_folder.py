"""Result folders: result, tables, page and figures.

A folder is written completely or not at all.

`RESULTS` lists the tables and files of each type of result, for `tables_of` and `write_results`. Results that
need more input, such as a shot or several results, have separate functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dic.processes import background, cores
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import filling, write_files, write_folder, write_tables
from kolsky.report.figures_alone import figure_files
from kolsky.shot.recordings import ShotRecordings, shot_recordings

if TYPE_CHECKING:
    from kolsky.equilibrium.solution import Solution
    from kolsky.inverse.result import Identification
    from kolsky.prediction.design import Aim, Scan
    from kolsky.prediction.predict import Prediction
    from kolsky.report.body_views import SheetView, SpecimenView
    from kolsky.report.figures.base import FigureKind
    from kolsky.shot.optical_data import Surfaces
    from kolsky.shot.records import PicturedShot, Shot
    from kolsky.studies.budget.records import Budget, Campaign
    from kolsky.studies.rates.records import RateReport
    from kolsky.studies.sweep import Sweep
    from kolsky.studies.sweep_analysis import SweepAnalysis


Tables = Mapping[str, Mapping[str, Any]]
"""Name of a table, which is that of its file without ".csv" -> heading, with the unit -> cells."""


def _rate_figures(report: RateReport) -> Iterable[tuple[Any, Mapping[str, FigureKind[Any]]]]:
    from kolsky.report.pages.rates import figures_of

    return ((group, figures_of(report, index)) for index, group in enumerate(report.groups))


@dataclass(frozen=True)
class ResultFiles:
    """Tables and files of a type of result; functions by their dotted names, loaded when they are used."""

    tables: str
    """Function of the result that returns its `Tables`, the main one first. If there is only one table, it
    returns the columns."""
    only: str = ""
    """Name of the only table; "" if the function gives the names."""
    files: Mapping[str, str] = field(default_factory=dict)
    """Name of a file -> function of its path and the result that writes the file. For JSON, the function of
    the result returns the object."""
    figures: Callable[[Any], Iterable[Any]] = lambda result: [result]
    """What the figures show, for `kolsky.report.figures_alone.figure_files`."""


_WAVES = {
    "waves.h5": "kolsky.bars.reduction.output.write_hdf5",
    "waves.html": "kolsky.report.pages.waves.render",
}
RESULTS = {
    "dic.result.FullField": ResultFiles("dic.output.full_field_columns", "history"),
    "kolsky.bars.guides.propagation.BarsTogether": ResultFiles(
        "kolsky.shot.waves.residual_columns", "residual"
    ),
    "kolsky.bars.records.FlyerResult": ResultFiles("kolsky.bars.reduction.output.tables", files=_WAVES),
    "kolsky.bars.records.WavesResult": ResultFiles(
        "kolsky.bars.reduction.output.tables",
        files={**_WAVES, "waves_database.csv": "kolsky.bars.reduction.output.write_database"},
    ),
    "kolsky.bodies.specimen_fit.SpecimenFit": ResultFiles("kolsky.bodies.specimen_output.tables"),
    "kolsky.inverse.joint_result.JointResult": ResultFiles(
        "kolsky.results.joint.tables",
        files={
            "joint.h5": "kolsky.results.joint.write_joint_hdf5",
            "joint.json": "kolsky.results.joint.to_json",
            "joint.html": "kolsky.report.pages.identification.render_joint",
        },
    ),
    "kolsky.inverse.result.Identification": ResultFiles("kolsky.results.tables.all_tables"),
    "kolsky.material.fits.compare.Comparison": ResultFiles("kolsky.material.fits.tables.tables"),
    "kolsky.material.reference_curve.ReferenceCurve": ResultFiles(
        "kolsky.material.reference_curve.curve_columns", "curve"
    ),
    "kolsky.prediction.predict.Prediction": ResultFiles(
        "kolsky.prediction.design.tables",
        files={
            "prediction.json": "kolsky.prediction.design.to_json",
            "prediction.html": "kolsky.report.pages.studies.render_prediction",
        },
    ),
    "kolsky.studies.budget.records.Budget": ResultFiles("kolsky.studies.budget.records.columns", "budget"),
    "kolsky.studies.planning.plan.Plan": ResultFiles(
        "kolsky.studies.planning.plan.tables",
        files={
            "plan.json": "kolsky.studies.planning.plan.to_json",
            "plan.html": "kolsky.report.pages.studies.render_plan",
        },
    ),
    "kolsky.studies.rate_dependence.SlowDynamics": ResultFiles("kolsky.studies.rate_dependence.tables"),
    "kolsky.studies.rates.records.RateReport": ResultFiles(
        "kolsky.studies.rates.output.tables",
        files={
            "rates.json": "kolsky.studies.rates.output.summary",
            "rates.html": "kolsky.report.pages.rates.render",
        },
        figures=_rate_figures,
    ),
    "kolsky.studies.sweep.Sweep": ResultFiles("kolsky.studies.sweep.columns", "sweep"),
}
"""Tables and files of a type of result, by the type's dotted name."""


def has_tables(result: object) -> bool:
    """True if there are tables of a result."""
    return _type_name(result) in RESULTS


def tables_of(result: Any, *more: Any) -> Tables:
    """Return every table of a result, by the name of its CSV file, as columns (SI), the main one first.

    Parameters
    ----------
    result, more
        A result of a type in `RESULTS`, and further arguments of its functions, e.g. a prediction's scan.

    Examples
    --------
    >>> import kolsky
    >>> next(iter(kolsky.tables_of(kolsky.waves("runs/bar-01"))))
    'waves'
    """
    known = RESULTS[_type_name(result)]
    made = _function(known.tables)(result, *more)
    return {known.only: made} if known.only else made


def write_results(folder: Path, result: Any, *more: Any, formats: Sequence[str] = ()) -> None:
    """Write every file that `RESULTS` lists for a result: HDF5, JSON, tables, page, figures; all or none.

    Parameters
    ----------
    folder
        Created if absent; InputError if it cannot be written.
    result, more
        As for `tables_of`.
    formats
        Also save each figure as a file, in any of `kolsky.report.FIGURE_FORMATS`.
    """
    write_folder(folder, _files_of(result, *more, formats=formats), tables_of(result, *more))


def _files_of(result: Any, *more: Any, formats: Sequence[str]) -> dict[str, Any]:
    """The files of a result without its tables, for `kolsky.base.files.write_folder`."""
    known = RESULTS[_type_name(result)]

    def content(name: str, function: Callable[..., Any]) -> Any:
        if name.endswith((".json", ".html")):
            return function(result, *more)
        return lambda path: function(path, result, *more)

    files = {name: content(name, _function(dotted)) for name, dotted in known.files.items()}
    return files | figure_files(formats, *known.figures(result))


def _type_name(result: object) -> str:
    return f"{type(result).__module__}.{type(result).__qualname__}"


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.rpartition(".")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found


RESULT_FILE = "identification.h5"
SUMMARY = "summary"
"""File name, without ending, of the table of one row. `kolsky open` lists shots by this table."""
PAGE = "report.html"
MOST_DRAWING = 4
"""Largest number of processes that draw a page. The slowest figure takes a quarter of all time."""


def drawing_processes() -> int:
    """Return the number of parallel processes that draw the figures of a page: one per core, 2 to 4."""
    return min(max(cores(), 2), MOST_DRAWING)


def write_identify_results(
    folder: Path, found: Identification, shot: Shot, *, formats: Sequence[str] = (), processes: int = 1
) -> None:
    """Write the results of `kolsky identify`: result file, tables, report and figures.

    Parameters
    ----------
    folder, found, shot, formats
        As for `write_results`; the shot of the identification is that of `kolsky.load_shot`.
    processes
        Processes that draw; with several, another one writes the result file at the same time.
    """
    from kolsky.results.tables import summary_row, tables  # imports the solver

    recordings = shot_recordings(shot, folder)
    whole = replace(found, image_correlation=recordings.numbers)

    def write(result: Path) -> None:
        from kolsky.results.hdf5 import write_identification  # HDF5 is loaded while the page is drawn

        write_identification(result, whole)

    with filling(folder) as partial:
        write_tables(partial, {**tables(found), SUMMARY: summary_row(found, _nominal_rate(shot))})
        with background(lambda: write(partial / RESULT_FILE), fork=processes > 1) as written:
            write_identify_page(partial, found, recordings, formats, processes=processes)
            written()


def _nominal_rate(shot: Shot) -> float:
    """Nominal strain rate of a shot in its window [1/s]; NaN if the specimen was hardly compressed."""
    from kolsky.studies.rates.records import strain_history

    try:
        return strain_history(shot).nominal_rate
    except ValueError:
        return float("nan")


def read_identify_results(folder: Path, shot: Shot) -> Identification:
    """Read the identification of a shot back from the folder of its results.

    Parameters
    ----------
    folder, shot
        InputError if the result cannot be used, or was made from files that differ from the shot's: the page
        would mix both versions.
    """
    from kolsky.results.hdf5 import read_identification

    path, now = folder / RESULT_FILE, shot.inputs
    found = read_identification(path)
    then = found.provenance.get("inputs", {})
    then = then if isinstance(then, dict) else {}
    differing = sorted(name for name in {*then, *now} if then.get(name) != now.get(name))
    if differing:
        more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
        raise InputError(
            path,
            f"was made from other files than those of the shot: {differing[0]}{more}",
            cure="run `kolsky identify` again, or put the files back",
        )
    return found


def write_identify_page(
    folder: Path,
    found: Identification,
    recordings: ShotRecordings,
    formats: Sequence[str] = (),
    *,
    processes: int = 1,
) -> None:
    """Write the page of an identification and, if formats are given, its figures as files."""
    from kolsky.report.pages.identification import write_report

    write_report(folder / PAGE, found, recordings, processes=processes)
    write_files(folder, figure_files(formats, recordings, found))


def write_dic_results(
    folder: Path,
    shot: PicturedShot,
    found: Surfaces,
    *,
    formats: Sequence[str] = (),
    csv: bool = False,
    vtu: bool = False,
    processes: int = 1,
) -> None:
    """Write the results of `kolsky dic` into the folder of dic.h5: page, outline, flyer, reporting table.

    Parameters
    ----------
    folder, shot, found, formats
        As for `write_results`; the shot has its pictures, as `kolsky.shot.load.load_pictures` gives it.
    csv, vtu
        Also write every frame's points as CSV, and as VTU for ParaView.
    processes
        Processes that draw the page.
    """
    from kolsky.report.pages.surfaces import render_surfaces
    from kolsky.report.picture_views import read_surface_view
    from kolsky.shot.optical_data import write_tables

    result = found.result
    shown = read_surface_view(shot.name, result, shot.pictures.series, found.flight)
    with filling(folder) as partial:
        write_tables(partial, found, shot.pictures.frames.frame)
        write_files(partial, figure_files(formats, shown))
        if csv:
            from dic.output import write_frames

            write_frames(partial / "surface", result.specimen, strain=result.strain.value)
        if vtu:
            from kolsky.report.paraview import write_body_vtu

            write_body_vtu(partial / "vtu", result.specimen, "specimen")
            if result.flyer is not None:
                write_body_vtu(partial / "vtu", result.flyer, "flyer")
        write_files(partial, {"dic.html": render_surfaces(shown, shot.inputs, processes=processes)})


def write_budget_results(
    folder: Path, results: Sequence[Budget], campaign: Campaign | None, *, formats: Sequence[str] = ()
) -> None:
    """Write the results of `kolsky budget`: budget.csv, budget.html and figures.

    ``results``: a budget for each free parameter. Files and figures of the first budget are named budget,
    those of the others budget and the parameter.
    """
    from kolsky.report.figures import BUDGETS
    from kolsky.report.pages.studies import render_budget
    from kolsky.studies.budget.records import columns

    tables, groups = {}, []
    for number, result in enumerate(results):
        end = f"-{result.parameter}" if number else ""
        tables[f"budget{end}"] = columns(result)
        registry = {key: replace(kind, name=f"{kind.name}{end}") for key, kind in BUDGETS.items()}
        groups.append((result, registry))
    files: dict[str, Any] = {"budget.html": render_budget(results, campaign)}
    write_folder(folder, files | figure_files(formats, *groups), tables)


def write_sweep_results(
    folder: Path,
    result: Sweep,
    analysis: SweepAnalysis,
    *,
    name: str = "sweep",
    warnings: Sequence[str] = (),
    formats: Sequence[str] = (),
) -> None:
    """Write the results of `kolsky sweep`: sweep.csv, sweep.html and figures.

    Parameters
    ----------
    folder, result, formats
        As for `write_results`.
    analysis
        That of `kolsky.studies.sweep_analysis.analyse_sweep`.
    name, warnings
        Name of table and page without their endings, and warnings at the top of the page.
    """
    from kolsky.report.pages.studies import render_sweep
    from kolsky.studies.sweep import columns

    page = {f"{name}.html": render_sweep(analysis, warnings)}
    write_folder(folder, page | figure_files(formats, analysis), {name: columns(result)})


def write_prediction_results(
    folder: Path,
    found: Prediction,
    scan: Scan | None = None,
    aim: Aim | None = None,
    *,
    formats: Sequence[str] = (),
) -> None:
    """Write the results of a prediction with its scan and the point found in it."""
    from kolsky.prediction.design import write_specification

    files = _files_of(found, scan, aim, formats=formats)
    if scan is not None:
        from kolsky.report.figures import SCANS

        files |= figure_files(formats, found, ((scan, aim), SCANS))
    with filling(folder) as partial:
        write_tables(partial, tables_of(found, scan, aim))
        write_files(partial, files)
        if isfinite(found.events.separation):
            write_specification(partial, found)


def write_specimen_results(
    folder: Path,
    view: SpecimenView | SheetView,
    inputs: Mapping[str, str],
    *,
    formats: Sequence[str] = (),
    vtu: bool = False,
) -> None:
    """Write specimen.html, .json, tables and figures of force curves or of a sheet.

    Force curves also give specimen.h5, and curves for `identify`. ``vtu``: also write the last sample of each
    test for ParaView.
    """
    from kolsky.bodies import specimen_output as output  # imports scipy.stats
    from kolsky.report.body_views import SpecimenView
    from kolsky.report.pages.bodies import render_specimen

    files: dict[str, Any] = {"specimen.html": render_specimen(view, inputs)}
    if isinstance(view, SpecimenView):
        tables = output.tables(*view.fits)
        files |= output.files_of(view.fits, inputs)
        solutions, fields = view.solutions, {}
    else:
        tables = output.field_tables(view.fit, view.steps)
        files["specimen.json"] = output.field_json(view.fit, view.steps) | {"inputs": dict(inputs)}
        solutions, fields = {"sheet": view.fit.cost.state.solution}, view.fields
    for name, solution in solutions.items() if vtu else ():
        files[f"{name}.vtu"] = partial(write_solution_vtu, solution=solution, fields=fields)
    write_folder(folder, files | figure_files(formats, view), tables)


def write_solution_vtu(
    path: Path, solution: Solution, fields: Mapping[str, FloatArray] | None = None
) -> None:
    """Write the last equilibrium of a solution for ParaView: displacement, nodal forces, further fields."""
    from kolsky.report.paraview import write_grid  # imports image correlation

    mesh, last = solution.model.mesh, solution.reached - 1
    named = {
        "displacement (m)": solution.displacements[last],
        "internal force (N)": solution.forces[last],
        **(fields or {}),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    points, *wide = (np.pad(x, ((0, 0), (0, 3 - x.shape[1]))) for x in (mesh.points, *named.values()))
    write_grid(path, points, mesh.cells, mesh.element.vtk, dict(zip(named, wide, strict=True)))
