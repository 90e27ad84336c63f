"""`kolsky identify`: load, identify, write, print.

One shot, or with --each many shots one by one: in this process, in several, or on a Dask cluster. Several
shots together are in `kolsky.cli.identify_shots`.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, as_completed
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError, refuse
from kolsky.cli import texts
from kolsky.cli.identify_shots import (
    JointOptions,
    identify_shots,
    refuse_single_shot_options,
    with_relaxation_option,
)
from kolsky.cli.options import AsJson, Figures, Mesh, Out, SolverOptions
from kolsky.cli.sweep import Workers
from kolsky.cli.terminal import quietly
from kolsky.inverse.parameters import PARAMETERS

if TYPE_CHECKING:
    from kolsky.inverse.problem import Settings
    from kolsky.shot.records import Shot


@dataclass(frozen=True)
class SingleShotJob:
    """The identification of one shot, as given on the command line; it can be pickled."""

    shot: Path
    """Its folder, or its shot.toml."""
    solver: SolverOptions
    """Numerical choices."""
    mesh: tuple[int, int]
    """Elements across the radius and along the length, of the search."""
    choices: Mapping[str, Any]
    """Fields of `kolsky.inverse.problem.Settings` beside the numerics."""
    out: Path | None = None
    """Where results go; None for the folder `results` of the shot."""
    relaxation: str = ""
    """Kind of relaxation, as written; empty for what the shot declares."""
    diagnose: bool = False
    """Whether the likeliest causes of misfit are tested."""
    paper: bool = False
    """Whether the method of Mates et al. is applied too."""
    formats: tuple[str, ...] = ()
    """Formats of figures alone."""


@dataclass(frozen=True)
class Printout:
    """What is printed of an identification; it can be pickled."""

    shot: str
    """Name of the shot."""
    answers: tuple[str, ...]
    """First lines: the free parameters with their intervals, the fit."""
    rows: Mapping[str, Any]
    """Names and values below them."""
    said: Mapping[str, Any]
    """The object of `--json`."""
    warnings: tuple[str, ...]
    """What to know before using the answer."""
    page: Path
    """The report."""


def _run_job(one: SingleShotJob, *, processes: int = 1) -> Printout:
    """Identify a shot and write its results."""
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import progress_bars

    shot, folder = load(one.shot, one.out, forks=processes > 1)
    shot = with_relaxation_option(shot, one.relaxation)
    from kolsky import identification
    from kolsky.inverse.problem import Settings
    from kolsky.report.result_folder import PAGE, write_identify_results
    from kolsky.results import printed
    from kolsky.results.identification_rows import fit_line
    from kolsky.results.tables import to_json

    settings = Settings(numerics=one.solver.numerics(one.mesh), **one.choices)
    with usable(shot), progress_bars() as progress:
        found = identification.identify(shot, settings, progress=progress)
        if one.diagnose:
            found = identification.diagnose(found, shot, settings, progress=progress)
    write_identify_results(folder, found, shot, formats=one.formats, processes=processes)
    beside, said, doubts = paper_answer(shot, settings, folder) if one.paper else ({}, {}, [])
    return Printout(
        shot=shot.name,
        answers=(*(printed.answer(e) for e in found.estimates.values()), fit_line(found)),
        rows={**printed.details(found), **beside},
        said={**to_json(found), **said},
        warnings=(*found.warnings, *doubts),
        page=folder / PAGE,
    )


def paper_answer(
    shot: "Shot", settings: "Settings", folder: Path
) -> tuple[dict[str, str], dict[str, Any], list[str]]:
    """The paper's answer: rows to print, keys of the JSON object, warnings. Its files are written.

    Without one there is none of these but a warning: our own answer stands.
    """
    from doe.ledger import LedgerError
    from kolsky.cli.terminal import progress_bars
    from kolsky.shot.curve import with_pull
    from kolsky.studies import paper_method as paper
    from kolsky.studies.paper_method import BOUNDS, paper_method

    given = {name: span for name, span in (settings.free or {}).items() if span and name in BOUNDS}
    try:
        with progress_bars() as progress:
            found = paper_method(
                with_pull(shot, settings.pull),
                bounds=given,
                held=settings.held,
                numerics=settings.numerics,
                refined_mesh=settings.refined_mesh,
                ledger=folder / f"{paper.STEM}.sqlite",
                progress=progress,
            )
    except (ValueError, LedgerError, OSError) as error:
        return {}, {paper.STEM: None}, [f"the paper's method has no answer: {error}"]
    paper.write_paper_method(folder, found)
    return (
        paper.rows(found),
        {paper.STEM: paper.to_json(found)},
        paper.paper_warnings(found),
    )


_Answer = Printout | InputError
"""What became of a shot: its answer, or why there is none."""


def refuse_shared(workers: Workers) -> None:
    """Refuse workers for a single identification."""
    for option, given in (("--processes", workers.processes is not None), ("--dask", bool(workers.dask))):
        if given:
            raise InputError(
                texts.COMMAND_LINE,
                f"{option} is for shots that are identified one by one",
                cure="give --each, or leave it out",
            )


def identify_each(shots: Sequence[Path], alike: SingleShotJob, workers: Workers, *, as_json: bool) -> None:
    """Identify every shot, write the results of each, print in the order of the shots."""
    started = perf_counter()
    from kolsky.cli.terminal import print_result, progress_bars, since

    tasks = [
        replace(alike, shot=shot, out=out)
        for shot, out in zip(shots, _result_folders(shots, alike.out), strict=True)
    ]
    if workers.dask or workers.processes is not None:
        # Workers of a scheduler share their machines: one thread each, unless more are asked for.
        threads = workers.threads(alike.solver.threads or (1 if workers.dask else None))
        tasks = [replace(task, solver=replace(task.solver, threads=threads)) for task in tasks]
    found: list[_Answer] = []
    with workers.executor() as executor:
        if executor is None:
            found = [_run_or_error(task, processes=2) for task in tasks]
        else:
            with progress_bars() as progress:
                found = run_jobs(executor, tasks, lambda done: progress("shots", done, len(tasks)))
    names = [_shot_name(shot) for shot in shots]
    there = [one for one in found if isinstance(one, Printout)]
    print_result(
        {"shots answered": f"{len(there)} of {len(shots)}"},
        {"shots": [_json_object(shot, one) for shot, one in zip(shots, found, strict=True)]}
        if as_json
        else None,
        answers=[f"{one.shot}: {line}" for one in there for line in one.answers],
        rest={"reports": ", ".join(str(one.page) for one in there), "wall time": since(started)},
        warnings=[
            f"{name}: {line}"
            for name, one in zip(names, found, strict=True)
            if isinstance(one, Printout)
            for line in one.warnings
        ],
    )
    refuse([problem for one in found if isinstance(one, InputError) for problem in one.problems])


def run_jobs(
    executor: Callable[[], Any], tasks: Sequence[SingleShotJob], told: Callable[[int], None]
) -> list[_Answer]:
    """Have an executor's workers answer."""
    found: dict[int, _Answer] = {}
    told(0)
    try:
        with executor() as pool:
            flying = {pool.submit(_in_worker, task): i for i, task in enumerate(tasks)}
            for future in as_completed(flying):
                found[flying[future]] = future.result()
                told(len(found))
    except _lost_worker_errors() as error:
        raise InputError(
            texts.COMMAND_LINE,
            f"a worker was lost with {len(found)} of {len(tasks)} shots answered ({error})",
            cure="take fewer workers or more memory; the shots that were answered have their results",
        ) from error
    return [found[i] for i in range(len(tasks))]


def _lost_worker_errors() -> tuple[type[BaseException], ...]:
    """What is raised where a worker died, of this machine or, once it is in use, of Dask."""
    if "distributed" not in sys.modules:
        return BrokenExecutor, CancelledError
    return BrokenExecutor, CancelledError, import_module("distributed").scheduler.KilledWorker


def _in_worker(task: SingleShotJob) -> _Answer:
    """The answer of a worker, whose terminal belongs to others."""
    with quietly(True):
        return _run_or_error(task, processes=1)


def _run_or_error(task: SingleShotJob, *, processes: int) -> _Answer:
    """The answer, or what is wrong with the shot."""
    try:
        return _run_job(task, processes=processes)
    except InputError as error:
        return error


def _shot_name(shot: Path) -> str:
    """Name of a shot's folder."""
    from kolsky.schema.shot_file import folder_of

    return folder_of(shot).resolve().name


def _result_folders(shots: Sequence[Path], out: Path | None) -> list[Path | None]:
    """Where each shot's results go; None for its own folder `results`."""
    from kolsky.schema.shot_file import folder_of

    places = [folder_of(shot).resolve() if out is None else out / _shot_name(shot) for shot in shots]
    double = sorted({str(place) for place in places if places.count(place) > 1})
    if double:
        raise InputError(
            texts.COMMAND_LINE,
            f"two shots would write to {double[0]}",
            cure="name each shot once; with --out their folders need names of their own",
        )
    return [None] * len(shots) if out is None else list(places)


def _json_object(shot: Path, one: _Answer) -> dict[str, Any]:
    """A shot in the object of `--json`."""
    if isinstance(one, Printout):
        return {"folder": str(shot), "report": str(one.page), "answer": one.said, "problem": None}
    return {"folder": str(shot), "report": None, "answer": None, "problem": str(one)}


def identify(
    shots: Annotated[
        list[Path],
        typer.Argument(
            metavar="SHOT...", help="A shot's folder, or its shot.toml; several: identified together."
        ),
    ],
    *,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="NAME[=LOW:HIGH]",
            help=f"Free parameter and the bounds of its search; repeat for more. {', '.join(PARAMETERS)}.",
            show_default="stiffness_factor, and poisson and damping if the data constrain them",
        ),
    ] = None,
    hold: Annotated[
        list[str] | None,
        typer.Option(
            "--hold",
            "-p",
            "--parameter",
            metavar="NAME[=VALUE]",
            help="Hold a parameter at the shot's value, or at this one (SI or with unit); repeat for more.",
        ),
    ] = None,
    mesh: Mesh = "24x32",
    refined_mesh: Annotated[
        str, typer.Option(metavar="NRxNY", help="Mesh of the final estimate and its check.")
    ] = "64x86",
    replicates: Annotated[
        int,
        typer.Option(min=0, help="Random draws of the flyer's and the curve's noise; 0: none."),
    ] = 64,
    method: Annotated[
        str,
        typer.Option(
            metavar="WHICH",
            help="least-squares, or paper: also the method of Mates et al. (factorial over friction and m, "
            "response surface of Phi, simplex); bounds by --free.",
        ),
    ] = "least-squares",
    solver: SolverOptions,
    bayes: Annotated[bool, typer.Option("--bayes", help="Sample the posterior too; needs emcee.")] = False,
    diagnose: Annotated[
        bool,
        typer.Option("--diagnose", help="Identify again with each of the two likeliest causes corrected."),
    ] = False,
    relaxation: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="Add a viscoelastic model with free constants: prony, prony:2 or bergstrom_boyce.",
            show_default="[relaxation] of shot.toml",
        ),
    ] = "",
    each: Annotated[
        bool, typer.Option("--each", help="Identify several shots one by one, with a results folder each.")
    ] = False,
    workers: Workers,
    joint: JointOptions,
    pull: Annotated[
        str, typer.Option(help="Pull of the curve that m refers to: first or conditioned.")
    ] = "first",
    seed: Annotated[int, typer.Option(min=0, help="Seed of every random draw.")] = 1,
    out: Out = None,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Identify the stiffness factor m (and more) of a shot, with its k = 2 interval and a report.

    Poisson's ratio and damping are estimated too if the ringing of the force constrains them. With --hold
    poisson --hold damping they keep the shot's values; the report shows the result for that case as well.

    Writes identification.h5, report.html and CSV tables into SHOT/results.

    Several shots of one material, with slow tests if given, are identified together: shared parameters,
    clock and gain of each shot, scatter between shots. The results are joint.json, joint.html, tables and the
    ledger joint.sqlite in the folder joint; the same command continues an interrupted run. With
    --each they are identified one by one, in parallel with --processes or --dask.
    """
    started = perf_counter()
    ranges = texts.ranges("--free", free) if free else None
    held, kept = texts.holds("--hold", hold or [])
    coarse, refined = texts.mesh("--mesh", mesh), texts.mesh("--refined-mesh", refined_mesh)
    texts.finer("--refined-mesh", refined, "--mesh", coarse)
    formats = texts.figure_formats(figures)
    texts.one_of("--method", method, ("least-squares", "paper"))
    texts.one_of("--pull", pull, ("first", "conditioned"))
    texts.apart("--free", ranges or {}, "--hold", [*held, *kept])
    if bayes:
        texts.installed("--bayes", "emcee", "bayes")
    if (len(shots) > 1 or joint.asked) and not each:
        refuse_shared(workers)
        refuse_single_shot_options(
            {
                "method": method != "least-squares",
                "bayes": bayes,
                "diagnose": diagnose,
            }
        )
        chosen = joint.settings(
            free=ranges,
            held=held,
            hold=kept,
            numerics=solver.numerics(coarse),
            refined=refined,
            replicates=replicates,
            seed=seed,
        )
        identify_shots(
            shots, joint, chosen, relaxation=relaxation, pull=pull, out=out, formats=formats, as_json=as_json
        )
        return
    alone = SingleShotJob(
        shots[0],
        solver,
        coarse,
        {
            "free": ranges,
            "held": held,
            "hold": kept,
            "refined_mesh": refined,
            "replicates": replicates,
            "bayes": bayes,
            "pull": "conditioned" if pull == "conditioned" else "first",
            "seed": seed,
        },
        out=out,
        relaxation=relaxation,
        diagnose=diagnose,
        paper=method == "paper",
        formats=tuple(formats),
    )
    if each:
        joint.refuse()
        identify_each(shots, alone, workers, as_json=as_json)
        return
    refuse_shared(workers)
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.result_folder import drawing_processes

    found = _run_job(alone, processes=drawing_processes())
    print_result(
        found.rows,
        found.said if as_json else None,
        answers=found.answers,
        rest={"report": found.page, "wall time": since(started)},
        warnings=found.warnings,
    )
