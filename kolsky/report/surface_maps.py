"""Maps of measured fields over a picture of a camera."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps, colors
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from dic.outcome import PointOutcome
from kolsky.base.arrays import IntArray
from kolsky.report.picture_views import OUTCOME_COLOURS
from kolsky.report.scene.drawing import png_of
from kolsky.report.scene.scene_data import grid_triangles
from kolsky.shot.measured_points import OUTCOME, FieldOfPoints, MeasuredPoints

COLOURS = "viridis"
"""Colour map of fields, as in the figures of `dic.html`."""
SHARE = (1.0, 99.0)
"""Percentiles of the values at the limits of the colours. Outliers then do not reduce the contrast."""
LONGEST = 720
"""Longer side of a map over a picture [px]."""
FINEST = 4
"""Maximum number of map pixels along one pixel of the picture."""


def limits_of(field: FieldOfPoints) -> tuple[float, float]:
    """Limits of a field's colours over all frames. They are constant for a whole film."""
    known = field.values[np.isfinite(field.values)]
    if not known.size:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(known, SHARE))
    widened = 1e-9 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > widened else (low - 0.5, high + 0.5)


def scale_colours(name: str = COLOURS) -> list[str]:
    """Colours of a colour map from its lower to its upper end, as hexadecimal text."""
    return [colors.to_hex(c) for c in colormaps[name](np.linspace(0.0, 1.0, 24))]


def faces_of(points: MeasuredPoints, frame: int) -> IntArray:
    """Triangles between neighbouring points that are valid in a frame, shape [n, 3]."""
    triangles = grid_triangles(points.cell)
    return np.asarray(triangles[points.surface.valid[frame][triangles].all(axis=1)])


def map_png(
    points: MeasuredPoints,
    name: str,
    frame: int,
    *,
    camera: int = 0,
    shape: tuple[int, int],
    limits: tuple[float, float],
) -> bytes:
    """A field of one frame as a transparent PNG that covers a camera's picture.

    Values are interpolated linearly between neighbouring points with a value. A point without such neighbours
    is a dot. Outcomes are dots; lost points are at their last known place. ``name``: a key of
    ``points.fields``. ``shape``: rows and columns of the picture [px]. ``limits``: see `limits_of`.
    """
    rows, columns = shape
    factor = min(FINEST, max(1.0, LONGEST / max(shape)))
    figure = Figure(figsize=(columns * factor / 100.0, rows * factor / 100.0), dpi=100)
    canvas = FigureCanvasAgg(figure)
    figure.patch.set_alpha(0.0)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.axis("off")
    values, places = points.fields[name].values[frame], points.places(camera, frame)
    known = np.isfinite(values) & np.isfinite(places).all(axis=1)
    step = _step(points)
    dot = (0.72 * step * factor * 0.6) ** 2  # 72 points an inch of 100 px; 0.6 of the distance of points
    if name == OUTCOME:
        shades = [OUTCOME_COLOURS[PointOutcome(int(v))] for v in values[known]]
        x, y = places[known].T
        ax.scatter(x, y, c=shades, s=dot, lw=0.0)
    else:
        faces = faces_of(points, frame)
        faces = faces[known[faces].all(axis=1)]
        lone = known.copy()
        lone[faces.ravel()] = False
        style: dict[str, Any] = {"cmap": COLOURS, "vmin": limits[0], "vmax": limits[1]}
        if len(faces):
            x, y = np.where(known[:, None], places, 0.0).T
            ax.tripcolor(Triangulation(x, y, faces), np.where(known, values, 0.0), shading="gouraud", **style)
        x, y = places[lone].T
        ax.scatter(x, y, c=values[lone], s=dot, lw=0.0, **style)
    ax.set_xlim(-0.5, columns - 0.5)
    ax.set_ylim(rows - 0.5, -0.5)
    canvas.draw()
    return png_of(np.asarray(canvas.buffer_rgba()))


def _step(points: MeasuredPoints) -> float:
    """Distance of neighbouring points in the reference picture [px]."""
    if len(points.cell) < 2:
        return 1.0
    span, cells = np.ptp(points.reference, axis=0), np.ptp(points.cell, axis=0)
    return float(max(span / np.maximum(cells, 1)))
