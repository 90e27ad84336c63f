"""The misfits in the planes of pairs of parameters, with every run: Fig. 9 of Mates et al. (2012)."""

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes

from kolsky.report.figures.base import MEASURED, PAGE, FigureKind, Panels, smooth_bar
from kolsky.report.nomenclature import axis_label, name_of
from kolsky.studies.sweep_analysis import Output, SweepAnalysis

LABELS = {
    "Phi_F": r"$\log_{10}\,\Phi_F$ (N)",
    "Phi_S": r"$\log_{10}\,\Phi_S$ (–)",
    "Phi": r"$\log_{10}\,\Phi$ (–)",
}
WORDS = {"Phi_F": "Φ_F", "Phi_S": "Φ_S", "Phi": "Φ"}
MOST_PAIRS = 3
"""Most pairs of parameters on a page; three parameters have as many."""
COLUMN_HEIGHT = 56.0


def caption(result: SweepAnalysis) -> str:
    """What is seen."""
    names = ", ".join(
        f"{WORDS[key]} ({100.0 * output.error:.2g} %)" for key, output in _shown(result).items()
    )
    others = "" if result.box.dimension == 2 else ", the other parameters where the best run has them"
    return (
        f"Misfits, Eqs. (M.3) to (M.5), interpolated between the runs{others}; in brackets the interpolant’s "
        f"error over the standard deviation of the runs: {names}. Circles: runs; crosses: runs that did not "
        "complete; star: the run with the smallest misfit."
    )


def _shown(result: SweepAnalysis) -> dict[str, Output]:
    return {name: output for name, output in result.outputs.items() if output.surrogate is not None}


def _pairs(result: SweepAnalysis) -> list[tuple[str, str]]:
    return list(combinations(result.box.names, 2))[:MOST_PAIRS]


def draw(result: SweepAnalysis, panels: Panels) -> None:
    """Draw a map of each misfit (columns) over each pair of parameters (rows)."""
    for row, pair in enumerate(_pairs(result)):
        for name in _shown(result):
            _map(panels[f"{name} {row}"], result, name, *pair)


def _map(ax: Axes, result: SweepAnalysis, name: str, first: str, second: str) -> None:
    x, y, values = result.map(name, first, second)
    fx, fy = name_of(first).factor, name_of(second).factor
    measured = result.outputs[name].values
    floor = np.nanmin(measured)  # an interpolant may dip below every run, where a logarithm ends
    level = np.log10(np.maximum(values, 0.5 * floor))
    drawn = ax.contourf(fx * x, fy * y, level, levels=14, cmap="cividis")
    smooth_bar(ax.figure.colorbar(drawn, ax=ax, label=LABELS[name], pad=0.02))  # type: ignore[union-attr]
    i, j = result.box.names.index(first), result.box.names.index(second)
    at = result.table.points
    done = np.isfinite(measured)
    ax.plot(fx * at[done, i], fy * at[done, j], "o", ms=2.0, mfc="white", mec=MEASURED, mew=0.4)
    if not done.all():
        ax.plot(fx * at[~done, i], fy * at[~done, j], "x", ms=3.0, mew=0.7, color=MEASURED)
    if result.best is not None:
        ax.plot(
            fx * at[result.best, i], fy * at[result.best, j], "*", ms=7, mfc="white", mec=MEASURED, mew=0.5
        )
    for ends, logarithmic, set_scale, set_limits in (
        (fx * x, result.box.logarithmic[i], ax.set_xscale, ax.set_xlim),
        (fy * y, result.box.logarithmic[j], ax.set_yscale, ax.set_ylim),
    ):
        set_scale("log" if logarithmic else "linear")
        set_limits(float(ends[0]), float(ends[-1]))
    ax.set_xlabel(axis_label(first))
    ax.set_ylabel(axis_label(second))


KIND: FigureKind[SweepAnalysis] = FigureKind(
    name="sweep-maps",
    width=PAGE,
    height=lambda result: COLUMN_HEIGHT * len(_pairs(result)),
    caption=caption,
    panels=lambda result: [
        [f"{name} {row}" for name in _shown(result)] for row in range(len(_pairs(result)))
    ],
    draw=draw,
    applies=lambda result: bool(_shown(result)) and result.box.dimension > 1 and result.best is not None,
)
