"""Residuals of a calibration over the field of each camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kolsky.report.figures.base import COLUMN, MODEL, PAGE, SHAPE, FigureKind, Panels, letter

if TYPE_CHECKING:
    from dic.calibration import Calibration

COLOURS = (SHAPE, MODEL)
"""Of camera 0 and camera 1."""


def _length(found: Calibration) -> float:
    """A round length near twice the rms residual [px]."""
    size = 2.0 * max(found.rms, 1e-12)
    power = 10.0 ** np.floor(np.log10(size))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda step: abs(step * power - size)))


def caption(found: Calibration) -> str:
    """What is seen."""
    return (
        "Residuals of all points used, measured less expected, where the two cameras saw them; their rms is "
        f"{found.rms:.3g} px. Vectors that agree with their neighbours would show a lens model too simple or "
        "a target that is not what it should be."
    )


def draw(found: Calibration, panels: Panels) -> None:
    """Draw one panel a camera, both to the same scale."""
    key = _length(found)
    for camera, colour in enumerate(COLOURS):
        ax = panels[f"camera {camera}"]
        views = [pair.views[camera] for pair in found.pairs if pair.outcome.used]
        seen = [view for view in views if view is not None]
        places = np.concatenate([view.pixels[view.used] for view in seen])
        vectors = np.concatenate([view.residual[view.used] for view in seen])
        columns, rows = found.rig.cameras[camera].sensor or tuple(places.max(axis=0))
        arrows = ax.quiver(
            *places.T, *vectors.T, color=colour, angles="xy", units="width", width=0.0013, alpha=0.8,
            scale=key / (0.06 * columns), scale_units="xy", headwidth=3.0, headlength=4.0, headaxislength=3.6,
        )  # fmt: skip
        ax.quiverkey(
            arrows, 0.88, 1.045, key, f"{key:g} px", labelpos="W", labelsep=0.06, coordinates="axes",
            fontproperties={"size": "small"},
        )  # fmt: skip
        ax.set_aspect("equal")
        ax.set_xlim(0, columns)
        ax.set_ylim(rows, 0)
        ax.set_xlabel("$x$ (px)")
        if camera == 0:
            ax.set_ylabel("$y$ (px)")
        else:
            ax.tick_params(labelleft=False)
        letter(ax, "ab"[camera])
        ax.set_title(f"camera {camera}", fontsize="small", pad=3.0)


def _height(found: Calibration) -> float:
    columns, rows = found.rig.cameras[0].sensor or (1, 1)
    return 16.0 + COLUMN * 0.88 * rows / columns


KIND = FigureKind(
    name="calibration-residuals",
    width=PAGE,
    height=_height,
    caption=caption,
    panels=lambda found: [["camera 0", "camera 1"]],
    draw=draw,
)
