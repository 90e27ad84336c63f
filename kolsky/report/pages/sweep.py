"""Page of a sweep over the parameters of a shot."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from kolsky.inverse.run_table import SCALE_FORCE, SCALE_SHAPE
from kolsky.report.figures import SWEEPS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of
from kolsky.studies.sweep_analysis import OUTPUTS, SweepAnalysis

MOST_LISTED = 200
"""Largest number of runs in the page's table; the CSV file has all."""
CHOSEN = "those that failed, then those with the smallest misfit"
WORDS = {"Phi_F": "Φ_F", "Phi_S": "Φ_S", "Phi": "Φ"}


def render(result: SweepAnalysis, warnings: Sequence[str] = ()) -> str:
    """Return the page as HTML text; see `write_page`."""
    table = result.table
    n = len(table.outcomes)
    completed = n - len(table.lost)
    listed = _listed(result)
    return render_page(
        "sweep.html",
        kind="Design of experiments over one impact test",
        heading=result.shot,
        subject="sweep",
        warnings=sentences(warnings),
        figures=draw_figures(SWEEPS.values(), result),
        facts=[
            ("runs", f"{n}, {completed} completed"),
            *((_named(name), _range(result, name)) for name in result.box.names),
            *([("smallest misfit", _best(result))] if result.best is not None else []),
            *([("least of the interpolant", _surface(result))] if result.optimum is not None else []),
        ],
        outputs=[
            {
                "name": WORDS[name] + (f" ({unit})" if (unit := OUTPUTS[name]) != "1" else ""),
                "runs": int(np.isfinite(output.values).sum()),
                "low": numbers.plain(float(np.nanmin(output.values))),
                "high": numbers.plain(float(np.nanmax(output.values))),
                "error": numbers.percent(output.error) if np.isfinite(output.error) else numbers.NOTHING,
                "refused": output.refused,
            }
            for name, output in result.outputs.items()
        ],
        outcomes=[(name.lower().replace("_", " "), n) for name, n in Counter(table.outcomes).most_common()],
        names=[_named(name) for name in result.box.names],
        listed=f"All {len(listed)} runs" if len(listed) == n else f"{len(listed)} of {n} runs: {CHOSEN}",
        runs=[_row(result, i) for i in listed],
    )


write_page = page_writer(render)


def _named(name: str) -> str:
    known = name_of(name)
    return known.symbol if known.unit == "1" else f"{known.symbol} ({known.unit})"


def _range(result: SweepAnalysis, name: str) -> str:
    i, factor = result.box.names.index(name), name_of(name).factor
    text = f"{numbers.plain(factor * result.box.lower[i])} to {numbers.plain(factor * result.box.upper[i])}"
    return f"{text}, evenly in the logarithm" if result.box.logarithmic[i] else text


def _best(result: SweepAnalysis) -> str:
    assert result.best is not None  # where it is asked for
    point = result.table.points[result.best]
    at = ", ".join(
        f"{_named(name)} = {numbers.plain(name_of(name).factor * value)}"
        for name, value in zip(result.box.names, point, strict=True)
    )
    return f"run {result.best}: {at}"


def _surface(result: SweepAnalysis) -> str:
    optimum = result.optimum
    assert optimum is not None  # where it is asked for
    at = ", ".join(
        f"{_named(name)} = {numbers.plain(name_of(name).factor * value)}"
        + (f" (at the {optimum.at_bound[name]} bound)" if name in optimum.at_bound else "")
        for name, value in optimum.at.items()
    )
    return f"{WORDS[optimum.output]} = {numbers.plain(optimum.value)} at {at}"


def _listed(result: SweepAnalysis) -> list[int]:
    """Return the indices of the runs in the table: all, or the failed and those with the smallest misfit."""
    n = len(result.table.outcomes)
    if n <= MOST_LISTED:
        return list(range(n))
    lost = list(result.table.lost)[: MOST_LISTED // 2]
    ranked = [int(i) for i in np.argsort(_phi(result)) if int(i) not in set(result.table.lost)]
    return [*lost, *ranked[: MOST_LISTED - len(lost)]]


def _phi(result: SweepAnalysis) -> Any:
    table = result.table
    phi = table.phi_force / SCALE_FORCE + table.phi_shape / SCALE_SHAPE  # Eq. (M.5)
    return phi if np.isfinite(phi).any() else table.phi_force


def _row(result: SweepAnalysis, i: int) -> dict[str, Any]:
    table = result.table
    both = table.phi_force[i] / SCALE_FORCE + table.phi_shape[i] / SCALE_SHAPE
    lost = i in table.lost
    return {
        "number": i,
        "point": [
            numbers.plain(name_of(name).factor * value)
            for name, value in zip(result.box.names, table.points[i], strict=True)
        ],
        "phi_force": _known(table.phi_force[i]),
        "phi_shape": _known(table.phi_shape[i]),
        "phi": _known(both),
        "outcome": table.ending(i).sentence if lost else "completed",
        "ok": not lost,
    }


def _known(value: float) -> str:
    return numbers.plain(float(value)) if np.isfinite(value) else numbers.NOTHING
