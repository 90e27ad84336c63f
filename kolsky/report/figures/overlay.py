"""What the figures with a picture under points have in common."""

import numpy as np
from matplotlib.axes import Axes

from kolsky.base.arrays import FloatArray
from kolsky.report.figures.base import MS, PAGE, Panels, letter
from kolsky.report.view import SurfaceView

LOST = "#CC79A7"


def panels_of(view: SurfaceView) -> list[list[str]]:
    """A panel a picture."""
    return [[f"frame {k}" for k in range(max(len(view.pictures), 1))]]


def height_of(view: SurfaceView) -> float:
    """Height of a row of pictures with the legend below it [mm]."""
    if not view.pictures:
        return 30.0
    rows, columns = next(iter(view.pictures.values())).shape
    return float(np.clip((PAGE - 12.0) / len(view.pictures) * rows / columns + 21.0, 30.0, 230.0))


def frames_in(view: SurfaceView, panels: Panels) -> list[tuple[int, Axes]]:
    """Draw the pictures; the frame and panel of each."""
    drawn: list[tuple[int, Axes]] = []
    rates = {name: panel for name, panel in panels.items() if name.startswith("frame ")}
    for (frame, picture), ax, mark in zip(view.pictures.items(), rates.values(), "abcdefgh", strict=False):
        low, high = np.percentile(np.asarray(picture, dtype=np.float64), [0.5, 99.5])
        ax.imshow(picture, cmap="gray", vmin=low, vmax=max(high, low + 1), interpolation="none")
        ax.set_xlim(-0.5, picture.shape[1] - 0.5)
        ax.set_ylim(picture.shape[0] - 0.5, -0.5)
        ax.set_xlabel("$x$ (px)")
        if not drawn:
            ax.set_ylabel("$y$ (px)")
        else:
            ax.tick_params(labelleft=False)
        letter(ax, mark)
        ax.set_title(f"{MS * view.result.t[frame]:.3f} ms", loc="right", pad=2.5)
        drawn.append((frame, ax))
    return drawn


def marker(view: SurfaceView) -> float:
    """Size of a point's marker that leaves its neighbours free [points]."""
    points = view.result.specimen.points
    if len(points) < 2 or not view.pictures:
        return 2.0
    step = float(np.min(np.diff(np.unique(points[:, 0]))) if np.unique(points[:, 0]).size > 1 else 5.0)
    columns = next(iter(view.pictures.values())).shape[1]
    width = (PAGE - 12.0) / len(view.pictures) * 72.0 / 25.4
    return float(np.clip(0.72 * step * width / columns, 0.5, 4.0))


def last_places(view: SurfaceView, frame: int) -> FloatArray:
    """Where points that are lost in a frame were last seen in camera 0 [px], shape [n, 2]."""
    body = view.result.specimen
    lost = np.flatnonzero(~body.surface.valid[frame])
    seen = np.asarray(np.isfinite(body.pixels[0][: frame + 1, lost]).all(axis=2))
    last = frame - np.argmax(seen[::-1], axis=0)
    return np.asarray(body.pixels[0][last, lost][seen.any(axis=0)])
