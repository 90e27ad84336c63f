"""Build and save figures as files, as CSV data, or as SVG for a page.

No window and no global state is used.

The CSV table of a figure is read from the drawn artists. The table and the figure are therefore equal.
Legends that overlap data are moved to a free position, in pixels of the canvas. Data are lines, markers, bars
and the edges of bands and contours. Fills of a whole panel and guide lines across it are not data.
"""

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import FigureCanvasSVG, RendererSVG
from matplotlib.collections import Collection, PathCollection, QuadMesh
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, StepPatch
from matplotlib.path import Path as Outline
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from matplotlib.textpath import text_to_path
from matplotlib.ticker import Locator, LogLocator, MaxNLocator
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from dic.files import replacing
from kolsky.base.files import write_table
from kolsky.inverse.result import Identification
from kolsky.report import FIGURE_FORMATS
from kolsky.report.figures import FigureKind, figures_of
from kolsky.results.display import in_display_units

_Place = Literal["upper right", "upper left", "lower right", "lower left", "upper center", "lower center"]
PLACES: tuple[_Place, ...] = get_args(_Place)
"""Positions of a legend, the preferred ones first."""
ROOM, MOST_ROOM = 0.1, 0.8
"""If no position is free, the y axis is extended upward in steps. The first number is the step, the second
the limit, both as shares of its range."""
TOUCH = 0.5
"""Boxes with a smaller overlap count as adjacent [px]."""


def free_legends(figure: Figure) -> bool:
    """Move every legend in a panel that overlaps data to a free position, above the data if there is none.

    ``figure``: after layout. Returns: True if an axis has new limits and the figure needs a new layout.
    """
    changed = False
    for ax in figure.axes:
        legend = ax.get_legend()
        if legend is None or legend.get_bbox_to_anchor().bounds != ax.bbox.bounds:
            continue
        if _covers(legend, ax) and not _move(legend, ax):
            changed |= _room_above(legend, ax)
    return changed


def _move(legend: Legend, ax: Axes) -> bool:
    """Move a legend to the first free position. Returns False, without a move, if there is none."""
    before = legend._loc_real  # type: ignore[attr-defined]  # Matplotlib has no public way to read it
    for place in PLACES:
        legend.set_loc(place)
        if not _covers(legend, ax):
            return True
    legend.set_loc(before)
    return False


def _room_above(legend: Legend, ax: Axes) -> bool:
    """Raise the upper limit of the y axis until a legend at the top is free; if it never is, restore it."""
    if ax.images:
        return False
    before, scale = ax.get_ylim(), ax.yaxis.get_transform()
    low, high = scale.transform(np.array(before))
    for share in np.arange(ROOM, MOST_ROOM + 0.5 * ROOM, ROOM):
        ax.set_ylim(before[0], float(scale.inverted().transform(np.array([high + share * (high - low)]))[0]))
        if _move(legend, ax):
            return True
    ax.set_ylim(before)
    return False


def _covers(legend: Legend, ax: Axes) -> bool:
    box = legend.get_window_extent()
    texts = [text for text in ax.texts if _shown(text)]
    return any(_shared(box, text.get_window_extent()) for text in texts) or _on_data(ax, box)


def _shown(text: Text) -> bool:
    return bool(text.get_visible() and text.get_text().strip())


def _shared(one: Bbox, other: Bbox) -> bool:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(wide > TOUCH and high > TOUCH)


def _on_data(ax: Axes, box: Bbox) -> bool:
    """True if data of a panel are inside a box. Drawings are clipped at the panel."""
    inside = Bbox.intersection(box.padded(-TOUCH), ax.bbox)
    if inside is None:
        return False
    drawn = [artist for artist in (*ax.lines, *ax.collections) if artist.get_visible()]
    bars = [bar for bars in ax.containers for bar in bars if hasattr(bar, "xy")]
    return any(_meets(path, joined, inside) for one in drawn for path, joined in _paths(one, ax)) or any(
        _shared(inside, bar.get_window_extent()) for bar in bars
    )


def _paths(artist: Artist, ax: Axes) -> Iterator[tuple[Outline, bool]]:
    """Lines of an artist in pixels, with True; its points, with False."""
    if isinstance(artist, QuadMesh):
        return  # it fills the panel
    if isinstance(artist, PathCollection) and len(artist.get_paths()) <= 1:
        places = np.ma.filled(np.ma.asarray(artist.get_offsets(), dtype=np.float64), np.nan)
        if len(places):
            yield Outline(artist.get_offset_transform().transform(places)), False
            return
    transform = artist.get_transform()
    if not all(transform.contains_branch_seperately(ax.transData)):
        return  # a guide from side to side
    if isinstance(artist, Collection):
        yield from ((path.transformed(transform), True) for path in artist.get_paths())
        return
    assert isinstance(artist, Line2D)
    path = artist.get_path().transformed(transform)
    if artist.get_linestyle() not in ("None", "", " "):
        yield path, True
    if artist.get_marker() not in ("None", "", " ", None):
        yield path, False


def _meets(path: Outline, joined: bool, box: Bbox) -> bool:
    """True if a line crosses a box. If its points are not joined: True if one of them is inside."""
    vertices = np.asarray(path.vertices, dtype=np.float64)
    if not joined:
        x, y = vertices.T
        return bool(np.any((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)))
    if not np.isfinite(vertices).all():
        path = path.cleaned(remove_nans=True)
    return bool(len(vertices)) and bool(path.intersects_bbox(box, filled=False))


_Points = tuple[str, NDArray[Any], NDArray[Any], NDArray[Any] | None]
"""Kind, x, y and values of an artist."""
DATA_COLUMNS = ("panel", "x axis", "y axis", "series", "kind", "x", "y", "value", "value axis")
_PICTURE_ARTISTS = frozenset({"gray", "grey", "Greys_r"})
"""Colour maps of camera pictures. They do not count as data of a figure."""


def write_data(path: Path, figure: Figure) -> Path:
    """Write the data of a figure, one row per point."""
    rows = list(_data_rows(figure))
    return write_table(path, {name: [row[i] for row in rows] for i, name in enumerate(DATA_COLUMNS)})


def _data_rows(figure: Figure) -> Iterator[tuple[Any, ...]]:
    for number, ax in enumerate(figure.axes, start=1):
        panel = str(ax.get_label() or number)
        if panel == "<colorbar>":
            continue
        axes = ax.get_xlabel(), ax.get_ylabel()
        drawn = [one for one in (*ax.lines, *ax.collections, *ax.images, *ax.patches) if one.get_visible()]
        for count, artist in enumerate(drawn, start=1):
            label = str(artist.get_label())
            series = f"{count}" if label.startswith("_") or not label else label
            bar = getattr(artist, "colorbar", None)
            third = "" if bar is None else bar.ax.get_ylabel() or bar.ax.get_xlabel()
            for kind, x, y, value in _artist_points(artist, ax):
                values = [""] * len(x) if value is None else _plain_number(value)
                for row in zip(_plain_number(x), _plain_number(y), values, strict=True):
                    yield (panel, *axes, series, kind, *row, third)


def _artist_points(artist: Any, ax: Axes) -> Iterator[_Points]:
    """Yield the points of an artist that is drawn in data coordinates."""
    match artist:
        case Line2D() if artist.get_transform() == ax.transData:
            yield "line", np.asarray(artist.get_xdata()), np.asarray(artist.get_ydata()), None
        case AxesImage() if (
            np.asarray(artist.get_array()).ndim == 2 and artist.cmap.name not in _PICTURE_ARTISTS
        ):
            yield _image_points(artist)
        case QuadMesh():
            corners = np.asarray(artist.get_coordinates())
            centres = 0.25 * (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1])
            yield "map", centres[..., 0].ravel(), centres[..., 1].ravel(), _flat_values(artist.get_array())
        case ContourSet():
            for level, path in zip(artist.levels, artist.get_paths(), strict=False):
                x, y = np.asarray(path.vertices).reshape(-1, 2).T
                yield "contour", x, y, np.full(len(x), level)
        case Quiver():
            x, y = np.asarray(artist.get_offsets()).T
            yield "arrow, x part", x, y, np.ravel(artist.U)
            yield "arrow, y part", x, y, np.ravel(artist.V)
        case PathCollection() if artist.get_offset_transform() == ax.transData:
            x, y = np.asarray(artist.get_offsets()).T
            values = artist.get_array()
            yield "points", x, y, None if values is None else _flat_values(values)
        case Collection() if artist.get_transform() == ax.transData:
            values = artist.get_array()
            colours = _flat_values([] if values is None else values)
            for number, path in enumerate(artist.get_paths()):
                x, y = np.asarray(path.vertices).reshape(-1, 2).T
                yield "outline", x, y, np.full(len(x), colours[number]) if number < len(colours) else None
        case StepPatch():
            heights, edges, _ = artist.get_data()
            yield "step", np.asarray(edges)[:-1], np.asarray(heights), None
        case Patch() if artist.get_data_transform() == ax.transData:
            x, y = artist.get_patch_transform().transform(artist.get_path().vertices).T
            yield "outline", x, y, None


def _image_points(artist: Any) -> _Points:
    """Return an image as values at the centres of its cells."""
    values: NDArray[Any] = np.ma.filled(np.ma.asarray(artist.get_array(), dtype=float), np.nan)
    left, right, bottom, top = artist.get_extent()
    if artist.origin == "upper":
        bottom, top = top, bottom
    rows, columns = values.shape[:2]
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
    xx, yy = np.meshgrid(x, y)
    return "map", xx.ravel(), yy.ravel(), values.reshape(rows * columns, -1)[:, 0]


def _flat_values(values: Any) -> NDArray[Any]:
    return np.ravel(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan))


def _plain_number(values: NDArray[Any]) -> list[Any]:
    return [float(value) for value in _flat_values(values)]


STYLE = Path(__file__).with_name("kolsky.mplstyle")
FORMATS = FIGURE_FORMATS
_ON_PAGE = 350.0
"""Resolution of pictures inside the figures of a page [dots per inch]. It is that of the rendered stills."""
_MM_PER_INCH = 25.4
_DPI = 72
"""Resolution of an SVG file [dots per inch]."""


class _Renderer(RendererSVG):
    """Draws an SVG, and measures texts for a layout in any resolution. Each text is measured once."""

    def __init__(self, figure: Figure) -> None:
        self.figure, self.target = figure, io.StringIO()
        width, height = _DPI * figure.get_size_inches()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        super().__init__(width, height, self.target, image_dpi=_ON_PAGE, metadata=nothing)
        self._text2path = text_to_path  # its parser keeps the formulas; there is no public way to set it

    def get_text_width_height_descent(self, s: str, prop: FontProperties, ismath: Any) -> Any:
        return tuple(map(self.points_to_pixels, _text_size(s, prop.copy(), ismath)))

    def points_to_pixels(self, points: Any) -> Any:
        return points * self.figure.dpi / _DPI


@lru_cache(4096)
def _text_size(text: str, font: FontProperties, math: Any) -> tuple[float, float, float]:
    """Width, height and depth of a text [pt]."""
    if math:  # parsed in the size of the drawing, not in that of the measures of Matplotlib
        width, height, depth, *_ = text_to_path.mathtext_parser.parse(text, _DPI, font)
        return width, height, depth
    return text_to_path.get_text_width_height_descent(text, font, math)


class _Between(Locator):
    """The positions of another locator between the limits of an axis. Ticks beyond them are not drawn."""

    def __init__(self, every: Locator) -> None:
        self.every = every
        for name in ("nonsingular", "set_params", "tick_values", "view_limits"):
            setattr(self, name, getattr(every, name))

    def __call__(self) -> Any:
        assert self.axis is not None  # an axis calls its own locator
        ticks, (low, high) = np.asarray(self.every()), np.sort(self.axis.get_view_interval())
        return ticks[(ticks >= low - 1e-9 * (high - low)) & (ticks <= high + 1e-9 * (high - low))]


class _Canvas(FigureCanvasSVG):
    """Canvas of a figure that is laid out as its SVG is drawn."""

    def __init__(self, figure: Figure) -> None:
        super().__init__(figure)
        self._renderer = _Renderer(figure)

    def get_renderer(self) -> _Renderer:
        return self._renderer


@cache
def _style() -> matplotlib.RcParams:
    return matplotlib.rc_params_from_file(STYLE, use_default_template=False)


def build(kind: FigureKind[Any], shown: Any) -> Figure:
    """Draw one figure of a result to which it applies, in its journal size; its label is its caption."""
    size = (kind.width / _MM_PER_INCH, kind.height(shown) / _MM_PER_INCH)
    with matplotlib.rc_context(_style()):
        figure = Figure(figsize=size, layout="constrained")
        _Canvas(figure)
        drawn = in_display_units(shown) if isinstance(shown, Identification) else shown
        figure.set_label(kind.draw_into(figure, drawn))
        for ax in figure.axes:
            for spine in ax.spines.values():
                spine.set_in_layout(False)  # ticks point inward: a spine lies on the edge of its axes
                spine.axis = None  # the place of a label is sought from its extent, without ticks
            for axis in (ax.xaxis, ax.yaxis):  # the number of ticks depends on it, also outside this style
                if isinstance(major := axis.get_major_locator(), MaxNLocator | LogLocator):
                    axis.set_major_locator(_Between(major))
                if isinstance(minor := axis.get_minor_locator(), LogLocator):
                    axis.set_minor_locator(_Between(minor))
                if "labelsize" not in axis.get_tick_params():
                    axis.set_tick_params(labelsize=matplotlib.rcParams["ytick.labelsize"])
                if not axis.get_label_text():
                    axis.set_label_coords(0.5, 0.5)  # the place of an empty label is not sought
        layout = figure.get_layout_engine()
        assert layout is not None
        layout.execute(figure)  # once: every saving would draw twice for it
        if free_legends(figure):
            layout.execute(figure)
        figure.set_layout_engine(None)
    return figure


def save_figures(
    folder: Path,
    shown: Any,
    *,
    formats: Iterable[str] = FORMATS,
    registry: Mapping[str, FigureKind[Any]] | None = None,
) -> list[Path]:
    """Save every figure that applies as `<name>.<format>`, each atomically. Returns: the files.

    Parameters
    ----------
    folder, shown
        Created if absent; the result that the figures show, TypeError if no figure shows its class.
    formats
        Any of "pdf", "svg", "png" (600 dots per inch) and "csv" (the data in the figure), else ValueError.
    registry
        The figures; default: those of `kolsky.report.figures.figures_of`.
    """
    formats = tuple(formats)
    unknown = [name for name in formats if name not in FORMATS]
    if unknown:
        raise ValueError(f"format {unknown[0]!r} is not one of {', '.join(FORMATS)}")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for kind in (figures_of(shown) if registry is None else registry).values():
        if not kind.applies(shown):
            continue
        figure = build(kind, shown)
        for name in formats:
            path = folder / f"{kind.name}.{name}"
            if name == "csv":
                write_data(path, figure)
            else:
                with replacing(path) as partial:
                    _save(figure, partial, name)
            written.append(path)
    return written


def inline_svg(figure: Figure, name: str) -> str:
    """A drawn figure as SVG for use inside an HTML page, its ids with the given name before them.

    Without namespaces, metadata and head, which HTML does not need, the page contains no address.
    """
    with matplotlib.rc_context(_style()):
        width, height = figure.get_size_inches()
        before, figure.dpi = figure.dpi, _DPI
        vectors = _Renderer(figure)
        renderer = MixedModeRenderer(figure, width, height, _ON_PAGE, vectors)
        figure.draw(renderer)  # type: ignore[arg-type]  # Matplotlib itself draws files with this class
        renderer.finalize()
        figure.dpi = before
    svg = vectors.target.getvalue()
    svg = re.sub(r"<!--[^<>]*-->|<style.*?</style>", "", svg[svg.index("<svg") :])
    prefix = f"{name}-"
    svg = _ATTRIBUTE.sub(lambda found: _on_page(found[1], found[2], prefix), svg)
    shape = 'stroke-linejoin="round" stroke-linecap="butt"'
    return svg.replace("<svg", f'<svg {shape} role="img" aria-labelledby="{prefix}caption"', 1)


_ATTRIBUTE = re.compile(r' (style|id|xlink:href|clip-path|xmlns|xmlns:xlink)="([^"]*)"(?=[^<>]*>)')
"""An attribute whose value depends on the page. Outside tags, Matplotlib escapes ">"."""


def _on_page(key: str, value: str, prefix: str) -> str:
    """An attribute of an SVG file as those of an element in a page.

    Styles become attributes, because a strict Content-Security-Policy does not allow them.
    """
    if key.startswith("xmlns"):
        return ""
    if key == "id":
        return f' id="{prefix}{value}"'
    if key == "xlink:href":
        return f' href="#{prefix}{value[1:]}"' if value.startswith("#") else f' href="{value}"'
    value = value.replace("url(#", f"url(#{prefix}")
    if key == "style":
        rules = {
            name.strip(): text.strip() for name, _, text in (rule.partition(":") for rule in value.split(";"))
        }
        return "".join(f' {name}="{text}"' for name, text in rules.items() if name)
    return f' {key}="{value}"'


def _save(figure: Figure, target: Path | io.StringIO, name: str, *, dpi: float | None = None) -> None:
    # No date and no program: the same result gives the same bytes.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[name]
    with matplotlib.rc_context(_style()):
        figure.savefig(target, format=name, metadata=metadata, dpi=dpi or matplotlib.rcParams["savefig.dpi"])
