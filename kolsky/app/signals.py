"""Signals from the files of an incomplete shot, for the plots of its form.

Nothing is guessed. A plot appears when its file and column are declared. Clocks, units and signs are applied
when they are declared.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from dic.images import PictureError, Pictures
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.units import quantity, unit_factor
from kolsky.pictures.picture_set import CAMERAS, PictureChanges, open_source, picture_changes
from kolsky.readers.recordings import read_contents
from kolsky.survey.pictures import SeriesEntry, survey_pictures
from kolsky.survey.surface import SurfaceSurvey, survey_surfaces
from kolsky.survey.tables import SUFFIXES, Survey, TableEntry, read_entry

MOST_POINTS = 3000
"""Maximum number of points of a plotted signal. Longer signals show the minimum and maximum of each
section."""
PREVIEW_ROWS = 6
RIGS = (".xml", ".yml", ".yaml", ".txt", ".csv", ".caldat", ".cal", ".json")
"""Endings of files that may contain two calibrated cameras."""


@dataclass(frozen=True)
class Signal:
    """A curve of a plot."""

    x: FloatArray
    """Shape [n], in the unit of the axis."""
    y: FloatArray
    """Values, shape [n]."""
    x_name: str
    """Quantity and unit along x."""
    y_name: str
    """Quantity and unit along y."""


def _places(folder: Path) -> list[Path]:
    """A folder and its subfolders without the results."""
    return [folder, *sorted(p for p in folder.iterdir() if p.is_dir() and p.name != "results")]


def candidate_files(folder: Path) -> list[str]:
    """Files of a folder and its subfolders that may be tables or recordings.

    Their names are those of a shot file. Only the first file of a series of exports is listed.
    """
    found: list[str] = []
    for place in _places(folder):
        names = sorted(p for p in place.iterdir() if p.is_file() and p.suffix.lower() in SUFFIXES)
        found += [
            p.relative_to(folder).as_posix() for p in (names if place == folder or len(names) < 9 else [])
        ]
    return found


@lru_cache(maxsize=64)
def _entry(path: Path, changed: float) -> TableEntry:
    return read_entry(path)


def entry(folder: Path, name: str) -> TableEntry:
    """A file of a shot as a table. Raises InputError if it does not exist or cannot be read."""
    path = folder / name
    if not name or not path.is_file():
        raise InputError(path, "is not there", cure="choose another file")
    return _entry(path, path.stat().st_mtime)


@lru_cache(maxsize=8)
def _surfaces(folder: Path, state: tuple[int, float]) -> SurfaceSurvey:
    return survey_surfaces(folder)


def surfaces(folder: Path) -> SurfaceSurvey:
    """The series of exports of a folder. They are read again if one of its tables was added or changed."""
    files = (one for place in _places(folder) for one in os.scandir(place))
    times = [one.stat().st_mtime for one in files if one.name.lower().endswith(SUFFIXES)]
    return _surfaces(folder, (len(times), max(times, default=0.0)))


@lru_cache(maxsize=8)
def _series(folder: Path, state: tuple[int, float]) -> tuple[SeriesEntry, ...]:
    return survey_pictures(folder, Survey({}, {})).others


def picture_series(folder: Path) -> tuple[SeriesEntry, ...]:
    """The picture series of a folder. They are searched again if something was added to the folder."""
    places = _places(folder)
    return _series(folder, (len(places), max(place.stat().st_mtime for place in places)))


def rig_files(folder: Path) -> list[str]:
    """Files of a folder and its subfolders that may contain two calibrated cameras."""
    files = (one for place in _places(folder) for one in sorted(place.iterdir()))
    return [
        one.relative_to(folder).as_posix() for one in files if one.is_file() and one.suffix.lower() in RIGS
    ]


def declared_series(folder: Path, content: Mapping[str, Any]) -> list[Pictures]:
    """The declared pictures of both cameras. Empty while one series cannot be opened."""
    found = []
    for camera in CAMERAS:
        section = content.get("pictures", {}).get(camera)
        if not isinstance(section, dict):
            return []
        kind = "file" if section.get("file") else "pattern"
        try:
            found.append(open_source(folder, kind, str(section.get(kind) or "")))
        except (PictureError, OSError, ValueError):
            return []
    return found


def changes(series: list[Pictures]) -> PictureChanges | None:
    """Difference of the pictures from the first one, by frame number; None without pictures."""
    count = min((one.n_frames for one in series), default=0)
    return picture_changes(series, np.arange(count, dtype=float), 1) if count else None


def change_signal(found: PictureChanges) -> Signal:
    """The change of the pictures by frame. It is the larger of those of both cameras."""
    return Signal(found.time, 100.0 * np.fmax(*found.change), FRAME, "Change from the first picture (%)")


def preview(table: TableEntry) -> tuple[list[str], list[list[str]]]:
    """Headings with units, and the first rows of a file."""
    heads = [f"{c.name}" + (f" [{c.unit}]" if c.unit and c.unit not in c.name else "") for c in table.columns]
    columns = [c.values if c.values.size else _samples(table, c.name)[:PREVIEW_ROWS] for c in table.columns]
    rows = [[f"{c[i]:.6g}" if i < len(c) else "" for c in columns] for i in range(PREVIEW_ROWS)]
    return heads, rows


def assigned(part: str, table: TableEntry) -> dict[str, str | None]:
    """Values of a table of the shot file, found in the data file: its name and columns."""
    from kolsky.survey.new_file import table_findings

    found = table_findings(Survey({part: table}, {})).values
    return {key: value for key, value in found.items() if key.startswith(f"{part}.")}


def _samples(table: TableEntry, name: str) -> FloatArray:
    for column in table.columns:
        if column.name == name and column.values.size:
            return column.values
    channel = next((c for c in read_contents(table.path).channels if c.name == name), None)
    return np.empty(0) if channel is None else np.asarray(channel.values(), dtype=float)


def _column(section: Mapping[str, Any], key: str) -> tuple[str, str]:
    """Name and unit of a declared column. Empty if blank."""
    declared = section.get(key)
    if not isinstance(declared, dict):
        return "", ""
    return str(declared.get("column", "")), str(declared.get("unit", ""))


def _values(table: TableEntry, section: Mapping[str, Any], key: str, si: str, into: float) -> FloatArray:
    """A declared column in the unit of a plot. It is not converted while its unit is blank or wrong."""
    name, unit = _column(section, key)
    values = _samples(table, name)
    try:
        return values * unit_factor(unit, si) * into
    except ValueError:
        return values


def _offset(section: Mapping[str, Any]) -> float:
    """The declared offset of a clock [s]. Zero while it is blank."""
    try:
        return quantity(str(section.get("clock_offset", "")), "s")
    except ValueError:
        return 0.0


def force_signal(folder: Path, content: Mapping[str, Any]) -> Signal | None:
    """The transmitted force's volts on the shot's clock. Compression is upward when its sign is declared."""
    section = content.get("force", {})
    table = entry(folder, str(section.get("file", "")))
    volts = _values(table, section, "voltage", "V", 1.0)
    if not volts.size:
        return None
    if table.clock is not None:
        time = np.linspace(table.clock[0], table.clock[1], table.clock[2])[: volts.size]
    else:
        time = _values(table, section, "time", "s", 1.0)
    if time.size != volts.size:
        return None
    flip = section.get("compression") == "negative"
    x, y = thinned(1e6 * (time + _offset(section)), -volts if flip else volts)
    return Signal(x, y, CLOCK, "Minus signal (V)" if flip else "Signal (V)")


def motion_signal(folder: Path, content: Mapping[str, Any]) -> Signal | None:
    """The flyer's motion by frame. It is toward the specimen when its sign is declared."""
    section = content.get("flyer")
    if isinstance(section, dict):
        table = entry(folder, str(section.get("file", "")))
        travel = _values(table, section, "displacement", "m", 1e3)
        number = _samples(table, str(section.get("frame", "")))
        if not travel.size:
            return None
        sign = -1.0 if section.get("positive") == "away from specimen" else 1.0
        frame = number if number.size == travel.size else np.arange(travel.size, dtype=float)
        travel = sign * travel[np.argsort(frame, kind="stable")]
        return Signal(np.arange(travel.size, dtype=float), travel, FRAME, MOTION)
    series = surfaces(folder).flyer or surfaces(folder).specimen
    if series is None or "surface" not in content:
        return None
    travel = 1e3 * np.linalg.norm(series.motion, axis=1)
    return Signal(np.arange(travel.size, dtype=float), travel, FRAME, "Mean motion (mm)")


CLOCK = "Time on the shot's clock (µs)"
FRAME, MOTION = "Frame, counted from 0", "Flyer toward specimen (mm)"


def on_clock(folder: Path, content: Mapping[str, Any], motion: Signal) -> Signal | None:
    """A motion by frame on the shot's clock, with the declared file of frames and its offset."""
    section = content.get("frames", {})
    time = _values(entry(folder, str(section.get("file", ""))), section, "time", "s", 1.0)
    number = motion.x.astype(int)
    if not time.size or number.max(initial=0) >= time.size:
        return None
    return Signal(1e6 * (np.sort(time)[number] + _offset(section)), motion.y, CLOCK, motion.y_name)


def curve_signal(folder: Path, content: Mapping[str, Any]) -> Signal | None:
    """The quasi-static curve. It is tension positive when its convention is declared."""
    section = content.get("curve", {})
    table = entry(folder, str(section.get("file", "")))
    strain = _values(table, section, "strain", "1", 100.0)
    stress = _values(table, section, "stress", "Pa", 1e-3)
    if not strain.size or strain.size != stress.size:
        return None
    sign = -1.0 if section.get("convention") == "compression positive" else 1.0
    return Signal(sign * strain, sign * stress, "Nominal strain (%)", "Nominal stress (kPa)")


def interval_of(content: Mapping[str, Any], table: str, *keys: str) -> tuple[float, float] | None:
    """A declared time span [µs]. None while an end is blank.

    ``keys``: one key with both ends of the span, or the two keys of its ends.
    """
    section = content.get(table, {})
    ends = section.get(keys[0], ["", ""]) if len(keys) == 1 else [section.get(key, "") for key in keys]
    try:
        first, last = (1e6 * quantity(str(end), "s") for end in ends)
    except (ValueError, TypeError):
        return None
    return first, last


def thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A signal with at most `MOST_POINTS`.

    They are the minimum and maximum of each section, in their order.
    """
    if x.size <= MOST_POINTS:
        return x, y
    size = -(-x.size // (MOST_POINTS // 2))
    whole = x.size // size * size
    rows = y[:whole].reshape(-1, size)
    start = np.arange(rows.shape[0]) * size
    extremes = np.sort(np.stack([rows.argmin(axis=1), rows.argmax(axis=1)], axis=1), axis=1) + start[:, None]
    chosen = np.unique(np.append(extremes.ravel(), [x.size - 1]))
    return x[chosen], y[chosen]
