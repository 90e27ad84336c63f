"""Figures of a sweep: maps of the misfit, main effects, sensitivity indices."""

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes

from kolsky.report.figures.base import BAND, COLUMN, MEASURED, PAGE, SHAPE, FigureKind, Panels, smooth_bar
from kolsky.report.nomenclature import axis_label, name_of
from kolsky.studies.sweep_analysis import Output, SweepAnalysis

LOG_LABELS = {
    "Phi_F": r"$\log_{10}\,\Phi_F$ (N)",
    "Phi_S": r"$\log_{10}\,\Phi_S$ (–)",
    "Phi": r"$\log_{10}\,\Phi$ (–)",
}
LABELS = {"Phi_F": r"$\Phi_F$ (N)", "Phi_S": r"$\Phi_S$ (–)", "Phi": r"$\Phi$ (–)"}
SYMBOLS = {"Phi_F": "Φ_F", "Phi_S": "Φ_S", "Phi": "Φ"}
TEX_SYMBOLS = {"Phi_F": r"$\Phi_F$", "Phi_S": r"$\Phi_S$", "Phi": r"$\Phi$"}
"""Misfits as axis labels, in captions and as tick labels."""
MOST_PAIRS = 3
"""Most pairs of parameters on a page; three parameters have as many."""
COLUMN_HEIGHT = 56.0


def caption_maps(result: SweepAnalysis) -> str:
    """Return the caption."""
    names = ", ".join(
        f"{SYMBOLS[key]} ({100.0 * output.error:.2g} %)" for key, output in _interpolated(result).items()
    )
    others = "" if result.box.dimension == 2 else ", the other parameters where the best run has them"
    return (
        f"Misfits, Eqs. (M.3) to (M.5), interpolated between the runs{others}; in brackets the interpolant’s "
        f"error over the standard deviation of the runs: {names}. Circles: runs; crosses: runs that did not "
        "complete; star: the run with the smallest misfit."
    )


def _interpolated(result: SweepAnalysis) -> dict[str, Output]:
    return {name: output for name, output in result.outputs.items() if output.surrogate is not None}


def _pairs(result: SweepAnalysis) -> list[tuple[str, str]]:
    return list(combinations(result.box.names, 2))[:MOST_PAIRS]


def draw_maps(result: SweepAnalysis, panels: Panels) -> None:
    """Draw a map of each misfit (columns) over each pair of parameters (rows)."""
    for row, pair in enumerate(_pairs(result)):
        for name in _interpolated(result):
            _map(panels[f"{name} {row}"], result, name, *pair)


def _map(ax: Axes, result: SweepAnalysis, name: str, first: str, second: str) -> None:
    x, y, values = result.map(name, first, second)
    fx, fy = name_of(first).factor, name_of(second).factor
    measured = result.outputs[name].values
    floor = np.nanmin(measured)  # an interpolant may dip below every run, where a logarithm ends
    level = np.log10(np.maximum(values, 0.5 * floor))
    drawn = ax.contourf(fx * x, fy * y, level, levels=14, cmap="cividis")
    smooth_bar(ax.figure.colorbar(drawn, ax=ax, label=LOG_LABELS[name], pad=0.02))  # type: ignore[union-attr]
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


def caption_effects(result: SweepAnalysis) -> str:
    """Return the caption."""
    return (
        "Main effects: mean of a misfit over all other parameters (line) and where 80 % of it lie (band), "
        "along each parameter; points: the runs."
    )


def draw_effects(result: SweepAnalysis, panels: Panels) -> None:
    """Draw one row per misfit and one column per parameter."""
    shown = _interpolated(result)
    for name, output in shown.items():
        for i, parameter in enumerate(result.box.names):
            ax, effect, factor = panels[f"{name} {i}"], output.effects[parameter], name_of(parameter).factor
            ax.plot(factor * result.table.points[:, i], output.values, "o", color=MEASURED, ms=1.2, mew=0.0)
            ax.fill_between(factor * effect.x, effect.low, effect.high, color=BAND, alpha=0.4, lw=0.0)
            ax.plot(factor * effect.x, effect.mean, color=SHAPE)
            ax.set_xlim(factor * effect.x[0], factor * effect.x[-1])
            if result.box.logarithmic[i]:
                ax.set_xscale("log")
            if i == 0:
                ax.set_ylabel(LABELS[name])
            else:
                ax.tick_params(labelleft=False)
            if name == list(shown)[-1]:
                ax.set_xlabel(axis_label(parameter))
            else:
                ax.tick_params(labelbottom=False)


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")


def caption_indices(result: SweepAnalysis) -> str:
    """Return the caption."""
    return (
        "Share of each misfit’s variance over the box that a parameter causes, by itself or with others "
        "(total Sobol’ indices, bars, 95 % intervals of the bootstrap), and by itself (first order, dots)."
    )


def draw_indices(result: SweepAnalysis, panels: Panels) -> None:
    """Draw groups of bars."""
    found, ax = result.indices, panels["indices"]
    assert found is not None  # `applies` says so
    d = len(found.names)
    for j, name in enumerate(found.names):
        x = np.arange(len(found.outputs)) + (j - 0.5 * (d - 1)) * 0.8 / d
        low, high = found.total_interval[:, j].T
        ax.bar(
            x, found.total[:, j], 0.72 / d, color=COLOURS[j % len(COLOURS)], label=f"${name_of(name).tex}$"
        )
        ax.vlines(x, low, high, color=MEASURED, lw=0.6)
        ax.plot(x, found.first[:, j], "o", color="white", mec=MEASURED, mew=0.5, ms=2.6)
    ax.set_xticks(np.arange(len(found.outputs)), [TEX_SYMBOLS[name] for name in found.outputs])
    ax.tick_params(axis="x", length=0)
    ax.axhline(0.0, color=MEASURED, lw=0.5)
    ax.set_xlabel("Misfit (–)")
    ax.set_ylabel("Sobol’ index (–)")
    ax.set_ylim(min(-0.05, 1.1 * float(found.first.min())), 1.3)
    ax.legend(loc="upper center", ncols=min(d, 6))


FIGURES: tuple[FigureKind[SweepAnalysis], ...] = (
    FigureKind(
        name="sweep-maps",
        width=PAGE,
        height=lambda result: COLUMN_HEIGHT * len(_pairs(result)),
        caption=caption_maps,
        panels=lambda result: [
            [f"{name} {row}" for name in _interpolated(result)] for row in range(len(_pairs(result)))
        ],
        draw=draw_maps,
        applies=lambda result: (
            bool(_interpolated(result)) and result.box.dimension > 1 and result.best is not None
        ),
    ),
    FigureKind(
        name="sweep-effects",
        width=PAGE,
        height=lambda result: 12.0 + 36.0 * len(_interpolated(result)),
        caption=caption_effects,
        panels=lambda result: [
            [f"{name} {i}" for i in range(result.box.dimension)] for name in _interpolated(result)
        ],
        draw=draw_effects,
        mosaic={"sharey": False},
        applies=lambda result: bool(_interpolated(result)),
    ),
    FigureKind(
        name="sweep-indices",
        width=COLUMN,
        height=lambda result: 62.0,
        caption=caption_indices,
        panels=lambda result: [["indices"]],
        draw=draw_indices,
        applies=lambda result: result.indices is not None,
    ),
)
