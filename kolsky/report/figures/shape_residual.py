"""Where and when the simulated outline differs from the measured one."""

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

from kolsky.inverse.result import Identification
from kolsky.report.figures.base import (
    COLUMN,
    MEASURED,
    MM,
    MS,
    UM,
    FigureKind,
    Panels,
    largest,
    say_empty,
    smooth_bar,
)


def caption(result: Identification) -> str:
    """What is seen."""
    outside = int((~result.comparison.inside).sum())
    counted = f"{outside} point{'' if outside == 1 else 's'} outside the model’s range"
    marks = f"crosses: {counted}, not counted" if outside else f"{counted}"
    return (
        "Simulated minus measured Z over height and time, one cell a measured point; the colour scale ends "
        f"at the 99th percentile of its size. Lines: the ends of the simulated specimen; {marks}."
    )


def cells(time: NDArray[np.float64], frame: NDArray[np.int64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rectangles half-way to the neighbours in time and height, shape [n, 4, 2], in the given units."""
    frames, first = np.unique(frame, return_index=True)
    step = float(np.median(np.diff(time[first]) / np.diff(frames))) if frames.size > 1 else 1e-5
    corners = np.empty((time.size, 4, 2))
    for number in frames:
        rows = np.flatnonzero(frame == number)
        rows = rows[np.argsort(y[rows])]
        gaps = np.diff(y[rows]) if rows.size > 1 else np.array([0.1 * abs(y[rows[0]])])
        low = y[rows] - 0.5 * np.concatenate([gaps[:1], gaps])
        high = y[rows] + 0.5 * np.concatenate([gaps, gaps[-1:]])
        if rows.size == 1:
            low, high = low[:1], high[:1]
        left, right = time[rows] - 0.5 * step, time[rows] + 0.5 * step
        loop = ((left, low), (right, low), (right, high), (left, high))
        corners[rows] = np.stack([np.stack(corner, axis=-1) for corner in loop], axis=1)
    return corners


def draw(result: Identification, panels: Panels) -> None:
    """Draw the map with its colour bar."""
    c, line, response, ax = result.comparison, result.comparison.centre_line, result.response, panels["map"]
    ax.set_xlabel("Time $t$ (ms)")
    ax.set_ylabel("Height $y$ (mm)")
    left_over = UM * (c.Z_model - line.Z)
    seen = c.inside & np.isfinite(left_over)
    limit = float(np.percentile(np.abs(left_over[seen]), 99.0)) if seen.any() else 1.0
    corners = cells(MS * line.time, line.frame, MM * line.y)[seen]
    # Edges in the colour of the face: without them viewers show white seams between the cells.
    mapped = PolyCollection(
        list(corners), array=left_over[seen], cmap="RdBu_r", edgecolors="face", linewidths=0.1
    )
    mapped.set_clim(-limit, limit)
    ax.add_collection(mapped)
    if not seen.any():
        say_empty(ax, "no simulated outline")
    if (~c.inside).any() and seen.any():
        ax.plot(MS * line.time[~c.inside], MM * line.y[~c.inside], "x", color=MEASURED, ms=1.6, mew=0.4)
    for end in (np.min, np.max):
        ax.plot(MS * response.surface_times, MM * end(response.surface_y[0], axis=1), color=MEASURED, lw=0.7)
    if line.time.size:
        ax.set_xlim(MS * line.time.min(), MS * line.time.max())
    ax.set_ylim(0.0, 1.03 * MM * max(largest(line.y, 1e-3), largest(response.surface_y, 1e-3)))
    figure = ax.get_figure()
    assert figure is not None  # an axes of a report always lies in one
    label = r"$Z_\mathrm{sim} - Z_\mathrm{meas}$ (µm)"
    smooth_bar(figure.colorbar(mapped, ax=ax, extend="both", label=label, pad=0.02))


KIND = FigureKind(
    name="shape-residual",
    width=COLUMN,
    height=lambda result: 62.0,
    caption=caption,
    panels=lambda result: [["map"]],
    draw=draw,
    applies=lambda result: result.comparison.centre_line.time.size > 0,
)
