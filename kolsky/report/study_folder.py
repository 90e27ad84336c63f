"""Result folders of the commands on many runs or shots: rates, plans, budgets, sweeps, predictions."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from kolsky.base.files import filling
from kolsky.inverse.joint_result import JointResult
from kolsky.prediction.design import Aim, Scan
from kolsky.prediction.output import to_json, write_tables
from kolsky.prediction.predict import Prediction
from kolsky.report.figures_alone import save_figures_alone
from kolsky.results import joint as joint_output
from kolsky.studies.budget.records import Budget, Campaign
from kolsky.studies.planning import output as plan_output
from kolsky.studies.planning.plan import Plan
from kolsky.studies.rates import output as rates_output
from kolsky.studies.rates.records import RateReport
from kolsky.studies.sweep import Sweep, write_sweep
from kolsky.studies.sweep_analysis import SweepAnalysis

if TYPE_CHECKING:
    from kolsky.report.figures.base import FigureKind


def write_rate_results(folder: Path, report: RateReport, *, formats: Sequence[str] = ()) -> None:
    """Write the results of `kolsky rate`: rates.h5, rates.html, tables and figures.

    Parameters
    ----------
    folder, formats
        As of `kolsky.report.result_folder.write_identify_results`.
    report
        The comparison of shots.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.report.pages.rates import figures_of, write_page

    with filling(folder) as partial:
        rates_output.write_hdf5(partial / "rates.h5", report)
        rates_output.write_csv(partial, report)
        write_page(partial / "rates.html", report)
        for index, group in enumerate(report.groups):
            save_figures_alone(partial, group, formats, registry=figures_of(report, index))


def write_plan_results(folder: Path, found: Plan, *, formats: Sequence[str] = ()) -> None:
    """Write what `kolsky plan` leaves: plan.h5, plan.json, tables and, if asked for, figures.

    Parameters
    ----------
    folder, formats
        As of `kolsky.report.result_folder.write_identify_results`.
    found
        The plan.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    with filling(folder) as partial:
        plan_output.write_hdf5(partial / "plan.h5", found)
        plan_output.write_csv(partial, found)
        text = json.dumps(plan_output.to_json(found), indent=2, allow_nan=False)
        (partial / "plan.json").write_text(text, encoding="utf-8")
        save_figures_alone(partial, found, formats)


def write_joint_results(folder: Path, found: JointResult, *, formats: Sequence[str] = ()) -> None:
    """Write the results of several shots identified together: joint.json, joint.html, tables, figures.

    Parameters
    ----------
    folder, formats
        As of `kolsky.report.result_folder.write_identify_results`.
    found
        The joint identification.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.report.figures import JOINT
    from kolsky.report.pages.joint import write_page

    with filling(folder) as partial:
        joint_output.write_joint(partial, found)
        write_page(partial / "joint.html", found)
        registry = {name: kind for name, kind in JOINT.items() if kind.applies(found)}
        save_figures_alone(partial, found, formats, registry=registry)


def write_budget_results(
    folder: Path,
    results: Sequence[Budget],
    campaign: Campaign | None,
    *,
    formats: Sequence[str] = (),
) -> None:
    """Write the results of `kolsky budget` beside its ledger: budget.csv, budget.html and figures.

    ``folder``, ``formats``: as of `kolsky.report.result_folder.write_identify_results`. ``results``: a budget
    for each free parameter; files and figures of the first are named budget, of others budget and the
    parameter. ``campaign``: a planned campaign, if one was asked for. Raises InputError if the results cannot
    be written.
    """
    from kolsky.report.pages.budget import write_page
    from kolsky.studies.budget.records import write_budget

    with filling(folder) as partial:
        for number, result in enumerate(results):
            write_budget(partial / ("budget.csv" if not number else f"budget-{result.parameter}.csv"), result)
        write_page(partial / "budget.html", results, campaign)
        for number, result in enumerate(results):
            registry = None if number == 0 else _named_after(result.parameter)
            save_figures_alone(partial, result, formats, registry=registry)


def _named_after(parameter: str) -> "dict[str, FigureKind[Budget]]":
    """The figures of a budget under names that end with a parameter."""
    from kolsky.report.figures import BUDGETS

    return {key: replace(kind, name=f"{kind.name}-{parameter}") for key, kind in BUDGETS.items()}


def write_sweep_results(
    folder: Path,
    result: Sweep,
    analysis: SweepAnalysis,
    *,
    name: str = "sweep",
    warnings: Sequence[str] = (),
    formats: Sequence[str] = (),
) -> None:
    """Write the results of `kolsky sweep` beside its database: sweep.csv, sweep.html and figures.

    Parameters
    ----------
    folder, formats
        As of `kolsky.report.result_folder.write_identify_results`.
    result
        Every run of the design.
    analysis
        Analysis of them by `kolsky.studies.sweep_analysis.analyse_sweep`.
    name
        Name of table and page without their endings.
    warnings
        Warnings at the top of the page.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    from kolsky.report.pages.sweep import write_page

    with filling(folder) as partial:
        write_sweep(partial / f"{name}.csv", result)
        write_page(partial / f"{name}.html", analysis, warnings=warnings)
        save_figures_alone(partial, analysis, formats)


def write_prediction_results(
    folder: Path,
    found: Prediction,
    scan: Scan | None = None,
    aim: Aim | None = None,
    *,
    film: str = "",
    formats: Sequence[str] = (),
) -> None:
    """Write prediction.html, prediction.json, tables, and a film and figures if they are asked for.

    ``folder``, ``formats``: as of `kolsky.report.result_folder.write_identify_results`. ``found``: the
    prediction. ``scan``, ``aim``: a scan that was made before, and the point found in it. ``film``: format of
    a film, "mp4" or "gif"; empty for none. Raises InputError if the results cannot be written.
    """
    from kolsky.report.figures import SCANS
    from kolsky.report.pages.prediction import write_page

    with filling(folder) as partial:
        write_tables(partial, found, scan)
        text = json.dumps(to_json(found, scan, aim), indent=2, allow_nan=False)
        (partial / "prediction.json").write_text(text, encoding="utf-8")
        write_page(partial / "prediction.html", found, scan, aim)
        save_figures_alone(partial, found, formats)
        if scan is not None:
            save_figures_alone(partial, (scan, aim), formats, registry=SCANS)
        if film:
            from kolsky.report.films import write_prediction_film

            write_prediction_film(partial / f"prediction.{film}", found)
