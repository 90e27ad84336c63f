"""What every page has in common: one template, text escaped, figures inside, written atomically."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from kolsky.atomic import replacing
from kolsky.report.canvas import inline_svg
from kolsky.report.figures import FigureKind

_HERE = Path(__file__).parent


def environment() -> Environment:
    """Templates of this folder: every text is escaped, a name that nobody set is an error."""
    return Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def drawn(kinds: Iterable[FigureKind[Any]], shown: Any, *, captioned: Any = None) -> list[dict[str, Any]]:
    """The figures that apply, numbered from 1, as the templates take them.

    Parameters
    ----------
    kinds
        Kinds of figures in the order of the page.
    shown
        What they draw.
    captioned
        What the captions and the question whether a figure applies are about; `shown` if left out.
    """
    about = shown if captioned is None else captioned
    return [
        {
            "id": kind.name,
            "number": number,
            "svg": Markup(inline_svg(kind, shown)),  # serialised as XML: every text is escaped
            "caption": kind.caption(about),
            "width": kind.width,
        }
        for number, kind in enumerate((kind for kind in kinds if kind.applies(about)), start=1)
    ]


def page(
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
        The heading, mostly a shot's name.
    subject
        What follows the heading in the window's title.
    using
        Templates with filters of their own; those of `environment` if left out.
    context
        Everything else the template names.
    """
    css = Markup((_HERE / "page.css").read_text(encoding="utf-8"))
    found = (using or environment()).get_template(template)
    return found.render(css=css, kind=kind, heading=heading, subject=subject, **context)


def write(path: Path, html: str) -> None:
    """Write a page as a single file; an older one is replaced when the new one is complete.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with replacing(Path(path)) as partial:
        # Names of files can hold bytes that are no text; they are shown as escapes rather than refused.
        partial.write_bytes(html.encode("utf-8", errors="backslashreplace"))
