"""[centre_line]: the specimen's outline at the frames, read and checked."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import BoolArray
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine
from kolsky.pictures.frames import frames_agree
from kolsky.readers.measured_tables import FrameTable, read_frame_table
from kolsky.readers.table import Column
from kolsky.schema.measured import CentreLineSection
from kolsky.schema.shot_file import ShotToml

LEAST_HEIGHT = 0.2
"""Least height that the outline at rest reaches above the transmission platen, over the declared length [-]:
one that reaches a tenth is that of another length."""
LARGEST_RADIUS = 3.0
"""Largest radius that a specimen's outline reaches, over the declared one [-]: one that is compressed to a
ninth of its length and slides freely."""


def read_outline(
    folder: Path, frames: FrameTable, section: CentreLineSection, toml: ShotToml
) -> tuple[CentreLine, FrameTable]:
    """[centre_line]: the specimen's outline at the frames, and the table it was read from.

    Raises InputError if the file cannot be read, or its frames and times are not those of [frames].
    """
    sigma = None
    if section.sigma_column is not None:
        cure = "give every point its standard deviation, or declare one for all: centre_line.sigma"
        sigma = replace(section.sigma_column.as_column(), bound="> 0", cure=cure)
    table = read_frame_table(
        folder / section.file,
        frame=Column(section.frame),
        time=None if section.time is None else section.time.as_column(),
        columns={"y": section.y.as_column(), "Z": section.Z.as_column(), "sigma": sigma},
        points=True,
        layout=None if section.layout is None else section.layout.as_layout(),
    )
    frames_agree(table, frames)
    index = np.searchsorted(frames.frame, table.frame)
    columns = table.columns
    line = CentreLine(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        frame=table.frame,
        y=columns["y"] + section.y_offset,
        Z=columns["Z"] + section.Z_offset,
        sigma=columns["sigma"] if sigma else np.full(table.frame.size, section.sigma),
    )
    return line, table


def check_outline(
    line: CentreLine,
    path: Path,
    rest: float,
    span: tuple[float, float],
    toml: ShotToml,
    *,
    line_of: Callable[[int], int] | None = None,
) -> None:
    """Points before the axis, between the platens; `kolsky.shot.plausibility` has compared them at rest.

    ``line``: the outline in the shot's coordinates, rows as in the file. ``path``: the file it came from.
    ``rest``: time of the last static frame on the shot's clock [s]. ``span``: the window [s]. ``toml``: the
    shot file. ``line_of``: line of the file on which a row stands, where the file is a table. Raises
    InputError for the first point that cannot be one of this specimen's outline, or if no point is in the
    window.
    """
    length, radius = toml.declared.specimen.length, 0.5 * toml.declared.specimen.diameter
    low, high = -0.1 * length, 1.1 * length
    cure = "remove points that are not of the specimen from the export; or check y_offset and Z_offset"
    largest = LARGEST_RADIUS * radius
    _check_height(line, path, line.time <= rest, length)
    for name, value, bad, allowed in (
        ("Z from the axis", line.Z, line.Z <= 0.0, "> 0 mm"),
        (
            "Z from the axis",
            line.Z,
            largest < line.Z,
            f"at most {largest * 1e3:.6g} mm, {LARGEST_RADIUS:g} times the specimen's radius",
        ),
        (
            "y above the transmission platen",
            line.y,
            (line.y < low) | (line.y > high),
            f"in [{low * 1e3:.6g}, {high * 1e3:.6g}] mm, 10 % around the specimen",
        ),
    ):
        rows = np.flatnonzero(bad)
        if rows.size:
            row = int(rows[0])
            message = f"{name} is {1e3 * float(value[row]):.6g} mm in frame {line.frame[row]}"
            if rows.size > 1:
                message += f" ({rows.size} such points)"
            raise InputError(
                path, f"{message}; it must be {allowed}", line=line_of(row) if line_of else None, cure=cure
            )
    if not np.any((line.time >= span[0]) & (line.time <= span[1])):
        raise InputError(path, "no point is inside the window", cure="export the frames of the test")


def each_once(line: CentreLine, table: FrameTable) -> tuple[CentreLine, tuple[str, ...]]:
    """The outline with every point counted once, and a sentence about those that the file has several times.

    A row that stands twice in an export is one measurement: counted twice it would weigh as much as two, and
    five hundred times it would draw the answer to itself.

    ``line``: the outline, rows as in the file, shape [n]. ``table``: the file it was read from.
    """
    rows = np.column_stack([line.frame, line.y, line.Z])
    _, first, counts = np.unique(rows, axis=0, return_index=True, return_counts=True)
    if first.size == len(rows):
        return line, ()
    kept, worst, several = np.sort(first), int(np.argmax(counts)), int((counts > 1).sum())
    row = int(first[worst])
    note = (
        f"{table.path.name} line {table.line(row)}: the point of frame {line.frame[row]} stands"
        f" {counts[worst]} times in the outline"
        + (f", as do {several - 1} others more than once" if several > 1 else "")
        + "; each was counted once: look at the export"
    )
    once = CentreLine(line.time[kept], line.frame[kept], line.y[kept], line.Z[kept], line.sigma[kept])
    return once, (note,)


def _check_height(line: CentreLine, path: Path, static: BoolArray, length: float) -> None:
    """The outline at rest reaches as high as one of a specimen of this length."""
    if not static.any():
        return
    height = float(line.y[static].max())
    if height < LEAST_HEIGHT * length:
        raise InputError(
            path,
            f"the outline at rest reaches {height * 1e3:.4g} mm above the transmission platen; it must reach"
            f" at least {100 * LEAST_HEIGHT:g} % of the specimen's length of {length * 1e3:.6g} mm",
            cure=f"check specimen.length (the outline ends at {height * 1e3:.4g} mm); or y_offset, and"
            " whether the outline was exported whole",
        )
