"""`kolsky budget`: simulate a test with errors and compute the effect of each on the estimates."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures
from kolsky.cli.sweep import Workers
from kolsky.inverse.settings import Numerics, Settings

_SETTINGS = Settings(numerics=Numerics(mesh=(16, 22)), refined_mesh=(32, 44), replicates=0)
"""Coarser than of an identification: a budget is a difference of many."""


def _rates(option: str, text: str) -> tuple[float, ...]:
    """ "200,1000" as the slowest and the fastest rate [1/s]."""
    rates = tuple(texts.numbers(option, text))
    if len(rates) != 2:
        raise texts.refusal(
            f"{option} needs the slowest and the fastest rate", cure="give two: --rates 100,1000"
        )
    return rates


def budget(
    test: Annotated[
        Path, typer.Argument(metavar="SHOT_OR_SPEC", help="A shot's folder, or a specification's file.")
    ],
    *,
    size: Annotated[
        tuple[str, ...],
        Option(
            'A source of error, e.g. "imperfections.length=0.3 %"; repeat. Without any: those of the '
            "specification's table budget, those that the shot declares, or typical ones.",
            metavar="KEY=SIGMA",
        ),
    ] = (),
    free: Annotated[
        str,
        Option(
            "Free parameters of the budget.",
            metavar="NAMES",
            show_default="the stiffness factor, others free as in identify",
        ),
    ] = "",
    draws: Annotated[int, Option("Random draws of the noise only.", min=4)] = 16,
    together: Annotated[int, Option("Random draws of all errors together.", min=0)] = 32,
    settings: Annotated[Settings, ("numerics", "refined_mesh")] = _SETTINGS,
    truth_mesh: Annotated[
        tuple[int, int] | None,
        Option("Mesh of the true run.", metavar="NRxNY", show_default="the specification's"),
    ] = None,
    workers: Workers,
    retry: Annotated[bool, Option("Repeat realisations that failed before.")] = False,
    slope: Annotated[
        float | None, Option("Plan a campaign for this expanded uncertainty of the rate slope per decade.")
    ] = None,
    rates: Annotated[
        tuple[float, ...],
        Option("Nominal strain rates of the campaign [1/s].", metavar="LOW,HIGH", read=_rates),
    ] = (200.0, 1000.0),
    scatter: Annotated[
        float, Option("Standard deviation of the stiffness from specimen to specimen.", min=0.0)
    ] = 0.0,
    out: Annotated[
        Path | None, Option("Where results go.", metavar="FOLDER", show_default="the test's results")
    ] = None,
    figures: Figures = (),
) -> None:
    """Budget the errors of a test; writes budget.csv and budget.html, and stores realisations in a ledger."""
    from doe.ledger import LedgerError
    from kolsky.base.files import jsonable, usable_folder
    from kolsky.cli.terminal import print_result, sweep_progress
    from kolsky.report.result_folder import write_budget_results
    from kolsky.studies.budget import budget as budgets
    from kolsky.studies.budget.factors import factors_of, usual_sizes
    from kolsky.studies.budget.records import facts, made_with, plan_campaign, printed, shot_sigma
    from kolsky.virtual.specification import read_specification

    folder = usable_folder(out or (test if test.is_dir() else test.parent) / "results")
    series = read_specification(_specification(test, folder))
    shot = series.shot(series.numbers[0])
    quantities = shot.quantities
    if truth_mesh is not None:
        finer = quantities.truth.model_copy(update={"mesh": truth_mesh})
        quantities = quantities.model_copy(update={"truth": finer})
    sizes = dict(part.partition("=")[::2] for part in size) or series.declared.budget or usual_sizes()
    numerics = replace(settings.numerics, threads=workers.threads(settings.numerics.threads))
    settings = replace(settings, numerics=numerics)
    if free:
        settings = replace(settings, free=dict.fromkeys(texts.listed(free)))
    cure = "correct the specification, or take more draws"
    with texts.refused(cure=cure, place=test, errors=(ValueError, LedgerError)):
        factors = factors_of({key: texts.plain_or_text(value) for key, value in sizes.items()})
        with workers.executor() as executor, sweep_progress() as progress:
            budgeted = budgets.budget(
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
    campaign, unplanned = None, ""
    if slope is not None:
        try:
            campaign = plan_campaign(rates[0], rates[1], slope, shot_sigma(budgeted[0], scatter))
        except ValueError as error:
            unplanned = str(error)
    write_budget_results(folder, budgeted, campaign, formats=figures)
    if unplanned:
        raise InputError(
            test,
            f"no campaign can be planned, and {folder / 'budget.html'} has none: {unplanned}",
            cure="budget more factors, or leave --rates out",
        )
    summary = {**printed(budgeted[0], campaign), "page": str(folder / "budget.html")}
    how = made_with(numerics.mesh, settings.refined_mesh, quantities.truth.mesh, draws, together)
    entries = [facts(one, campaign) for one in budgeted]
    print_result(summary, jsonable({"made_with": how, "budgets": entries}, "budget"))


def _specification(test: Path, folder: Path) -> Path:
    """The specification's file; one is written for a shot."""
    if test.suffix == ".toml" and test.name != "shot.toml":
        return test
    if test.is_dir() and not (test / "shot.toml").exists():
        return test
    from kolsky.results.hdf5 import read_identification
    from kolsky.shot.load import load_shot
    from kolsky.virtual.shot_file import specification_of

    shot = load_shot(test)
    stored = shot.folder / "results" / "identification.h5"
    answer = (
        {name: one.value for name, one in read_identification(stored).estimates.items()}
        if stored.exists()
        else {}
    )
    folder.mkdir(parents=True, exist_ok=True)
    return specification_of(shot, folder, answer=answer)
