"""A speckle pattern and the noise floor that it promises."""

from dataclasses import dataclass

import numpy as np
from matplotlib.ticker import PercentFormatter
from numpy.typing import NDArray

from dic.images import SpeckleQuality
from kolsky.report.figures.base import (
    BAND,
    GREY,
    MEASURED,
    MODEL,
    PAGE,
    FigureKind,
    Panels,
    letter,
    smooth_bar,
)

MPX = 1e3
"""Factor from px to mpx."""


@dataclass(frozen=True)
class Speckles:
    """What the figure shows."""

    picture: NDArray[np.float64]
    """Grey values, shape [rows, columns]."""
    quality: SpeckleQuality
    """What was found of them."""


def caption(shown: Speckles) -> str:
    """What is seen."""
    quality = shown.quality
    text = (
        f"(a) The speckles. (b) Predicted standard deviation of a match with a subset of {quality.subset} px "
        "centred there, the larger of x and y, from the noise of the static frames. (c) Share of the subsets "
        "that reach a floor."
    )
    return text if quality.wanted is None else f"{text} Dotted: the floor asked for."


def height_of(shown: Speckles) -> float:
    """Height of a row of three panels with the colour bar below [mm]."""
    rows, columns = shown.picture.shape
    return float(np.clip(0.30 * PAGE * rows / columns + 17.0, 40.0, 200.0))


def draw(shown: Speckles, panels: Panels) -> None:
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
        letter(ax, mark)


KIND: FigureKind[Speckles] = FigureKind(
    name="speckle-floor",
    width=PAGE,
    height=height_of,
    caption=caption,
    panels=lambda shown: [["picture", "floor", "share"]],
    draw=draw,
)
