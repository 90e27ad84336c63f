"""The shot as it would be if a likely cause were put right, for an identification of its own."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kolsky.base.records import FlyerMotion
from kolsky.diagnosis import candidate_input as inputs
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.settings import Settings
from kolsky.shot.records import ForceChannel, Shot

FIELDS = {inputs.LENGTH: "length", inputs.DIAMETER: "diameter", inputs.DENSITY: "density"}
"""Fields of the specimen by their keys."""
HELD = {
    inputs.POISSON: "poisson",
    inputs.DAMPING: "damping",
    inputs.KIND: "mass_damping",
    inputs.INTERFACE: "friction",
}
"""Parameters that are then held at the found value."""


def corrected(shot: Shot, settings: Settings, finding: CauseFinding) -> tuple[Shot, Settings] | None:
    """The shot and the settings with the found value; None where none can be given, as for a flyer's tilt."""
    key, value = finding.key, finding.value
    if key in FIELDS:
        specimen, name = shot.specimen, FIELDS[key]
        wrong = getattr(specimen, name)
        return replace(shot, specimen=replace(specimen, **{name: value * wrong})), settings
    if key in HELD:
        return shot, replace(settings, held={**settings.held, HELD[key]: value})
    if key not in CHANGES:
        return None
    return CHANGES[key](shot, value), settings


def _gain(shot: Shot, value: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        right = replace(force.transducer, sensitivity=force.transducer.sensitivity / value)
        return replace(shot, force=replace(force, transducer=right))
    history = force.history()
    right_history = replace(history, force=value * history.force, sigma=value * history.sigma)
    return replace(shot, force=replace(force, measured=right_history))


def _zero(shot: Shot, value: float) -> Shot:
    """Volts taken off after the baseline, whose own mean is the zero."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    volts = force.transducer.compression_sign * force.transducer.sensitivity * value
    later = force.time > force.baseline[1]
    recording = replace(force.recording, value=force.recording.value - np.where(later, volts, 0.0))
    return replace(shot, force=replace(force, recording=recording))


def _force_clock(shot: Shot, lag: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        return replace(shot, force=replace(force, clock_offset=force.clock_offset - lag))
    history = force.history()
    return replace(shot, force=replace(force, measured=replace(history, time=history.time - lag)))


def _outline_clock(shot: Shot, lag: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # it is not tried without one
    return replace(shot, centre_line=replace(line, time=line.time - lag))


def _flyer_clock(shot: Shot, lag: float) -> Shot:
    """The motion is known until its last frame, and compared no longer."""
    motion = replace(shot.flyer, time=shot.flyer.time - lag)
    first, last = shot.window
    return replace(shot, flyer=motion, window=(first, min(last, float(motion.time[-1]))))


def _motion(shot: Shot, factor: float) -> Shot:
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return replace(shot, flyer=replace(motion, displacement=factor * motion.displacement))
    return replace(shot, flyer=replace(motion, velocity=factor * motion.velocity))


def _height(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # as above
    return replace(shot, centre_line=replace(line, y=line.y + offset))


def _radius(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # as above
    return replace(shot, centre_line=replace(line, Z=line.Z + offset))


CHANGES: dict[str, Callable[[Shot, float], Shot]] = {
    inputs.SENSITIVITY: _gain,
    inputs.BASELINE: _zero,
    inputs.FORCE_CLOCK: _force_clock,
    inputs.OUTLINE_CLOCK: _outline_clock,
    inputs.FLYER_CLOCK: _flyer_clock,
    inputs.SCALE: _motion,
    inputs.Y_OFFSET: _height,
    inputs.Z_OFFSET: _radius,
}
"""What puts a recording or a scale right, by the cause's key."""
