"""One self-contained page about a calibration: figures, parameters, pairs and what became of them."""

from pathlib import Path
from typing import Any

from dic.calibration import Calibration
from kolsky.report.calibrationsummary import summary, warnings
from kolsky.report.figures import CALIBRATION
from kolsky.report.rendering import drawn, page, write


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
    write(path, render(name, found))


def render(name: str, found: Calibration) -> str:
    """The page as HTML text; see `write_page`."""
    return page(
        "calibrationpage.html",
        kind="Two cameras from pictures of a target",
        heading=name,
        subject="calibration",
        figures=drawn(CALIBRATION.values(), found),
        rows=list(summary(found).items()),
        warnings=[f"{warning}." for warning in warnings(found)],
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
