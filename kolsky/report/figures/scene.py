"""The specimen between its platens at three times, rendered, half of it cut away."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import MS, PAGE, FigureKind, Panels, smooth_bar
from kolsky.report.scene.fields import FIELDS
from kolsky.report.scene.stills import COUNT, begin, stills


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "The check run, its half behind a cut along the axis, between the platens (cut too), coloured by the "
        "smallest principal stretch; beside it the measured outline, nearest frame, turned about the axis. "
        "Points: as measured."
    )


def applies(result: Identification) -> bool:
    """Whether the result holds what is drawn, and this machine can render."""
    return stills(result) is not None


def draw(result: Identification, panels: Panels) -> None:
    """Set the pictures side by side."""
    found = stills(result)
    assert found is not None  # `applies` has looked
    stage, images = found
    rows, columns = (np.flatnonzero((images < 255).any(axis=axes)) for axes in ((0, 2, 3), (0, 1, 3)))
    cut = images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]  # without the empty margins
    axes = [panels[f"scene {column}"] for column in range(COUNT)]
    for ax in axes:
        ax.set_axis_off()
    for ax, image, time in zip(axes, cut, stage.times, strict=False):
        ax.imshow(image, interpolation="antialiased")
        ax.text(0.5, 1.02, f"{MS * time:.2f} ms", transform=ax.transAxes, ha="center", va="bottom")
    kind = FIELDS[stage.field]
    colours = ScalarMappable(Normalize(*stage.limits), kind.colours)
    bar = axes[0].figure.colorbar(  # type: ignore[union-attr]
        colours, ax=axes, location="bottom", label=kind.label, aspect=50, shrink=0.5
    )
    smooth_bar(bar)


KIND = FigureKind(
    name="scene",
    width=PAGE,
    height=lambda result: 45.0,
    caption=caption,
    panels=lambda result: [[f"scene {column}" for column in range(COUNT)]],
    draw=draw,
    applies=applies,
    ahead=begin,
)
