"""Residual of every pair of calibration pictures, and how residuals are distributed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from kolsky.report.figures.base import GREY, MEASURED, PAGE, FigureKind, Panels, letter
from kolsky.report.figures.calibration_residuals import COLOURS

if TYPE_CHECKING:
    from dic.calibration import Calibration

NAMED = 30
"""Up to this many pairs each has its name on the axis."""


def caption(found: Calibration) -> str:
    """What is seen."""
    bad = [pair.name for pair in found.rejected if np.isfinite(pair.rms)]
    crossed = f" Crosses: pairs left out ({', '.join(bad)})." if bad else ""
    return (
        f"(a) Rms residual of each picture; line: of all that were used.{crossed} (b) Residuals along x and "
        "y over their standard deviation, with the normal distribution."
    )


def draw(found: Calibration, panels: Panels) -> None:
    """Draw both panels."""
    ax = panels["pairs"]
    values = []
    for camera, (colour, shift) in enumerate(zip(COLOURS, (-0.16, 0.16), strict=True)):
        for used, mark in ((True, "os"[camera]), (False, "x")):
            rows = [
                (k + shift, view.rms)
                for k, pair in enumerate(found.pairs)
                if pair.outcome.used is used and (view := pair.views[camera]) is not None
            ]
            if rows:
                label = f"camera {camera}" if used else f"camera {camera}, left out"
                ax.plot(
                    *np.array(rows).T,
                    mark,
                    color=colour,
                    ms=3.5,
                    mew=0.8 if mark == "x" else 0.0,
                    label=label,
                )
                values += [value for _, value in rows]
    ax.axhline(found.rms, color=GREY, lw=0.8, zorder=0)
    if max(values) > 10.0 * max(min(values), 1e-12):
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_ylim(0.5 * min(values), 30.0 * max(values))  # room for the legend
    else:
        ax.set_ylim(0.0, 1.45 * max(values))
    ax.set(xlabel="Pair", ylabel="Rms residual (px)", xlim=(-0.7, len(found.pairs) - 0.3))
    names = [pair.name for pair in found.pairs]
    if len(names) <= NAMED:
        ax.set_xticks(
            range(len(names)), names, fontsize="x-small", rotation=0 if max(map(len, names)) < 3 else 90
        )
        ax.tick_params(axis="x", which="minor", bottom=False, top=False)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(loc="upper right", ncols=2)
    letter(ax, "a")

    ax = panels["distribution"]
    edges = np.linspace(-4.0, 4.0, 41)
    for camera, colour in enumerate(COLOURS):
        scaled = [
            (view.residual / (found.unit * view.sigma[:, None]))[view.used].ravel()
            for pair in found.pairs
            if pair.outcome.used and (view := pair.views[camera]) is not None
        ]
        ax.hist(
            np.concatenate(scaled),
            edges.tolist(),
            density=True,
            histtype="step",
            color=colour,
            label=f"camera {camera}",
        )
    z = np.linspace(-4.0, 4.0, 201)
    ax.plot(z, np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi), "--", color=MEASURED, lw=0.8, label="normal")
    ax.set(xlabel="Residual / $σ$", ylabel="Density", xlim=(-4.0, 4.0))
    ax.set_ylim(0.0, 1.35 * ax.get_ylim()[1])
    ax.legend(loc="upper right")
    letter(ax, "b")


KIND = FigureKind(
    name="calibration-pairs",
    width=PAGE,
    height=lambda found: 60.0,
    caption=caption,
    panels=lambda found: [["pairs", "distribution"]],
    draw=draw,
    mosaic={"width_ratios": [1.6, 1.0]},
)
