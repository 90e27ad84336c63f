"""Samples of the posterior: every coordinate alone, every pair."""

import numpy as np

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import GREY, MEASURED, MODEL, PAGE, FigureKind, Panels
from kolsky.report.nomenclature import name_of

BINS = 30
DOTS = 800
"""Most samples drawn as dots of a pair."""


def caption(result: Identification) -> str:
    """What is seen."""
    assert result.posterior is not None
    chains = result.posterior
    state = "converged" if chains.converged else "not converged"
    return (
        f"Samples of the posterior ({state}, {chains.steps} steps of each walker, longest autocorrelation "
        f"time {chains.autocorrelation:.3g} steps) with the likelihood to the power of {chains.power:.3g}. "
        "Dashed: median; dotted: 95 % interval; lines across pairs: the answer. Priors: "
        f"{chains.prior}."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw histograms on the diagonal, pairs below it."""
    chains = result.posterior
    assert chains is not None
    every = max(1, -(-len(chains.samples) // DOTS))
    for i, row in enumerate(chains.names):
        for j, column in enumerate(chains.names[: i + 1]):
            ax = panels[f"{row} {column}"]
            x, y = chains.samples[:, j], chains.samples[:, i]
            if i == j:
                ax.hist(x, bins=BINS, color=MODEL, alpha=0.6, lw=0.0)
                ax.axvline(chains.median[i], color=MEASURED, lw=0.7, ls="--")
                for end in (chains.lower[i], chains.upper[i]):
                    ax.axvline(end, color=GREY, lw=0.7, ls=":")
                ax.set_yticks([])
            else:
                ax.plot(x[::every], y[::every], ".", color=MODEL, ms=2.0, mew=0.0, alpha=0.6)
                for name, line in ((column, ax.axvline), (row, ax.axhline)):
                    if name in result.estimates:
                        line(result.estimates[name].value, color=MEASURED, lw=0.5)
            if i == len(chains.names) - 1:
                ax.set_xlabel(_label(column))
            else:
                ax.tick_params(labelbottom=False)
            if j == 0 and i:
                ax.set_ylabel(_label(row))
            elif i != j:
                ax.tick_params(labelleft=False)
            ax.locator_params(axis="x", nbins=4)
            ax.set_xlim(np.min(x), np.max(x))
            if i != j:
                ax.set_ylim(np.min(y), np.max(y))


def _label(name: str) -> str:
    shown = name_of(name)
    return f"${shown.tex}$ ({'–' if shown.unit == '1' else shown.unit})"


def panels(result: Identification) -> list[list[str]]:
    """The lower triangle."""
    assert result.posterior is not None
    names = result.posterior.names
    return [
        [f"{row} {column}" if j <= i else "." for j, column in enumerate(names)]
        for i, row in enumerate(names)
    ]


KIND = FigureKind(
    name="corner",
    width=PAGE,
    height=lambda result: 20.0 + 36.0 * len(result.posterior.names if result.posterior else ()),
    caption=caption,
    panels=panels,
    draw=draw,
    applies=lambda result: result.posterior is not None,
)
