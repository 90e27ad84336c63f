"""Building and saving of figures without a window or global state, alone or as SVG for a page."""

import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dic.files import replacing
from kolsky.inverse.result import Identification
from kolsky.report.display_units import in_display_units
from kolsky.report.figure_data import write_data
from kolsky.report.figures import FigureKind, figures_of
from kolsky.report.formats import FIGURE_FORMATS
from kolsky.report.free_labels import free_legends

STYLE = Path(__file__).with_name("kolsky.mplstyle")
FORMATS = FIGURE_FORMATS
ON_PAGE = 350.0
"""Resolution of pictures inside the figures of a page [dots per inch], that of the rendered stills."""
_MM_PER_INCH = 25.4
_SVG, _LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}"


@cache
def _style() -> matplotlib.RcParams:
    return matplotlib.rc_params_from_file(STYLE, use_default_template=False)


def build(kind: FigureKind[Any], shown: Any) -> Figure:
    """Draw one figure in its journal size.

    Parameters
    ----------
    kind : FigureKind
        An entry of one of the registries in `figures`.
    shown : Identification or SurfaceView
        Result to show; `kind.applies` must be true for it.
    """
    size = (kind.width / _MM_PER_INCH, kind.height(shown) / _MM_PER_INCH)
    with matplotlib.rc_context(_style()):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        mosaic: list[Any] = kind.panels(shown)
        drawn = in_display_units(shown) if isinstance(shown, Identification) else shown
        kind.draw(drawn, figure.subplot_mosaic(mosaic, **kind.mosaic))
        for ax in figure.axes:
            for spine in ax.spines.values():
                spine.set_in_layout(False)  # ticks point inward: a spine lies on the edge of its axes
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
    """Save every figure that applies as `<name>.<format>`, each atomically.

    Parameters
    ----------
    folder : Path
        Folder; created if absent.
    shown : Identification or another result
        Result that the figures show.
    formats : iterable of str
        Any of "pdf", "svg", "png" (600 dots per inch) and "csv", the data that the figure shows.
    registry : mapping
        The figures; those of `kolsky.report.figures.figures_of` if not given.

    Raises
    ------
    ValueError
        If a format is not one of these.
    TypeError
        If no figure shows things of this class.
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


def inline_svg(kind: FigureKind[Any], shown: Any, name: str | None = None) -> str:
    """One figure as SVG to stand inside an HTML page.

    Ids carry the figure's name, or the given one, so that several figures of a page cannot clash. Namespaces,
    metadata and the document head are left out: HTML needs none, and nothing in the page then names another
    address.
    """
    buffer = io.StringIO()
    _save(build(kind, shown), buffer, "svg", dpi=ON_PAGE)
    root = ElementTree.fromstring(buffer.getvalue())
    for metadata in root.findall(f"{_SVG}metadata"):
        root.remove(metadata)
    for holder in root.findall(f"{_SVG}defs"):
        for style in holder.findall(f"{_SVG}style"):
            holder.remove(style)
    root.attrib |= {
        "stroke-linejoin": "round",
        "stroke-linecap": "butt",
    }
    prefix = f"{name or kind.name}-"
    for element in root.iter():
        element.tag = element.tag.removeprefix(_SVG)
        _plain_style(element)
        for key, value in list(element.attrib.items()):
            del element.attrib[key]
            element.attrib[key.removeprefix(_LINK)] = _renamed(key.removeprefix(_LINK), value, prefix)
    root.attrib["role"] = "img"
    root.attrib["aria-labelledby"] = f"{prefix}caption"
    return ElementTree.tostring(root, encoding="unicode")


def load_drawing() -> None:
    """Draw a figure of nothing: fonts, formulas and what Matplotlib makes once are then there.

    Of use in a thread before processes that draw are forked, each of which would load them again.
    """
    with matplotlib.rc_context(_style()):
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.set_xlabel(r"Nothing $x^2_\mathrm{a}$ (–)")
        ax.plot([1.0, 2.0], [1.0, 2.0], "o-", label="none")
        ax.set_yscale("log")
        ax.legend()
    _save(figure, io.StringIO(), "svg", dpi=ON_PAGE)


def _plain_style(element: ElementTree.Element) -> None:
    """Turn a style into attributes of the same names: a strict Content-Security-Policy allows no other."""
    for rule in element.attrib.pop("style", "").split(";"):
        name, _, value = rule.partition(":")
        if name.strip():
            element.attrib[name.strip()] = value.strip()


def _renamed(key: str, value: str, prefix: str) -> str:
    if key == "id":
        return prefix + value
    if key == "href" and value.startswith("#"):
        return f"#{prefix}{value[1:]}"
    return value.replace("url(#", f"url(#{prefix}")


def _save(figure: Figure, target: Path | io.StringIO, name: str, *, dpi: float | None = None) -> None:
    # No date and no program: the same result gives the same bytes.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[name]
    with matplotlib.rc_context(_style()):
        figure.savefig(target, format=name, metadata=metadata, dpi=dpi or matplotlib.rcParams["savefig.dpi"])
