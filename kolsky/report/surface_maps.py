"""Maps of measured fields: over a picture of a camera, and on the surface in space (PyVista)."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from threading import Lock
from typing import Any

import numpy as np
from matplotlib import colormaps, colors
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from dic.outcome import PointOutcome
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.report.picture_views import OUTCOME_COLOURS
from kolsky.report.scene.drawing import offscreen_pyvista, pixels_of, plotting
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
SPACE_SIZE = (640, 480)
"""Width and height of a picture of the surface in space [px]."""
_DRAWING = Lock()
"""VTK draws one picture at a time."""


@dataclass(frozen=True)
class View:
    """Direction from the surface to the eye, as angles from Z [°]. Z points toward the cameras."""

    azimuth: float = 30.0
    """Rotation about y toward x [°]."""
    elevation: float = 20.0
    """Angle above the plane of x and Z [°]."""


def limits_of(field: FieldOfPoints) -> tuple[float, float]:
    """Limits of a field's colours over all frames. They are constant for a whole film."""
    known = field.values[np.isfinite(field.values)]
    if not known.size:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(known, SHARE))
    widened = 1e-9 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > widened else (low - 0.5, high + 0.5)


def scale_colours() -> list[str]:
    """Colours of a scale from its lower to its upper end, as hexadecimal text."""
    return [colors.to_hex(c) for c in colormaps[COLOURS](np.linspace(0.0, 1.0, 24))]


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
    return _png(np.asarray(canvas.buffer_rgba()))


def _step(points: MeasuredPoints) -> float:
    """Distance of neighbouring points in the reference picture [px]."""
    if len(points.cell) < 2:
        return 1.0
    span, cells = np.ptp(points.reference, axis=0), np.ptp(points.cell, axis=0)
    return float(max(span / np.maximum(cells, 1)))


def _png(pixels: NDArray[np.uint8]) -> bytes:
    import matplotlib.image

    file = BytesIO()
    matplotlib.image.imsave(file, pixels, format="png")
    return file.getvalue()


def space_png(
    points: MeasuredPoints,
    name: str,
    frame: int,
    *,
    limits: tuple[float, float],
    view: View = View(),
    chosen: int | None = None,
) -> bytes:
    """The surface of one frame in space with a field on it, and the reference as a wire mesh, as PNG.

    ``chosen``: a point to mark. Raises `kolsky.report.scene.drawing.CannotRender` if VTK cannot render here.
    """
    pyvista = offscreen_pyvista()
    with _DRAWING, plotting(pyvista, SPACE_SIZE) as plotter:
        _fill(plotter, pyvista, points, name, frame, limits, chosen)
        _look(plotter, points, view)
        return _png(pixels_of(plotter))


def positions_of(points: MeasuredPoints, frame: int | None) -> FloatArray:
    """Positions in space, y up, in the displayed unit; NaN for lost points.

    With None, the positions of the reference.
    """
    factor, _ = points.length
    X = points.surface.X if frame is None else points.surface.position[frame]
    if frame is not None:
        X = np.where(points.surface.valid[frame][:, None], X, np.nan)
    return np.asarray(factor * X * ([1.0, -1.0, 1.0] if points.plane else [1.0, 1.0, 1.0]))


def _fill(plotter, pyvista, points, name, frame, limits, chosen) -> None:  # type: ignore[no-untyped-def]
    """Add wire mesh, surface and chosen point to a picture; PyVista has no types."""
    at_reference, now = positions_of(points, None), positions_of(points, frame)
    whole, faces = grid_triangles(points.cell), faces_of(points, frame)
    values = points.fields[name].values[frame]
    if len(whole):
        net = pyvista.PolyData(at_reference, faces=np.column_stack([np.full(len(whole), 3), whole]).ravel())
        plotter.add_mesh(net, style="wireframe", color="#c9c9c9", line_width=1, lighting=False)
    finite = np.asarray(np.isfinite(now).all(axis=1))
    style = {"cmap": COLOURS, "clim": limits, "show_scalar_bar": False, "nan_color": "#e6e6e6"}
    if name == OUTCOME:
        shades = np.array([colors.to_rgb(OUTCOME_COLOURS[PointOutcome(int(v))]) for v in values])
        places = np.where(finite[:, None], now, at_reference)  # a lost point at its reference place
        cloud = pyvista.PolyData(places)
        cloud.point_data["colour"] = (255 * shades).astype(np.uint8)
        plotter.add_mesh(cloud, scalars="colour", rgb=True, point_size=7, render_points_as_spheres=True)
    elif len(faces):
        mesh = pyvista.PolyData(
            np.where(finite[:, None], now, at_reference),
            faces=np.column_stack([np.full(len(faces), 3), faces]).ravel(),
        )
        mesh.point_data["field"] = values
        plotter.add_mesh(mesh, scalars="field", ambient=0.35, specular=0.0, **style)
    if chosen is not None and finite[chosen]:
        plotter.add_points(now[[chosen]], color="#d55e00", point_size=14, render_points_as_spheres=True)
    plotter.add_axes(xlabel="x", ylabel="y", zlabel="Z", color="#1a1a1a", line_width=3)


def _look(plotter, points: MeasuredPoints, view: View) -> None:  # type: ignore[no-untyped-def]
    """Set the camera of a picture. The surface fits into the picture of every frame at one scale."""
    a, e = np.radians(view.azimuth), np.radians(view.elevation)
    eye = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    frames = range(0, points.surface.n_frames, max(1, points.surface.n_frames // 20))
    places = np.vstack([positions_of(points, frame) for frame in (None, *frames)])
    places = places[np.asarray(np.isfinite(places).all(axis=1))]
    axes = np.column_stack([right, np.cross(eye, right)])
    flat = places @ axes
    low, high = flat.min(axis=0), flat.max(axis=0)
    centre = places.mean(axis=0)
    middle = centre + axes @ (0.5 * (low + high) - centre @ axes)
    width, height = plotter.window_size
    distance = 10.0 * float(np.ptp(places, axis=0).max() or 1.0)
    plotter.camera_position = [(middle + distance * eye).tolist(), middle.tolist(), (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 0.55 * float(max(high[1] - low[1], (high[0] - low[0]) * height / width))
