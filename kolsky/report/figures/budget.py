"""Figure of an error budget: the expanded uncertainty that each source gives the answer."""

import numpy as np

from kolsky.report.figures.base import GREY, MEASURED, PAGE, SHAPE, FigureKind, Panels, label_text
from kolsky.report.nomenclature import name_of
from kolsky.studies.budget.records import Budget, Source

MOST = 24
"""Most sources in the figure."""
ROW = 5.2
"""Height of a source [mm]."""


def ordered(result: Budget) -> list[Source]:
    """Return the sources whose uncertainty is known, the largest first."""
    known = [source for source in result.sources if np.isfinite(source.u)]
    return sorted(known, key=lambda source: -source.u)[:MOST]


def caption(result: Budget) -> str:
    """Return the caption."""
    low, _ = result.u_together_interval
    drawn = (
        ""
        if np.isnan(low)
        else f" Line: all at once, {len(result.together)} draws; band: 95 % interval of that. Dashed: the "
        "sources added in quadrature."
    )
    return (
        f"Error budget of {name_of(result.parameter).symbol}: expanded uncertainty (k = 2) from each source "
        f"alone, the other sources without error; numbers: share of the sum of squares.{drawn}"
    )


def draw(result: Budget, panels: Panels) -> None:
    """Draw a bar a source."""
    ax, sources, factor = panels["bars"], ordered(result), 2.0 * name_of(result.parameter).factor
    place = np.arange(len(sources))[::-1]
    widths = [factor * source.u for source in sources]
    colours = [GREY if source.factor.shared else SHAPE for source in sources]
    ax.barh(place, widths, 0.7, color=colours)
    for y, source, width in zip(place, sources, widths, strict=True):
        ax.annotate(
            f"{100.0 * result.share(source):.2g} %",
            (width, y),
            xytext=(2, 0),
            textcoords="offset points",
            va="center",
            fontsize="small",
            bbox={"fc": "white", "ec": "none", "pad": 0.5},
        )
    ax.set_yticks(place, [label_text(source.factor.words, 44) for source in sources])
    ax.tick_params(axis="y", length=0)
    total, (low, high) = factor * result.u_together, result.u_together_interval
    if np.isfinite(low):
        ax.axvspan(factor * low, factor * high, color=MEASURED, alpha=0.08, lw=0.0, zorder=0)
        ax.axvline(total, color=MEASURED, lw=0.8)
        ax.axvline(factor * result.u_sum, color=MEASURED, lw=0.8, ls="--")
    known = name_of(result.parameter)
    unit = "–" if known.unit == "1" else known.unit
    ax.set_xlabel(f"Expanded uncertainty of ${known.tex}$ ({unit})")
    ax.set_xlim(0.0, None)
    ax.set_ylim(-0.6, len(sources) - 0.4)
    shared = [source for source in sources if source.factor.shared]
    if shared and len(shared) < len(sources):
        ax.plot([], [], "s", color=SHAPE, label="anew for each shot")
        ax.plot([], [], "s", color=GREY, label="common to all shots")
        ax.legend(loc="lower right")


FIGURES: tuple[FigureKind[Budget], ...] = (
    FigureKind(
        name="budget",
        width=PAGE,
        height=lambda result: 18.0 + ROW * max(3, len(ordered(result))),
        caption=caption,
        panels=lambda result: [["bars"]],
        draw=draw,
        applies=lambda result: bool(ordered(result)),
    ),
)
