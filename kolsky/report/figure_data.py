"""Data of a figure as a CSV table, read from the drawn artists, so that the two cannot differ.

One row per point: panel, the quantities of the axes with their units, the label of the series, its kind, x, y
and, for colours and arrows, a value. Guides across a whole panel and camera pictures are no data and are left
out.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PathCollection, QuadMesh
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, StepPatch
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

from kolsky.base.files import write_table

Points = tuple[str, NDArray[Any], NDArray[Any], NDArray[Any] | None]
"""Kind, x, y and values of an artist."""
COLUMNS = ("panel", "x axis", "y axis", "series", "kind", "x", "y", "value", "value axis")
PICTURES = frozenset({"gray", "grey", "Greys_r"})
"""Colour maps of camera pictures, which are no data of a figure."""


def write_data(path: Path, figure: Figure) -> Path:
    """Write the data of a figure, one row per point; an older file is replaced by the complete new one."""
    rows = list(_rows(figure))
    return write_table(path, {name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)})


def _rows(figure: Figure) -> Iterator[tuple[Any, ...]]:
    for number, ax in enumerate(figure.axes, start=1):
        panel = str(ax.get_label() or number)
        if panel == "<colorbar>":
            continue
        axes = ax.get_xlabel(), ax.get_ylabel()
        for count, artist in enumerate(_artists(ax), start=1):
            label = str(artist.get_label())
            series = f"{count}" if label.startswith("_") or not label else label
            bar = getattr(artist, "colorbar", None)
            third = "" if bar is None else bar.ax.get_ylabel() or bar.ax.get_xlabel()
            for kind, x, y, value in _points(artist, ax):
                values = [""] * len(x) if value is None else _plain(value)
                for row in zip(_plain(x), _plain(y), values, strict=True):
                    yield (panel, *axes, series, kind, *row, third)


def _artists(ax: Axes) -> list[Artist]:
    drawn = [*ax.lines, *ax.collections, *ax.images, *ax.patches]
    return [artist for artist in drawn if artist.get_visible()]


def _points(artist: Any, ax: Axes) -> Iterator[Points]:
    """Yield the points of an artist that is drawn in data coordinates."""
    match artist:
        case Line2D() if artist.get_transform() == ax.transData:
            yield "line", np.asarray(artist.get_xdata()), np.asarray(artist.get_ydata()), None
        case AxesImage() if np.asarray(artist.get_array()).ndim == 2 and artist.cmap.name not in PICTURES:
            yield _image(artist)
        case QuadMesh():
            corners = np.asarray(artist.get_coordinates())
            centres = 0.25 * (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1])
            yield "map", centres[..., 0].ravel(), centres[..., 1].ravel(), _flat(artist.get_array())
        case ContourSet():
            for level, path in zip(artist.levels, artist.get_paths(), strict=False):
                x, y = np.asarray(path.vertices).reshape(-1, 2).T
                yield "contour", x, y, np.full(len(x), level)
        case Quiver():
            x, y = np.asarray(artist.get_offsets()).T
            yield "arrow, x part", x, y, np.ravel(artist.U)
            yield "arrow, y part", x, y, np.ravel(artist.V)
        case PathCollection() if artist.get_offset_transform() == ax.transData:
            x, y = np.asarray(artist.get_offsets()).T
            values = artist.get_array()
            yield "points", x, y, None if values is None else _flat(values)
        case Collection() if artist.get_transform() == ax.transData:
            values = artist.get_array()
            colours = _flat([] if values is None else values)
            for number, path in enumerate(artist.get_paths()):
                x, y = np.asarray(path.vertices).reshape(-1, 2).T
                yield "outline", x, y, np.full(len(x), colours[number]) if number < len(colours) else None
        case StepPatch():
            heights, edges, _ = artist.get_data()
            yield "step", np.asarray(edges)[:-1], np.asarray(heights), None
        case Patch() if artist.get_data_transform() == ax.transData:
            x, y = artist.get_patch_transform().transform(artist.get_path().vertices).T
            yield "outline", x, y, None


def _image(artist: Any) -> Points:
    """Return an image as values at the centres of its cells."""
    values: NDArray[Any] = np.ma.filled(np.ma.asarray(artist.get_array(), dtype=float), np.nan)
    left, right, bottom, top = artist.get_extent()
    if artist.origin == "upper":
        bottom, top = top, bottom
    rows, columns = values.shape[:2]
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
    xx, yy = np.meshgrid(x, y)
    return "map", xx.ravel(), yy.ravel(), values.reshape(rows * columns, -1)[:, 0]


def _flat(values: Any) -> NDArray[Any]:
    return np.ravel(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan))


def _plain(values: NDArray[Any]) -> list[Any]:
    return [float(value) for value in _flat(values)]
