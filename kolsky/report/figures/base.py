"""Definition of a figure: its size, its panels and the function that draws it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from kolsky.inverse.result import Identification

Panels = Mapping[str, Axes]
Shown = TypeVar("Shown")
"""Type of the result that a figure shows."""

MEASURED = "#000000"
MODEL = "#D55E00"
FORCE = "#E69F00"
SHAPE = "#0072B2"
PAPER = "#CC79A7"
BAND = "#56B4E9"
GREY = "#8C8C8C"
"""Okabe-Ito colours (and one grey), one meaning each in all figures."""

ROUTES = {"joint": MEASURED, "force only": FORCE, "shape only": SHAPE, "paper": PAPER}
"""Colour of each route."""

MS, MM, UM, MJ = 1e3, 1e3, 1e6, 1e3
"""Factors from SI to ms, mm, µm and mJ, the units of the axes."""

COLUMN, PAGE = 85.0, 170.0
"""Width of a journal's column and page [mm]."""


LONG_LABELS = 1e4
"""Values over their range beyond which a tick's label needs six digits or more."""


@dataclass(frozen=True)
class FigureKind(Generic[Shown]):
    """One figure of a page, made by `figure`."""

    name: str
    """Name of the saved file, letters, digits and hyphens."""
    width: float
    """Width [mm]."""
    height: Callable[[Shown], float]
    """Height [mm]."""
    panels: Callable[[Shown], list[list[str]]]
    """Mosaic of panel names, as `Figure.subplot_mosaic` takes it; "." leaves a place empty."""
    draw: Callable[[Shown, Panels], str]
    """Draws a result into the panels and returns the caption; computes only differences and ratios."""
    applies: Callable[[Shown], bool]
    """True if the result holds what the figure shows."""
    mosaic: Mapping[str, Any]
    """Further options of `Figure.subplot_mosaic`."""

    def caption(self, result: Shown) -> str:
        """Return the caption in plain text."""
        scratch = Figure(layout="constrained")
        return self.draw(result, scratch.subplot_mosaic(self.panels(result), **self.mosaic))


def figure(
    width: float,
    height: float | Callable[[Any], float],
    panels: list[list[str]] | Callable[[Any], list[list[str]]],
    *,
    applies: Callable[[Any], bool] = lambda result: True,
    **mosaic: Any,
) -> Callable[[Callable[[Shown, Panels], str]], FigureKind[Shown]]:
    """Make a figure of the function that draws it and returns its caption; the name is the function's.

    ``width``, ``height``: size [mm]. ``panels``: names of the panels, row by row. ``height`` and ``panels``
    may be functions of the result. ``applies``: true if a result holds what the figure shows. ``mosaic``:
    further options of `Figure.subplot_mosaic`.
    """

    def kind(draw: Callable[[Shown, Panels], str]) -> FigureKind[Shown]:
        return FigureKind(
            name=draw.__name__.replace("_", "-"),
            width=width,
            height=height if callable(height) else lambda result: height,
            panels=panels if callable(panels) else lambda result: panels,
            draw=draw,
            applies=applies,
            mosaic=mosaic,
        )

    return kind


def label_panel(ax: Axes, text: str) -> None:
    """Mark a panel (a), (b), ... above its corner."""
    ax.annotate(
        f"({text})",
        (0.0, 1.0),
        xytext=(0, 2.5),
        xycoords="axes fraction",
        textcoords="offset points",
        fontweight="bold",
        annotation_clip=False,
    )


def note_empty(ax: Axes, text: str) -> None:
    """Write into a panel why it is empty."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=GREY)


def few_ticks(ax: Axes, most: int) -> None:
    """Limit the ticks of the x axis; values that differ in their last digits only have long labels.

    ``ax``: axes whose limits are set. ``most``: most intervals between ticks where the labels are short.
    """
    low, high = ax.get_xlim()
    span = abs(high - low)
    long = span > 0.0 and max(abs(low), abs(high)) / span > LONG_LABELS
    ax.locator_params(axis="x", nbins=min(most, 3) if long else most)


def plain_log_ticks(ax: Axes) -> None:
    """Label a logarithmic x axis with plain numbers; within a factor of five they lie at equal distances."""
    low, high = ax.get_xlim()
    far = high > 5.0 * low
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if far else MaxNLocator(3))
    ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def label_text(text: str, most: int) -> str:
    """Return a name for use in a figure: one line of printable characters, a long one without its middle.

    A dollar sign is escaped, so that it starts no formula. A character that the figures' font does not have
    becomes a square; the tables of a page have it as it is.
    """
    font = get_font(findfont("DejaVu Sans"))
    known = (c if c.isprintable() else " " for c in text)
    line = "".join(c if font.get_char_index(ord(c)) else "□" for c in known)
    if len(line) > most:
        line = f"{line[: most - most // 2 - 1]}…{line[-(most // 2) :]}"
    return line.replace("$", r"\$")


def smooth_bar(bar: Colorbar) -> None:
    """Draw a colour bar as vectors; Matplotlib would put a bitmap into the vector file."""
    if bar.solids is not None:
        bar.solids.set_rasterized(False)
        bar.solids.set_edgecolor("face")  # no white seams between its steps


def largest(values: NDArray[np.float64], default: float = 1.0) -> float:
    """Return the largest finite |value|, or `default` if there is none or all are zero."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size and finite.max() > 0.0 else default


def weighted_chi2(result: Identification) -> NDArray[np.float64]:
    """Return chi-square of each run with the weights of the final search, shape [n_runs].

    The sums of the runs are weighted by noise alone, those of the search by noise and model discrepancy in
    quadrature; the median noise of force and of outline stands for all of their points.
    """
    c, design, quality = result.comparison, result.design, result.surrogate
    force = _share(c.force_sigma, quality.get("force_discrepancy", 0.0))
    if not c.centre_line.time.size:
        return force * design.chi2_force
    shape = _share(c.centre_line.sigma, quality.get("shape_discrepancy", 0.0))
    return force * design.chi2_force + shape * design.chi2_shape


def _share(sigma: NDArray[np.float64], tau: float) -> float:
    """Return the variance of the noise over that of noise and discrepancy, `sigma`'s median for the noise."""
    if tau == 0.0 or sigma.size == 0:
        return 1.0
    noise = float(np.median(sigma))
    return noise**2 / (noise**2 + tau**2)
