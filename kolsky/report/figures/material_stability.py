"""How far each law is stable, in four modes that are all there are without the renamed ones."""

import numpy as np

from kolsky.material.fits.compare import Comparison, Row
from kolsky.material.fits.modes import Mode
from kolsky.material.fits.stability import PathStability, Stability
from kolsky.report.figures.base import BAND, GREY, MEASURED, MODEL, PAGE, FigureKind, Panels

PATHS = (
    (Mode.UNIAXIAL, "tension", "Uniaxial tension"),
    (Mode.UNIAXIAL, "compression", "Uniaxial compression"),
    (Mode.EQUIBIAXIAL, "tension", "Equibiaxial tension"),
    (Mode.PLANAR, "tension", "Planar, simple shear"),
)
"""Equibiaxial tension is uniaxial compression with another stretch; both are drawn, each in its own."""


def caption(comparison: Comparison) -> str:
    """What is seen."""
    return (
        "Stretch to which each law meets Drucker's criterion. A bar that ends in a cross: unstable from "
        "there; in a vertical stroke: the law locks; in nothing: stable as far as it was followed. Blue: the "
        "stretches of the tests in this mode."
    )


def draw(comparison: Comparison, panels: Panels) -> None:
    """Draw a bar for each law and path."""
    rows = [row for row in comparison.rows if row.fit is not None]
    places = np.arange(len(rows), 0, -1)
    for number, ((mode, direction, title), ax) in enumerate(zip(PATHS, panels.values(), strict=True)):
        for place, row in zip(places, rows, strict=True):
            path = _path(row, mode, direction)
            end = 1.0 + path.strain
            ax.plot([1.0, end], [place, place], color=MEASURED, lw=1.6, solid_capstyle="butt")
            if path.outcome is not Stability.STABLE:
                ax.plot([end], [place], "x" if path.outcome is Stability.UNSTABLE else "|", ms=5, color=MODEL)
        for test in comparison.tests:
            lam = test.deformation[(test.strain > 0.0) == (direction == "tension")]
            if test.mode is mode and lam.size:
                ax.axvspan(
                    1.0, lam.max() if direction == "tension" else lam.min(), color=BAND, alpha=0.3, lw=0
                )
        ax.axvline(1.0, color=GREY, lw=0.5)
        ax.set_xscale("log")
        low, high = ax.get_xlim()
        ticks = [t for t in (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0) if low <= t <= high]
        ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
        ax.set_xticks([], minor=True)
        ax.set(xlabel="Stretch (–)", title=title, ylim=(0.3, len(rows) + 0.7))
        ax.set_yticks(places, [row.candidate.name.replace("_", " ") for row in rows] if number == 0 else [])
        ax.tick_params(axis="y", left=False, right=False)


def _path(row: Row, mode: Mode, direction: str) -> PathStability:
    return next(path for path in row.stability if path.mode is mode and path.direction == direction)


KIND: FigureKind[Comparison] = FigureKind(
    name="material-stability",
    width=PAGE,
    height=lambda comparison: 18.0 + 4.5 * sum(row.fit is not None for row in comparison.rows),
    caption=caption,
    panels=lambda comparison: [[title for _, _, title in PATHS]],
    draw=draw,
)
