"""The force residual in units of its noise, along time and as a distribution."""

import numpy as np

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import BAND, COLUMN, GREY, MODEL, MS, FigureKind, Panels, largest, say_empty


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "Residual of the force over the standard deviation of each bin, with the band of k = 2 (left), and "
        "its distribution beside the standard normal one (right). Stretches of one sign are error of the "
        "model, not noise."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw history and histogram."""
    c = result.comparison
    weighted = (c.force_model - c.force_measured) / c.force_sigma
    history, share = panels["history"], panels["share"]
    history.axhspan(-2.0, 2.0, color=BAND, alpha=0.3, lw=0.0)
    history.axhline(0.0, color=GREY, lw=0.5)
    history.vlines(MS * c.force_time, 0.0, weighted, color=MODEL, lw=0.5)
    history.plot(MS * c.force_time, weighted, "o", color=MODEL, ms=1.5, mew=0.0)
    history.set_xlabel("Time $t$ (ms)")
    history.set_ylabel(r"$(F_\mathrm{sim} - F_\mathrm{meas})/\sigma$ (–)")

    reach = max(4.0, 1.05 * largest(weighted))
    history.set_ylim(-reach, reach)
    finite = weighted[np.isfinite(weighted)]
    if finite.size == 0:
        say_empty(history, "no simulated force")
    else:
        edges = np.linspace(-reach, reach, 31)
        share.hist(
            finite, bins=edges.tolist(), density=True, orientation="horizontal", color=MODEL, alpha=0.6
        )
    z = np.linspace(-reach, reach, 200)
    share.plot(np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi), z, color="black", lw=0.7)
    share.set_xlabel("Density (–)")
    share.set_xlim(left=0.0)
    share.tick_params(labelleft=False)


KIND = FigureKind(
    name="force-residual",
    width=COLUMN,
    height=lambda result: 50.0,
    caption=caption,
    panels=lambda result: [["history", "share"]],
    draw=draw,
    applies=lambda result: result.comparison.force_time.size > 0,
    mosaic={"sharey": True, "width_ratios": [3.2, 1.0]},
)
