"""The specimen between its platens at three times, rendered, half of it cut away."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from kolsky.identification import Identification
from kolsky.report.figures.base import MS, PAGE, FigureKind, Panels, smooth_bar
from kolsky.report.scene.drawing import picture, renders
from kolsky.report.scene.fields import FIELDS
from kolsky.report.scene.film import chosen
from kolsky.report.scene.stage import NotShown, stage_of

COUNT = 3
SIZE = (800, 480)
"""Of each picture [px]: 350 dots per inch on the page."""


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "The check run, its half behind a cut along the axis, between the platens (cut too), coloured by the "
        "smallest principal stretch; beside it the measured outline, nearest frame, turned about the axis. "
        "Points: as measured."
    )


def applies(result: Identification) -> bool:
    """Whether the result holds what is drawn, and this machine can render."""
    try:
        stage_of(result)
    except NotShown:
        return False
    return renders()


def draw(result: Identification, panels: Panels) -> None:
    """Render three times and set the pictures side by side."""
    stage = stage_of(result)
    bar = None
    for column, k in enumerate(chosen(len(stage.times), COUNT)):
        ax = panels[f"scene {column}"]
        image = picture(stage, k, size=SIZE, bar=False)
        used = np.flatnonzero((image < 255).any(axis=(1, 2)))
        ax.imshow(image[max(used[0] - 4, 0) : used[-1] + 5], interpolation="antialiased")
        ax.set_axis_off()
        ax.text(0.5, 1.0, f"{MS * stage.times[k]:.2f} ms", transform=ax.transAxes, ha="center", va="bottom")
        bar = ax
    assert bar is not None  # a stage has at least one time
    kind = FIELDS[stage.field]
    colours = ScalarMappable(Normalize(*stage.limits), kind.colours)
    axes = [ax for name, ax in panels.items() if name.startswith("scene")]
    smooth_bar(
        bar.figure.colorbar(colours, ax=axes, location="bottom", label=kind.label, aspect=50, shrink=0.5)
    )


KIND = FigureKind(
    name="scene",
    width=PAGE,
    height=lambda result: 52.0,
    caption=caption,
    panels=lambda result: [[f"scene {column}" for column in range(COUNT)]],
    draw=draw,
    applies=applies,
)
