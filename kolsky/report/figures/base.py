"""Definition of a figure: its size, its panels and the function that draws it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Annotation
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
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
GREEN = "#009E73"
YELLOW = "#F0E442"
GREY = "#8C8C8C"
"""Okabe-Ito colours (and one grey). Each of the first six has one meaning in all figures."""

SERIES = (SHAPE, MODEL, GREEN, PAPER, FORCE, BAND, MEASURED)
MARKERS = "osD^v<>"
"""Colours and markers of series of one kind, used in this order."""

DOTS: dict[str, Any] = {"fmt": "o", "ms": 1.6, "mew": 0.0, "elinewidth": 0.5}
"""Style of measured points with error bars."""

ROUTES = {"joint": MEASURED, "force only": FORCE, "shape only": SHAPE, "paper": PAPER}
"""Colour of each route."""

MS, MM, UM, MJ, KPA, BAR = 1e3, 1e3, 1e6, 1e3, 1e-3, 1e-5
"""Factors from SI to ms, mm, µm, mJ, kPa and bar, the units of the axes."""

COLUMN, PAGE = 85.0, 170.0
"""Width of a journal's column and page [mm]."""


LETTERS = "abcdefghijklmnopqrstuvwxyz"
LONG_LABELS = 1e4
"""Values divided by their range. Above this limit, a tick's label needs six digits or more."""


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
    """Mosaic of panel names for `Figure.subplot_mosaic`; "." is an empty position."""
    draw: Callable[[Shown, Panels], str]
    """Draws a result into the panels and returns the caption. It computes only differences and ratios."""
    applies: Callable[[Shown], bool]
    """True if the result contains the data of the figure."""
    letters: bool | Sequence[str]
    """True if all panels are marked (a), (b), ...; or the names of the marked panels."""
    mosaic: Mapping[str, Any]
    """Further options of `Figure.subplot_mosaic`."""

    def draw_into(self, target: Figure, result: Shown) -> str:
        """Draw a result into an empty figure and return the caption."""
        mosaic: list[Any] = self.panels(result)
        panels = target.subplot_mosaic(mosaic, **self.mosaic)
        caption = self.draw(result, panels)
        if self.letters and len(panels) > 1:
            for letter, name in zip(LETTERS, panels if self.letters is True else self.letters, strict=False):
                label_panel(panels[name], letter)
        return caption

    def caption(self, result: Shown) -> str:
        """Return the caption in plain text."""
        return self.draw_into(Figure(layout="constrained"), result)


def figure(
    width: float,
    height: float | Callable[[Any], float],
    panels: list[list[str]] | Callable[[Any], list[list[str]]],
    *,
    applies: Callable[[Any], bool] = lambda result: True,
    letters: bool | Sequence[str] = False,
    **mosaic: Any,
) -> Callable[[Callable[[Shown, Panels], str]], FigureKind[Shown]]:
    """Make a figure of the name of the function that draws it and returns its caption, see `FigureKind`.

    ``height`` and ``panels`` may be functions of the result. ``mosaic``: options of `Figure.subplot_mosaic`.
    """

    def kind(draw: Callable[[Shown, Panels], str]) -> FigureKind[Shown]:
        return FigureKind(
            name=draw.__name__.replace("_", "-"),
            width=width,
            height=height if callable(height) else lambda result: height,
            panels=panels if callable(panels) else lambda result: panels,
            draw=draw,
            applies=applies,
            letters=letters,
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
    """Write into an empty panel the reason why it is empty."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=GREY)


def few_ticks(ax: Axes, most: int) -> None:
    """Limit the intervals between ticks of an x axis with final limits; fewer if its labels are long."""
    low, high = ax.get_xlim()
    span = abs(high - low)
    long = span > 0.0 and max(abs(low), abs(high)) / span > LONG_LABELS
    ax.locator_params(axis="x", nbins=min(most, 3) if long else most)


def plain_log_ticks(axis: Axis, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Label a logarithmic axis with plain numbers, ``subs`` in each decade."""
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def label_text(text: str, most: int) -> str:
    """Return a name as one line of printable characters for a figure, without the middle of a long one.

    A dollar sign is escaped, because it would start a formula. A character that the font lacks becomes a
    square.
    """
    font = get_font(findfont("DejaVu Sans"))
    known = (c if c.isprintable() else " " for c in text)
    line = "".join(c if font.get_char_index(ord(c)) else "□" for c in known)
    if len(line) > most:
        line = f"{line[: most - most // 2 - 1]}…{line[-(most // 2) :]}"
    return line.replace("$", r"\$")


COLOURS = 64
"""Number of colours of a colour bar. Each is a path of its own in a vector file."""


def colour_bar(mapped: ScalarMappable, axes: Axes | list[Axes], label: str, **options: Any) -> None:
    """Add a colour bar drawn as vectors. Matplotlib would put a bitmap into the vector file."""
    if not isinstance(mapped, ContourSet):
        mapped.set_cmap(mapped.get_cmap().resampled(COLOURS))
    parent = (axes if isinstance(axes, Axes) else axes[0]).get_figure(root=True)
    assert parent is not None  # an axes of a report always lies in one
    bar = parent.colorbar(mapped, ax=axes, label=label, **options)
    if bar.solids is not None:
        bar.solids.set_rasterized(False)
        bar.solids.set_edgecolor("face")  # no white seams between its steps


def legend_above(ax: Axes, *, ncols: int) -> None:
    """Put the legend of a panel above all panels."""
    parent = ax.get_figure(root=True)
    assert parent is not None  # an axes of a report always lies in one
    parent.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=ncols)


def show_picture(ax: Axes, picture: NDArray[np.generic], *, dark: bool = False) -> None:
    """Show a camera's picture between its darkest and brightest greys; ``dark`` makes points visible."""
    low, high = np.percentile(np.asarray(picture, dtype=np.float64), [0.5, 99.5])
    least = 2.0 * low - high - 1 if dark else low
    ax.imshow(picture, cmap="gray", vmin=least, vmax=max(high, low + 1), interpolation="none")
    ax.set_xlabel("$x$ (px)")


def picture_height(picture: tuple[int, ...], width: float, room: float, low: float, high: float) -> float:
    """Height of a figure [mm] with pictures of this shape [rows, columns], between two limits [mm].

    ``width``: width of a picture [mm]. ``room``: height of labels, legends and bars [mm].
    """
    rows, columns = picture
    return float(np.clip(width * rows / columns + room, low, high))


def show_points(
    ax: Axes, places: NDArray[np.float64], values: NDArray[np.float64], low: float, high: float, **style: Any
) -> PathCollection:
    """Show positions, shape [n, 2], coloured by values between two limits."""
    x, y = places.T
    return ax.scatter(x, y, c=values, vmin=low, vmax=high, **({"lw": 0.0} | style))


class Cells(PolyCollection):
    """Coloured cells without overlap, drawn as one outline per colour: a small file, made in a short time."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw the cells with edges in the colour of their faces."""
        self.update_scalarmappable()
        colours, which = np.unique(self.get_facecolor(), axis=0, return_inverse=True)
        style: dict[str, Any] = {"transform": self.get_transform(), "figure": self.get_figure()}
        style["linewidth"], paths = np.max(self.get_linewidth()), self.get_paths()
        for number, colour in enumerate(colours):
            outline = Outline.make_compound_path(*(paths[int(k)] for k in np.flatnonzero(which == number)))
            one = PathPatch(outline, color=colour, **style)
            one.set_clip_box(self.get_clip_box())
            one.draw(renderer)


def label_point(
    ax: Axes, text: str, point: tuple[float, float], shift: tuple[float, float], **style: Any
) -> Annotation:
    """Write a text next to a point, at the offset ``shift`` [points]."""
    return ax.annotate(text, point, xytext=shift, textcoords="offset points", **style)


def largest(values: NDArray[np.float64], default: float = 1.0) -> float:
    """Return the largest finite |value|. The result is `default` if there is none or all are zero."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size and finite.max() > 0.0 else default


def weighted_chi2(result: Identification) -> NDArray[np.float64]:
    """Return chi-square of each run with the weights of the final search, shape [n_runs].

    The sums of the runs are weighted by noise only; the search adds the model discrepancy in quadrature. The
    median noise of a channel stands for all its points.
    """
    c, design, quality = result.comparison, result.design, result.surrogate
    force = _share(c.force_sigma, quality.get("force_discrepancy", 0.0))
    if not c.centre_line.time.size:
        return force * design.chi2_force
    shape = _share(c.centre_line.sigma, quality.get("shape_discrepancy", 0.0))
    return force * design.chi2_force + shape * design.chi2_shape


def _share(sigma: NDArray[np.float64], tau: float) -> float:
    """Return the variance of the noise, the median of `sigma`, over that of noise and discrepancy."""
    if tau == 0.0 or sigma.size == 0:
        return 1.0
    noise = float(np.median(sigma))
    return noise**2 / (noise**2 + tau**2)
