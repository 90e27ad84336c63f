"""Read flyer and outline from the exports of [surface], or an outline from [centre_line]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dic.outcome import PointOutcome
from dic.surfaces.cylinder import Cylinder, fit_cylinder
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.pictures.frames import frames_agree, read_section
from kolsky.readers.dic_export import DicExport, PointState, matching, read
from kolsky.readers.measured_tables import FrameTable
from kolsky.schema.measured import CentreLineSection, SurfaceSection
from kolsky.schema.shot_file import ShotToml

if TYPE_CHECKING:
    from dic.surfaces.surface_history import SurfaceHistory

OUTCOMES = {
    PointState.VALID: PointOutcome.VALID,
    PointState.REJECTED: PointOutcome.LOW_CORRELATION,
    PointState.MISSING: PointOutcome.NOT_CONVERGED,
}
"""Outcome of a point by its state in an export. An export does not give the reason for a missing point."""
WIDEST_ANGLE = 30.0
"""Largest angle between the axis of a fitted cylinder and the declared one [degrees]."""


@dataclass(frozen=True)
class Placement:
    """The axes x, y, Z of the test in the coordinates of an export."""

    rotation: FloatArray
    """Rows x, y, Z as unit vectors of the export's coordinates, shape [3, 3]."""
    origin: FloatArray
    """The point of the specimen's axis at y = 0, in the export's coordinates [m], shape [3]."""
    cylinder: Cylinder | None = None
    """The best-fit cylinder that defines the axes, if there is one."""


def declared_placement(*, y: str, Z: str, origin: tuple[float, float, float]) -> Placement:
    """Test axes that are parallel to axes of the export."""
    along, toward = _unit(y), _unit(Z)
    if abs(along @ toward) > 0.5:
        raise ValueError(f"y and Z must be different axes, got {y} and {Z}")
    return Placement(np.array([np.cross(along, toward), along, toward]), np.array(origin, dtype=np.float64))


def cylinder_placement(
    export: DicExport, *, y: str, Z: str, on_platen: tuple[float, float, float], radius: float, sigma: float
) -> Placement:
    """The test frame from the cylinder that fits the reference positions best."""
    covariance = np.broadcast_to(sigma**2 * np.eye(3), (len(export.X), 3, 3))
    cylinder = fit_cylinder(export.X, covariance, radius=radius)
    declared = _unit(y)
    cosine = float(cylinder.axis @ declared)
    if abs(cosine) < np.cos(np.radians(WIDEST_ANGLE)):
        angle = float(np.degrees(np.arccos(min(1.0, abs(cosine)))))
        raise ValueError(
            f"the axis of the best-fit cylinder is {angle:.0f} degrees off the declared axis {y}; it must be"
            f" within {WIDEST_ANGLE:g} degrees"
        )
    along = cylinder.axis * np.sign(cosine)
    toward = _unit(Z) - (_unit(Z) @ along) * along
    toward = toward / np.linalg.norm(toward)
    origin = cylinder.point + ((np.asarray(on_platen) - cylinder.point) @ along) * along
    return Placement(np.array([np.cross(along, toward), along, toward]), origin, cylinder)


def surface_history(
    export: DicExport, placement: Placement, time: FloatArray, *, sigma: float
) -> SurfaceHistory:
    """The points of an export in the test frame.

    ``export``: the points. ``placement``: position of the test frame. ``time``: times of the frames on the
    shot's clock [s], shape [n_frames]. ``sigma``: standard deviation of each component of a position [m].
    Raises ValueError for the reasons of `dic.surfaces.surface_history.SurfaceHistory`.
    """
    outcome = np.full(export.state.shape, int(PointOutcome.VALID))
    for state, meaning in OUTCOMES.items():
        outcome[export.state == state] = int(meaning)
    from dic.surfaces.surface_history import SurfaceHistory  # imports image correlation

    X = (export.X - placement.origin) @ placement.rotation.T
    u = export.u @ placement.rotation.T
    return SurfaceHistory(t=time, X=X, u=u, sigma=np.full(export.u.shape, sigma), outcome=outcome)


def flyer_motion(export: DicExport, placement: Placement, time: FloatArray, *, sigma: float) -> FlyerMotion:
    """Mean displacement toward the specimen of the points that are valid in every frame.

    Other points are left out. With a tilted flyer they would cause steps of the mean. ``export``: points on
    the flyer. ``placement``: position of the test frame; the flyer moves toward -y. ``time``: times of the
    frames on the shot's clock [s], shape [n_frames]. ``sigma``: standard deviation of one displacement of the
    mean [m]. Raises ValueError if no point is valid in every frame.
    """
    kept = np.all(export.state == PointState.VALID, axis=0)
    if not kept.any():
        raise ValueError("no point of the flyer is valid in every frame")
    displacement = -(export.u[:, kept] @ placement.rotation[1]).mean(axis=1)
    return FlyerMotion(time=time, displacement=displacement, sigma=np.full(time.size, sigma))


def _unit(axis: str) -> FloatArray:
    if len(axis) != 2 or axis[0] not in "+-" or axis[1] not in "XYZ":
        raise ValueError(f"an axis must be one of +X, -X, +Y, -Y, +Z, -Z, got {axis!r}")
    direction = np.zeros(3)
    direction["XYZ".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return direction


def measured_surface(
    toml: ShotToml, section: SurfaceSection, frames: FrameTable
) -> tuple[CentreLine, FlyerMotion | None, dict[str, str]]:
    """The outline, the flyer's motion if its area was exported, and the hashes of the files by pattern.

    Raises InputError if an export cannot be read, or if it does not fit the declared axes. The same error is
    raised for a frame that is missing in the file of the frames.
    """
    from dic.surfaces.surface_history import centre_line  # imports image correlation

    folder, specimen = toml.path.parent, toml.declared.specimen
    export, time = _export(folder, section.pattern, section, frames, toml)
    with toml.refusing("surface", "does not fit its points", cure="check y, Z, origin"):
        if section.frame == "cylinder":
            placement = cylinder_placement(
                export,
                y=section.y,
                Z=section.Z,
                on_platen=section.origin,
                radius=0.5 * specimen.diameter,
                sigma=section.sigma,
            )
        else:
            placement = declared_placement(y=section.y, Z=section.Z, origin=section.origin)
        points = centre_line(
            surface_history(export, placement, time, sigma=section.sigma), half_width=section.half_width
        )
    if not points.t.size:
        raise toml.error("surface.half_width", "holds no valid point", cure="widen it, or check origin")
    line = CentreLine(
        time=points.t, frame=export.frame[points.frame], y=points.y, Z=points.Z, sigma=points.sigma
    )
    hashes = {section.pattern: export.sha256}
    if section.flyer is None:
        return line, None, hashes
    area, flyer_time = _export(folder, section.flyer.pattern, section, frames, toml)
    try:
        flyer = flyer_motion(area, placement, flyer_time, sigma=section.flyer.sigma)
    except ValueError as error:
        raise toml.error("surface.flyer", str(error), cure="export a smaller area, always in view") from None
    return line, flyer, {**hashes, section.flyer.pattern: area.sha256}


def _export(
    folder: Path, pattern: str, section: SurfaceSection, frames: FrameTable, toml: ShotToml
) -> tuple[DicExport, FloatArray]:
    """The files of a pattern and the times of their frames on the shot's clock [s]."""
    export = read(
        matching(folder, pattern),
        section.program,
        unit=section.unit,
        delimiter=section.delimiter,
        decimal=section.decimal,
    )
    index = np.searchsorted(frames.frame, export.frame).clip(max=frames.frame.size - 1)
    unknown = np.flatnonzero(frames.frame[index] != export.frame)
    if unknown.size:
        message = f"is frame {export.frame[unknown[0]]}, which is not in {frames.path.name}"
        cure = "give the files the frame numbers of the frames' file"
        raise InputError(export.paths[int(unknown[0])], message, cure=cure)
    return export, frames.time[index] + toml.declared.frames.clock_offset


LEAST_HEIGHT = 0.2
"""Smallest height of the outline at rest over the declared length [-]. A tenth indicates a wrong length."""
LARGEST_RADIUS = 3.0
"""Largest radius of an outline over the declared one [-]: a sliding specimen at a ninth of its length."""


def read_outline(
    frames: FrameTable, section: CentreLineSection, toml: ShotToml
) -> tuple[CentreLine, FrameTable]:
    """[centre_line]: the specimen's outline at the frames, and its source table.

    Raises InputError if the file cannot be read, or if its frames and times are not those of [frames].
    """
    sigma = None
    if section.sigma_column is not None:
        cure = "give every point its standard deviation, or declare one for all: centre_line.sigma"
        sigma = replace(section.sigma_column.as_column(), bound="> 0", cure=cure)
    columns = {"y": section.y.as_column(), "Z": section.Z.as_column(), "sigma": sigma}
    table = read_section(toml, section, columns=columns, points=True)
    frames_agree(table, frames)
    index = np.searchsorted(frames.frame, table.frame)
    line = CentreLine(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        frame=table.frame,
        y=table.columns["y"] + section.y_offset,
        Z=table.columns["Z"] + section.Z_offset,
        sigma=table.columns["sigma"] if sigma else np.full(table.frame.size, section.sigma),
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
    """Check that the points have a plausible radius and lie between the platens.

    `kolsky.shot.plausibility` has already checked the points at rest. ``line``: the outline in the shot's
    coordinates, rows as in the file. ``path``: its file. ``rest``: time of the last static frame on the
    shot's clock [s]. ``span``: the window [s]. ``toml``: the shot file. ``line_of``: line of a row in the
    file, if the file is a table. Raises InputError for the first point that cannot be on this specimen's
    outline. The same error is raised if no point is in the window.
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
            message = f"{message}; it must be {allowed}"
            raise InputError(path, message, line=line_of(row) if line_of else None, cure=cure)
    if not np.any((line.time >= span[0]) & (line.time <= span[1])):
        raise InputError(path, "no point is inside the window", cure="export the frames of the test")


def each_once(line: CentreLine, table: FrameTable) -> tuple[CentreLine, tuple[str, ...]]:
    """The outline without duplicate points, and a note about the duplicates.

    A repeated row in an export is one measurement. If it counted several times, it would have too much weight
    and bias the result. ``line``: the outline, rows as in the file, shape [n].
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
    """Check the height of the outline at rest against the specimen's length."""
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
