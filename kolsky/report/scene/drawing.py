"""Picture of the specimen cut in half between its platens, rendered by PyVista.

For the report, and the stills and films of `kolsky film`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kolsky.base.process import run_program
from kolsky.report.scene.scene_data import (
    EYE,
    FIELDS,
    PLATEN,
    RIGHT,
    SIDE_DISTANCE,
    Scene,
    Surface,
    lifted,
    measured_body,
    platens,
    simulated,
)

SIZE = (1008, 560)
"""Width and height of a picture [px]; multiples of 16, as video codecs require."""
MARGIN = 0.18
"""Share of the half-width left for the colour bar."""
PAPER, STEEL, MEASURED = "#FFFFFF", "#9AA0A6", "#D9D9D9"
POINT = "#D55E00"
POINT_SIZE = 12.0
"""Of a measured point [px] of the picture before it is halved against jagged edges."""
LONGEST_TRIAL = 120.0
"""Time that VTK has to show that it can render [s]."""


def picture(scene: Scene, k: int, *, size: tuple[int, int] = SIZE, bar: bool = True) -> NDArray[np.uint8]:
    """Render the specimen at one time.

    ``k``: index into ``scene.times``; IndexError if there is no such time. ``size``: width and height [px].
    Returns: RGB, shape [height, width, 3].
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
        plotter.enable_anti_aliasing("ssaa")
        _fill(plotter, pyvista, scene, k, bar)
        return np.asarray(plotter.screenshot(return_img=True))[..., :3]
    finally:
        plotter.close()


class CannotRender(RuntimeError):
    """PyVista is not installed, or VTK cannot render on this machine."""


def offscreen_pyvista() -> Any:
    """Return PyVista, checked to render into memory.

    Raises CannotRender if PyVista is not installed, or VTK finds neither a display nor EGL nor OSMesa.
    """
    require_pyvista()
    if not renders():
        raise CannotRender(
            "VTK finds neither a display nor EGL nor OSMesa to draw with; install one (Debian: libegl1)"
        )
    return _silent_pyvista()


def require_pyvista() -> None:
    """Refuse if PyVista is not installed."""
    try:
        import pyvista  # noqa: F401
    except ImportError:
        raise CannotRender("pictures of the scene need PyVista: pip install pyvista") from None


def _silent_pyvista() -> Any:
    """Return PyVista with the messages of VTK about displays switched off."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    return pyvista


@cache
def renders() -> bool:
    """Return True if this machine can render; tried in a separate process, because VTK may crash."""
    trial = Path(__file__).with_name("render_trial.py")
    return run_program(trial, timeout=LONGEST_TRIAL).returncode == 0


def _fill(plotter: Any, pyvista: Any, scene: Scene, k: int, bar: bool) -> None:
    kind = FIELDS[scene.field]
    radius, top = float(scene.nodes[..., 0].max()), float(scene.nodes[..., 1].max())
    plotter.set_background(PAPER)
    drawn = plotter.add_mesh(
        _mesh(pyvista, simulated(scene, k)),
        scalars="field",
        clim=scene.limits,
        cmap=kind.colours,
        smooth_shading=True,
        split_sharp_edges=True,
        show_scalar_bar=False,
        ambient=0.6,  # with the diffuse light of a face toward the eye 1: the colours of the scale
        diffuse=0.45,
    )
    for platen in platens(radius, scene.nodes[k][scene.mesh.upper_face, 1].mean()):
        plotter.add_mesh(
            _mesh(pyvista, platen), color=STEEL, opacity=0.5, smooth_shading=True, split_sharp_edges=True
        )
    beside = measured_body(scene, k)
    if beside is not None:
        plotter.add_mesh(_mesh(pyvista, beside), color=MEASURED, smooth_shading=True, ambient=0.3)
        dots = lifted(scene.points_at(k), 0.004 * radius)
        shift = np.array([-SIDE_DISTANCE * radius, 0.0, 0.0])
        plotter.add_points(dots, color=POINT, point_size=POINT_SIZE, render_points_as_spheres=True)
        plotter.add_points(dots + shift, color=POINT, point_size=POINT_SIZE, render_points_as_spheres=True)
    if bar:
        plotter.add_scalar_bar(
            title=f"{kind.label}\n", mapper=drawn.mapper, vertical=True, position_x=0.89, position_y=0.15,
            height=0.7, width=0.05, color="black", title_font_size=16, label_font_size=15, n_labels=5,
            fmt="%.2f", font_family="arial",
        )  # fmt: skip
        plotter.add_text(f"{1e3 * scene.times[k]:.3f} ms", position="upper_left", color="black", font_size=12)
    _set_camera(plotter, radius, top, beside=beside is not None)


def _set_camera(plotter: Any, radius: float, top: float, *, beside: bool) -> None:
    """Set a parallel projection, the same at all times, with room for the colour bar at the right."""
    left_end = -SIDE_DISTANCE * radius * RIGHT[0] - radius if beside else -PLATEN * radius
    across = 0.5 * (PLATEN * radius - left_end)
    width, height = plotter.window_size
    middle = (0.5 * (PLATEN * radius + left_end) + MARGIN * across) * RIGHT + [0.0, 0.5 * top, 0.0]
    plotter.camera_position = [(middle + 20.0 * radius * EYE).tolist(), middle.tolist(), (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = max(
        0.55 * top + PLATEN * radius * EYE[1], (1.0 + 1.6 * MARGIN) * across * height / width
    )


def _mesh(pyvista: Any, surface: Surface) -> Any:
    """A surface as PyVista's."""
    faces = np.column_stack([np.full(len(surface.faces), 4), surface.faces]).ravel()
    mesh = pyvista.PolyData(surface.points, faces=faces)
    if surface.values is not None:
        mesh.point_data["field"] = surface.values
    return mesh
