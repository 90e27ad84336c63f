"""Load and check a shot from a folder: from exports, a whole surface, pictures or bars.

The window is the part of the shot that is simulated and compared. It lasts from rest until a recording ends.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kolsky.bars.flyer.front_path import BarForce, back_force, front_path, front_velocity
from kolsky.bars.records import FaceWaves, Reduction
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refuse, refused
from kolsky.base.records import CentreLine, FlyerMotion, Recording
from kolsky.base.units import in_us
from kolsky.pictures.frames import body_moves, flyer_motion, read_frames, sound_at_rest
from kolsky.pictures.picture_set import PictureSet, check_frames, open_pictures
from kolsky.pictures.specimen_length import RimAtRest, conditioned_length, length_notes
from kolsky.readers.measured_tables import FrameTable
from kolsky.schema.apparatus import elastic_body
from kolsky.schema.shot_file import (
    BarDrivenShotFile,
    ShotFile,
    ShotToml,
    Source,
    is_bar_driven,
    parsed,
    shot_toml,
)
from kolsky.shot.curve import shot_fields
from kolsky.shot.evidence import Evidence, missing_files
from kolsky.shot.force import check_sign, force_channel, incident_to_compare
from kolsky.shot.plausibility import gate, travel_of, with_warnings
from kolsky.shot.records import ForceChannel, OpticalData, PicturedShot, Shot, ShotBase, fields_of
from kolsky.shot.surface import check_outline, each_once, measured_surface, read_outline

if TYPE_CHECKING:
    from kolsky.shot.bars import CheckedBars


UNCOVERED_SHARE = 0.05
"""Largest share of frames after the end of the force recording, if window.end is not declared."""


def window(
    toml: ShotToml,
    frame_time: FloatArray,
    flyer_end: float,
    scope: Recording,
    scope_time: FloatArray,
    *,
    symmetry_end: float | None = None,
) -> tuple[float, float]:
    """The window on the shot's clock: as declared, or from the last static frame to the last usable one.

    The last usable frame lies before the end of symmetry, and all recordings cover it. ``toml``: the shot
    file. ``frame_time``: frame times on the shot's clock [s], shape [n_frames]. ``flyer_end``: time of the
    last flyer displacement [s]. ``scope``: the force channel. ``scope_time``: its sample times on the shot's
    clock [s], shape [n_samples]. ``symmetry_end``: time at which the flyer leaves its first direction [s];
    None if it does not, or if the time is unknown. Raises InputError if the specimen already moves at the
    start, or if the recordings do not cover the window.
    """
    declared = toml.declared
    rest = float(frame_time[declared.frames.static - 1])
    start = rest if declared.window.start is None else declared.window.start
    span = f"{in_us(scope_time[0])} to {in_us(scope_time[-1])}"
    if start > rest or start < frame_time[0]:
        message = "is not allowed"
        allowed = f"between the first and the last static frame, {in_us(frame_time[0])} to {in_us(rest)}"
        raise toml.error("window.start", message, allowed=allowed, cure="the simulation starts from rest")
    if scope_time[0] > start:
        raise InputError(
            scope.path,
            f"begins at {in_us(scope_time[0])}, after the window's start at {in_us(start)} (shot's clock)",
            cure=f"check force.clock_offset: {in_us(start - scope_time[0])} less would fit; and"
            " frames.clock_offset; or was the record's beginning cut off?",
        )
    if declared.window.end is not None:
        end = declared.window.end
        covered = min(float(frame_time[-1]), flyer_end, float(scope_time[-1]))
        if not start < end <= covered:
            raise toml.error(
                "window.end",
                f"is not allowed (frames end at {in_us(frame_time[-1])}, flyer at {in_us(flyer_end)},"
                f" force at {in_us(scope_time[-1])})",
                allowed=f"after the start at {in_us(start)} and at most {in_us(covered)}",
            )
        return start, end
    beyond = frame_time > scope_time[-1]
    if beyond.sum() > UNCOVERED_SHARE * frame_time.size:
        raise InputError(
            scope.path,
            f"{beyond.sum()} of {frame_time.size} camera frames are beyond the scope record, which spans"
            f" {span} (shot's clock)",
            cure="was the record ended before the test? Then declare window.end inside it; else check"
            " force.clock_offset and frames.clock_offset: both clocks must count from one trigger",
        )
    if symmetry_end is not None:
        beyond |= frame_time >= symmetry_end
    end = float(frame_time[~beyond][-1])
    if not start < end:
        message = "leaves no frame after the static ones"
        raise toml.error("frames.static", message, cure="declare fewer static frames")
    return start, end


def load_shot(source: Source, *, measure: Callable[[PictureSet], OpticalData] | None = None) -> Shot:
    """Load and check a shot.

    Parameters
    ----------
    source
        The shot's folder with its shot.toml, the path of such a file, or the parsed file.
    measure
        The function that correlates the pictures of a shot without exports. The default is
        `kolsky.shot.optical_data.measured`, which stores the result in the shot's results folder.

    Returns
    -------
    Shot
        All declared and measured values, in SI, on the shot's clock.

    Raises
    ------
    InputError
        If a file is missing or damaged; if a declaration is unknown, incomplete or impossible; or if
        declarations and recordings contradict each other.

    Examples
    --------
    >>> import kolsky
    >>> shot = kolsky.load_shot("runs/open-05")
    >>> 1e3 * shot.specimen.length  # mm
    6.5
    """
    file = parsed(source)
    if is_bar_driven(file):
        return load_bar_driven(file)
    toml, frames = _open(file)
    declared = toml.declared
    rest = float(frames.time[declared.frames.static - 1] + declared.frames.clock_offset)
    surface, flyer, table, inputs = declared.surface, None, None, dict[str, str]()
    if surface is not None:
        centre_line, flyer, inputs = measured_surface(toml, surface, frames)
        source_of_line = toml.path.parent / surface.pattern
    elif declared.flyer is None or declared.centre_line is None:
        return _with_pictures(toml, frames, rest, measure)
    if flyer is None:
        assert declared.flyer is not None  # checked by the schema
        flyer, inputs[declared.flyer.file] = flyer_motion(
            frames, declared.flyer, toml, check=partial(_check_travel, toml, rest)
        )
    else:
        _check_travel(toml, rest, flyer)
        body_moves(flyer, rest, source_of_line, toml)
    if surface is None:
        assert declared.centre_line is not None  # checked above
        centre_line, table = read_outline(frames, declared.centre_line, toml)
        source_of_line, inputs[declared.centre_line.file] = table.path, table.sha256
    base = _base(toml, frames, inputs)
    span = _compared_span(toml, frames, base["force"], flyer)
    gate(Evidence(file=toml, declared=declared, outline=centre_line, rest=rest))
    check_outline(centre_line, source_of_line, rest, span, toml, line_of=table.line if table else None)
    centre_line, notes = each_once(centre_line, table) if table else (centre_line, ())
    base |= incident_to_compare(toml, span)
    fitted = surface is not None and surface.frame == "cylinder"
    return with_warnings(
        Shot(**base, flyer=flyer, centre_line=centre_line, window=span, notes=notes, axis_by_radius=fitted)
    )


def _check_travel(toml: ShotToml, rest: float, flyer: FlyerMotion) -> None:
    """Check a flyer's motion; `rest` is the time of the last static frame [s]."""
    gate(Evidence(file=toml, declared=toml.declared, **travel_of(flyer, rest)))


def load_pictures(source: Source) -> PicturedShot:
    """Load and check a shot with pictures, before they are correlated.

    Raises
    ------
    InputError
        For the reasons of `load_shot`, or if the shot has no pictures.
    """
    toml, frames = _open(source)
    if toml.declared.pictures is None:
        message = "is missing: this shot has no pictures"
        raise toml.error("pictures", message, cure="add [pictures], [calibration], [dic]")
    pictures = open_pictures(toml, frames)
    check_frames(pictures)
    return _with_picture_set(toml, frames, pictures)


def check_shot(source: Source) -> "ShotBase | CheckedBars":
    """Load and check a shot without correlating its pictures or reducing its bar signals.

    Raises
    ------
    InputError
        For the reasons of `load_shot`.

    Examples
    --------
    >>> import kolsky
    >>> kolsky.check_shot("runs/open-05").name
    'open-05'
    """
    file = parsed(source)
    if is_bar_driven(file):
        if {"interface", "curve", "law", "model"} & set(file.content):
            return load_shot(file)
        from kolsky.shot.bars import check_bars

        return check_bars(file)
    toml, _ = _open(file)
    if toml.declared.flyer is None and toml.declared.surface is None:
        return load_pictures(toml)
    if toml.declared.pictures is not None:
        load_pictures(toml)
    return load_shot(toml)


def _with_pictures(
    toml: ShotToml, frames: FrameTable, rest: float, measure: Callable[[PictureSet], OpticalData] | None
) -> Shot:
    """A shot with flyer and outline from its pictures."""
    shot = _with_picture_set(toml, frames, open_pictures(toml, frames))
    if measure is None:
        from kolsky.shot.optical_data import measured

        measure = measured
    found = measure(shot.pictures)
    found = replace(found, flyer=sound_at_rest(found.flyer, rest))
    assert isinstance(shot.force, ForceChannel)  # `_base` made it so
    body_moves(found.flyer, rest, found.source, toml)
    span = _compared_span(toml, frames, shot.force, found.flyer, found.symmetry_end)
    check_outline(found.centre_line, found.source, rest, span, toml)
    base = fields_of(shot)
    base |= incident_to_compare(toml, span)
    base["uncertainty"] = {**found.offsets, **shot.uncertainty}  # declared values take precedence
    loaded = with_warnings(
        Shot(
            **base,
            flyer=found.flyer,
            centre_line=found.centre_line,
            window=span,
            symmetry_end=found.symmetry_end,
            axis_by_radius=True,
        )
    )
    return loaded if found.rim is None else _with_length(loaded, found.rim)


def _with_length(shot: Shot, rim: RimAtRest) -> Shot:
    """The shot with specimen length and outline heights corrected by its pictures."""
    declared, uncertainty = shot.specimen.length, dict(shot.uncertainty)
    sigma = uncertainty.get("specimen_length", 0.0) * declared
    length = conditioned_length(rim, declared=declared, sigma=sigma, y_sigma=uncertainty.get("y_offset", 0.0))
    told = replace(shot, length_by_pictures=length, notes=(*shot.notes, *length_notes(length)))
    if not length.conditioned:
        return told
    assert told.centre_line is not None  # the pictures showed it
    return replace(
        told,
        specimen=replace(shot.specimen, length=length.used),
        centre_line=replace(told.centre_line, y=told.centre_line.y + length.y_shift),
        uncertainty={
            **uncertainty,
            "specimen_length": length.used_sigma / length.used,
            "y_offset": length.y_sigma,
        },
    )


def _with_picture_set(toml: ShotToml, frames: FrameTable, pictures: PictureSet) -> PicturedShot:
    return PicturedShot(**_base(toml, frames, pictures.inputs), pictures=pictures)


def _compared_span(
    toml: ShotToml,
    frames: FrameTable,
    force: ForceChannel,
    flyer: FlyerMotion,
    symmetry_end: float | None = None,
) -> tuple[float, float]:
    """The window of a shot with cameras. The sign of the force is checked in it."""
    span = window(
        toml,
        frames.time + toml.declared.frames.clock_offset,
        float(flyer.time[-1]),
        force.recording,
        force.time,
        symmetry_end=symmetry_end,
    )
    check_sign(force.raw_force(), force.time, span, flyer, toml)
    return span


def _open(source: Source) -> tuple[ShotToml, FrameTable]:
    """The shot file and the frame times."""
    toml = shot_toml(source)
    refuse(missing_files(toml, toml.declared.data_files()))
    gate(Evidence(file=toml, declared=toml.declared))
    calibration = toml.declared.calibration
    if calibration is not None and calibration.target is not None:
        from kolsky.pictures.calibration import target_of  # imports image correlation: for pictures only

        target_of(calibration.target, toml)
    frames = read_frames(toml)
    gate(Evidence(file=toml, declared=toml.declared, frame_time=frames.time))
    return toml, frames


def _base(toml: ShotToml, frames: FrameTable, optical: dict[str, str]) -> dict[str, Any]:
    """The fields of `ShotBase` of a shot with cameras; `optical` are the hashes of the optical data."""
    declared, folder = toml.declared, toml.path.parent
    rest = float(frames.time[declared.frames.static - 1] + declared.frames.clock_offset)
    force = force_channel(folder, rest, toml, frames.time)
    bar = declared.transmission.bar
    given = shot_fields(toml, declared)
    return {
        **given,
        "support": declared.transmission.support,
        **_elastic(declared, None if bar is None else Bar(**bar.model_dump())),
        "transducer_depth": declared.transmission.transducer_depth or 0.0,
        "force": force,
        "inputs": {
            toml.path.name: toml.sha256,
            declared.force.file: force.recording.sha256,
            declared.frames.file: frames.sha256,
            **optical,
            **given["inputs"],
        },
    }


def _elastic(declared: ShotFile, bar: Bar | None) -> dict[str, Any]:
    """The bar and the elastic bodies on both sides of the specimen, as fields of `ShotBase`."""
    found: dict[str, Any] = {"transmission_bar": bar}
    if declared.transmission.support == "mesh":
        behind = elastic_body(declared.transmission, "mesh")
        longest = max(behind.parts, key=lambda part: part.length)
        found |= {"behind": behind, "transmission_bar": replace(longest, length=behind.length)}
    body = declared.flyer_body
    if body is not None and body.model != "rigid":
        found["flyer_body"] = elastic_body(body, body.model, seen_at=body.seen_at or 0.0)
    return found


REACH = 0.9
"""Largest simulated approach of the faces, divided by the specimen's length [-]."""


def driven_by_waves(
    base: ShotBase,
    reduction: Reduction,
    waves: FaceWaves,
    *,
    centre_line: CentreLine | None = None,
    end: float | None = None,
) -> Shot:
    """The shot with a front face that moves with ``c0 (eps_i - eps_r)``, without a measured flyer.

    All times are on the shot's clock, even if a transducer measures the transmitted force (`base.force`).
    """
    motion = front_velocity(reduction, waves)
    path = front_path(motion)
    last = path.end if end is None else end
    first = float(motion.time[0])
    if not first < last <= path.end:
        raise ValueError(
            f"the end is {last:.9g} s, must be after the wave's arrival at {first:.9g} s and not after the"
            f" reduction's last time {path.end:.9g} s"
        )
    times = motion.time[motion.time <= last]
    reached, length = path.position(times), base.specimen.length
    if base.support == "bar":
        step = float(times[1] - times[0])
        back = reduction.back_velocity.value[: times.size]
        reached = reached - step * (np.cumsum(back) - 0.5 * (back + back[0]))
    if not (reached.max() > 0.0 and reached[-1] > 0.0):
        raise ValueError(
            f"the front face moves away from the specimen, by {-reached[-1] * 1e3:.4g} mm: check the signs"
            " of the gauges, compression is positive"
        )
    if reached.max() > REACH * length:
        raise ValueError(
            f"the faces approach by {reached.max() * 1e3:.4g} mm, allowed are {REACH:g} of the specimen's"
            f" length of {length * 1e3:.4g} mm: end the window earlier, or check the gauge factors"
        )
    return Shot(**fields_of(base), flyer=motion, centre_line=centre_line, window=(path.start, last))


def load_bar_driven(source: Source) -> Shot:
    """A shot from the gauges of its bars, without a centre line, identified from the force only.

    Raises InputError for a missing or damaged file, a wrong declaration, or signals of another test.
    """
    from kolsky.bars.reduction.analyse import analyse  # both for shots with bars only
    from kolsky.shot.bars import load_waves

    file = parsed(source)
    declared = file.validated(BarDrivenShotFile)
    given = load_waves(file)
    if declared.window.start is not None:
        message = "has no effect where bar waves drive the test: it begins with their arrival"
        raise file.error("window.start", message, cure="remove it")
    with refused(file.path.parent, cure="correct the gauge or bar that it names in shot.toml"):
        result = analyse(given)
        fields = shot_fields(file, declared)
        fields["inputs"] = {**given.inputs, **fields["inputs"]}
        transmission_bar = Bar(**vars(given.bars["transmission"]))
        force = BarForce(*back_force(result.reduction, result.faces))
        base = ShotBase(**fields, support="bar", transmission_bar=transmission_bar, force=force)
        shot = driven_by_waves(base, result.reduction, result.faces, end=declared.window.end)
    return with_warnings(shot)
