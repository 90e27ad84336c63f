"""Flyer and outline of a shot from the exports that [surface] declares."""

from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.readers.dic_export.export import DicExport, matching, read
from kolsky.readers.frame_times import FrameTimes
from kolsky.shot import surface_export as s
from kolsky.shot.schema.reading import ShotToml
from kolsky.shot.schema.surface import SurfaceSection


def measured_surface(
    toml: ShotToml, section: SurfaceSection, frames: FrameTimes
) -> tuple[CentreLine, FlyerMotion | None, dict[str, str]]:
    """The outline, the flyer's motion if its area was exported, and the hashes of the files by pattern.

    Raises
    ------
    InputError
        If an export cannot be read, has a frame that the frames' file does not know, or does not fit the
        declared axes.
    """
    folder, specimen = toml.path.parent, toml.declared.specimen
    export, time = _export(folder, section.pattern, section, frames, toml)
    try:
        if section.frame == "cylinder":
            placement = s.cylinder_placement(
                export,
                y=section.y,
                Z=section.Z,
                on_platen=section.origin,
                radius=0.5 * specimen.diameter,
                sigma=section.sigma,
            )
        else:
            placement = s.declared_placement(y=section.y, Z=section.Z, origin=section.origin)
        points = s.outline(
            s.surface_history(export, placement, time, sigma=section.sigma), half_width=section.half_width
        )
    except ValueError as error:
        raise toml.error("surface", f"does not fit its points: {error}", cure="check y, Z, origin") from None
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
        flyer = s.flyer_motion(area, placement, flyer_time, sigma=section.flyer.sigma)
    except ValueError as error:
        raise toml.error("surface.flyer", str(error), cure="export a smaller area, always in view") from None
    return line, flyer, {**hashes, section.flyer.pattern: area.sha256}


def _export(
    folder: Path, pattern: str, section: SurfaceSection, frames: FrameTimes, toml: ShotToml
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
        raise InputError(
            export.paths[int(unknown[0])],
            f"is frame {export.frame[unknown[0]]}, which is not in {frames.path.name}",
            cure="number the files as the frames' file numbers its frames",
        )
    return export, frames.time[index] + toml.declared.frames.clock_offset
