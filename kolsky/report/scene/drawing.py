"""One picture: the half of the specimen behind a cut, its platens, measured points, the measured body beside it.

Axes as everywhere: x across, y along the axis, Z toward the cameras. The half x <= 0 is kept, seen from the
front and the right, so that both the cut and the surface that the cameras saw are in view.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kolsky.report.scene.fields import FIELDS
from kolsky.report.scene.stage import Stage

FloatArray = NDArray[np.float64]

TURNS = 61
"""Angles of half a turn."""
PLATEN, PLATEN_THICKNESS = 1.15, 0.07
"""Radius of a platen over the specimen's largest, and its thickness over that."""
ASIDE = 2.6
"""Distance of the measured body from the simulated one over the largest radius."""
PAPER, STEEL, MEASURED = "#FFFFFF", "#9AA0A6", "#D9D9D9"
POINT = "#D55E00"


def picture(
    stage: Stage, k: int, *, size: tuple[int, int] = (1000, 700), bar: bool = True
) -> NDArray[np.uint8]:
    """Render the specimen at one time.

    Parameters
    ----------
    stage
        What to show.
    k
        Number of the picture in ``stage.times``.
    size
        Width and height [px].
    bar
        Whether to add the colour bar and the time.

    Returns
    -------
    image
        RGB, shape [height, width, 3].

    Raises
    ------
    IndexError
        If there is no such time.
    """
    pyvista = headless()
    if not 0 <= k < len(stage.times):
        raise IndexError(f"there are pictures 0 to {len(stage.times) - 1}, not {k}")
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="three lights")
    try:
        _fill(plotter, pyvista, stage, k, bar)
        return np.asarray(plotter.screenshot(return_img=True))[..., :3]
    finally:
        plotter.close()


def headless() -> Any:
    """PyVista, rendering into memory; without a display VTK must not look for one."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")
    import pyvista

    return pyvista


def _fill(plotter: Any, pyvista: Any, stage: Stage, k: int, bar: bool) -> None:
    kind = FIELDS[stage.field]
    radius, top = float(stage.nodes[..., 0].max()), float(stage.nodes[..., 1].max())
    plotter.set_background(PAPER)
    body = simulated(pyvista, stage, k)
    plotter.add_mesh(
        body,
        scalars="field",
        clim=stage.limits,
        cmap=kind.colours,
        smooth_shading=True,
        split_sharp_edges=True,
        show_scalar_bar=False,
        specular=0.2,
    )
    for platen in _platens(pyvista, radius, stage.nodes[k][stage.mesh.upper_face, 1].mean()):
        plotter.add_mesh(platen, color=STEEL, opacity=0.45, smooth_shading=True, split_sharp_edges=True)
    y, Z = stage.outline(k)
    if y.size > 1:
        shift = np.array([-ASIDE * radius, 0.0, 0.0])
        beside = revolved(pyvista, np.column_stack([Z, y]), np.linspace(0.0, 2.0 * np.pi, 2 * TURNS - 1))
        plotter.add_mesh(beside.translate(shift), color=MEASURED, smooth_shading=True, specular=0.1)
        dots = _proud(stage.points(k), 0.004 * radius)
        plotter.add_points(dots, color=POINT, point_size=5.0, render_points_as_spheres=True)
        plotter.add_points(dots + shift, color=POINT, point_size=5.0, render_points_as_spheres=True)
    if bar:
        plotter.add_scalar_bar(
            title=kind.label, vertical=True, position_x=0.86, position_y=0.2, height=0.6, width=0.06,
            color="black", title_font_size=16, label_font_size=14, n_labels=5, fmt="%.3g", font_family="arial",
        )  # fmt: skip
        plotter.add_text(f"{1e3 * stage.times[k]:.3f} ms", position="upper_left", color="black", font_size=12)
    _look(plotter, radius, top, beside=y.size > 1)


def _look(plotter: Any, radius: float, top: float, *, beside: bool) -> None:
    """A parallel view that is the same for every time."""
    middle = np.array([-0.5 * ASIDE * radius if beside else 0.0, 0.5 * top, 0.0])
    azimuth, elevation = np.radians(38.0), np.radians(18.0)
    way = np.array(
        [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
    )
    plotter.camera_position = [(middle + 20.0 * radius * way).tolist(), middle.tolist(), (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    width, height = plotter.window_size
    half = PLATEN * radius + (0.5 * ASIDE * radius if beside else 0.0)
    plotter.camera.parallel_scale = 1.08 * max(
        0.5 * top + 0.45 * PLATEN * radius, half * np.cos(azimuth) * height / width + 0.1 * radius
    )


def simulated(pyvista: Any, stage: Stage, k: int) -> Any:
    """Cut plane and skin of the half x <= 0, with the point data "field"."""
    mesh, nodes, values = stage.mesh, stage.nodes[k], stage.values[k]
    zero = np.zeros(len(nodes))
    front = np.column_stack([zero, nodes[:, 1], nodes[:, 0]])
    behind = np.column_stack([zero, nodes[:, 1], -nodes[:, 0]])
    quads = np.column_stack([np.full(mesh.n_elements, 4), mesh.quads]).ravel()
    cut = pyvista.PolyData(np.vstack([front, behind]), faces=np.concatenate([quads, _shifted(quads, len(nodes))]))
    cut.point_data["field"] = np.tile(values, 2)
    skin = np.concatenate([mesh.lower_face, mesh.side[1:-1], mesh.upper_face[::-1]])
    angles = np.linspace(0.0, np.pi, TURNS)
    shell = revolved(pyvista, nodes[skin], angles)
    shell.point_data["field"] = np.tile(values[skin], TURNS)
    return cut.append_polydata(shell)


def revolved(pyvista: Any, line: FloatArray, angles: FloatArray) -> Any:
    """The surface that a line (r, y), shape [n, 2], sweeps; angle 0 is toward the cameras, then x < 0."""
    n = len(line)
    r, y = line.T
    x, Z = -np.sin(angles)[:, None] * r, np.cos(angles)[:, None] * r
    points = np.stack([x, np.broadcast_to(y, x.shape), Z], axis=-1).reshape(-1, 3)
    first = (n * np.arange(len(angles) - 1)[:, None] + np.arange(n - 1)).ravel()
    faces = np.column_stack([np.full(first.size, 4), first, first + 1, first + n + 1, first + n])
    return pyvista.PolyData(points, faces=faces.ravel())


def _shifted(faces: NDArray[np.int64], by: int) -> NDArray[np.int64]:
    """Faces [4, a, b, c, d, 4, ...] of the same shape, their corners numbered later."""
    table = faces.reshape(-1, 5).copy()
    table[:, 1:] += by
    return table.ravel()


def _platens(pyvista: Any, radius: float, top: float) -> list[Any]:
    thick = PLATEN_THICKNESS * radius
    return [
        pyvista.Cylinder(
            center=(0.0, height, 0.0), direction=(0, 1, 0), radius=PLATEN * radius, height=thick, resolution=120
        )
        for height in (-0.5 * thick, top + 0.5 * thick)
    ]


def _proud(points: FloatArray, by: float) -> FloatArray:
    """Points lifted off the surface by a little, so that it does not hide them."""
    across = np.hypot(points[:, 0], points[:, 2])
    factor = 1.0 + by / np.where(across > 0.0, across, np.inf)
    return np.column_stack([factor * points[:, 0], points[:, 1], factor * points[:, 2]])
