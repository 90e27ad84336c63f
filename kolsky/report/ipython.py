"""Registration of the views as methods of results, and of figures with IPython.

Modules are imported only when they are needed.
"""

import io
import sys
from typing import Any

from dic import views

__all__ = ["register"]

PNG_DPI = 144.0
"""Resolution of a figure in a notebook [dots per inch]. A journal's page is 960 px wide."""


def register() -> None:
    """Register the views as methods of results and, if it runs, with IPython."""
    views.MAKERS.append(_notebook)
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is not None:
        pictures = shell.display_formatter.formatters["image/png"]
        pictures.for_type_by_name("matplotlib.figure", "Figure", _png)


def _notebook() -> Any:
    from kolsky.report import notebook  # slow to load, therefore only when something is shown

    return notebook


def _png(figure: Any) -> bytes:
    """A figure that is the value of a cell."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=PNG_DPI)
    return picture.getvalue()
