"""Films of a planned test and of a bending actuator, and stills of deformed specimens in three dimensions.

Films and stills of a shot's simulation are in `kolsky.report.scene`.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.bodies.actuator_bending import Direction
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.solution import Solution
from kolsky.prediction.predict import Prediction
from kolsky.report.canvas import STYLE
from kolsky.report.figures.base import BAND, BAR, GREY, MM, MS, SHAPE
from kolsky.report.figures.bodies import draw_shape
from kolsky.report.scene.drawing import offscreen_pyvista, plotting, write_frames

_SIZE, _DPI = (6.4, 4.8), 100
"""Size of a film's picture [inch] and its resolution [dots per inch]."""
_STEEL = "0.75"


@contextmanager
def _two_panels(heights: tuple[int, int]) -> Iterator[tuple[Axes, Axes, Callable[[], NDArray[np.uint8]]]]:
    """Two panels of a picture, and the function that draws them as bytes, shape [height, width, 3]."""
    with matplotlib.rc_context(matplotlib.rc_params_from_file(STYLE, use_default_template=False)):
        figure = Figure(figsize=_SIZE, dpi=_DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)

        def pixels() -> NDArray[np.uint8]:
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()

        side, trace = figure.subplots(2, 1, height_ratios=heights)
        yield side, trace, pixels


def write_prediction_film(path: Path, found: Prediction) -> Path:
    """Write the test as a film, with one picture per 25 µs. ``rate``: frame rate of the film [1/s]."""
    response = found.response
    if response is None:
        raise ValueError("a film shows the specimen's finite elements: predict without the quick way")
    frames = range(len(response.surface_times))
    picture = partial(_prediction_picture, found)
    return write_frames(path, picture, frames, rate=25.0)


def _prediction_picture(found: Prediction, k: int) -> NDArray[np.uint8]:
    """One picture as an array of bytes, shape [height, width, 3]."""
    response, bars, test = found.response, found.bars, found.test.declared
    assert response is not None  # `write_prediction_film` refuses others
    time = float(response.surface_times[k])
    n = min(round(time / float(bars.times[1])), len(bars.times) - 1)
    with _two_panels((2, 1)) as (side, trace, pixels):
        length = MM * test.specimen.length
        face, rest = length - MM * bars.flyer_path[n], -MM * bars.support_path[n]
        step = float(bars.times[1])
        end = length + MM * sum(part.length for part in test.flyer.values())
        bar = end - MM * float(bars.incident.velocity(test.incident.length)[: n + 1].sum()) * step
        height = 0.0
        for part in reversed(test.flyer.values()):
            _box_patch(side, face + height, MM * part.length, MM * part.diameter)
            height += MM * part.length
        _box_patch(side, bar, 40.0, MM * test.incident.diameter)
        depth = 0.0
        for part in test.transmission.values():
            depth += MM * part.length
            _box_patch(side, rest - depth, MM * part.length, MM * part.diameter)
        y, r = MM * response.surface_y[0, k], MM * response.surface_r[0, k]
        outline = np.concatenate([np.stack([y, r], 1), np.stack([y, -r], 1)[::-1]])
        side.add_patch(Polygon(outline, facecolor=BAND, edgecolor="k", lw=0.6))
        side.set(xlim=(-12.0, end + 8.0), ylim=(-11.0, 11.0), aspect="equal", xlabel="mm")
        side.invert_xaxis()
        side.set_title(f"{MS * time:.3f} ms after the striker's touch", fontsize="medium")
        force = np.interp(response.force_times, bars.times, bars.force_transmission)
        trace.plot(MS * response.force_times, force, color=SHAPE, lw=0.8)
        trace.axvline(MS * time, color=GREY, lw=0.8)
        trace.set(xlabel="Time (ms)", ylabel="Transmitted force (N)", xlim=(0.0, MS * bars.times[-1]))
        return pixels()


def _box_patch(ax: Axes, start: float, length: float, diameter: float) -> None:
    corner = (start, -0.5 * diameter)
    ax.add_patch(Rectangle(corner, length, diameter, facecolor=_STEEL, edgecolor="k", lw=0.6))


def write_actuator_film(path: Path, shown: Direction) -> None:
    """Write a film, mp4 or gif, with one picture per step and four pictures per second."""
    write_frames(path, partial(_actuator_picture, shown), range(len(shown.pristine.angle)), rate=4.0)


def _actuator_picture(shown: Direction, step: int) -> NDArray[np.uint8]:
    """One picture as an array of bytes, shape [height, width, 3]."""
    run = shown.pristine
    mesh = run.solution.model.mesh
    places = MM * (mesh.points + run.solution.displacements)[..., [0, 2]]
    low, high = places.min(axis=(0, 1)) - 3.0, places.max(axis=(0, 1)) + 3.0
    bar, angle = BAR * run.pressures.max(axis=1), np.degrees(run.angle)
    with _two_panels((3, 1)) as (side, trace, pixels):
        draw_shape(side, run, step)
        side.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="$x$ (mm)", ylabel="$z$ (mm)")
        side.set_title(f"{shown.name}: {bar[step]:.3f} bar, {angle[step]:.1f}°", fontsize="medium")
        trace.plot(bar, angle, "-", color=SHAPE, lw=0.8)
        trace.plot(bar[step], angle[step], "o", color=SHAPE, ms=4)
        trace.axhline(0.0, color=GREY, lw=0.5)
        trace.set(xlabel="pressure (bar)", ylabel="bend (°)")
        return pixels()


_STILL_SIZE = (1200, 700)
"""Width and height of a still [px]."""
_STILL_TITLE = "largest stretch of the element"


def largest_stretches(solution: Solution) -> FloatArray:
    """Largest principal stretch of each element's mean deformation at the last step reached, shape [m]."""
    model = solution.model
    of = geometry(model.mesh, kinematics=model.kinematics, thickness=model.thickness, gauss=model.gauss)
    d, u = model.dimension, solution.displacements[solution.reached - 1][model.mesh.cells]
    share = of.volumes / of.volumes.sum(axis=1, keepdims=True)
    F = np.eye(d) + np.einsum("mg,mgkj,mki->mij", share, of.E[..., :d], u, optimize=True)
    return np.asarray(np.linalg.svd(F, compute_uv=False)[:, 0], dtype=np.float64)


def write_specimen_still(path: Path, solution: Solution) -> None:
    """Write the specimen at the last step reached, deformed, coloured by the largest stretch, as PNG."""
    pyvista, mesh = offscreen_pyvista(), solution.model.mesh
    moved = mesh.points + solution.displacements[solution.reached - 1]
    points = np.pad(moved, ((0, 0), (0, 3 - moved.shape[1])))
    grid = pyvista.UnstructuredGrid({mesh.element.vtk: mesh.cells}, 1e3 * points)
    grid.cell_data[_STILL_TITLE] = largest_stretches(solution)
    with plotting(pyvista, _STILL_SIZE) as plotter:
        bar: dict[str, Any] = {"title": f"{_STILL_TITLE}\n", "position_x": 0.25, "width": 0.5}
        bar |= {"color": "black", "fmt": "%.2f", "n_labels": 5}
        plotter.add_mesh(grid, scalars=_STILL_TITLE, cmap="viridis", scalar_bar_args=bar)
        extents = " x ".join(f"{edge:.3g}" for edge in 1e3 * np.ptp(moved, axis=0))
        plotter.add_text(
            f"simulated part, deformed: {extents} mm", position="upper_left", color="black", font_size=12
        )
        if mesh.dimension == 2:
            plotter.view_xy()
        else:
            plotter.view_isometric()
        plotter.enable_parallel_projection()
        plotter.camera.zoom(1.3)
        plotter.screenshot(str(path))
