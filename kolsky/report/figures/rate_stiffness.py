"""Nominal stress and moduli at fixed strains against strain rate, with the quasi-static curve's own point."""

from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from kolsky.report.figures.base import PAGE, FigureKind, Panels, letter
from kolsky.studies.rates.records import GroupRates

KPA = 1e-3
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^v<>"
PANELS = {
    "stress": ("nominal stress", "Nominal stress (kPa)"),
    "secant": ("secant modulus", "Secant modulus (kPa)"),
    "tangent": ("tangent modulus", "Tangent modulus (kPa)"),
}


def caption(group: GroupRates) -> str:
    """What is seen."""
    return (
        "Nominal compressive stress, secant modulus and tangent modulus at fixed nominal strains (given"
        " beside each series; 0: the initial modulus) against nominal strain rate, ±2u. Filled: the shots,"
        " the quasi-static curve times m; open: the quasi-static curve itself"
        + (
            ", at its own rate, and its level carried to theirs (dotted)."
            if _slow(group)
            else ". Its rate is not declared, so it is not drawn."
        )
    )


def draw(group: GroupRates, panels: Panels) -> None:
    """Draw the three quantities."""
    slow = _slow(group)
    for number, (panel, (quantity, label)) in enumerate(PANELS.items()):
        ax = panels[panel]
        letter(ax, "abc"[number])
        ax.set_xscale("log")
        ax.set_xlabel("Strain rate (1/s)")
        ax.set_ylabel(label)
        for k, at in enumerate(group.stiffness):
            if quantity not in at.quantities:
                continue
            colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
            value, sigma = (KPA * x for x in at.quantities[quantity])
            style: dict[str, Any] = {"color": colour, "fmt": marker, "ms": 2.8, "lw": 0.8}
            ax.errorbar(at.rates, value, yerr=2.0 * sigma, **style)
            end = int(np.argmax(at.rates))
            ax.annotate(
                f"{at.strain:g}",
                (at.rates[end], value[end]),
                xytext=(5, 0),
                textcoords="offset points",
                va="center",
                color=colour,
                annotation_clip=False,
            )
            if slow:
                base, spread = (KPA * x for x in at.baseline[quantity])
                ax.errorbar(slow, base, yerr=2.0 * spread, mfc="white", **style)
                ax.plot([slow, at.rates.min()], [base, base], ":", color=colour, lw=0.6)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.margins(x=0.2, y=0.1)


def _slow(group: GroupRates) -> float | None:
    """The one quasi-static rate of the group, if there is one."""
    rates = {shot.quasi_static.rate for shot in group.counted}
    return rates.pop() if len(rates) == 1 else None


KIND: FigureKind[GroupRates] = FigureKind(
    name="rate-stiffness",
    width=PAGE,
    height=lambda group: 58.0,
    caption=caption,
    panels=lambda group: [list(PANELS)],
    draw=draw,
    applies=lambda group: len(group.stiffness) > 0,
)
