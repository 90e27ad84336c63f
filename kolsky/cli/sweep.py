"""`kolsky sweep`: choose the points, run what no ledger holds, write a row a run and a page."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.cli import texts
from kolsky.cli.options import SOLVER_DEFAULTS, AsJson, Figures, Mesh, Numbers, Out, ShotPath, SolverOptions


def sweep(
    shot: ShotPath,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="NAME=LOW:HIGH[:LEVELS]",
            help="A parameter to vary; repeat for more. LEVELS belong to a factorial.",
            show_default="friction=0:2 and stiffness_factor=0.75:1.25, 10 levels each",
        ),
    ] = None,
    parameter: Numbers = None,
    design: Annotated[
        str,
        typer.Option(
            help="factorial, fractional, composite, box-behnken or csv; with --runs points lhs, maximin, "
            "sobol, halton or d-optimal."
        ),
    ] = "factorial",
    runs: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Points of a design that takes any number.")
    ] = 64,
    generators: Annotated[
        str, typer.Option(metavar="WORDS", help='Of a fractional design, a word a parameter, e.g. "a b ab".')
    ] = "",
    points: Annotated[
        Path | None, typer.Option(metavar="CSV", help="File of a csv design; columns NAME (UNIT).")
    ] = None,
    mesh: Mesh = "16x22",
    solver: SolverOptions = SOLVER_DEFAULTS,
    seed: Annotated[int, typer.Option(min=0, help="Seed of a random design.")] = 1,
    log: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="NAME", help="Spread this parameter evenly in its logarithm; repeat."),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(
            "--where",
            metavar="INEQUALITY",
            help='Leave out points that break it, e.g. "friction <= 2 * stiffness_factor" (SI); repeat.',
        ),
    ] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Share the runs out over so many processes of this machine.")
    ] = None,
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Give the runs to a Dask scheduler: address or its file.")
    ] = "",
    ledger: Annotated[
        str,
        typer.Option(
            help="File that keeps every run as it is made, so that nothing is run twice, or none.",
            show_default="sweep.sqlite among the results",
        ),
    ] = "",
    retry: Annotated[bool, typer.Option("--retry", help="Run again what did not complete before.")] = False,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Run the I-th of N parts of the design.", show_default="all")
    ] = "1/1",
    merge: Annotated[
        list[Path] | None,
        typer.Option("--merge", metavar="LEDGER", help="Take over another ledger's runs; repeat for more."),
    ] = None,
    out: Out = None,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Run a design of experiments over a shot's parameters; writes sweep.csv, a row a run, and sweep.html."""
    started = perf_counter()
    from kolsky.cli.sweep_options import DesignChoice, Records, Workers

    choice = DesignChoice.of(
        design,
        vary or [],
        runs=runs,
        seed=seed,
        generators=generators,
        points=points,
        logarithmic=tuple(log or ()),
        where=tuple(where or ()),
    )
    held = texts.values("--parameter", parameter or [])
    elements = texts.mesh("--mesh", mesh)
    records = Records(ledger, retry=retry, shard=texts.shard("--shard", shard), merge=tuple(merge or ()))
    workers = Workers(processes, dask)
    formats = texts.figure_formats(figures)
    chosen = choice.design()
    texts.apart("--points" if points else "--vary", chosen.box.names, "--parameter", held)
    part = records.part(chosen)
    from kolsky.cli.inputs import load, usable
    from kolsky.cli.terminal import print_result, since, sweep_progress

    loaded, folder = load(shot, out)
    numerics = replace(solver, threads=workers.threads(solver.threads)).numerics(elements)
    place = records.place(folder)
    from kolsky.base.json_types import jsonable
    from kolsky.report.study_folder import write_sweep_results
    from kolsky.results.summary import failed_runs
    from kolsky.studies import sweep as sweeping
    from kolsky.studies.sweep_analysis import analyse_sweep, surface_optimum
    from kolsky.uncertainty.warnings.runs import lost_runs, run_again, sliding

    with usable(loaded), records.usable(), workers.executor() as executor, sweep_progress() as progress:
        result = sweeping.sweep(
            loaded,
            part,
            held=held,
            numerics=numerics,
            ledger=place,
            merge=records.merge,
            retry=records.retry,
            executor=executor,
            progress=progress,
        )
    warnings = [
        *run_again(result.damaged),
        *lost_runs(result.table),
        *sliding(loaded.interface, [*result.table.names, *held]),
    ]
    analysis = analyse_sweep(result.shot, chosen.box, result.table)
    write_sweep_results(folder, result, analysis, name=records.stem, warnings=warnings, formats=formats)
    summary = {
        "shot": result.shot,
        **sweeping.counts(result),
        **({"left_out_by_constraints": chosen.settings["refused"]} if where else {}),
        **sweeping.least_misfit(result),
        **surface_optimum(analysis),
        "file": str(folder / f"{records.stem}.csv"),
        "page": str(folder / f"{records.stem}.html"),
        **({} if place is None else {"ledger": str(place)}),
    }
    failed = {"failed_runs": failed_runs(result.table)}
    said = jsonable({**summary, **failed, "warnings": warnings}, "sweep") if as_json else None
    print_result(summary, said, rest={"wall time": since(started)}, warnings=warnings)
