"""The part of a shot that is simulated and compared: from rest to where every recording still is."""

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import Recording
from kolsky.base.units import in_us
from kolsky.shot.schema.reading import ShotToml

UNCOVERED_SHARE = 0.05
"""Share of the frames that the force recording may miss at its end without a declared window.end."""


def window(
    toml: ShotToml,
    frame_time: FloatArray,
    flyer_end: float,
    scope: Recording,
    scope_time: FloatArray,
    *,
    symmetry_end: float | None = None,
) -> tuple[float, float]:
    """The window on the shot's clock: as declared, else from the last static frame to the last covered one
    before symmetry ends.

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
    symmetry_end
        Time at which the flyer leaves its first direction [s], None if it does not or is not known.

    Raises
    ------
    InputError
        If the specimen already moves at the start, or the recordings do not cover the window.
    """
    declared = toml.declared
    rest = float(frame_time[declared.frames.static - 1])
    start = rest if declared.window.start is None else declared.window.start
    span = f"{in_us(scope_time[0])} to {in_us(scope_time[-1])}"
    if start > rest or start < frame_time[0]:
        raise toml.error(
            "window.start",
            "is not allowed",
            allowed=f"between the first and the last static frame, {in_us(frame_time[0])} to {in_us(rest)}",
            cure="the simulation starts from rest",
        )
    if scope_time[0] > start:
        raise InputError(
            scope.path,
            f"begins at {in_us(scope_time[0])}, after the window's start at {in_us(start)} (shot's clock)",
            cure="check force.clock_offset and frames.clock_offset",
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
            cure="check force.clock_offset and frames.clock_offset, or declare window.end inside the record",
        )
    if symmetry_end is not None:
        beyond |= frame_time >= symmetry_end
    end = float(frame_time[~beyond][-1])
    if not start < end:
        raise toml.error(
            "frames.static", "leaves no frame after the static ones", cure="declare fewer static frames"
        )
    return start, end
