"""Measured and simulated outline of the specimen at six times."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import (
    GREY,
    MEASURED,
    MM,
    MODEL,
    MS,
    PAGE,
    UM,
    FigureKind,
    Panels,
    largest,
    letter,
)

COUNT = 6


def chosen_frames(result: Identification) -> NDArray[np.int64]:
    """Frame numbers at equal distances through the window, the last one included, shape [<= 6]."""
    frames = np.unique(result.comparison.centre_line.frame)
    if frames.size <= COUNT:
        return frames
    return frames[np.round(np.arange(1, COUNT + 1) * (frames.size - 1) / COUNT).astype(int)]


def caption(result: Identification) -> str:
    """What is seen."""
    return (
        "Outline of the specimen on the camera side at six times: measured points with ±2σ and the simulated "
        "side surface (top); ΔZ, simulated minus measured Z of the same points, with ±2σ (bottom). y is the "
        "height above the transmission platen."
    )


def draw(result: Identification, panels: Panels) -> None:
    """Draw the overlay above the residual, a column a time."""
    c, line, response = result.comparison, result.comparison.centre_line, result.response
    frames = chosen_frames(result)
    left_over = UM * (c.Z_model - line.Z)
    shown = MM * np.concatenate([line.Z, c.Z_model[c.inside]])
    limits = (shown.min() - 0.3, shown.max() + 0.3) if shown.size else (0.0, 1.0)
    reach = 1.15 * largest((np.abs(left_over) + 2.0 * UM * line.sigma)[np.isin(line.frame, frames)])
    for column in range(COUNT):
        top, low = panels[f"outline {column}"], panels[f"residual {column}"]
        top.set_xlabel("$Z$ (mm)")
        low.set_xlabel(r"$\Delta Z$ (µm)")
        top.set_xlim(*limits)
        low.axvline(0.0, color=GREY, lw=0.5)
        low.set_xlim(-reach, reach)
        for ax in (top, low):
            if column == 0:
                ax.set_ylabel("Height $y$ (mm)")
            else:
                ax.tick_params(labelleft=False)
        if column >= frames.size:
            continue
        rows = line.frame == frames[column]
        time = line.time[rows][0]
        letter(top, f"{'abcdef'[column]}")
        top.text(0.95, 0.965, f"{MS * time:.2f} ms", transform=top.transAxes, ha="right", va="top")
        # The model's outline is drawn where it was sampled at the frame's time; the rest is for the points.
        nearest = int(np.argmin(np.abs(response.surface_times - time)))
        if abs(response.surface_times[nearest] - time) < 1e-9:
            r, y = response.surface_r[0, nearest], response.surface_y[0, nearest]
            top.plot(MM * r, MM * y, color=MODEL, label="simulated")
        else:
            order = np.argsort(line.y[rows])
            top.plot(MM * c.Z_model[rows][order], MM * line.y[rows][order], color=MODEL, label="simulated")
        style: dict[str, Any] = {"fmt": "o", "color": MEASURED, "ms": 1.8, "mew": 0.0, "elinewidth": 0.6}
        y = MM * line.y[rows]
        top.errorbar(MM * line.Z[rows], y, xerr=2.0 * MM * line.sigma[rows], label="measured", **style)
        low.errorbar(left_over[rows], y, xerr=2.0 * UM * line.sigma[rows], **style)
    # The specimen is flattest in the last picture: that panel has room above it.
    panels[f"outline {max(frames.size, 1) - 1}"].legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))


KIND = FigureKind(
    name="profiles",
    width=PAGE,
    height=lambda result: 105.0,
    caption=caption,
    panels=lambda result: [[f"{row} {column}" for column in range(COUNT)] for row in ("outline", "residual")],
    draw=draw,
    mosaic={"sharey": True, "height_ratios": [1.25, 1.0]},
    applies=lambda result: result.comparison.centre_line.time.size > 0,
)
