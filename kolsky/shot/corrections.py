"""The shot with an input at the value that was found of it: a factor, a lag, an offset."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kolsky.base.records import FlyerMotion
from kolsky.shot.records import ForceChannel, Shot


def with_gain(shot: Shot, value: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        right = replace(force.transducer, sensitivity=force.transducer.sensitivity / value)
        return replace(shot, force=replace(force, transducer=right))
    history = force.history()
    right_history = replace(history, force=value * history.force, sigma=value * history.sigma)
    return replace(shot, force=replace(force, measured=right_history))


def with_zero(shot: Shot, value: float) -> Shot:
    """Volts taken off outside the baseline, whose own mean is the zero: after it, or before one that follows
    the test."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    volts = force.transducer.compression_sign * force.transducer.sensitivity * value
    first, last = force.baseline
    moved = force.time > last if first <= shot.window[0] else force.time < first
    recording = replace(force.recording, value=force.recording.value - np.where(moved, volts, 0.0))
    return replace(shot, force=replace(force, recording=recording))


def with_force_clock(shot: Shot, lag: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        return replace(shot, force=replace(force, clock_offset=force.clock_offset - lag))
    history = force.history()
    return replace(shot, force=replace(force, measured=replace(history, time=history.time - lag)))


def with_flyer_clock(shot: Shot, lag: float) -> Shot:
    """The motion is known until its last frame, and compared no longer."""
    motion = replace(shot.flyer, time=shot.flyer.time - lag)
    first, last = shot.window
    return replace(shot, flyer=motion, window=(first, min(last, float(motion.time[-1]))))


def with_motion(shot: Shot, factor: float) -> Shot:
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return replace(shot, flyer=replace(motion, displacement=factor * motion.displacement))
    return replace(shot, flyer=replace(motion, velocity=factor * motion.velocity))


def with_outline(name: str, sign: float = 1.0) -> Callable[[Shot, float], Shot]:
    """A column of the outline, moved by what was found."""

    def applied(shot: Shot, found: float) -> Shot:
        line = shot.centre_line
        assert line is not None  # it is not tried without one
        return replace(shot, centre_line=replace(line, **{name: getattr(line, name) + sign * found}))

    return applied


def with_film(shot: Shot, factor: float) -> Shot:
    """The frames' times, and a window that ends with them."""
    motion, line = replace(shot.flyer, time=factor * shot.flyer.time), shot.centre_line
    if line is not None:
        line = replace(line, time=factor * line.time)
    first, last = shot.window
    return replace(shot, flyer=motion, centre_line=line, window=(first, min(last, float(motion.time[-1]))))


def with_pictures(shot: Shot, factor: float) -> Shot:
    """Every length of the pictures, with its uncertainty as it is."""
    line = shot.centre_line
    if line is not None:
        line = replace(line, y=factor * line.y, Z=factor * line.Z)
    return replace(with_motion(shot, factor), centre_line=line)


def with_mirrored(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # it is not tried without one
    return replace(shot, centre_line=replace(line, y=shot.specimen.length + offset - line.y))


def with_leak(shot: Shot, rate: float) -> Shot:
    """The rate of a transducer whose charge is declared to leak already is added."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    constant = 1.0 / (1.0 / force.transducer.time_constant + rate)
    return replace(shot, force=replace(force, transducer=replace(force.transducer, time_constant=constant)))
