"""Figures of a result as files of their own, where a command is asked for them."""

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
    """Save the figures of a result alone, if formats are asked for; Matplotlib is loaded only then."""
    if formats:
        from kolsky.report.canvas import save_figures

        save_figures(folder / "figures", shown, formats=tuple(formats), registry=registry)
