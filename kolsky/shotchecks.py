"""What declarations and recordings of a shot must agree on; each function refuses one contradiction."""

import numpy as np

from kolsky.errors import InputError
from kolsky.readers.centre_line_csv import CentreLineTable
from kolsky.readers.flyer_csv import FlyerTable
from kolsky.readers.frame_times import FrameTimes
from kolsky.records import FloatArray, FlyerMotion, Recording
from kolsky.shottoml import ShotToml

MOTION_SIGMAS = 6.0
"""A displacement this many sigmas from rest is motion: noise does that once in 5e8 frames."""
UNCOVERED_SHARE = 0.05
"""Share of the frames that the force recording may miss at its end without a declared window.end."""
SMALLEST_BASELINE = 20
"""Samples needed for the zero and the noise of the force."""


def frames_agree(table: FlyerTable | CentreLineTable, frames: FrameTimes) -> None:
    """Every frame number is one of the frames', and the file's own times are the frames' times.

    Times agree if they differ by no more than half of the last printed digit of each file.
    """
    index = np.searchsorted(frames.frame, table.frame).clip(max=frames.frame.size - 1)
    unknown = np.flatnonzero(frames.frame[index] != table.frame)
    if unknown.size:
        row = int(unknown[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} is not in {frames.path.name} ({unknown.size} such lines)",
            line=row + 2,
            cure="both files must come from the same test; are two columns swapped?",
        )
    if table.time is None:
        return
    expected = frames.time[index]
    tolerance = 0.5 * (table.digit + frames.digit)
    # The sum of the half digits and the times themselves are rounded binary numbers.
    slack = 1e-6 * tolerance + 4.0 * np.finfo(float).eps * np.abs(expected).max()
    apart = np.flatnonzero(np.abs(table.time - expected) > tolerance + slack)
    if apart.size:
        row = int(apart[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} has the time {table.time[row]:.9g} s, in {frames.path.name} it has"
            f" {expected[row]:.9g} s ({apart.size} such lines)",
            line=row + 2,
            cure="both files must come from the same test and clock; are two columns swapped?",
        )


def some_motion_frames(frames: FrameTimes, toml: ShotToml) -> None:
    """There are more frames than static ones."""
    if toml.declared.frames.static >= frames.frame.size:
        raise toml.error(
            "frames.static",
            "is not allowed",
            allowed=f"smaller than the {frames.frame.size} frames in {frames.path.name}",
            cure="count the frames before the flyer moves",
        )


def flyer_covers(table: FlyerTable, frames: FrameTimes, toml: ShotToml) -> None:
    """Every frame up to the end of the window has a flyer displacement."""
    missing = np.setdiff1d(frames.frame, table.frame)
    end = toml.declared.window.end
    if end is not None:
        beyond = frames.frame[frames.time + toml.declared.frames.clock_offset > end]
        missing = np.setdiff1d(missing, beyond)
    if not missing.size:
        return
    number = int(missing[0])
    line = int(np.searchsorted(frames.frame, number)) + 2
    if number > table.frame[-1]:
        raise InputError(
            frames.path,
            f"frame {number} is beyond the flyer record, which ends with frame {table.frame[-1]} in"
            f" {table.path.name} ({missing.size} such frames)",
            line=line,
            cure="export the flyer for all frames, or declare window.end inside its record",
        )
    raise InputError(
        frames.path,
        f"frame {number} has no displacement in {table.path.name} ({missing.size} such frames)",
        line=line,
        cure="export the flyer for every frame, or remove the frame from all files",
    )


def flyer_moves(table: FlyerTable, flyer: FlyerMotion, toml: ShotToml) -> None:
    """At rest in the static frames, then toward the specimen, by less than its length."""
    n_static = toml.declared.frames.static
    length = toml.declared.specimen.length
    sigma = toml.declared.flyer.sigma
    travel = flyer.displacement - flyer.displacement[:n_static].mean()
    row = int(np.argmax(np.abs(travel)))
    if abs(travel[row]) >= length:
        raise InputError(
            table.path,
            f"the flyer's displacement of {travel[row] * 1e3:.6g} mm exceeds the specimen's length"
            f" ({length * 1e3:.6g} mm)",
            line=row + 2,
            cure="check flyer.displacement in the shot file: is it the right column and unit?",
        )
    moving = np.flatnonzero(np.abs(travel[:n_static]) > MOTION_SIGMAS * sigma)
    if moving.size:
        row = int(moving[0])
        raise InputError(
            table.path,
            f"frame {table.frame[row]} is {travel[row] * 1e6:.3g} um from the mean of the {n_static} frames"
            f" declared static, more than {MOTION_SIGMAS:g} times flyer.sigma ({sigma * 1e6:.3g} um)",
            line=row + 2,
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


def window(
    toml: ShotToml, frame_time: FloatArray, flyer_end: float, scope: Recording, scope_time: FloatArray
) -> tuple[float, float]:
    """The window on the shot's clock: as declared, else from the last static frame to the last covered one.

    Parameters
    ----------
    toml
        The shot file.
    frame_time
        Frame times on the shot's clock [s], shape [n_frames].
    flyer_end
        Time of the last flyer displacement [s].
    scope
        The force channel.
    scope_time
        Its sample times on the shot's clock [s], shape [n_samples].

    Raises
    ------
    InputError
        If the specimen already moves at the start, or the recordings do not cover the window.
    """
    declared = toml.declared
    rest = float(frame_time[declared.frames.static - 1])
    start = rest if declared.window.start is None else declared.window.start
    span = f"{_us(scope_time[0])} to {_us(scope_time[-1])}"
    if start > rest or start < frame_time[0]:
        raise toml.error(
            "window.start",
            "is not allowed",
            allowed=f"between the first and the last static frame, {_us(frame_time[0])} to {_us(rest)}",
            cure="the simulation starts from rest",
        )
    if scope_time[0] > start:
        raise InputError(
            scope.path,
            f"begins at {_us(scope_time[0])}, after the window's start at {_us(start)} (shot's clock)",
            cure="check force.clock_offset and frames.clock_offset",
        )
    if declared.window.end is not None:
        end = declared.window.end
        covered = min(float(frame_time[-1]), flyer_end, float(scope_time[-1]))
        if not start < end <= covered:
            raise toml.error(
                "window.end",
                f"is not allowed (frames end at {_us(frame_time[-1])}, flyer at {_us(flyer_end)},"
                f" force at {_us(scope_time[-1])})",
                allowed=f"after the start at {_us(start)} and at most {_us(covered)}",
            )
        return start, end
    beyond = frame_time > scope_time[-1]
    if beyond.sum() > UNCOVERED_SHARE * frame_time.size:
        raise InputError(
            scope.path,
            f"{beyond.sum()} of {frame_time.size} camera frames are beyond the scope record, which spans"
            f" {span} (shot's clock)",
            cure="check force.clock_offset and frames.clock_offset, or declare window.end inside the record",
        )
    end = float(frame_time[~beyond][-1])
    if not start < end:
        raise toml.error(
            "frames.static", "leaves no frame after the static ones", cure="declare fewer static frames"
        )
    return start, end


def clipping(scope: Recording, toml: ShotToml) -> None:
    """No sample at or beyond the recorder's full scale (with `bits`: at its first or last code)."""
    force = toml.declared.force
    limit = force.full_scale
    if force.bits is not None:
        # Codes run from -2^(b-1) to 2^(b-1) - 1; half a code less, since the volts are printed rounded.
        limit *= 1.0 - 1.5 / 2 ** (force.bits - 1)
    clipped = np.flatnonzero(np.abs(scope.value) >= limit)
    if clipped.size:
        row = int(clipped[0])
        raise InputError(
            scope.path,
            f"column '{scope.channel}' is clipped: {scope.value[row]:.6g} V in the first of {clipped.size}"
            f" samples at or beyond full scale (force.full_scale = {force.full_scale:g} V)",
            line=row + 2,
            cure="a clipped force is lost; repeat the test at a coarser range, or correct force.full_scale",
        )


def baseline(volts: FloatArray, rest: float, toml: ShotToml) -> None:
    """Enough samples before the flyer moves, with visible noise.

    Parameters
    ----------
    volts
        Samples in the baseline window [V], shape [n].
    rest
        Time of the last static frame on the shot's clock [s].
    toml
        The shot file.
    """
    if toml.declared.force.baseline[1] > rest:
        raise toml.error(
            "force.baseline",
            "overlaps the flyer's motion",
            allowed=f"before the last static frame at {_us(rest)} (shot's clock)",
            cure="end it earlier",
        )
    if volts.size < SMALLEST_BASELINE:
        raise toml.error(
            "force.baseline",
            f"holds {volts.size} samples",
            allowed=f"a time span with at least {SMALLEST_BASELINE} samples",
            cure="choose a longer span inside the record, on the shot's clock",
        )
    if np.ptp(volts) == 0.0:
        raise toml.error(
            "force.baseline",
            f"holds the same value {volts[0]:.6g} V {volts.size} times, so the noise is unknown",
            cure="is force.voltage the right column, and was the channel connected?",
        )


def force_sign(
    force: FloatArray, scope_time: FloatArray, span: tuple[float, float], flyer: FlyerMotion, toml: ShotToml
) -> None:
    """A flyer that went far into the specimen has pushed it, not pulled.

    Parameters
    ----------
    force
        Compression-positive force at the scope samples [N], shape [n].
    scope_time
        Their times on the shot's clock [s], shape [n].
    span
        The window [s].
    flyer
        The flyer's motion.
    toml
        The shot file.
    """
    # A bonded face pulls in the first waves; only a good part of the compression decides the sign.
    inside = flyer.time <= span[1]
    if np.ptp(flyer.displacement[inside]) < 0.1 * toml.declared.specimen.length:
        return
    mean = float(force[(scope_time >= span[0]) & (scope_time <= span[1])].mean())
    if mean < 0.0:
        raise toml.error(
            "force.compression",
            f"contradicts the recording: with this sign the specimen pulls, by {-mean:.3g} N in the mean",
            cure="declare the other sign, or check force.voltage and force.baseline",
        )


def _us(seconds: float) -> str:
    """A time as a user writes it."""
    return f"{seconds * 1e6:.7g} us"
