"""What every page has in common: one template, text escaped, figures inside, written atomically."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any
from unicodedata import category

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from kolsky.base.files import replacing
from kolsky.base.process import infrequent_gc
from kolsky.report.canvas import inline_svg
from kolsky.report.figures import FigureKind
from kolsky.report.pages.parallel import draw_in_processes

_HERE = Path(__file__).parent
HEADING = 120
"""Most characters of a heading."""
LONGEST = 2000
"""Most characters of any other text that a page shows; the longest warning has some 600."""


def environment() -> Environment:
    """Templates of this folder: every text is escaped and legible, a name that nobody set is an error."""
    return Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=printable_text,
    )


def printable_text(value: Any) -> Any:
    """A text as a page can hold it: control characters become "□", a very long text loses its middle.

    Names and metadata of files come from anywhere. HTML allows no control characters, and those that turn the
    direction of writing would let a name pass for another; the results file has every text whole.
    """
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    # Other separators and surrogates stay: a space is a space, and `write` shows what is no text.
    line = "".join("□" if c not in "\t\n\r" and category(c) in ("Cc", "Cf") else c for c in value)
    return shortened(line, LONGEST)


def shortened(text: str, most: int) -> str:
    """A text of at most `most` characters, its middle replaced by "…" if it is longer."""
    return text if len(text) <= most else f"{text[: most - most // 2 - 1]}…{text[-(most // 2) :]}"


def draw_figures(
    kinds: Iterable[FigureKind[Any]],
    shown: Any,
    *,
    captioned: Any = None,
    first: int = 1,
    processes: int = 1,
) -> list[dict[str, Any]]:
    """The figures that apply, numbered, as the templates take them.

    Parameters
    ----------
    kinds
        Kinds of figures in the order of the page.
    shown
        What they draw.
    captioned
        What the captions and the question whether a figure applies are about; `shown` if left out.
    first
        Number of the first figure.
    processes
        Processes that draw, 1 or 2; see `kolsky.report.pages.parallel.draw_in_processes`.
    """
    kinds, about = list(kinds), shown if captioned is None else captioned
    apart = [kind for kind in kinds if kind.ahead is not None]
    for kind in apart:
        if kind.ahead is not None:
            kind.ahead(about)
    alone = [kind for kind in kinds if kind.ahead is None and kind.applies(about)]
    with infrequent_gc():
        pictures = draw_in_processes(processes, [partial(inline_svg, kind, shown) for kind in alone])
        svgs = dict(zip((kind.name for kind in alone), pictures, strict=True))
        svgs |= {kind.name: inline_svg(kind, shown) for kind in apart if kind.applies(about)}
    return [
        {
            "id": kind.name,
            "number": number,
            "svg": Markup(svgs[kind.name]),  # serialised as XML: every text is escaped
            "caption": kind.caption(about),
            "width": kind.width,
        }
        for number, kind in enumerate((kind for kind in kinds if kind.name in svgs), start=first)
    ]


def render_page(
    template: str,
    *,
    kind: str,
    heading: str,
    subject: str,
    using: Environment | None = None,
    **context: Any,
) -> str:
    """A page as HTML text.

    Parameters
    ----------
    template
        A file of this folder that extends `base.html`.
    kind
        The line above the heading: what sort of page it is.
    heading
        The heading, mostly a shot's name; a long one is abridged.
    subject
        What follows the heading in the window's title.
    using
        Templates with filters of their own; those of `environment` if left out.
    context
        Everything else the template names.
    """
    css = Markup((_HERE / "page.css").read_text(encoding="utf-8"))
    found = (using or environment()).get_template(template)
    return found.render(css=css, kind=kind, heading=shortened(heading, HEADING), subject=subject, **context)


def write_html(path: Path, html: str) -> None:
    """Write a page as a single file; an older one is replaced when the new one is complete.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with replacing(Path(path)) as partial:
        # Names of files can hold bytes that are no text; they are shown as escapes rather than refused.
        partial.write_bytes(html.encode("utf-8", errors="backslashreplace"))
