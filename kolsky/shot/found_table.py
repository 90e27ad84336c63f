"""One table that was found in a folder: its columns with their units, its clock, its layout."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.units import UnitError, unit_factor
from kolsky.readers.text import matched

DIMENSIONS = ("s", "m", "V", "Pa", "N", "1")
"""SI units of what columns of a shot hold."""
_UNIT = re.compile(r".*?(?:[(\[]\s*([^()\[\]]+?)\s*[)\]]|\s/\s*(\S+)|\s+in\s+(\S+)|_([A-Za-zµ%]+))\s*")
_FRAME = re.compile(r"(frame|bild|image|img|picture|photo|trame|fotograma)(?![a-z]*zeit)", re.IGNORECASE)
_TIME = re.compile(r"(time|zeit|temps|tiempo|t)\b", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class FoundColumn:
    """One column of a table, as its heading names it."""

    name: str
    """Its heading, by which a shot file asks for it."""
    unit: str
    """Its unit as the heading or the line below it writes it; empty if neither does."""
    dimension: str
    """SI unit of its kind, one of `DIMENSIONS`; empty if it is not known."""
    values: FloatArray
    """What it holds, in `unit`, shape [n]; empty of a recorder's channel."""

    def toml(self) -> str:
        """The column as a shot file declares it."""
        return f"{{ column = {quoted(self.name)}, unit = {quoted(self.unit)} }}"

    @property
    def whole(self) -> bool:
        """True if it holds whole numbers that never fall: frame numbers, point by point."""
        x = self.values
        return x.size > 1 and bool((x == np.round(x)).all() and (np.diff(x) >= 0.0).all() and x[0] >= 0.0)


@dataclass(frozen=True)
class FoundTable:
    """One file that could be read."""

    path: Path
    """The file."""
    columns: tuple[FoundColumn, ...]
    """Its columns of numbers; of a recorder's file its channels."""
    layout: Mapping[str, str | int] = field(default_factory=dict)
    """Keys of `layout` that it needs; none if it is UTF-8 with commas, points and one header line."""
    clock: tuple[float, float, int] | None = None
    """First and last time [s] and number of samples of a recorder's file that is no plain table."""

    @property
    def time(self) -> FoundColumn | None:
        """Its time column."""
        named = [c for c in self.columns if _TIME.match(c.name) and c.dimension in ("s", "")]
        found = [c for c in self.columns if c.dimension == "s"] or named
        return found[0] if len(found) == 1 else None

    @property
    def frame(self) -> FoundColumn | None:
        """Its column of frame numbers."""
        found = [c for c in self.columns if c.whole and _FRAME.search(c.name) and c.dimension in ("", "1")]
        return found[0] if len(found) == 1 else None

    def of(self, dimension: str) -> list[FoundColumn]:
        """Its columns of one kind."""
        return [c for c in self.columns if c.dimension == dimension]

    def only(self, pattern: str, dimension: str) -> FoundColumn | None:
        """The one column of a kind whose name begins so; None if there is not exactly one."""
        found = [c for c in self.of(dimension) if re.match(pattern, c.name, re.IGNORECASE)]
        return found[0] if len(found) == 1 else None

    def toml_layout(self) -> str:
        """Its layout as a shot file declares it; empty if it needs none."""
        said = (f"{k} = {v if isinstance(v, int) else quoted(v)}" for k, v in self.layout.items())
        return f"{{ {', '.join(said)} }}" if self.layout else ""

    def seconds(self) -> FloatArray:
        """First and last time and the steps' median [s], shape [3]; NaN where they are not known."""
        time = self.time
        if self.clock is not None:
            first, last, count = self.clock
            return np.array([first, last, (last - first) / max(count - 1, 1)])
        if time is None or not time.unit or time.values.size < 2:
            return np.full(3, np.nan)
        t = time.values * unit_factor(time.unit, "s")
        return np.array([t[0], t[-1], np.median(np.diff(np.unique(t)))])


def unit_in(heading: str) -> str:
    """The unit that a heading names: in brackets, behind a stroke, "in", or a last underscore."""
    match = matched(_UNIT, heading)
    text = next((group for group in match.groups() if group), "") if match else ""
    text = "1" if text == "-" else text
    return text if dimension_of(text) else ""


def dimension_of(unit: str) -> str:
    """SI unit of a unit's kind, one of `DIMENSIONS`; empty if it is none of them."""
    for dimension in DIMENSIONS if unit else ():
        try:
            unit_factor("1" if unit == "-" else unit, dimension)
        except UnitError:
            continue
        return dimension
    return ""


def quoted(text: str) -> str:
    """A text as TOML writes it."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
