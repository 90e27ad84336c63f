r"""Pressure for a wanted bend: Newton's method on the exact slope, and bounded least squares of several.

For one pressure and one angle the equilibrium's own sensitivity gives the step,

    p <- p - (Theta(p) - Theta_d) / (dTheta/dp),                                               (A.2)

kept inside the bracket that the angles met so far make, by bisection where it would leave it. Several
pressures, or a position of the tip, are found by SciPy's trust region with bounds (Branch, Coleman and Li
1999) on (Theta - Theta_d) and (t - t_d) / L with their exact Jacobian.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.optimize import least_squares

from implicit.sensitivity import direct
from kolsky.actuator.model import WEIGHT, Actuator, Bending, bend_of, bend_slope
from kolsky.base.arrays import FloatArray

TOLERANCE = 1e-6
"""Largest difference of the angle from the wanted one [rad]."""
ITERATIONS = 25
"""Most equilibria of a search."""
RAMP = 4
"""Steps to the first pressure."""


class Reached(StrEnum):
    """How a search for a pressure ended."""

    YES = "reached"
    ABOVE = "beyond the largest pressure"
    BELOW = "below the bend without pressure"
    NEAREST = "the nearest within the bounds"
    FAILED = "no equilibrium"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True)
class Inversion:
    """A pressure that was searched for."""

    angle: float
    """The wanted angle [rad]."""
    pressures: FloatArray
    """Pressure of each cavity [Pa], shape [n_cavities]; NaN where there was no equilibrium."""
    found: float
    """The angle there [rad]."""
    slope: FloatArray
    """dTheta/dp there [rad/Pa], shape [n_cavities]."""
    ended: Reached
    """How it ended."""
    equilibria: int
    """Equilibria that were needed."""


def pressure_for(
    actuator: Actuator, gravity: Sequence[float] | FloatArray, angle: float, *, most: float
) -> Inversion:
    """Find the pressure in all cavities that bends an actuator to an angle, Eq. (A.2).

    Parameters
    ----------
    actuator
        The actuator.
    gravity
        Acceleration of free fall [m/s^2].
    angle
        Wanted angle [rad].
    most
        Largest pressure [Pa].
    """
    rest = actuator.simulate(gravity, np.zeros(1))
    start = Search(angle, most, float(rest.angle[0]), 0.5 * most)
    if not rest.solution.outcome.ok or angle < start.low_angle - TOLERANCE:
        ended = Reached.BELOW if rest.solution.outcome.ok else Reached.FAILED
        return _ended(angle, rest, ended, 1)
    near = rest
    for n in range(2, ITERATIONS + 2):
        near = _next_equilibrium(actuator, gravity, near, start.pressure)
        if not near.solution.outcome.ok:
            return _ended(angle, near, Reached.FAILED, n)
        value, slope = float(near.angle[-1]), float(near.slopes()[-1].sum())
        if abs(value - angle) <= TOLERANCE:
            return _ended(angle, near, Reached.YES, n)
        if start.pressure == most and value < angle:
            return _ended(angle, near, Reached.ABOVE, n)
        start.take(value, slope)
    return _ended(angle, near, Reached.NOT_CONVERGED, ITERATIONS + 1)


class Search:
    """The bracket of a rising function, and the next place to look."""

    def __init__(self, wanted: float, most: float, at_zero: float, first: float) -> None:
        self.wanted, self.most = wanted, most
        self.low, self.low_angle, self.high = 0.0, at_zero, most
        self.pressure = first

    def take(self, angle: float, slope: float) -> None:
        """Go on from the angle and slope at `pressure`."""
        if angle < self.wanted:
            self.low = self.pressure
        else:
            self.high = self.pressure
        step = self.pressure - (angle - self.wanted) / slope if slope > 0.0 else np.nan
        inside = self.low < step < self.high
        beyond = step >= self.high == self.most  # nothing was seen above it yet: look there
        self.pressure = step if inside else self.most if beyond else 0.5 * (self.low + self.high)


def _next_equilibrium(
    actuator: Actuator, gravity: Sequence[float] | FloatArray, near: Bending, pressure: float
) -> Bending:
    before = float(near.pressures[-1, 0])
    if near.solution.reached == 1 and before == 0.0:
        return actuator.simulate(gravity, pressure * np.arange(1, RAMP + 1) / RAMP)
    guess = near.solution.displacements[-1:]
    return actuator.simulate(gravity, np.array([pressure]), guess=guess)


def _ended(angle: float, at: Bending, ended: Reached, equilibria: int) -> Inversion:
    ok = at.solution.outcome.ok
    slope = at.slopes()[-1] if ok else np.full(at.pressures.shape[1], np.nan)
    pressures = at.pressures[-1] if ok else np.full(at.pressures.shape[1], np.nan)
    return Inversion(angle, pressures, float(at.angle[-1]), slope, ended, equilibria)


def pressures_for(
    actuator: Actuator,
    gravity: Sequence[float] | FloatArray,
    *,
    angle: float,
    tip: Sequence[float] | FloatArray | None = None,
    most: float,
) -> Inversion:
    """Find the pressure of each cavity for a wanted angle, and position of the tip if there is one.

    Parameters
    ----------
    actuator, gravity, most
        As of `pressure_for`; every pressure lies in [0, most].
    angle
        Wanted angle [rad].
    tip
        Wanted position of the tip from the origin [m], shape [3]; None: only the angle counts.
    """
    count, memory = len(actuator.cavities), _Memory(actuator, gravity)
    size = float(np.ptp(actuator.mesh.points[:, 0]))

    def residual(x: FloatArray) -> FloatArray:
        chord = memory.at(most * x).chord[-1]
        left = np.array([float(bend_of(chord)) - angle])
        return left if tip is None else np.concatenate([left, (chord - np.asarray(tip)) / size])

    def jacobian(x: FloatArray) -> FloatArray:
        near = memory.at(most * x)
        by = most * chord_slopes(near)
        top = bend_slope(near.chord[-1])[None] @ by
        return top if tip is None else np.concatenate([top, by / size])

    try:
        best = least_squares(residual, np.full(count, 0.4), jac=jacobian, bounds=(0.0, 1.0), xtol=1e-12)
    except _NoEquilibriumError:
        empty = np.full(count, np.nan)
        return Inversion(angle, empty, np.nan, empty, Reached.FAILED, memory.equilibria)
    near = memory.at(most * best.x)
    close = float(np.abs(best.fun).max()) <= 1e2 * TOLERANCE
    ended = Reached.YES if close else Reached.NEAREST if best.status > 0 else Reached.NOT_CONVERGED
    return Inversion(angle, most * best.x, float(near.angle[-1]), near.slopes()[-1], ended, memory.equilibria)


def chord_slopes(near: Bending) -> FloatArray:
    """Derivative of the chord by the pressures at the last step [m/Pa], shape [3, n_cavities]."""
    names = tuple(h for h in near.solution.model.histories if h != WEIGHT)
    found = direct(near.solution, histories=names)
    by = (found.mean_displacement("tip") - found.mean_displacement("origin"))[-1]
    return by[-len(names) :].T


class _NoEquilibriumError(Exception):
    """A place of the search has no equilibrium."""


class _Memory:
    """The last equilibrium, from which the next is reached."""

    def __init__(self, actuator: Actuator, gravity: Sequence[float] | FloatArray) -> None:
        self.actuator, self.gravity = actuator, gravity
        self.last: Bending | None = None
        self.equilibria = 0

    def at(self, pressures: FloatArray) -> Bending:
        """The equilibrium at pressures of shape [n_cavities]."""
        last = self.last
        if last is not None and np.array_equal(last.pressures[-1], pressures):
            return last
        self.equilibria += 1
        if last is None:
            found = self.actuator.simulate(self.gravity, np.outer(np.arange(1, RAMP + 1) / RAMP, pressures))
        else:
            found = self.actuator.simulate(
                self.gravity, pressures[None], guess=last.solution.displacements[-1:]
            )
        if not found.solution.outcome.ok:
            raise _NoEquilibriumError
        self.last = found
        return found
