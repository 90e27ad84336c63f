"""Common parts of all pages: templates with escaped text, figures as SVG, atomic writing."""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any
from unicodedata import category

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from dic.processes import run_parallel
from kolsky.base.process import infrequent_gc
from kolsky.report.canvas import build, inline_svg
from kolsky.report.figures import FigureKind, figures_of
from kolsky.results import nomenclature, numbers
from kolsky.results.nomenclature import upper_first, with_subscripts

_HERE = Path(__file__).parent
HEADING = 120
"""Largest number of characters of a heading."""
LONGEST = 2000
"""Largest number of characters of any other text. The longest warning has some 600."""


@cache
def environment() -> Environment:
    """Return the templates of this folder. Text is escaped and printable; undefined names are errors."""
    made = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=printable_text,
    )
    made.filters |= {
        "typeset": nomenclature.typeset,
        "upper_first": nomenclature.upper_first,
        "symbol": nomenclature.with_subscripts,
        "in_words": nomenclature.in_words,
        "name_of": nomenclature.name_of,
        "route_label": nomenclature.route_label,
        "plain": numbers.plain,
    }
    made.globals |= {
        "like": numbers.like,
        "uncertainty": lambda value, U: numbers.measured(value, U)[1],
        "unit": shown_unit,
    }
    return made


def shown_unit(unit: str) -> str:
    """Return the unit as shown: nothing for "1"."""
    return "" if unit == "1" else unit


def printable_text(value: Any) -> Any:
    """Return a text with "□" for control characters, and for those that change the direction of writing.

    Names and metadata of files can contain anything. A very long text loses its middle.
    """
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    # Separators stay. Surrogates stay too; `render_page` shows them as escapes.
    line = "".join("□" if c not in "\t\n\r" and category(c) in ("Cc", "Cf") else c for c in value)
    return shortened(line, LONGEST)


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters. "…" replaces the middle of a longer one."""
    return text if len(text) <= most else f"{text[: most - most // 2 - 1]}…{text[-(most // 2) :]}"


FigureGroup = tuple[Iterable[FigureKind[Any]], Any]
"""Figures in the order of a page, and the result that they show."""


def draw_figures(
    shown: Any,
    kinds: Iterable[FigureKind[Any]] | None = None,
    *,
    first: int = 1,
    processes: int = 1,
    mark: str = "",
) -> list[dict[str, Any]]:
    """Draw figures, those of a result by default, with the options of `draw_groups`."""
    kinds = figures_of(shown).values() if kinds is None else kinds
    return draw_groups([(kinds, shown)], first=first, processes=processes, mark=mark)


def draw_groups(
    groups: Sequence[FigureGroup], *, first: int = 1, processes: int = 1, mark: str = ""
) -> list[dict[str, Any]]:
    """Draw the figures that apply and return them with numbers, for the templates.

    The first and the last figures take longest and are started first, so that parallel processes finish at
    about the same time. ``groups``: in the order of the page. ``processes``: processes that draw. ``mark``:
    suffix of the figures' ids, if a page has several figures of one name.
    """
    figures = [(kind, shown) for kinds, shown in groups for kind in kinds if kind.applies(shown)]
    names = [f"{kind.name}-{mark}" if mark else kind.name for kind, _ in figures]
    with infrequent_gc():
        draw = [partial(_drawn, *one, name) for one, name in zip(figures, names, strict=True)]
        order = sorted(range(len(draw)), key=lambda k: min(k, len(draw) - 1 - k))
        drawn = run_parallel([draw[k] for k in order], processes=processes)
        pictures = [drawn[order.index(k)] for k in range(len(draw))]
    return [
        {
            "id": name,
            "number": number,
            "svg": Markup(svg),  # serialised as XML: every text is escaped
            "caption": with_subscripts(caption),
            "width": kind.width,
        }
        for number, (name, (svg, caption), (kind, _)) in enumerate(
            zip(names, pictures, figures, strict=True), start=first
        )
    ]


def _drawn(kind: FigureKind[Any], shown: Any, name: str) -> tuple[str, str]:
    """Draw a figure, and return its SVG and its caption."""
    figure = build(kind, shown)
    return inline_svg(figure, name), str(figure.get_label())


def render_page(template: str, *, kind: str, heading: str, subject: str, **context: Any) -> str:
    """Return a page as HTML text, which needs no network and has no external scripts.

    ``template``: a file of this folder that extends `base.html`. ``kind``: line above the heading.
    ``subject``: text after the heading in the title of the window. ``context``: all other variables of the
    template. File names can contain bytes that are not text; they are escapes.
    """
    css = Markup((_HERE / "page.css").read_text(encoding="utf-8"))
    page = environment().get_template(template)
    policy = {
        "styles": digest(css),
        "scripts": digest(context["script"]) if "script" in context else "'none'",
    }
    heading = shortened(heading, HEADING)
    text = page.render(css=css, policy=policy, kind=kind, heading=heading, subject=subject, **context)
    return text.encode("utf-8", errors="backslashreplace").decode("utf-8")


def script(name: str) -> Markup:
    """A script of this folder, for embedding in a page."""
    return Markup((_HERE / name).read_text(encoding="utf-8"))


def digest(text: str) -> Markup:
    """The source of a Content-Security-Policy that allows exactly this text."""
    value = base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode()
    return Markup(f"'sha256-{value}'")


def sentences(texts: Iterable[str]) -> list[str]:
    """Return warnings as sentences."""
    return [f"{upper_first(text)}." for text in texts]
