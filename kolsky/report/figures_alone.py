"""Figures of a result as separate files, if a command requests them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kolsky.report.figures.base import FigureKind


def save_figures_alone(
    folder: Path,
    shown: Any,
    formats: Sequence[str],
    *,
    registry: "Mapping[str, FigureKind[Any]] | None" = None,
) -> None:
    """Save the figures of a result as separate files if formats are given.

    Matplotlib is loaded only in this case.
    """
    if formats:
        from kolsky.report.canvas import save_figures

        save_figures(folder / "figures", shown, formats=tuple(formats), registry=registry)
