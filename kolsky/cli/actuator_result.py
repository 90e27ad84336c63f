"""How a command on an actuator ends: its page, its JSON file and figures, and what the terminal shows."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kolsky.report.actuator_view import ActuatorView


def write_result(
    folder: Path,
    view: "ActuatorView",
    said: dict[str, Any],
    inputs: dict[str, str],
    *,
    formats: tuple[str, ...],
    as_json: bool,
    started: float,
    more: Callable[[Path], None] | None = None,
) -> None:
    """Write actuator.html, actuator.json, figures and what `more` writes, and print the result."""
    from kolsky.base.files import filling
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.figures_alone import save_figures_alone
    from kolsky.report.pages.actuator import printed, write_page
    from kolsky.report.specimen_folder import write_json

    with filling(folder) as partial:
        if more is not None:
            more(partial)
        write_json(partial / "actuator.json", said)
        write_page(partial / "actuator.html", view, inputs)
        save_figures_alone(partial, view, formats)
    print_result(
        printed(view),
        said if as_json else None,
        rest={"page": folder / "actuator.html", "wall time": since(started)},
        warnings=view.warnings,
    )
