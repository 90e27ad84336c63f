"""Picture of the specimen cut in half between its platens, measured points on it, measured body beside it.

Axes: x across, y along the axis, Z toward the cameras. The half x <= 0 is drawn, seen from the front right,
so that both the cut and the surface that the cameras saw are in view.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.report.scene.fields import FIELDS
from kolsky.report.scene.scene_data import Scene

TURNS = 61
"""Angular divisions of half a revolution, ends included."""
SIZE = (1008, 560)
"""Width and height of a picture [px]; multiples of 16, as video codecs require."""
PLATEN, PLATEN_THICKNESS = 1.15, 0.07
"""Radius of a platen over the specimen's largest, and its thickness over that."""
ASIDE = 2.9
"""Distance of the measured body from the simulated one over the largest radius."""
MARGIN = 0.18
"""Share of the half-width left for the colour bar."""
PAPER, STEEL, MEASURED = "#FFFFFF", "#9AA0A6", "#D9D9D9"
POINT = "#D55E00"


def picture(scene: Scene, k: int, *, size: tuple[int, int] = SIZE, bar: bool = True) -> NDArray[np.uint8]:
    """Render the specimen at one time.

    Parameters
    ----------
    scene
        Simulation to show.
    k
        Index into ``scene.times``.
    size
        Width and height [px].
    bar
        Add the colour bar and the time.

    Returns
    -------
    image
        RGB, shape [height, width, 3].

    Raises
    ------
    IndexError
        If there is no such time.
    """
    return render(offscreen_pyvista(), scene, k, size=size, bar=bar)


def render(
    pyvista: Any, scene: Scene, k: int, *, size: tuple[int, int] = SIZE, bar: bool = True
) -> NDArray[np.uint8]:
    """Render with the given PyVista, see `silent_pyvista`; where VTK cannot draw, the process may crash."""
    if not 0 <= k < len(scene.times):
        raise IndexError(f"there are pictures 0 to {len(scene.times) - 1}, not {k}")
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    try:
        _fill(plotter, pyvista, scene, k, bar)
        return np.asarray(plotter.screenshot(return_img=True))[..., :3]
    finally:
        plotter.close()


class CannotRender(RuntimeError):
    """VTK cannot render on this machine."""


def offscreen_pyvista() -> Any:
    """Return PyVista, checked to render into memory.

    Raises
    ------
    CannotRender
        If VTK finds neither a display nor EGL nor OSMesa.
    """
    if not renders():
        raise CannotRender(
            "VTK finds neither a display nor EGL nor OSMesa to draw with; install one (Debian: libegl1)"
        )
    return silent_pyvista()


def silent_pyvista() -> Any:
    """Return PyVista with the messages of VTK about displays switched off."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    return pyvista


@cache
def renders() -> bool:
    """Return True if this machine can render; tried in a separate process, because VTK may crash."""
    trial = (
        "import pyvista; p = pyvista.Plotter(off_screen=True); p.add_mesh(pyvista.Sphere()); p.screenshot()"
    )
    ended = subprocess.run([sys.executable, "-c", trial], capture_output=True, timeout=120)
    return ended.returncode == 0


def _fill(plotter: Any, pyvista: Any, scene: Scene, k: int, bar: bool) -> None:
    kind = FIELDS[scene.field]
    radius, top = float(scene.nodes[..., 0].max()), float(scene.nodes[..., 1].max())
    plotter.set_background(PAPER)
    body = simulated(pyvista, scene, k)
    drawn = plotter.add_mesh(
        body,
        scalars="field",
        clim=scene.limits,
        cmap=kind.colours,
        smooth_shading=True,
        split_sharp_edges=True,
        show_scalar_bar=False,
        specular=0.15,
        ambient=0.25,
    )
    for platen in _platens(pyvista, radius, scene.nodes[k][scene.mesh.upper_face, 1].mean()):
        plotter.add_mesh(platen, color=STEEL, opacity=0.5, smooth_shading=True, split_sharp_edges=True)
    y, Z = scene.outline_at(k)
    if y.size > 1:
        shift = np.array([-ASIDE * radius, 0.0, 0.0])
        beside = revolved(pyvista, np.column_stack([Z, y]), np.linspace(0.0, 2.0 * np.pi, 2 * TURNS - 1))
        plotter.add_mesh(beside.translate(shift), color=MEASURED, smooth_shading=True, ambient=0.3)
        dots = _lifted(scene.points_at(k), 0.004 * radius)
        plotter.add_points(dots, color=POINT, point_size=5.0, render_points_as_spheres=True)
        plotter.add_points(dots + shift, color=POINT, point_size=5.0, render_points_as_spheres=True)
    if bar:
        plotter.add_scalar_bar(
            title=f"{kind.label}\n", mapper=drawn.mapper, vertical=True, position_x=0.89, position_y=0.15,
            height=0.7, width=0.05, color="black", title_font_size=16, label_font_size=15, n_labels=5,
            fmt="%.2f", font_family="arial",
        )  # fmt: skip
        plotter.add_text(f"{1e3 * scene.times[k]:.3f} ms", position="upper_left", color="black", font_size=12)
    _set_camera(plotter, radius, top, beside=y.size > 1)


def _set_camera(plotter: Any, radius: float, top: float, *, beside: bool) -> None:
    """Set a parallel projection, the same at all times, with room for the colour bar at the right."""
    azimuth, elevation = np.radians(40.0), np.radians(18.0)
    right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
    way = np.array(
        [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
    )
    left_end = -ASIDE * radius * right[0] - radius if beside else -PLATEN * radius
    across = 0.5 * (PLATEN * radius - left_end)
    width, height = plotter.window_size
    middle = (0.5 * (PLATEN * radius + left_end) + MARGIN * across) * right + [0.0, 0.5 * top, 0.0]
    plotter.camera_position = [(middle + 20.0 * radius * way).tolist(), middle.tolist(), (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = max(
        0.55 * top + PLATEN * radius * np.sin(elevation), (1.0 + 1.6 * MARGIN) * across * height / width
    )


def simulated(pyvista: Any, scene: Scene, k: int) -> Any:
    """Cut plane and outer surface of the half x <= 0, with the point data "field"."""
    mesh, nodes, values = scene.mesh, scene.nodes[k], scene.values[k]
    zero = np.zeros(len(nodes))
    front = np.column_stack([zero, nodes[:, 1], nodes[:, 0]])
    behind = np.column_stack([zero, nodes[:, 1], -nodes[:, 0]])
    quads = np.column_stack([np.full(len(mesh.quads), 4), mesh.quads]).ravel()
    both = np.concatenate([quads, _shifted(quads, len(nodes))])
    cut = pyvista.PolyData(np.vstack([front, behind]), faces=both)
    cut.point_data["field"] = np.tile(values, 2)
    skin = np.concatenate([mesh.lower_face, mesh.side[1:-1], mesh.upper_face[::-1]])
    angles = np.linspace(0.0, np.pi, TURNS)
    shell = revolved(pyvista, nodes[skin], angles)
    shell.point_data["field"] = np.tile(values[skin], TURNS)
    return cut.append_polydata(shell)


def revolved(pyvista: Any, line: FloatArray, angles: FloatArray) -> Any:
    """Surface of revolution of a line (r, y), shape [n, 2]; angle 0 is toward the cameras, then x < 0."""
    n = len(line)
    r, y = line.T
    x, Z = -np.sin(angles)[:, None] * r, np.cos(angles)[:, None] * r
    points = np.stack([x, np.broadcast_to(y, x.shape), Z], axis=-1).reshape(-1, 3)
    first = (n * np.arange(len(angles) - 1)[:, None] + np.arange(n - 1)).ravel()
    faces = np.column_stack([np.full(first.size, 4), first, first + 1, first + n + 1, first + n])
    return pyvista.PolyData(points, faces=faces.ravel())


def _shifted(faces: NDArray[np.int64], by: int) -> NDArray[np.int64]:
    """Faces [4, a, b, c, d, 4, ...] with a constant added to the number of every corner."""
    table = faces.reshape(-1, 5).copy()
    table[:, 1:] += by
    return table.ravel()


def _platens(pyvista: Any, radius: float, top: float) -> list[Any]:
    """Halves of both platens behind the cut."""
    thick, R = PLATEN_THICKNESS * radius, PLATEN * radius
    angles = np.linspace(0.0, np.pi, TURNS)
    halves = []
    for low in (-thick, top):
        line = np.array([[0.0, low], [R, low], [R, low + thick], [0.0, low + thick]])
        wall = pyvista.PolyData(
            np.array([[0.0, y, sign * r] for sign in (1.0, -1.0) for r, y in line]),
            faces=[4, 0, 1, 2, 3, 4, 4, 5, 6, 7],
        )
        halves.append(wall.append_polydata(revolved(pyvista, line, angles)))
    return halves


def _lifted(points: FloatArray, by: float) -> FloatArray:
    """Points moved outward by `by` [m], so that the surface does not hide them."""
    across = np.hypot(points[:, 0], points[:, 2])
    factor = 1.0 + by / np.where(across > 0.0, across, np.inf)
    return np.column_stack([factor * points[:, 0], points[:, 1], factor * points[:, 2]])
