"""What a longer window and another speed of the flyer would bring."""

from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from kolsky.report.figures.base import GREY, MS, PAGE, FigureKind, Panels, letter
from kolsky.report.nomenclature import name_of
from kolsky.studies.planning.plan import Plan

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
MARKERS = "osDv^"


def caption(plan: Plan) -> str:
    """What is seen."""
    return (
        "Expected standard deviations of the parameters over their scale, all estimated together from force "
        "and outline: (a) if the data end at some time, (b) at other speeds of the flyer on the same path "
        "(open symbols: if the other parameters were known). (c) Expected correlations of the estimates. The "
        "scale is the value itself, of Poisson’s ratio its distance from 1/2."
    )


def draw(plan: Plan, panels: Panels) -> None:
    """Draw three panels."""
    scale = plan.information.sensitivity.scale
    by_end = np.array([e.deviations for e in plan.by_end]) / scale
    speeds = np.array([rate.factor for rate in plan.rates])
    together = np.array([rate.expected.deviations for rate in plan.rates]) / scale
    alone = np.array([rate.expected.alone for rate in plan.rates]) / scale
    for j, name in enumerate(plan.names):
        colour, marker, symbol = COLOURS[j % 5], MARKERS[j % 5], f"${name_of(name).tex}$"
        panels["end"].plot(MS * plan.end_times, 100.0 * _finite(by_end[:, j]), color=colour, label=symbol)
        line: dict[str, Any] = {"color": colour, "marker": marker, "ms": 3.2}
        panels["rate"].plot(speeds, 100.0 * _finite(together[:, j]), label=symbol, **line)
        panels["rate"].plot(speeds, 100.0 * _finite(alone[:, j]), ls=":", mfc="white", lw=0.7, **line)
    for number, (i, k) in enumerate(combinations(range(len(plan.names)), 2)):
        first, second = name_of(plan.names[i]).tex, name_of(plan.names[k]).tex
        r = [np.nan if R is None else R[i, k] for R in (rate.expected.correlation for rate in plan.rates)]
        style: dict[str, Any] = {"color": COLOURS[number % 5], "marker": MARKERS[number % 5], "ms": 3.2}
        panels["correlation"].plot(speeds, r, label=f"${first}$, ${second}$", **style)
    panels["end"].set(xlabel="End of the data (ms)", ylabel="Standard deviation over scale (%)")
    panels["rate"].set_ylabel("Standard deviation over scale (%)")
    panels["correlation"].set_ylabel("Correlation (–)")
    panels["correlation"].set_ylim(-1.05, 1.05)
    panels["correlation"].axhline(0.0, color=GREY, lw=0.5)
    for name in ("end", "rate"):
        panels[name].set_yscale("log")
        panels[name].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panels[name].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        panels[name].yaxis.set_minor_formatter(NullFormatter())
    for name in ("rate", "correlation"):
        _speeds(panels[name], speeds)
    for key, ax in zip("abc", panels.values(), strict=True):
        letter(ax, key)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(loc="best")


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)


def _speeds(ax: Axes, speeds: np.ndarray) -> None:
    ax.set_xlabel("Speed of the flyer over the shot’s (–)")
    ax.set_xscale("log")
    ax.set_xticks(speeds, [f"{speed:g}" for speed in speeds])
    ax.minorticks_off()


KIND: FigureKind[Plan] = FigureKind(
    name="plan-choices",
    width=PAGE,
    height=lambda plan: 58.0,
    caption=caption,
    panels=lambda plan: [["end", "rate", "correlation"]],
    draw=draw,
)
