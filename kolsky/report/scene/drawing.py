"""Picture of the specimen cut in half between its platens, by PyVista; films and still pictures.

The pictures are for the report and for `kolsky film`. Every file is replaced when the new one is complete.
The cut in the plane is drawn as SVG, fast enough for a slider.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from dic.files import replacing
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
"""Size of a measured point [px], before the picture is halved for smooth edges."""
LONGEST_TRIAL = 120.0
"""Time limit for the rendering test of VTK [s]."""


def picture(scene: Scene, k: int) -> NDArray[np.uint8]:
    """Render the specimen at one time, as `render`."""
    return render(offscreen_pyvista(), scene, k)


def render(pyvista: Any, scene: Scene, k: int, *, bar: bool = True) -> NDArray[np.uint8]:
    """Render the specimen at time ``k`` of ``scene.times`` with the PyVista of `offscreen_pyvista`.

    ``bar``: True to draw the colour bar and the time. Returns: RGB, shape [height, width, 3]. Raises
    IndexError if there is no such time.
    """
    if not 0 <= k < len(scene.times):
        raise IndexError(f"there are pictures 0 to {len(scene.times) - 1}, not {k}")
    with plotting(pyvista, SIZE) as plotter:
        plotter.enable_anti_aliasing("ssaa")
        _fill(plotter, pyvista, scene, k, bar)
        return pixels_of(plotter)


@contextmanager
def plotting(pyvista: Any, size: tuple[int, int]) -> Iterator[Any]:
    """A plotter that draws on white into memory. ``size``: width and height [px]."""
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.set_background(PAPER)
        yield plotter
    finally:
        plotter.close()


def pixels_of(plotter: Any) -> NDArray[np.uint8]:
    """The picture of a plotter, RGB, shape [height, width, 3]."""
    return np.asarray(plotter.screenshot(return_img=True))[..., :3]


class CannotRender(RuntimeError):
    """VTK cannot render on this machine."""


def offscreen_pyvista() -> Any:
    """Return PyVista, checked to render into memory, without VTK's messages about displays.

    Raises CannotRender if VTK finds neither a display nor EGL nor OSMesa.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    if not renders():
        raise CannotRender(
            "VTK finds neither a display nor EGL nor OSMesa to draw with; install one (Debian: libegl1)"
        )
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    return pyvista


@cache
def renders() -> bool:
    """Return True if this machine can render. The test runs in a separate process, because VTK may crash."""
    trial = Path(__file__).with_name("render_trial.py")
    return run_program(trial, timeout=LONGEST_TRIAL).returncode == 0


def _fill(plotter: Any, pyvista: Any, scene: Scene, k: int, bar: bool) -> None:
    kind = FIELDS[scene.field]
    radius, top = float(scene.nodes[..., 0].max()), float(scene.nodes[..., 1].max())
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
    """Set a parallel projection with space for the colour bar at the right. It is the same at all times."""
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
    """A surface as a PyVista mesh."""
    faces = np.column_stack([np.full(len(surface.faces), 4), surface.faces]).ravel()
    mesh = pyvista.PolyData(surface.points, faces=faces)
    if surface.values is not None:
        mesh.point_data["field"] = surface.values
    return mesh


Progress = Callable[[int], None]
FILMS = ("mp4", "gif")
"""Formats of a film."""


def write_film(
    path: Path, scene: Scene, *, every: int = 1, rate: float = 25.0, progress: Progress = lambda n: None
) -> Path:
    """Write the deformation of ``scene`` as a film, with the arguments and errors of `write_frames`."""
    frames = range(len(scene.times))
    return write_frames(path, lambda k: picture(scene, k), frames, every=every, rate=rate, progress=progress)


def write_frames(
    path: Path,
    draw: Callable[[int], NDArray[np.uint8]],
    frames: Sequence[int],
    *,
    every: int = 1,
    rate: float = 25.0,
    progress: Progress = lambda n: None,
) -> Path:
    """Write pictures as a film.

    ``path``: its suffix gives the format, one of `FILMS`. ``draw``: returns the picture of a frame, shape
    [height, width, 3]. ``every``: take every n-th frame, starting with the first. ``rate``: frame rate of the
    film [1/s]. ``progress``: called with 1 after each picture. Raises ValueError if the format is unknown, or
    if `every` or `rate` is not positive.
    """
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in FILMS:
        raise ValueError(f"format {kind!r} is not one of {', '.join(FILMS)}")
    if every < 1 or not rate > 0.0:
        raise ValueError(f"every must be at least 1 and rate positive, got {every} and {rate}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial, _writer(partial, kind, rate) as film:
        for k in frames[::every]:
            film.append_data(draw(k))
            progress(1)
    return path


def write_stills(folder: Path, scene: Scene, count: int = 6) -> list[Path]:
    """Write `count` pictures at equal intervals of time as PNG files and return their paths."""
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    import matplotlib.image

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for k in evenly_spaced(len(scene.times), count):
        path = folder / f"still_{k:05d}.png"
        with replacing(path) as partial:
            matplotlib.image.imsave(partial, picture(scene, k), format="png")
        written.append(path)
    return written


def evenly_spaced(n: int, count: int) -> Sequence[int]:
    """Indices of `count` of n pictures at equal intervals, with the first and the last."""
    return sorted({int(k) for k in np.round(np.linspace(0, n - 1, min(count, n)))})


def _writer(path: Path, kind: str, rate: float) -> Any:
    """Open a film for writing."""
    import imageio.v2 as imageio

    if kind == "gif":
        return imageio.get_writer(path, format="GIF", mode="I", duration=1e3 / rate, loop=0)
    return imageio.get_writer(
        path, format="FFMPEG", mode="I", fps=rate, codec="libx264", pixelformat="yuv420p", quality=8
    )


WIDTH, HEIGHT = 480, 300
"""Size of the drawing [px]."""
INK = "#1a1a1a"


def cut_svg(scene: Scene, k: int) -> str:
    """The cut through the specimen at a time, coloured by its field, with the measured outline as dots."""
    nodes, values = 1e3 * scene.nodes[k], scene.values[k]
    low, high = scene.limits
    kind = FIELDS[scene.field]
    shade = colormaps[kind.colours]
    widest, tallest = 1e3 * scene.nodes[..., 0].max(), 1e3 * scene.nodes[..., 1].max()
    scale = min((WIDTH - 20) / (2.3 * widest), (HEIGHT - 78) / (1.16 * tallest))
    middle, floor = WIDTH / 2, HEIGHT - 58

    def at(r: float, y: float) -> str:
        return f"{middle + scale * r:.1f},{floor - scale * y:.1f}"

    parts = []
    for quad in scene.mesh.quads:
        share = (float(values[quad].mean()) - low) / (high - low)
        colour = _hex(shade(min(max(share, 0.0), 1.0), bytes=True))
        for side in (1.0, -1.0):
            corners = " ".join(at(side * r, y) for r, y in nodes[quad])
            parts.append(f'<polygon points="{corners}" fill="{colour}" stroke="{colour}" stroke-width=".6"/>')
    top, half = nodes[:, 1].max(), 1.15 * widest
    for y, thick in ((0.0, -0.05), (top, 0.05)):
        corners = " ".join(
            at(r, h)
            for r, h in ((-half, y), (half, y), (half, y + thick * tallest), (-half, y + thick * tallest))
        )
        parts.append(f'<polygon points="{corners}" fill="#8a8a8a"/>')
    y, Z = scene.outline_at(k)
    for one, radius in zip(1e3 * y, 1e3 * Z, strict=True):
        x, height = at(radius, one).split(",")
        parts.append(f'<circle cx="{x}" cy="{height}" r="2.2" fill="#fff" stroke="{INK}"/>')
    bar = "".join(
        f'<rect x="{WIDTH / 2 - 100 + 4 * i}" y="{HEIGHT - 34}" width="4.3" height="9" '
        f'fill="{_hex(shade(i / 49.0, bytes=True))}"/>'
        for i in range(50)
    )
    text = f'font-size="12" fill="{INK}" text-anchor="middle"'
    ends = (
        f'<text x="{WIDTH / 2 - 100}" y="{HEIGHT - 12}" {text}>{low:.3g}</text>'
        f'<text x="{WIDTH / 2 + 100}" y="{HEIGHT - 12}" {text}>{high:.3g}</text>'
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 12}" {text}>{escape(kind.label)}</text>'
    )
    words = f"Cut through the specimen, coloured by: {kind.label}; dots: measured outline"
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" aria-label="{escape(words)}">'
        + "".join(parts) + bar + ends + "</svg>"
    )  # fmt: skip


def _hex(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{int(part):02x}" for part in colour[:3])
