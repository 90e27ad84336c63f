"""Corrections: a shot with one input changed to its estimated value, or with a changed curve.

Each change of the curve is one entry of `FORMS`: a function of the curve and an amount. Amount 0: no change.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from explicit.materials import marlow_from_curve
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, MaterialCurve
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
    """Subtract a zero offset from the volts of the test, after (or before) the baseline, which is kept."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # this cause needs a force channel
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
    """Shift the flyer's clock. The window ends no later than the last frame of the shifted motion."""
    motion = replace(shot.flyer, time=shot.flyer.time - lag)
    first, last = shot.window
    return replace(shot, flyer=motion, window=(first, min(last, float(motion.time[-1]))))


def with_motion(shot: Shot, factor: float) -> Shot:
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return replace(shot, flyer=replace(motion, displacement=factor * motion.displacement))
    return replace(shot, flyer=replace(motion, velocity=factor * motion.velocity))


def with_outline(name: str, sign: float = 1.0) -> Callable[[Shot, float], Shot]:
    """A function that shifts one coordinate of the outline by a given value times ``sign``."""

    def applied(shot: Shot, found: float) -> Shot:
        line = shot.centre_line
        assert line is not None  # this cause needs an outline
        return replace(shot, centre_line=replace(line, **{name: getattr(line, name) + sign * found}))

    return applied


def with_film(shot: Shot, factor: float) -> Shot:
    """Scale the times of the frames. The end of the window is scaled too."""
    motion, line = replace(shot.flyer, time=factor * shot.flyer.time), shot.centre_line
    if line is not None:
        line = replace(line, time=factor * line.time)
    first, last = shot.window
    return replace(shot, flyer=motion, centre_line=line, window=(first, min(last, float(motion.time[-1]))))


def with_pictures(shot: Shot, factor: float) -> Shot:
    """Scale every length measured in the pictures. Their uncertainties do not change."""
    line = shot.centre_line
    if line is not None:
        line = replace(line, y=factor * line.y, Z=factor * line.Z)
    return replace(with_motion(shot, factor), centre_line=line)


def with_mirrored(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # this cause needs an outline
    return replace(shot, centre_line=replace(line, y=shot.specimen.length + offset - line.y))


def with_leak(shot: Shot, rate: float) -> Shot:
    """Correct for a charge leak of the transducer. ``rate`` is added to a declared leak rate."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # this cause needs a force channel
    constant = 1.0 / (1.0 / force.transducer.time_constant + rate)
    return replace(shot, force=replace(force, transducer=replace(force.transducer, time_constant=constant)))


PAST_END = 2.0
"""An extended curve ends at this multiple of its last s = sqrt(I1 - 3), beyond all specimens."""
MORE_POINTS = 40
"""Number of points added past the last one."""
SOFTEST = 0.02
"""Smallest quotient past the last point over that at the point. No law follows a curve that falls to zero."""
FINEST = 4096
"""Number of stretches from which the stretch at a given s is interpolated."""


def changed_curve(curve: MaterialCurve, amounts: Mapping[str, float]) -> MaterialCurve:
    """The curve with the changes of `FORMS` in ``amounts``.

    Raises ValueError if the changed curve is not a curve of one branch.
    """
    changed = replace(curve, law=None)
    for name, amount in amounts.items():
        changed = FORMS[name](changed, amount)
    return changed


def _with_stress(curve: MaterialCurve, factor: FloatArray | float) -> MaterialCurve:
    """The curve with every stress and its uncertainty multiplied."""
    modes = None if curve.modes is None else factor * curve.modes
    return replace(curve, stress=factor * curve.stress, sigma=np.abs(factor * curve.sigma), modes=modes)


def _scale(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Every stress times 1 + amount."""
    return _with_stress(curve, 1.0 + amount)


def _true_stress(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Convert true stress to nominal stress of an incompressible specimen (amount 1): T = sigma / λ."""
    return _with_stress(curve, curve.stretch**-amount)


def _true_strain(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Convert logarithmic strain to stretch (amount 1): λ = exp(strain)."""
    nominal = curve.stretch - 1.0
    return replace(curve, stretch=1.0 + nominal + amount * (np.expm1(nominal) - nominal))


def _tilt(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Multiply the secants by a factor that grows along the curve, by ``amount`` from start to end."""
    strain = np.abs(curve.stretch - 1.0)
    return _with_stress(curve, 1.0 + amount * (strain / strain.max() - 0.5))


def _past_end(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Extend the curve: T / (λ - 1/λ²) departs from its end tangent by ``amount`` at `PAST_END`."""
    law = marlow_from_curve(curve.stretch, curve.stress)
    s = law.last * np.linspace(1.0, PAST_END, MORE_POINTS + 1)[1:]
    quotient = law.two_u_prime(s) + amount * law.quotient[-1] * (s / law.last - 1.0) ** 2
    quotient = np.maximum(quotient, SOFTEST * law.quotient[-1])
    end = curve.stretch[np.argmax(np.abs(curve.stretch - 1.0))]
    stretch = _stretch_of(s, compression=bool(end < 1.0))
    stress = quotient * (stretch - stretch**-2)
    share = stress / curve.stress[np.argmax(np.abs(curve.stretch - 1.0))]
    more = share * curve.sigma[np.argmax(np.abs(curve.stretch - 1.0))]
    return MaterialCurve(
        stretch=np.append(curve.stretch, stretch),
        stress=np.append(curve.stress, stress),
        sigma=np.append(curve.sigma, more),
    )


def _stretch_of(s: FloatArray, *, compression: bool) -> FloatArray:
    """Stretch of one branch with a given s = sqrt(I1 - 3)."""
    largest = float(s.max())
    ends = (1.0 / (1.0 + largest) ** 2, 1.0) if compression else (1.0, 1.0 + largest)
    stretch = np.geomspace(*ends, FINEST)
    known = np.abs(stretch - 1.0) * np.sqrt((stretch + 2.0) / stretch)
    order = np.argsort(known)
    return np.asarray(np.interp(s, known[order], stretch[order]))


def _branch(curve: MaterialCurve, amount: float) -> MaterialCurve:
    """Exchange tension and compression (amount 1), for a curve that was declared on the wrong branch."""
    if amount < 0.5:
        return curve
    return replace(curve, stretch=2.0 - curve.stretch, stress=-curve.stress)


FORMS: dict[str, Callable[[MaterialCurve, float], MaterialCurve]] = {
    "scale": _scale,
    "true stress": _true_stress,
    "true strain": _true_strain,
    "tilt": _tilt,
    "past end": _past_end,
    "branch": _branch,
}
"""Changes of the curve by name."""
