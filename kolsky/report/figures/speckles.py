"""Figures of speckle patterns: predicted standard deviation of a match over the image."""

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.ticker import PercentFormatter

from dic.chain.speckle_report import Speckles
from kolsky.report.figures.base import (
    BAND,
    GREY,
    MEASURED,
    MODEL,
    PAGE,
    FigureKind,
    Panels,
    label_panel,
    smooth_bar,
)
from kolsky.report.figures.surface_points import LOST
from kolsky.report.surface_view import SurfaceView

MPX = 1e3
"""Factor from px to mpx."""


def _cameras(view: SurfaceView) -> list[tuple[int, Speckles]]:
    """Cameras whose speckles are known: number and speckles."""
    return [(camera, found) for camera, found in enumerate(view.speckles) if found is not None]


def caption_overlay(view: SurfaceView) -> str:
    """Return the caption."""
    quality = _cameras(view)[0][1].quality
    small = any(found.quality.too_small.any() for _, found in _cameras(view))
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


def height_of_overlay(view: SurfaceView) -> float:
    """Height of two pictures with the colour bar below [mm]."""
    rows, columns = _cameras(view)[0][1].picture.shape
    return float(np.clip(0.36 * PAGE * rows / columns + 22.0, 40.0, 200.0))


def draw_overlay(view: SurfaceView, panels: Panels) -> None:
    """Draw the picture of each camera with its map."""
    shown, drawn = _cameras(view), None
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
        label_panel(ax, mark)
        axes.append(ax)
    axes[0].set_ylabel("$y$ (px)")
    if drawn is not None:
        full = ScalarMappable(drawn.norm, drawn.cmap)  # a transparent bar would show its seams
        bar = axes[0].figure.colorbar(full, ax=axes, location="bottom", aspect=40, pad=0.02, extend="both")
        bar.set_label("Predicted standard deviation of a match (mpx)")
        smooth_bar(bar)


def caption_floor(shown: Speckles) -> str:
    """Return the caption."""
    quality = shown.quality
    text = (
        f"(a) The speckles. (b) Predicted standard deviation of a match with a subset of {quality.subset} px "
        "centred there, the larger of x and y, from the noise of the static frames. (c) Share of the subsets "
        "that reach a floor."
    )
    return text if quality.wanted is None else f"{text} Dotted: the floor asked for."


def height_of_floor(shown: Speckles) -> float:
    """Height of a row of three panels with the colour bar below [mm]."""
    rows, columns = shown.picture.shape
    return float(np.clip(0.30 * PAGE * rows / columns + 17.0, 40.0, 200.0))


def draw_floor(shown: Speckles, panels: Panels) -> None:
    """Draw the picture, the map and the distribution."""
    quality, (picture, floor, share) = shown.quality, (panels[name] for name in ("picture", "floor", "share"))
    low, high = np.percentile(shown.picture, [0.5, 99.5])
    picture.imshow(shown.picture, cmap="gray", vmin=low, vmax=max(high, low + 1), interpolation="nearest")
    known = MPX * quality.floor[np.all(np.isfinite(quality.floor), axis=2)]
    worst = MPX * quality.floor.max(axis=2)
    ends = np.percentile(known.max(axis=1), [1.0, 99.0]) if known.size else (0.0, 1.0)
    floor.set_facecolor(GREY)
    drawn = floor.imshow(
        worst, cmap="plasma", vmin=ends[0], vmax=max(ends[1], 1.01 * ends[0]), interpolation="nearest"
    )
    for ax in (picture, floor):
        ax.set_xlabel("$x$ (px)")
    picture.set_ylabel("$y$ (px)")
    floor.tick_params(labelleft=False)
    figure = floor.figure
    bar = figure.colorbar(drawn, ax=floor, location="bottom", aspect=25, pad=0.02, extend="both")  # type: ignore[union-attr]
    bar.set_label("Predicted floor (mpx)")
    smooth_bar(bar)

    parts = np.arange(1, len(known) + 1) / max(len(known), 1)
    for k, (name, colour, style) in enumerate((("$x$", MEASURED, "-"), ("$y$", MODEL, "--"))):
        share.step(np.sort(known[:, k]), parts, style, color=colour, where="post", label=name)
    if quality.wanted is not None:
        share.axvline(MPX * quality.wanted, color=BAND, ls=":", label="asked for")
    share.set_xlim(0.0, 1.15 * max(float(ends[1]), MPX * (quality.wanted or 0.0)))
    share.set_ylim(0.0, 1.0)
    share.yaxis.set_major_formatter(PercentFormatter(1.0))
    share.set_xlabel("Floor (mpx)")
    share.set_ylabel("Share of the subsets")
    share.legend(loc="upper left")
    for ax, mark in zip((picture, floor, share), "abc", strict=True):
        label_panel(ax, mark)


FIGURES: tuple[FigureKind[SurfaceView], ...] = (
    FigureKind(
        name="speckles",
        width=PAGE,
        height=height_of_overlay,
        caption=caption_overlay,
        panels=lambda view: [[f"camera {camera}" for camera, _ in _cameras(view)]],
        draw=draw_overlay,
        applies=lambda view: bool(_cameras(view)),
    ),
)
SPECKLE_FLOOR = FigureKind(
    name="speckle-floor",
    width=PAGE,
    height=height_of_floor,
    caption=caption_floor,
    panels=lambda shown: [["picture", "floor", "share"]],
    draw=draw_floor,
)
