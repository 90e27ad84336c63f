"""CSV tables that appear whole or not at all."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dic.cells import text_cell
from kolsky.atomic import replacing

__all__ = ["write_table"]


def write_table(path: Path, columns: Mapping[str, Iterable[Any]]) -> Path:
    """Write named columns of equal length, floats with 9 significant digits; returns the path.

    Text that a spreadsheet would take for a formula gets a leading apostrophe; see `dic.cells.text_cell`.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow([text_cell(name) for name in columns])
        rows.writerows([_cell(value) for value in row] for row in zip(*columns.values(), strict=True))
    return path


def _cell(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else text_cell(str(value))
