"""Both cameras' pictures at rest under what their speckles promise, and where the subset is too small."""

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable

from dic.chain.speckle_report import Speckles
from kolsky.report.figures.base import PAGE, FigureKind, Panels, letter, smooth_bar
from kolsky.report.figures.overlay import LOST
from kolsky.report.view import SurfaceView

MPX = 1e3
"""Factor from px to mpx."""


def _shown(view: SurfaceView) -> list[tuple[int, Speckles]]:
    return [(camera, found) for camera, found in enumerate(view.speckles) if found is not None]


def caption(view: SurfaceView) -> str:
    """What is seen."""
    quality = _shown(view)[0][1].quality
    small = any(found.quality.too_small.any() for _, found in _shown(view))
    wanted = f"{MPX * (quality.wanted or 0.0):g} mpx"
    return (
        "Mean static pictures of the cameras, and over them the predicted standard deviation of a match with "
        f"a subset of {quality.subset} px centred there, the larger of x and y. "
        + (
            f"Outlined: the subset is too small for {wanted}."
            if small
            else f"It is under {wanted} everywhere."
        )
    )


def height_of(view: SurfaceView) -> float:
    """Height of two pictures with the colour bar below [mm]."""
    rows, columns = _shown(view)[0][1].picture.shape
    return float(np.clip(0.36 * PAGE * rows / columns + 22.0, 40.0, 200.0))


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw a picture with its map a camera."""
    shown, drawn = _shown(view), None
    worst = [MPX * np.where(np.isinf(s.quality.floor), np.nan, s.quality.floor).max(axis=2) for _, s in shown]
    known = np.concatenate([values[np.isfinite(values)] for values in worst])
    low, high = np.percentile(known, [1.0, 99.0]) if known.size else (0.0, 1.0)
    axes: list[Any] = []
    for (camera, found), values, mark in zip(shown, worst, "ab", strict=False):
        ax = panels[f"camera {camera}"]
        dark, bright = np.percentile(found.picture, [0.5, 99.5])
        ax.imshow(found.picture, cmap="gray", vmin=dark, vmax=max(bright, dark + 1), interpolation="none")
        drawn = ax.imshow(
            values, cmap="viridis", vmin=low, vmax=max(high, 1.01 * low), alpha=0.65, interpolation="none"
        )
        small = found.quality.too_small
        if small.any() and not small.all():
            ax.contour(small, levels=[0.5], colors=[LOST], linewidths=1.0)
        ax.set_xlabel("$x$ (px)")
        ax.set_title(f"camera {camera}", loc="right", pad=2.5)
        letter(ax, mark)
        axes.append(ax)
    axes[0].set_ylabel("$y$ (px)")
    if drawn is not None:
        full = ScalarMappable(drawn.norm, drawn.cmap)  # a bar that one sees through shows its seams
        bar = axes[0].figure.colorbar(full, ax=axes, location="bottom", aspect=40, pad=0.02, extend="both")
        bar.set_label("Predicted standard deviation of a match (mpx)")
        smooth_bar(bar)


KIND: FigureKind[SurfaceView] = FigureKind(
    name="speckles",
    width=PAGE,
    height=height_of,
    caption=caption,
    panels=lambda view: [[f"camera {camera}" for camera, _ in _shown(view)]],
    draw=draw,
    applies=lambda view: bool(_shown(view)),
)
