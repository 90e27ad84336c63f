"""Tables of a user's folder and their roles in a shot, with columns, units, clock and layout."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.units import dimension_of, unit_factor
from kolsky.readers.contents import Channel
from kolsky.readers.header import likely_unit
from kolsky.readers.measured_tables import QUANTITIES
from kolsky.readers.recordings import read_contents
from kolsky.survey.surface import SurfaceSurvey, survey_surfaces

_FRAME = re.compile(r"(frame|bild|image|img|picture|photo|trame|fotograma)(?![a-z]*zeit)", re.IGNORECASE)
SIGMA = "(sigma|σ|std|uncert|unsich|incert|écart)"
"""Words that identify a column of standard deviations."""
_TIME = re.compile(r"(time|zeit|temps|tiempo|t)\b", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class ColumnEntry:
    """One column of a table."""

    name: str
    """Its heading, as used in a shot file."""
    unit: str
    """Its unit as written in the heading or in the line below. Empty if there is none."""
    dimension: str
    """SI unit of its kind, one of `kolsky.base.units.SHOT_KINDS`; empty if unknown."""
    values: FloatArray
    """Its values in `unit`, shape [n]. Empty for a recorder's channel."""

    def toml(self) -> str:
        """The column in the syntax of a shot file."""
        return f"{{ column = {quoted(self.name)}, unit = {quoted(self.unit)} }}"

    @property
    def whole(self) -> bool:
        """True if its values are whole numbers that never decrease, e.g. the frame number of each point."""
        x = self.values
        return x.size > 1 and bool((x == np.round(x)).all() and (np.diff(x) >= 0.0).all() and x[0] >= 0.0)


@dataclass(frozen=True)
class TableEntry:
    """One file that could be read."""

    path: Path
    columns: tuple[ColumnEntry, ...]
    """Its numeric columns. For a recorder's file, its channels."""
    form: str = ""
    """Format that `layout` must name, because the file itself gives the times. Empty for other files."""
    clock: tuple[float, float, int] | None = None
    """First and last time [s] and number of samples, for a recorder's file that is not a plain table."""

    @property
    def time(self) -> ColumnEntry | None:
        """Its time column."""
        named = [c for c in self.columns if _TIME.match(c.name) and c.dimension in ("s", "")]
        return _single([c for c in self.columns if c.dimension == "s"] or named)

    @property
    def frame(self) -> ColumnEntry | None:
        """Its column of frame numbers."""
        return _single(
            [c for c in self.columns if c.whole and _FRAME.search(c.name) and c.dimension in ("", "1")]
        )

    def of(self, dimension: str) -> list[ColumnEntry]:
        """Its columns with this SI unit."""
        return [c for c in self.columns if c.dimension == dimension]

    def only(self, named: str, *dimensions: str, unlike: str = "$.") -> ColumnEntry | None:
        """The only column with one of these SI units, a name like `named` and not like `unlike`, or None."""
        return _single(
            [
                c
                for c in self.columns
                if c.dimension in dimensions
                and re.search(named, c.name, re.IGNORECASE)
                and not re.search(unlike, c.name, re.IGNORECASE)
            ]
        )

    @property
    def strain(self) -> ColumnEntry | None:
        """Its column of strains."""
        return self.only(QUANTITIES["strain"][1].pattern, "1", "")

    @property
    def stress(self) -> ColumnEntry | None:
        """Its column of stresses."""
        return self.only(QUANTITIES["stress"][1].pattern, "Pa", "", unlike=f"^{SIGMA}")

    @property
    def voltage(self) -> ColumnEntry | None:
        """The transmitted force's column: the only one in volts, or the only such one with its name."""
        return self.only("", "V") or self.only("transm|ausgang|output|sortie", "V")

    @property
    def displacement(self) -> ColumnEntry | None:
        """The flyer's displacement: the only column of lengths that is not a standard deviation."""
        return self.only("", "m", unlike=SIGMA)

    @property
    def times(self) -> FloatArray | None:
        """Its times on the file's clock [s], shape [n]; None if unknown."""
        if self.clock is not None:
            return np.linspace(*self.clock)
        time = self.time
        return None if time is None or not time.unit else time.values * unit_factor(time.unit, "s")


def _single(columns: list[ColumnEntry]) -> ColumnEntry | None:
    """The only column; None if there are none or several."""
    return columns[0] if len(columns) == 1 else None


def quoted(text: str) -> str:
    """A text in TOML syntax."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


SUFFIXES = (
    ".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".xls", ".xlsx", ".tdms", ".mat", ".lvm", ".wfm", ".isf",
    ".bin",
)  # fmt: skip
"""Endings of files that may contain tables or recordings."""
WORKBOOKS = ("excel", "excel 97")
"""Formats with sheets that may be tables or recordings."""
SHIFT = "on the file's clock"
_SCOPE_ROWS = 200
"""Smallest number of samples with which a table without a column in volts is a recording of the force."""


@dataclass(frozen=True)
class Survey:
    """The files of a folder by their role in a shot."""

    parts: Mapping[str, TableEntry]
    """ Files found for "force", "frames", "flyer", "centre_line" and "curve", one file each."""
    doubtful: Mapping[str, str]
    """File name -> reason why it was not used."""
    recordings: tuple[TableEntry, ...] = ()
    """Files with a clock and signals, possibly recordings of the bars."""
    surface: SurfaceSurvey = field(default_factory=SurfaceSurvey)
    """Exports of a DIC program, one file per frame."""


def survey(folder: Path) -> Survey:
    """Survey the files of a folder. Nothing is written, and unreadable files are listed."""
    parts: dict[str, list[TableEntry]] = {}
    doubtful: dict[str, str] = {}
    recordings: list[TableEntry] = []
    surface = survey_surfaces(folder)
    files = sorted(p for p in folder.iterdir() if p.is_file() and p.suffix.lower() in SUFFIXES)
    for path in files:
        if path in surface.files:
            continue
        try:
            table = read_entry(path)
        except InputError as error:
            doubtful[path.name] = str(error) if "DuoDIC" in error.message else error.message
            continue
        if _is_recording(table):
            recordings.append(table)
        part = _part_of(table)
        if part is None:
            doubtful[path.name] = "its columns are of no part of a shot"
        else:
            parts.setdefault(part, []).append(table)
    for part, tables in parts.items():
        if len(tables) > 1:
            names = ", ".join(table.path.name for table in tables)
            doubtful |= {t.path.name: f"could be [{part}], and so could each of {names}" for t in tables}
    chosen = {part: tables[0] for part, tables in parts.items() if len(tables) == 1}
    for part, series in (("centre_line", surface.specimen), ("flyer", surface.flyer)):
        if series is not None and part in chosen:
            doubtful[chosen.pop(part).path.name] = f"the exports {series.pattern} are taken instead"
    return Survey(chosen, {**doubtful, **surface.doubtful}, tuple(recordings), surface)


def _is_recording(table: TableEntry) -> bool:
    """True for a file with a clock, many samples and a signal other than lengths or frame numbers."""
    if table.clock is not None:
        return table.clock[2] >= _SCOPE_ROWS
    time = table.time
    if time is None or time.values.size < _SCOPE_ROWS or table.frame is not None:
        return False
    return any(c is not time and c.dimension in ("", "V", "1") for c in table.columns)


def _part_of(table: TableEntry) -> str | None:
    """The table of a shot file for a file. None if the columns of the file do not identify it."""
    frame, lengths = table.frame, table.of("m")
    if frame is not None:
        if np.unique(frame.values).size < frame.values.size:
            return "centre_line" if len(lengths) > 1 else None
        if lengths:
            return "flyer"
        return "frames" if table.time is not None else None
    if table.strain is not None and table.stress is not None:
        return "curve"
    if table.of("V") or table.clock is not None:
        return "force"
    long = table.time is not None and table.time.values.size >= _SCOPE_ROWS
    return "force" if long and len(table.columns) > 1 and not table.of("Pa") and not lengths else None


def clock_text(table: TableEntry) -> str:
    """First time, last time and step of a file, in words; empty if not known."""
    times = table.times
    if times is None or times.size < 2 or not np.isfinite(times).all():
        return ""
    step = float(np.median(np.diff(np.unique(times))))
    return f"{microseconds(times[0])} to {microseconds(times[-1])}, every {microseconds(step)}, {SHIFT}"


def microseconds(seconds: float) -> str:
    """A time as text."""
    return f"{1e6 * seconds:.6g} us"


def read_entry(path: Path) -> TableEntry:
    """A file, read with its detected layout. Raises InputError if the file cannot be read."""
    contents = read_contents(path)
    facts = contents.facts
    if facts["format"] not in ("delimited", *WORKBOOKS):
        columns = [
            ColumnEntry(c.name, c.unit or "", dimension_of(c.unit or ""), np.empty(0))
            for c in contents.channels
        ]
        return TableEntry(path, tuple(columns), facts["format"], _clock(contents.channels[0]))
    columns = []
    for channel in sorted((*contents.channels, *contents.times), key=lambda channel: channel.number):
        try:
            values = channel.values()
        except InputError:
            continue  # a column of words
        below = channel.unit if "units" in facts or facts["format"] in WORKBOOKS else None
        unit = likely_unit(channel.name) or below or ""
        columns.append(ColumnEntry(channel.name, unit, dimension_of(unit), values))
    entry = TableEntry(path, tuple(columns))
    if entry.time is None:
        with suppress(InputError, IndexError):  # a rate or an interval in the header may give the clock
            return replace(entry, form=facts["format"], clock=_clock(contents.channels[0]))
    return entry


def _clock(channel: Channel) -> tuple[float, float, int]:
    """First and last time [s] and number of samples of a channel."""
    clock = channel.clock()
    return clock.start, clock.start + clock.interval * (channel.samples - 1), channel.samples
