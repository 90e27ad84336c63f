"""One self-contained page about a calibration: figures, parameters, pairs and what became of them."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from dic.calibration import Calibration
from kolsky import calibratecommand
from kolsky.atomic import replacing
from kolsky.report.canvas import inline_svg
from kolsky.report.figures import CALIBRATION

_HERE = Path(__file__).parent


def write_page(path: Path, name: str, found: Calibration) -> None:
    """Write the page as a single HTML file without scripts or outside resources.

    Parameters
    ----------
    path : Path
        The file, replaced atomically if it exists; its folder must exist.
    name : str
        What was calibrated.
    found : Calibration
        The result.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    html = render(name, found)
    with replacing(Path(path)) as partial:
        partial.write_bytes(html.encode("utf-8", errors="backslashreplace"))


def render(name: str, found: Calibration) -> str:
    """The page as HTML text; see `write_page`."""
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    figures = [
        {
            "id": kind.name,
            "number": number,
            "svg": Markup(inline_svg(kind, found)),  # serialised as XML: every text is escaped
            "caption": kind.caption(found),
            "width": kind.width,
        }
        for number, kind in enumerate(CALIBRATION.values(), start=1)
    ]
    return environment.get_template("calibrationpage.html").render(
        css=Markup((_HERE / "page.css").read_text(encoding="utf-8")),
        name=name,
        figures=figures,
        rows=list(calibratecommand.summary(found).items()),
        warnings=calibratecommand.warnings(found),
        pairs=[_row(pair) for pair in found.pairs],
    )


def _row(pair: Any) -> dict[str, Any]:
    """What the table says of a pair."""
    points = [0 if view is None else int(view.used.sum()) for view in pair.views]
    rms = ["" if view is None else f"{view.rms:.4f}" for view in pair.views]
    said = (
        "" if pair.outcome.value == 0 else f"{pair.outcome.cause}: {pair.reason}. Cure: {pair.outcome.cure}"
    )
    return {
        "name": pair.name, "rms": rms, "points": points, "ok": pair.outcome.used, "said": said,
        "outcome": pair.outcome.name.lower().replace("_", " "),
    }  # fmt: skip
