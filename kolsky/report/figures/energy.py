"""Where the work of the platens went."""

import numpy as np

from kolsky.inverse.result import Identification, worst_imbalance
from kolsky.report.figures.base import COLUMN, GREY, MEASURED, MJ, MS, FigureKind, Panels, largest, say_empty
from kolsky.report.numbers import percent

PARTS = {
    "elastic": "#0072B2",
    "kinetic": "#56B4E9",
    "damping": "#E69F00",
    "viscous": "#999999",
    "friction": "#CC79A7",
    "hourglass": "#F0E442",
    "hourglass_damping": "#D55E00",
    "impact": "#009E73",
}


def caption(result: Identification) -> str:
    """What is seen."""
    worst = percent(worst_imbalance(result.response))
    return (
        "Energy ledger of the check run: the work of both platens (line) and what it became (areas, "
        "stacked), and the share that is not accounted for, over the largest work; "
        f"its largest size is {worst}. The legend gives each part’s largest share of that work."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw the stacked ledger above its residual."""
    ledger, time = result.response.energy, MS * result.response.surface_times
    top, low = panels["ledger"], panels["residual"]
    scale = largest(ledger.external[0])
    # nothing relaxes in most tests, and a part that is nowhere needs no place in the legend
    parts = [name for name in PARTS if name != "viscous" or (np.abs(ledger.viscous[0]) > 0.0).any()]
    shares = [largest(getattr(ledger, name)[0], default=0.0) / scale for name in parts]
    labels = [
        f"{name.replace('_', ' ')}, {percent(share)}" for name, share in zip(parts, shares, strict=True)
    ]
    stack = [MJ * getattr(ledger, name)[0] for name in parts]
    ended = np.isfinite(ledger.external[0])
    if not ended.any():
        say_empty(top, "no simulation completed")
    colours = [PARTS[name] for name in parts]
    top.stackplot(time[ended], [part[ended] for part in stack], labels=labels, colors=colours, lw=0.0)
    top.plot(time, MJ * ledger.external[0], color=MEASURED, lw=0.8, label="work of the platens")
    top.set_ylabel("Energy $W$ (mJ)")
    top.tick_params(labelbottom=False)
    top.legend(loc="upper left", reverse=True)
    low.axhline(0.0, color=GREY, lw=0.5)
    low.plot(time, 100.0 * ledger.residual[0] / scale, color=MEASURED, lw=0.8)
    low.set_xlabel("Time $t$ (ms)")
    low.set_ylabel("Residual (%)")
    if time.size:
        low.set_xlim(time[0], time[-1])
    low.margins(y=0.2)


KIND = FigureKind(
    name="energy",
    width=COLUMN,
    height=lambda result: 78.0,
    caption=caption,
    panels=lambda result: [["ledger"], ["residual"]],
    draw=draw,
    mosaic={"sharex": True, "height_ratios": [2.8, 1.0]},
)
