"""Figures of results as separate files, if a command requests them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def figure_files(
    formats: Sequence[str], *shown: Any, name: str = "figures"
) -> dict[str, Callable[[Path], object]]:
    """The folder of the figures of some results, for `kolsky.base.files.write_folder`.

    A pair is a result with its registry of figures. Empty without formats. Matplotlib is loaded only if
    figures are written.
    """

    def write(folder: Path) -> None:
        from kolsky.report.canvas import save_figures

        for one in shown:
            result, registry = one if isinstance(one, tuple) else (one, None)
            save_figures(folder, result, formats=formats, registry=registry)

    return {name: write} if formats else {}
