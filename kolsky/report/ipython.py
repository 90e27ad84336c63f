"""Registration of the HTML views with IPython, by name of the type, so that nothing is imported early."""

import sys
from collections.abc import Callable
from typing import Any

__all__ = ["register"]

SHOWN = (
    ("dic.surfaces.surface_history", "SurfaceHistory"),
    ("kolsky.inverse.result", "Identification"),
    ("kolsky.shot.records", "ShotBase"),
)
"""Module and name of every type with a view in `kolsky.report.notebook`; subclasses are shown alike."""


def register() -> None:
    """Register the views with the running IPython, if there is one."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is not None:
        register_with(shell.display_formatter.formatters["text/html"].for_type_by_name)


def register_with(for_type_by_name: Callable[[str, str, Callable[[Any], str]], Any]) -> None:
    """Call ``for_type_by_name(module, name, view)`` of a formatter once for every type that has a view."""
    for module, name in SHOWN:
        for_type_by_name(module, name, _html)


def _html(data: Any) -> str:
    from kolsky.report.notebook import html  # loads much: when something is shown, not before

    return html(data)
