"""Pictures with the points of the specimen coloured by their epipolar error."""

import numpy as np
from matplotlib.lines import Line2D

from kolsky.report.figures.base import FORCE, MODEL, PAGE, SHAPE, FigureKind, Panels
from kolsky.report.figures.overlay import LOST, frames_in, height_of, last_places, marker, panels_of
from kolsky.report.view import SurfaceView

STEPS = (0.05, 0.1)
"""Where the colour changes [px]."""
COLOURS = (SHAPE, FORCE, MODEL)
"""Colours below, between and above the steps."""


def caption(view: SurfaceView) -> str:
    """What is seen."""
    body = view.result.specimen
    size = np.abs(body.epipolar[body.surface.valid])
    low, high = (100.0 * float(np.mean(size > step)) if size.size else 0.0 for step in STEPS)
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the distance of camera "
        "1's point from the epipolar line. Over all frames its rms is "
        f"{body.epipolar_rms:.3f} px; {low:.2g} % of the points exceed {STEPS[0]:g} px, {high:.2g} % exceed "
        f"{STEPS[1]:g} px. Crosses: where points that are lost at that time were last seen."
    )


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw the pictures, the points and one legend."""
    body, size = view.result.specimen, marker(view)
    drawn = frames_in(view, panels)
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        kind = np.searchsorted(STEPS, np.abs(body.epipolar[frame, valid]))
        places = body.pixels[0][frame, valid]
        for number, colour in enumerate(COLOURS):
            ax.plot(*places[kind == number].T, "o", color=colour, ms=size, mew=0.0)
        ax.plot(*last_places(view, frame).T, "x", color=LOST, ms=size, mew=0.5)
    names = (f"below {STEPS[0]:g} px", f"{STEPS[0]:g} to {STEPS[1]:g} px", f"above {STEPS[1]:g} px")
    handles = [
        *(
            Line2D([], [], marker="o", ls="", color=c, ms=3.5, label=n)
            for c, n in zip(COLOURS, names, strict=True)
        ),
        Line2D([], [], marker="x", ls="", color=LOST, ms=3.5, label="lost"),
    ]
    if drawn:
        drawn[0][1].figure.legend(
            handles=handles, loc="outside lower center", ncols=4, title="Epipolar distance"
        )


KIND: FigureKind[SurfaceView] = FigureKind(
    name="overlay-epipolar",
    width=PAGE,
    height=height_of,
    caption=caption,
    panels=panels_of,
    draw=draw,
    applies=lambda view: bool(view.pictures),
)
