"""Sobol' indices of a sweep's misfits."""

import numpy as np

from kolsky.report.figures.base import COLUMN, MEASURED, FigureKind, Panels
from kolsky.report.nomenclature import name_of
from kolsky.studies.sweep_analysis import SweepAnalysis

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
WORDS = {"Phi_F": r"$\Phi_F$", "Phi_S": r"$\Phi_S$", "Phi": r"$\Phi$"}


def caption(result: SweepAnalysis) -> str:
    """What is seen."""
    return (
        "Share of each misfit’s variance over the box that a parameter causes, by itself or with others "
        "(total Sobol’ indices, bars, 95 % intervals of the bootstrap), and by itself (first order, dots)."
    )


def draw(result: SweepAnalysis, panels: Panels) -> None:
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
    ax.set_xticks(np.arange(len(found.outputs)), [WORDS[name] for name in found.outputs])
    ax.tick_params(axis="x", length=0)
    ax.axhline(0.0, color=MEASURED, lw=0.5)
    ax.set_xlabel("Misfit (–)")
    ax.set_ylabel("Sobol’ index (–)")
    ax.set_ylim(min(-0.05, 1.1 * float(found.first.min())), 1.3)
    ax.legend(loc="upper center", ncols=min(d, 6))


KIND: FigureKind[SweepAnalysis] = FigureKind(
    name="sweep-indices",
    width=COLUMN,
    height=lambda result: 62.0,
    caption=caption,
    panels=lambda result: [["indices"]],
    draw=draw,
    applies=lambda result: result.indices is not None,
)
