"""Pictures with the points of the specimen coloured by the uncertainty of their match."""

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from kolsky.report.figures.base import PAGE, FigureKind, Panels, smooth_bar
from kolsky.report.figures.overlay import LOST, frames_in, height_of, last_places, marker, panels_of
from kolsky.report.view import SurfaceView


def caption(view: SurfaceView) -> str:
    """What is seen."""
    return (
        "Camera 0 at some times, with the valid points of the specimen coloured by the larger of both "
        "cameras' "
        "standard deviations of their place; crosses: where points that are lost at that time were last seen."
    )


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw the pictures, the points and one colour bar."""
    body = view.result.specimen
    drawn = frames_in(view, panels)
    if not drawn:
        return
    sigma = np.fmax(*body.match_sigma)
    shown = np.concatenate([sigma[frame][body.surface.valid[frame]] for frame, _ in drawn])
    low, high = (0.0, 1.0) if shown.size == 0 else np.percentile(shown, [1.0, 99.0])
    size = marker(view)
    points: Any = None
    for frame, ax in drawn:
        valid = body.surface.valid[frame]
        x, y = body.pixels[0][frame, valid].T
        points = ax.scatter(
            x,
            y,
            c=sigma[frame, valid],
            s=size**2,
            vmin=low,
            vmax=max(high, low * 1.01),
            cmap="plasma",
            lw=0.0,
        )
        lost = last_places(view, frame)
        ax.plot(*lost.T, "x", color=LOST, ms=size, mew=0.5, clip_on=True)
    figure = drawn[0][1].figure
    bar = figure.colorbar(  # type: ignore[union-attr]
        points, ax=[ax for _, ax in drawn], location="bottom", shrink=0.5, aspect=45, pad=0.02, extend="both"
    )
    bar.set_label("Standard deviation of a match (px)")
    bar.locator = MaxNLocator(6)
    bar.update_ticks()
    smooth_bar(bar)


KIND: FigureKind[SurfaceView] = FigureKind(
    name="overlay-sigma",
    width=PAGE,
    height=height_of,
    caption=caption,
    panels=panels_of,
    draw=draw,
    applies=lambda view: bool(view.pictures),
)
