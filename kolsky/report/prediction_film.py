"""Film of a planned test: bar's end, flyer, specimen and platen from the side, and the transmitted force."""

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from dic.files import replacing
from kolsky.prediction.predict import Prediction
from kolsky.report.canvas import STYLE
from kolsky.report.figures.base import GREY, MM, MS, SHAPE
from kolsky.report.scene.film import writer_for

SIZE = (6.4, 4.8)
"""Size of a picture [inch], at `DPI` dots each."""
DPI = 100
STEEL, SOFT = "0.75", "#56B4E9"


def write_prediction_film(
    path: Path,
    found: Prediction,
    *,
    every: int = 1,
    rate: float = 25.0,
    progress: Callable[[int], None] = lambda n: None,
) -> Path:
    """Write the test as a film, a picture each 25 µs.

    Parameters
    ----------
    path
        File to write, mp4 or gif.
    found
        A prediction with finite elements.
    every
        Take one picture in this many.
    rate
        Frame rate of the film [1/s].
    progress
        Called with 1 after each picture.

    Raises
    ------
    ValueError
        If the prediction has no finite elements.
    ImportError
        If the package that writes films is not installed.
    """
    response = found.response
    if response is None:
        raise ValueError("a film shows the specimen's finite elements: predict without the quick way")
    writer = writer_for(path.suffix.lstrip(".").lower())
    with replacing(path) as partial, writer(partial, rate) as film:
        for k in range(0, len(response.surface_times), every):
            film.append_data(picture(found, k))
            progress(1)
    return path


def picture(found: Prediction, k: int) -> np.ndarray:
    """One picture as an array of bytes, shape [height, width, 3]."""
    response, bars, test = found.response, found.bars, found.test.declared
    assert response is not None  # `write_prediction_film` refuses others
    time = float(response.surface_times[k])
    n = min(round(time / float(bars.times[1])), len(bars.times) - 1)
    with matplotlib.rc_context(matplotlib.rc_params_from_file(STYLE, use_default_template=False)):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        side, trace = figure.subplots(2, 1, height_ratios=(2, 1))
        length = MM * test.specimen.length
        face, rest = length - MM * bars.flyer_path[n], -MM * bars.support_path[n]
        step = float(bars.times[1])
        end = length + MM * sum(part.length for part in test.flyer.values())
        bar = end - MM * float(bars.incident.velocity(test.incident.length)[: n + 1].sum()) * step
        height = 0.0
        for part in reversed(test.flyer.values()):
            _box(side, face + height, MM * part.length, MM * part.diameter)
            height += MM * part.length
        _box(side, bar, 40.0, MM * test.incident.diameter)
        depth = 0.0
        for part in test.transmission.values():
            depth += MM * part.length
            _box(side, rest - depth, MM * part.length, MM * part.diameter)
        y, r = MM * response.surface_y[0, k], MM * response.surface_r[0, k]
        outline = np.concatenate([np.stack([y, r], 1), np.stack([y, -r], 1)[::-1]])
        side.add_patch(Polygon(outline, facecolor=SOFT, edgecolor="k", lw=0.6))
        side.set(xlim=(-12.0, end + 8.0), ylim=(-11.0, 11.0), aspect="equal", xlabel="mm")
        side.invert_xaxis()
        side.set_title(f"{MS * time:.3f} ms after the striker's touch", fontsize="medium")
        trace.plot(MS * response.force_times, bars_force(found), color=SHAPE, lw=0.8)
        trace.axvline(MS * time, color=GREY, lw=0.8)
        trace.set(xlabel="Time (ms)", ylabel="Transmitted force (N)", xlim=(0.0, MS * bars.times[-1]))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def bars_force(found: Prediction) -> np.ndarray:
    """Force on the transmission platen at the specimen's force times [N], shape [n]."""
    assert found.response is not None
    return np.interp(found.response.force_times, found.bars.times, found.bars.force_transmission)


def _box(ax: matplotlib.axes.Axes, start: float, length: float, diameter: float) -> None:
    corner = (start, -0.5 * diameter)
    ax.add_patch(Rectangle(corner, length, diameter, facecolor=STEEL, edgecolor="k", lw=0.6))
