"""`kolsky material relaxation`: relaxation, oscillation, temperature sweeps and shots on one axis of time."""

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, OutFolder

if TYPE_CHECKING:
    from kolsky.joint.slow_dynamics import SlowDynamics


def material_relaxation(
    tests: Annotated[
        Path, typer.Argument(metavar="TESTS.toml", help="List of slow tests: holds, ramps, oscillation.")
    ],
    shots: Annotated[
        list[Path] | None,
        typer.Option("--shot", metavar="SHOT", help="An identified shot to place beside them; repeat."),
    ] = None,
    branches: Annotated[
        int, typer.Option(min=0, max=8, help="Most branches of the Prony series that are tried.")
    ] = 3,
    out: OutFolder = Path("relaxation"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Relaxation, oscillation (DMA), temperature sweeps and shots on one axis of time; fit a Prony series.

    Writes relaxation.html, relaxation.json and CSV tables.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result, since
    from kolsky.joint.slow_dynamics import analyse
    from kolsky.joint.slow_schema import read_slow_list
    from kolsky.joint.slow_tables import summary, tables
    from kolsky.report.pages.relaxation import write_page
    from kolsky.studies.rates.collect import collected_shot

    slow = read_slow_list(tests)
    folder = usable_folder(out)
    rated = [collected_shot(shot, group="all") for shot in shots or ()]
    try:
        found = analyse(slow, rated, at_most=branches)
    except ValueError as error:
        raise InputError(tests, str(error), cure="correct the list or the tables that it names") from error
    said = {"inputs": dict(slow.files), **summary(found)}
    with filling(folder) as partial:
        for name, table in tables(found).items():
            write_table(partial / f"{name}.csv", table)
        text = json.dumps(said, indent=2, allow_nan=False) + "\n"
        (partial / "relaxation.json").write_text(text, encoding="utf-8")
        write_page(partial / "relaxation.html", found, dict(slow.files))
        if formats:
            from kolsky.report.canvas import save_figures

            save_figures(partial / "figures", found, formats=formats)
    print_result(
        _rows(found),
        said if as_json else None,
        rest={"report": folder / "relaxation.html", "wall time": since(started)},
        warnings=found.remarks,
    )


def _rows(found: "SlowDynamics") -> dict[str, Any]:
    """The lines that a terminal gets."""
    fit = found.fit
    low, high = fit.interval("factor")
    E, factor = 1e-3 * found.young, float(fit.values[0])
    rows: dict[str, Any] = {
        "verdict": found.verdict.sentence,
        "long-term E": f"{E:.4g} kPa, {E * low / factor:.4g} to {E * high / factor:.4g} (k = 2)",
    }
    for k in range(len(fit.model.series)):
        strength, time = fit.interval(f"strength {k + 1}"), fit.interval(f"time {k + 1}")
        rows[f"branch {k + 1}"] = (
            f"strength {fit.model.series.strengths[k]:.4g} ({strength[0]:.3g} to {strength[1]:.3g}), time"
            f" {fit.model.series.times[k]:.4g} s ({time[0]:.3g} to {time[1]:.3g}), k = 2"
        )
    for name, sweep in found.sweeps.items():
        if sweep.law_holds and sweep.covariance is not None:
            u = sweep.covariance.diagonal() ** 0.5
            rows[f"{name}: WLF"] = (
                f"C1 = {sweep.C1:.4g} ± {2.0 * u[0]:.2g}, C2 = {sweep.C2:.4g} ± {2.0 * u[1]:.2g} K (k = 2) at"
                f" {sweep.sweep.reference - 273.15:.4g} °C"
            )
    for one in found.moduli:
        rows[one.label] = (
            f"E_a {1e-3 * one.modulus.min():.4g} to {1e-3 * one.modulus.max():.4g} kPa, age"
            f" {one.age.min():.3g} to {one.age.max():.3g} s"
        )
    return rows
