"""Figures of results as separate files, if a command requests them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kolsky.report.figures.base import FigureKind


def figure_files(
    formats: Sequence[str], *shown: Any, name: str = "figures"
) -> dict[str, Callable[[Path], object]]:
    """The folder of the figures of some results, for `kolsky.base.files.write_folder`.

    Empty without formats. Matplotlib is loaded only if figures are written.
    """
    return grouped_figures(formats, [(one, None) for one in shown], name)


def grouped_figures(
    formats: Sequence[str],
    groups: "Iterable[tuple[Any, Mapping[str, FigureKind[Any]] | None]]",
    name: str = "figures",
) -> dict[str, Callable[[Path], object]]:
    """As `figure_files`, each result with its own registry of figures."""

    def write(folder: Path) -> None:
        from kolsky.report.canvas import save_figures

        for shown, registry in groups:
            save_figures(folder, shown, formats=formats, registry=registry)

    return {name: write} if formats else {}
