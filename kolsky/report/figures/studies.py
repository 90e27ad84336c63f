"""Figures of studies with many runs: sweep, error budget."""

from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from doe.sensitivity import SobolIndices
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    GREY,
    MEASURED,
    MS,
    PAGE,
    SERIES,
    SHAPE,
    Panels,
    colour_bar,
    figure,
    label_point,
    label_text,
)
from kolsky.results.nomenclature import axis_label, name_of
from kolsky.studies.budget.records import Budget, Source
from kolsky.studies.sweep_analysis import Output, SweepAnalysis

SYMBOLS = {"Phi_F": "Φ_F", "Phi_S": "Φ_S", "Phi": "Φ"}
TEX_SYMBOLS = {"Phi_F": r"\Phi_F", "Phi_S": r"\Phi_S", "Phi": r"\Phi"}
UNITS = {"Phi_F": "N", "Phi_S": "–", "Phi": "–"}
"""Misfits in captions, in formulas, and their units."""
MOST_PAIRS = 3
"""Maximum number of parameter pairs on a page; three parameters have three pairs."""
LEAST_SPAN = 1e-3
"""A map has one colour if a misfit's logarithm has a smaller range than this. It is 0.2 %, less than a
surrogate resolves."""
COLUMN_HEIGHT = 56.0


def _interpolated(result: SweepAnalysis) -> dict[str, Output]:
    return {name: output for name, output in result.outputs.items() if output.surrogate is not None}


def _pairs(result: SweepAnalysis) -> list[tuple[str, str]]:
    return list(combinations(result.box.names, 2))[:MOST_PAIRS]


@figure(
    PAGE,
    lambda result: COLUMN_HEIGHT * len(_pairs(result)),
    lambda result: [
        [f"{name} {row}" for name in _interpolated(result)] for row in range(len(_pairs(result)))
    ],
    applies=lambda result: (
        bool(_interpolated(result)) and result.box.dimension > 1 and result.best is not None
    ),
)
def sweep_maps(result: SweepAnalysis, panels: Panels) -> str:
    for row, pair in enumerate(_pairs(result)):
        for name in _interpolated(result):
            _map(panels[f"{name} {row}"], result, name, *pair)
    names = ", ".join(
        f"{SYMBOLS[key]} ({100.0 * output.error:.2g} %)" for key, output in _interpolated(result).items()
    )
    others = "" if result.box.dimension == 2 else ", the other parameters at the values of the best run"
    return (
        f"Misfits, Eqs. (M.3) to (M.5), interpolated between the runs{others}; in brackets the interpolant’s "
        f"error over the standard deviation of the runs: {names}. Circles: runs; crosses: runs that did not "
        "complete; star: the run with the smallest misfit."
    )


def _map(ax: Axes, result: SweepAnalysis, name: str, first: str, second: str) -> None:
    x, y, values = result.map(name, first, second)
    fx, fy = name_of(first).factor, name_of(second).factor
    measured = result.outputs[name].values
    floor = np.nanmin(measured)  # an interpolant may dip below every run, where a logarithm ends
    level = np.log10(np.maximum(values, 0.5 * floor))
    middle = float(level.mean())
    levels = 14 if np.ptp(level) > LEAST_SPAN else [middle - LEAST_SPAN, middle + LEAST_SPAN]
    drawn = ax.contourf(fx * x, fy * y, level, levels=levels, cmap="cividis")
    colour_bar(drawn, ax, rf"$\log_{{10}}\,{TEX_SYMBOLS[name]}$ ({UNITS[name]})", pad=0.02)
    i, j = result.box.names.index(first), result.box.names.index(second)
    at = result.table.points
    completed = np.isfinite(measured)
    ax.plot(fx * at[completed, i], fy * at[completed, j], "o", ms=2.0, mfc="white", mec=MEASURED, mew=0.4)
    if not completed.all():
        ax.plot(fx * at[~completed, i], fy * at[~completed, j], "x", ms=3.0, mew=0.7, color=MEASURED)
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
    ax.set(xlabel=axis_label(first), ylabel=axis_label(second))


@figure(
    PAGE,
    lambda result: 12.0 + 36.0 * len(result.outputs),
    lambda result: [[f"{name} {i}" for i in range(result.box.dimension)] for name in result.outputs],
    applies=lambda result: bool(result.outputs),
    sharey=False,
)
def sweep_effects(result: SweepAnalysis, panels: Panels) -> str:
    outputs, size = result.outputs, 3.0 if result.box.dimension == 1 else 1.2
    for name, output in outputs.items():
        for i, parameter in enumerate(result.box.names):
            ax, effect = panels[f"{name} {i}"], output.effects.get(parameter)
            factor = name_of(parameter).factor
            ax.plot(factor * result.table.points[:, i], output.values, "o", color=MEASURED, ms=size, mew=0.0)
            if effect is not None:
                ax.fill_between(factor * effect.x, effect.low, effect.high, color=BAND, alpha=0.4, lw=0.0)
                ax.plot(factor * effect.x, effect.mean, color=SHAPE)
            if result.box.lower[i] < result.box.upper[i]:
                ax.set_xlim(factor * result.box.lower[i], factor * result.box.upper[i])
            if result.box.logarithmic[i]:
                ax.set_xscale("log")
            if i == 0:
                ax.set_ylabel(f"${TEX_SYMBOLS[name]}$ ({UNITS[name]})")
            else:
                ax.tick_params(labelleft=False)
            if name == list(outputs)[-1]:
                ax.set_xlabel(axis_label(parameter))
            else:
                ax.tick_params(labelbottom=False)
    line = (
        "line: the interpolant"
        if result.box.dimension == 1
        else "line: mean over all other parameters, band: where 80 % of them lie"
    )
    without = [SYMBOLS[name] for name, output in outputs.items() if not output.effects]
    left = f" No interpolant of {', '.join(without)} is good enough to be drawn." if without else ""
    return f"Misfits, Eqs. (M.3) to (M.5), along each parameter. Points: runs; {line}.{left}"


MOST_LINES = 5
"""Maximum number of simulated forces in one panel."""


@figure(
    PAGE,
    62.0,
    [["force", "cost"]],
    applies=lambda result: result.forces is not None,
    letters=True,
    width_ratios=[2.2, 1.0],
)
def sweep_forces(result: SweepAnalysis, panels: Panels) -> str:
    along, (name,) = result.forces, result.box.names
    assert along is not None  # checked by `applies`
    known, ax = name_of(name), panels["force"]
    unit = "" if known.unit == "1" else f" {known.unit}"
    chosen = np.unique(np.linspace(0, len(along.x) - 1, MOST_LINES).round().astype(int))
    ax.plot(MS * along.time, along.measured, color=MEASURED, lw=1.4, label="measured")
    for colour, k in zip(SERIES, chosen, strict=False):
        label = f"${known.tex}$ = {known.factor * along.x[k]:.4g}{unit}"
        ax.plot(MS * along.time, along.force[k], color=colour, lw=0.8, label=label)
    ax.set(xlabel="Time (ms)", ylabel="Transmitted force (N)")
    ax.legend()
    ax = panels["cost"]
    ax.plot(known.factor * along.x, along.steps, "o-", color=MEASURED, ms=2.5, lw=0.6)
    ax.set(xlabel=axis_label(name), ylabel="Time steps of a run")
    ax.set_ylim(0.0, 1.1 * float(along.steps.max()))
    return (
        f"(a) Transmitted force, measured and simulated with several values of {known.symbol}. (b) Cost of a "
        "run: its number of time steps."
    )


@figure(COLUMN, 62.0, [["indices"]], applies=lambda result: result.indices is not None)
def sweep_indices(result: SweepAnalysis, panels: Panels) -> str:
    assert result.indices is not None  # checked by `applies`
    ax = panels["indices"]
    _bars(ax, result.indices)
    ax.set_xlabel("Misfit (–)")
    ax.legend(loc="upper center", ncols=min(len(result.indices.names), 6))
    return (
        "Share of each misfit’s variance over the box that a parameter causes, alone or together with "
        "others (total Sobol’ indices, bars, 95 % intervals of the bootstrap), and alone (first order, "
        "dots)."
    )


def _bars(ax: Axes, indices: SobolIndices) -> None:
    """Draw total indices with their intervals as bars, and first-order indices as dots."""
    count, place = len(indices.names), np.arange(len(indices.outputs))
    for j, name in enumerate(indices.names):
        x = place + (j - 0.5 * (count - 1)) * 0.8 / count
        low, high = indices.total_interval[:, j].T
        colour = SERIES[j % len(SERIES)]
        ax.bar(x, indices.total[:, j], 0.72 / count, color=colour, label=f"${name_of(name).tex}$")
        ax.vlines(x, low, high, color=MEASURED, lw=0.6)
        ax.plot(x, indices.first[:, j], "o", color="white", mec=MEASURED, mew=0.5, ms=2.6)
    ax.set_xticks(
        place, [f"${TEX_SYMBOLS[name]}$" if name in TEX_SYMBOLS else name for name in indices.outputs]
    )
    ax.tick_params(axis="x", length=0)
    ax.axhline(0.0, color=MEASURED, lw=0.5)
    ax.set_ylabel("Sobol’ index (–)")
    ax.set_ylim(min(-0.05, 1.1 * float(indices.first.min())), 1.3)


MOST_SOURCES = 24
"""Maximum number of sources in the figure."""
SOURCE_HEIGHT = 5.2
"""Height of a source [mm]."""


def _ordered_sources(result: Budget) -> list[Source]:
    """Return the sources with known uncertainty, the largest first."""
    sources = [source for source in result.sources if np.isfinite(source.u)]
    return sorted(sources, key=lambda source: -source.u)[:MOST_SOURCES]


@figure(
    PAGE,
    lambda result: 18.0 + SOURCE_HEIGHT * max(3, len(_ordered_sources(result))),
    [["bars"]],
    applies=lambda result: bool(_ordered_sources(result)),
)
def budget(result: Budget, panels: Panels) -> str:
    ax, sources, factor = panels["bars"], _ordered_sources(result), 2.0 * name_of(result.parameter).factor
    place = np.arange(len(sources))[::-1]
    widths = [factor * source.u for source in sources]
    colours = [GREY if source.factor.shared else SHAPE for source in sources]
    ax.barh(place, widths, 0.7, color=colours)
    for y, source, width in zip(place, sources, widths, strict=True):
        box: dict[str, Any] = {"bbox": {"fc": "white", "ec": "none", "pad": 0.5}}
        share = f"{100.0 * result.share(source):.2g} %"
        label_point(ax, share, (width, y), (2, 0), va="center", fontsize="small", **box)
    ax.set_yticks(place, [label_text(source.factor.words, 44) for source in sources])
    ax.tick_params(axis="y", length=0)
    total, (low, high) = factor * result.u_together, result.u_together_interval
    drawn = ""
    if np.isfinite(low):
        drawn = (
            f" Line: all at once, {len(result.together)} draws; band: 95 % interval of that. Dashed: the "
            "sources added in quadrature."
        )
        ax.axvspan(factor * low, factor * high, color=MEASURED, alpha=0.08, lw=0.0, zorder=0)
        ax.axvline(total, color=MEASURED, lw=0.8)
        ax.axvline(factor * result.u_sum, color=MEASURED, lw=0.8, ls="--")
    name = name_of(result.parameter)
    unit = "–" if name.unit == "1" else name.unit
    ax.set_xlabel(f"Expanded uncertainty of ${name.tex}$ ({unit})")
    ax.set_xlim(0.0, None)
    ax.set_ylim(-0.6, len(sources) - 0.4)
    shared = [source for source in sources if source.factor.shared]
    if shared and len(shared) < len(sources):
        ax.plot([], [], "s", color=SHAPE, label="anew for each shot")
        ax.plot([], [], "s", color=GREY, label="common to all shots")
        ax.legend(loc="lower right")
    return (
        f"Error budget of {name.symbol}: expanded uncertainty (k = 2) from each source "
        f"alone, the other sources without error; numbers: share of the sum of squares.{drawn}"
    )
