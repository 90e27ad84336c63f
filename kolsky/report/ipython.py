"""Registration of the views with IPython, by name of the type, and as methods of results.

Modules are imported only when they are needed.
"""

import io
import sys
from collections.abc import Callable
from typing import Any

from dic import views

__all__ = ["register"]

SHOWN = (
    ("dic.surfaces.surface_history", "SurfaceHistory"),
    ("kolsky.inverse.result", "Identification"),
    ("kolsky.shot.records", "ShotBase"),
)
"""Module and name of every type with a view in `kolsky.report.notebook`. Subclasses have the same view."""


PNG_DPI = 144.0
"""Resolution of a figure in a notebook [dots per inch]. A journal's page is 960 px wide."""


def register() -> None:
    """Register the views as methods of results and, if it runs, with IPython."""
    views.MAKERS.append(_notebook)
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is not None:
        formatters = shell.display_formatter.formatters
        register_with(formatters["text/html"].for_type_by_name)
        formatters["image/png"].for_type_by_name("matplotlib.figure", "Figure", _png)


def register_with(for_type_by_name: Callable[[str, str, Callable[[Any], str]], Any]) -> None:
    """Call ``for_type_by_name(module, name, view)`` of a formatter once for every type that has a view."""
    for module, name in SHOWN:
        for_type_by_name(module, name, _html)


def _notebook() -> Any:
    from kolsky.report import notebook  # slow to load, therefore only when something is shown

    return notebook


def _html(data: Any) -> str:
    return str(_notebook().html(data))


def _png(figure: Any) -> bytes:
    """A figure that is the value of a cell."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=PNG_DPI)
    return picture.getvalue()
