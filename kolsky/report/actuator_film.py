"""Film of an actuator that bends under a rising pressure."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dic.files import replacing
from kolsky.actuator.study import Direction
from kolsky.report.canvas import STYLE
from kolsky.report.figures.actuator import BAR, draw_shape
from kolsky.report.figures.base import GREY, MM, SHAPE
from kolsky.report.scene.film import writer_for

SIZE, DPI = (6.4, 4.8), 100
"""Size of a picture [inch] and its dots an inch."""


def write_actuator_film(path: Path, shown: Direction, *, rate: float = 4.0) -> None:
    """Write a film, mp4 or gif, a picture a step, `rate` of them a second.

    Raises
    ------
    ImportError
        If the package that writes films is not installed.
    """
    writer = writer_for(path.suffix.lstrip(".").lower())
    with replacing(path) as partial, writer(partial, rate) as film:
        for step in range(len(shown.pristine.angle)):
            film.append_data(picture(shown, step))


def picture(shown: Direction, step: int) -> np.ndarray:
    """One picture as an array of bytes, shape [height, width, 3]."""
    run = shown.pristine
    mesh = run.solution.model.mesh
    places = MM * (mesh.points + run.solution.displacements)[..., [0, 2]]
    low, high = places.min(axis=(0, 1)) - 3.0, places.max(axis=(0, 1)) + 3.0
    bar, angle = BAR * run.pressures.max(axis=1), np.degrees(run.angle)
    with matplotlib.rc_context(matplotlib.rc_params_from_file(STYLE, use_default_template=False)):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        side, trace = figure.subplots(2, 1, height_ratios=(3, 1))
        draw_shape(side, run, step)
        side.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="$x$ (mm)", ylabel="$z$ (mm)")
        side.set_title(f"{shown.name}: {bar[step]:.3f} bar, {angle[step]:.1f}°", fontsize="medium")
        trace.plot(bar, angle, "-", color=SHAPE, lw=0.8)
        trace.plot(bar[step], angle[step], "o", color=SHAPE, ms=4)
        trace.axhline(0.0, color=GREY, lw=0.5)
        trace.set(xlabel="pressure (bar)", ylabel="bend (°)")
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()
