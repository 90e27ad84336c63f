"""`kolsky budget`: simulate a test with errors and compute the effect of each on the estimates."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Mesh, SolverOptions
from kolsky.cli.sweep import Workers


def budget(
    test: Annotated[
        Path, typer.Argument(metavar="SHOT_OR_SPEC", help="A shot's folder, or a specification's file.")
    ],
    *,
    size: Annotated[
        list[str] | None,
        typer.Option(
            "--size",
            metavar="KEY=SIGMA",
            help='A source of error, e.g. "imperfections.length=0.3 %"; repeat. Without any: those of the '
            "specification's table budget, those that the shot declares, or typical ones.",
        ),
    ] = None,
    free: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Free parameters of the budget.",
            show_default="the stiffness factor, others free as in identify",
        ),
    ] = "",
    draws: Annotated[int, typer.Option(min=4, help="Random draws of the noise only.")] = 16,
    together: Annotated[int, typer.Option(min=0, help="Random draws of all errors together.")] = 32,
    mesh: Mesh = "16x22",
    refined_mesh: Mesh = "32x44",
    truth_mesh: Annotated[
        str, typer.Option(metavar="NRxNY", help="Mesh of the truth.", show_default="the specification's")
    ] = "",
    solver: SolverOptions,
    workers: Workers,
    retry: Annotated[bool, typer.Option("--retry", help="Repeat realisations that failed before.")] = False,
    slope: Annotated[
        float | None,
        typer.Option(help="Plan a campaign for this expanded uncertainty of the rate slope per decade."),
    ] = None,
    rates: Annotated[
        str, typer.Option(metavar="LOW,HIGH", help="Nominal strain rates of the campaign [1/s].")
    ] = "200,1000",
    scatter: Annotated[
        float, typer.Option(min=0.0, help="Standard deviation of the stiffness from specimen to specimen.")
    ] = 0.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="the test's results"),
    ] = None,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Budget the errors of a test; writes budget.csv and budget.html, and stores realisations in a ledger."""
    started = perf_counter()
    analysis, refined = texts.mesh("--mesh", mesh), texts.mesh("--refined-mesh", refined_mesh)
    formats = texts.figure_formats(figures)
    ends = texts.numbers("--rates", rates)
    if len(ends) != 2:
        raise InputError(
            texts.COMMAND_LINE,
            "--rates needs the slowest and the fastest rate",
            cure="give two: --rates 100,1000",
        )
    from doe.ledger import LedgerError
    from kolsky.base.files import jsonable, usable_folder
    from kolsky.cli.terminal import print_result, since, sweep_progress
    from kolsky.inverse.problem import Settings
    from kolsky.report.result_folder import write_budget_results
    from kolsky.studies.budget.budget import budget as budget_of
    from kolsky.studies.budget.factors import factors_of, usual_sizes
    from kolsky.studies.budget.records import facts, made_with, plan_campaign, printed, shot_sigma
    from kolsky.virtual.specification import read_specification

    folder = usable_folder(out or (test if test.is_dir() else test.parent) / "results")
    series = read_specification(_specification(test, folder))
    shot = series.shot(series.numbers[0])
    quantities = shot.quantities
    if truth_mesh:
        finer = quantities.truth.model_copy(update={"mesh": texts.mesh("--truth-mesh", truth_mesh)})
        quantities = quantities.model_copy(update={"truth": finer})
    sizes = dict(part.partition("=")[::2] for part in size or []) or series.declared.budget or usual_sizes()
    numerics = replace(solver, threads=workers.threads(solver.threads)).numerics(analysis)
    settings = Settings(numerics=numerics, refined_mesh=refined, replicates=0)
    if free:
        settings = replace(settings, free=dict.fromkeys(texts.listed(free)))
    try:
        factors = factors_of({key: texts.plain_or_text(value) for key, value in sizes.items()})
        with workers.executor() as executor, sweep_progress() as progress:
            found = budget_of(
                quantities,
                factors,
                settings=settings,
                folder=shot.folder,
                draws=draws,
                together=together,
                ledger=folder / "budget.sqlite",
                retry=retry,
                executor=executor,
                progress=progress,
            )
    except (ValueError, LedgerError) as error:
        raise InputError(test, str(error), cure="correct the specification, or take more draws") from None
    campaign, unplanned = None, ""
    if slope is not None:
        try:
            campaign = plan_campaign(ends[0], ends[1], slope, shot_sigma(found[0], scatter))
        except ValueError as error:
            unplanned = str(error)
    write_budget_results(folder, found, campaign, formats=formats)
    if unplanned:
        raise InputError(
            test,
            f"no campaign can be planned, and {folder / 'budget.html'} has none: {unplanned}",
            cure="budget more factors, or leave --rates out",
        )
    summary = {**printed(found[0], campaign), "page": str(folder / "budget.html")}
    how = made_with(analysis, refined, quantities.truth.mesh, draws, together)
    budgets = [facts(one, campaign) for one in found]
    said = jsonable({"made_with": how, "budgets": budgets}, "budget") if as_json else None
    print_result(summary, said, rest={"wall time": since(started)})


def _specification(test: Path, folder: Path) -> Path:
    """The specification's file; that of a shot is written first."""
    if test.suffix == ".toml" and test.name != "shot.toml":
        return test
    if test.is_dir() and not (test / "shot.toml").exists():
        return test
    from kolsky.results.hdf5 import read_identification
    from kolsky.shot.load import load_shot
    from kolsky.virtual.shot_file import specification_of

    shot = load_shot(test)
    kept = shot.folder / "results" / "identification.h5"
    answer = (
        {name: one.value for name, one in read_identification(kept).estimates.items()}
        if kept.exists()
        else {}
    )
    folder.mkdir(parents=True, exist_ok=True)
    return specification_of(shot, folder, answer=answer)
