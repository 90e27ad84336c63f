"""[frames] and [flyer]: times of frames and displacements, read and checked for impossible values."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import FlyerMotion
from kolsky.base.units import in_us
from kolsky.readers.measured_tables import FrameTable, read_frame_table
from kolsky.readers.table import Column
from kolsky.schema.measured import CentreLineSection, FlyerSection, FramesSection
from kolsky.schema.shot_file import ShotToml

STRAY_SIGMAS = 20.0
"""A displacement is an outlier under two conditions. It differs from the value predicted by its neighbours by
more than this many standard deviations, and by more than `STRAY_STEPS`."""
STRAY_STEPS = 3.0
"""The same limit in units of the flyer's largest step between two frames. The start of the motion curves the
path by less than one step."""
MOST_STRAY = 0.03
"""Largest share of outliers among the frames. A larger share indicates another kind of noise."""
MOST_AT_REST = 0.25
"""Largest share of outliers among the static frames."""
LAST_AT_REST = 3
"""Number of last static frames without outliers. A displacement in these frames may be the real start of the
motion."""
STRAY_NEIGHBOURS = 6
"""Number of frames in the cubic fit that predicts a displacement. With four, the outlier could not be
identified among the five frames."""


def stray_frames(
    time: FloatArray, displacement: FloatArray, sigma: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Find outliers: displacements that contradict their neighbours."""
    stray, off = np.zeros(time.size, dtype=bool), np.zeros(time.size)
    if time.size <= 2 * STRAY_NEIGHBOURS or not (np.diff(time) > 0.0).all():
        return stray, off
    for _ in range(int(MOST_STRAY * time.size) + 1):
        sound = np.flatnonzero(~stray)
        apart, spread = np.array(
            [_distance_to_neighbours(time, displacement, sound, row) for row in range(time.size)]
        ).T
        scatter = np.maximum(1.4826 * np.median(np.abs(apart[sound]) / spread[sound]), sigma)
        step = np.quantile(np.abs(np.diff(displacement[sound])), 0.9)
        beyond = np.abs(apart) > np.maximum(STRAY_SIGMAS * scatter * spread, STRAY_STEPS * step)
        if not (beyond & ~stray).any():
            return stray, off
        worst = int(np.argmax(np.where(beyond & ~stray, np.abs(apart) / spread, 0.0)))
        stray[worst], off[worst] = True, apart[worst]
    return np.zeros(time.size, dtype=bool), np.zeros(time.size)


def _stray_at_rest(displacement: FloatArray, sigma: FloatArray, limit: float) -> BoolArray:
    """Find outliers among static frames: displacements that vanish in later ones, as no flyer returns."""
    off = np.abs(displacement - np.median(displacement)) > limit * sigma
    if off[-LAST_AT_REST:].any() or off.sum() > MOST_AT_REST * off.size:
        return np.zeros(off.size, dtype=bool)
    return np.asarray(off)


def _distance_to_neighbours(
    time: FloatArray, displacement: FloatArray, sound: np.ndarray, row: int
) -> tuple[float, float]:
    """A displacement minus the cubic fit of its neighbours [m], and the sigma of this per unit sigma."""
    others = sound[sound != row]
    first = np.searchsorted(others, row) - STRAY_NEIGHBOURS // 2
    near = others[int(np.clip(first, 0, others.size - STRAY_NEIGHBOURS)) :][:STRAY_NEIGHBOURS]
    t = (time[near] - time[row]) / (time[near[-1]] - time[near[0]])
    shares = np.linalg.pinv(np.vander(t, 4, increasing=True))[0]  # weights in the cubic's value at the frame
    apart = displacement[row] - shares @ displacement[near]
    return float(apart), float(np.hypot(1.0, np.linalg.norm(shares)))


MOTION_SIGMAS = 6.0
"""A displacement of more than this many sigmas is motion. Noise exceeds it once in 5e8 frames."""


def read_frames(toml: ShotToml) -> FrameTable:
    """Read [frames]: frame numbers and their times on the clock of the file.

    Raises InputError if the file cannot be read, or if all frames are static.
    """
    frames = read_section(toml, toml.declared.frames, clock=True)
    if toml.declared.frames.static >= frames.frame.size:
        raise toml.error(
            "frames.static",
            "is not allowed",
            allowed=f"smaller than the {frames.frame.size} frames in {frames.path.name}",
            cure="count the frames before the flyer moves",
        )
    return frames


def read_section(
    toml: ShotToml, section: FramesSection | FlyerSection | CentreLineSection, **more: Any
) -> FrameTable:
    """The table of a section with frame numbers. ``more``: further arguments of `read_frame_table`."""
    return read_frame_table(
        toml.path.parent / section.file,
        frame=Column(section.frame),
        time=None if section.time is None else section.time.as_column(),
        layout=None if section.layout is None else section.layout.as_layout(),
        **more,
    )


def flyer_motion(
    frames: FrameTable,
    section: FlyerSection,
    toml: ShotToml,
    *,
    check: Callable[[FlyerMotion], object] = lambda flyer: None,
) -> tuple[FlyerMotion, str]:
    """Read [flyer]: the flyer's displacement toward the specimen at the frames, and the hash of its file.

    ``check``: called with the motion before its rest and travel are checked. Raises InputError if the file
    cannot be read, if its frames and times differ from those of [frames], or if the flyer does not move.
    """
    table = read_section(toml, section, columns={"displacement": section.displacement.as_column()})
    frames_agree(table, frames)
    flyer_covers(table, frames, toml)
    sign = 1.0 if section.positive == "toward specimen" else -1.0
    index = np.searchsorted(frames.frame, table.frame)
    flyer = FlyerMotion(
        time=frames.time[index] + toml.declared.frames.clock_offset,
        displacement=sign * table.columns["displacement"],
        sigma=np.full(table.frame.size, section.sigma),
    )
    stray, off = stray_frames(flyer.time, flyer.displacement, flyer.sigma)
    flyer = replace(
        flyer,
        sigma=np.where(stray, np.abs(off), flyer.sigma),
        notes=tuple(
            f"{table.path.name} line {table.line(row)}: frame {table.frame[row]} of the flyer is"
            f" {off[row] * 1e3:+.3g} mm off the frames around it; it was given no weight: look at it, or"
            " correct the export"
            for row in np.flatnonzero(stray).tolist()
        ),
    )
    check(flyer)
    flyer_moves(table, flyer, section.sigma, toml, stray=stray)
    return flyer, table.sha256


def frames_agree(table: FrameTable, frames: FrameTable) -> None:
    """Check that every frame is in [frames], with a time equal within half the last digits of both files."""
    index = np.searchsorted(frames.frame, table.frame).clip(max=frames.frame.size - 1)
    unknown = np.flatnonzero(frames.frame[index] != table.frame)
    if unknown.size:
        row = int(unknown[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} is not in {frames.path.name} ({unknown.size} such lines)",
            line=table.line(row),
            cure="both files must come from the same test; are two columns swapped?",
        )
    if not table.time.size:
        return
    expected = frames.time[index]
    tolerance = 0.5 * (table.digit + frames.digit)
    # Both the sum of the half digits and the times are rounded binary numbers.
    slack = 1e-6 * tolerance + 4.0 * np.finfo(float).eps * np.abs(expected).max()
    apart = np.flatnonzero(np.abs(table.time - expected) > tolerance + slack)
    if apart.size:
        row = int(apart[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} has the time {table.time[row]:.9g} s, in {frames.path.name} it has"
            f" {expected[row]:.9g} s ({apart.size} such lines)",
            line=table.line(row),
            cure=_time_cure(table.time, expected),
        )


def _time_cure(time: FloatArray, expected: FloatArray) -> str:
    """Remedy for times [s] that differ from those of the frames: another unit, clock or column."""
    spans = float(np.ptp(time)), float(np.ptp(expected))
    ratio = spans[0] / spans[1] if min(spans) > 0.0 else 1.0
    power = round(float(np.log10(ratio)) / 3.0)
    # Rounding changes the span of the times slightly. Times of another test have a different span.
    if power != 0 and abs(ratio / 10.0 ** (3 * power) - 1.0) < 1e-2:
        return f"its times are {10.0 ** (3 * power):g} times those: correct the unit of one column"
    shift = float(np.median(time - expected))
    if power == 0 and np.ptp(time - expected) <= 1e-3 * spans[1]:
        return (
            f"its times are {in_us(shift)} later throughout: are they of another trigger? Leave the time "
            "column of this table out if the frame numbers are right"
        )
    return "both files must come from the same test and clock; are two columns swapped?"


def flyer_covers(table: FrameTable, frames: FrameTable, toml: ShotToml) -> None:
    """Check that every frame up to the end of the window has a flyer displacement."""
    missing = np.setdiff1d(frames.frame, table.frame)
    end = toml.declared.window.end
    if end is not None:
        beyond = frames.frame[frames.time + toml.declared.frames.clock_offset > end]
        missing = np.setdiff1d(missing, beyond)
    if not missing.size:
        return
    number = int(missing[0])
    line = frames.line(int(np.searchsorted(frames.frame, number)))
    what = f"frame {number} has no displacement in {table.path.name}"
    cure = "export the flyer for every frame, or remove the frame from all files"
    if number > table.frame[-1]:
        last = f"which ends with frame {table.frame[-1]} in {table.path.name}"
        what = f"frame {number} is beyond the flyer record, {last}"
        cure = "export the flyer for all frames, or declare window.end inside its record"
    raise InputError(frames.path, f"{what} ({missing.size} such frames)", line=line, cure=cure)


def flyer_moves(
    table: FrameTable, flyer: FlyerMotion, sigma: float, toml: ShotToml, *, stray: BoolArray | None = None
) -> None:
    """Check the flyer's motion: first at rest, then toward the specimen by less than its length."""
    n_static = toml.declared.frames.static
    length = toml.declared.specimen.length
    sound = np.ones(flyer.time.size, dtype=bool) if stray is None or stray[:n_static].all() else ~stray
    travel = flyer.displacement - flyer.displacement[:n_static][sound[:n_static]].mean()
    travel[~sound] = 0.0
    row = int(np.argmax(np.abs(travel)))
    if abs(travel[row]) >= length:
        raise InputError(
            table.path,
            f"the flyer's displacement of {travel[row] * 1e3:.6g} mm exceeds the specimen's length"
            f" ({length * 1e3:.6g} mm)",
            line=table.line(row),
            cure="check flyer.displacement in the shot file: is it the right column and unit?",
        )
    moving = np.flatnonzero(np.abs(travel[:n_static]) > MOTION_SIGMAS * sigma)
    if moving.size:
        row = int(moving[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} is {travel[row] * 1e6:.3g} um from the mean of the {n_static} frames"
            f" declared static, more than {MOTION_SIGMAS:g} times flyer.sigma ({sigma * 1e6:.3g} um)",
            line=table.line(row),
            cure="lower frames.static, or declare the noise that flyer.sigma really has",
        )
    if abs(travel[row]) <= MOTION_SIGMAS * sigma:
        raise InputError(
            table.path,
            f"the flyer never moves by more than {abs(travel[row]) * 1e6:.3g} um",
            cure="check flyer.displacement in the shot file: is it the right column and unit?",
        )
    if travel[row] < 0.0:
        raise toml.error(
            "flyer.positive",
            f"contradicts {table.path.name}: with this sign the flyer moves away from the specimen, by"
            f" {-travel[row] * 1e3:.4g} mm",
            cure="declare the other sign",
        )


def sound_at_rest(flyer: FlyerMotion, rest: float) -> FlyerMotion:
    """The motion with a list of outliers in its static frames.

    The uncertainty of an outlier is set to its deviation. ``flyer``: its motion, from pictures. ``rest``:
    time of the last static frame on the shot's clock [s].
    """
    static = np.flatnonzero(flyer.time <= rest)
    if static.size == 0:
        return flyer
    shared = np.zeros(1) if flyer.shared_sigma is None else flyer.shared_sigma
    at_rest, sigma = flyer.displacement[static], np.hypot(flyer.sigma, shared)[static]
    stray = _stray_at_rest(at_rest, sigma, MOTION_SIGMAS)
    if not stray.any():
        return flyer
    off = np.abs(at_rest - np.median(at_rest[~stray]))
    uncertain, moved = flyer.sigma.copy(), flyer.displacement - at_rest[~stray].mean()
    uncertain[static[stray]] = off[stray]
    said = [
        f"the flyer was found {1e6 * off[i]:.3g} um from its place at {in_us(flyer.time[static[i]])}, but at "
        "its place in later static frames: the frame's uncertainty is set to this distance"
        for i in np.flatnonzero(stray)
    ]
    return replace(flyer, displacement=moved, sigma=uncertain, notes=(*flyer.notes, *said))


def body_moves(flyer: FlyerMotion, rest: float, source: Path, toml: ShotToml) -> None:
    """Check the motion of a flyer in pictures.

    It is at rest in the static frames, then moves toward the specimen. ``flyer``: its motion; lost frames
    have no row. ``rest``: time of the last static frame on the shot's clock [s]. ``source``: the file named
    in an error message.
    """
    static = flyer.time <= rest
    if not static.any():
        raise InputError(
            source,
            "the flyer was found in no static frame, so its place at rest is unknown",
            cure="declare a region in [dic] flyer that the flyer covers in the static frames too",
        )
    travel = flyer.displacement - flyer.displacement[static].mean()
    shared = np.zeros(1) if flyer.shared_sigma is None else flyer.shared_sigma
    sigma = np.hypot(flyer.sigma, shared)
    score = np.where(static, np.abs(travel) / sigma, 0.0)
    if score.max() > MOTION_SIGMAS:
        row = int(np.argmax(score))
        raise toml.error(
            "frames.static",
            f"contradicts the pictures: at {in_us(flyer.time[row])} the flyer is {travel[row] * 1e6:.3g} "
            f"um from its mean place at rest, {score[row]:.2g} times its standard deviation",
            cure="lower frames.static",
        )
    furthest = float(travel[np.argmax(np.abs(travel))])
    if furthest <= MOTION_SIGMAS * float(np.median(flyer.sigma)):
        moves = (
            "never moves" if furthest > 0.0 else f"moves away from the specimen, by {-furthest * 1e3:.4g} mm"
        )
        raise toml.error(
            "dic.flyer_side",
            f"does not fit the pictures: with it the flyer {moves}",
            cure="declare where the flyer lies in the pictures of camera 0, and its region",
        )
    if furthest >= toml.declared.specimen.length:
        raise InputError(
            source,
            f"the flyer's displacement of {furthest * 1e3:.6g} mm exceeds the specimen's length"
            f" ({toml.declared.specimen.length * 1e3:.6g} mm)",
            cure="check the calibration: its unit, and the crop offsets",
        )
