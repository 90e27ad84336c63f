"""The specimen cut along its axis, between its platens: for figures, stills and films.

Every file is replaced when the new one is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from dic.files import replacing
from kolsky.report.scene.scene_data import FIELDS, Scene

SIZE, DPI = (1008, 560), 100
"""Width and height of a picture [px], multiples of 16, as video codecs require; its resolution."""
PLATEN, THICKNESS = 1.15, 0.07
"""Half width of the panel and thickness of a platen, divided by the specimen's largest radius."""
STEEL, POINT = "#9AA0A6", "#D55E00"


def draw_cut(ax: Axes, scene: Scene, k: int) -> QuadMesh:
    """Draw the cut at time ``k`` of ``scene.times`` in mm: the field, platens, the measured outline.

    The panel has the same limits at all times. Returns: the field, for a colour bar.
    """
    r, y = np.moveaxis(1e3 * scene.nodes[k], -1, 0)
    low, high = scene.limits
    drawn = ax.pcolormesh(
        np.hstack([-r[:, :0:-1], r]),
        np.hstack([y[:, :0:-1], y]),
        np.hstack([scene.values[k, :, ::-1], scene.values[k]]),
        cmap=FIELDS[scene.field].colours,
        vmin=low,
        vmax=high,
        rasterized=True,
    )
    widest, tallest = 1e3 * scene.nodes.max(axis=(0, 1, 2))
    half = PLATEN * max(widest, 1e3 * scene.measured_outline.Z.max(initial=0.0))
    thick = THICKNESS * widest
    for bottom in (-thick, float(y[-1].mean())):
        ax.add_patch(Rectangle((-half, bottom), 2.0 * half, thick, facecolor=STEEL))
    heights, radii = scene.outline_at(k)
    for side, label in ((1e3, "measured"), (-1e3, "_mirrored")):
        ax.plot(side * radii, 1e3 * heights, ".", color=POINT, ms=3.0, label=label)
    ax.set(xlim=(-half, half), ylim=(-thick, tallest + thick), aspect="equal")
    return drawn


def picture(scene: Scene, k: int, *, axes: bool = True) -> NDArray[np.uint8]:
    """The cut at time ``k``, RGB, shape [height, width, 3]. ``axes``: with axes, colour bar and time.

    Raises IndexError if there is no such time.
    """
    if not 0 <= k < len(scene.times):
        raise IndexError(f"there are pictures 0 to {len(scene.times) - 1}, not {k}")
    figure = Figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.08, 0.1, 0.76, 0.8) if axes else (0.0, 0.0, 1.0, 1.0))
    drawn = draw_cut(ax, scene, k)
    if axes:
        bar = figure.add_axes((0.89, 0.15, 0.02, 0.7))
        figure.colorbar(drawn, cax=bar, label=FIELDS[scene.field].label)
        title = f"{1e3 * scene.times[k]:.3f} ms; points: measured outline"
        ax.set(xlabel="r (mm)", ylabel="y (mm)", title=title)
    else:
        ax.set_axis_off()
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def png_of(pixels: NDArray[np.uint8]) -> bytes:
    """Pixels as a PNG file, RGB or RGBA, shape [height, width, 3 or 4]."""
    import matplotlib.image

    file = BytesIO()
    matplotlib.image.imsave(file, pixels, format="png")
    return file.getvalue()


FILMS = ("mp4", "gif")
"""Formats of a film."""


def write_film(
    path: Path,
    scene: Scene,
    *,
    every: int = 1,
    rate: float = 25.0,
    progress: Callable[[int], None] = lambda n: None,
) -> Path:
    """Write the deformation of ``scene`` as a film.

    ``path``: its suffix gives the format, one of `FILMS`. ``every``: take every n-th picture, starting with
    the first. ``rate``: frame rate of the film [1/s]. ``progress``: called with 1 after each picture. Raises
    ValueError if the format is unknown, or if `every` or `rate` is not positive.
    """
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in FILMS:
        raise ValueError(f"format {kind!r} is not one of {', '.join(FILMS)}")
    if every < 1 or not rate > 0.0:
        raise ValueError(f"every must be at least 1 and rate positive, got {every} and {rate}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial, _writer(partial, kind, rate) as film:
        for k in range(0, len(scene.times), every):
            film.append_data(picture(scene, k))
            progress(1)
    return path


def write_stills(folder: Path, scene: Scene, count: int = 6) -> list[Path]:
    """Write `count` pictures at equal intervals of time as PNG files and return their paths."""
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for k in evenly_spaced(len(scene.times), count):
        path = folder / f"still_{k:05d}.png"
        with replacing(path) as partial:
            partial.write_bytes(png_of(picture(scene, k)))
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
