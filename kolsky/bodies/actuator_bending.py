"""Bending angle of an actuator under a pressure and gravity, and the pressure for a target angle.

The pressures for a target are found by SciPy's trust region with bounds (Branch, Coleman and Li 1999). Its
residuals are (Theta - Theta_d) and, for a target of the tip, (t - t_d) / L, with their exact Jacobian. For
one pressure and one angle its step is Newton's,

    p <- p - (Theta(p) - Theta_d) / (dTheta/dp).                                               (A.2)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.bodies.actuator_model import (
    Actuator,
    Bending,
    Touching,
    bend_of,
    bend_slope,
    forces_outside,
    smallest_gap,
    touching,
)
from kolsky.bodies.actuator_reading import ActuatorSpec
from kolsky.equilibrium.solid import Solid

OVERLAP = 0.1
"""With contact, a larger overlap of facing points than this gives a warning; share of the gap at rest [-]."""
_FILM_STEPS = 8
"""Smallest number of steps up to the largest pressure."""


@dataclass(frozen=True)
class Direction:
    """The actuator under one direction of gravity."""

    name: str
    pristine: Bending
    """Equilibria under increasing pressures."""
    healed: Bending | None
    asked: FloatArray
    """Indices of the steps at the declared pressures, shape [n_pressures]."""
    gap: FloatArray
    """Smallest distance of neighbouring chambers [m], shape [n]. Below 0 they overlap. NaN without gaps."""
    touching: Touching | None = None
    forces: dict[str, FloatArray] = field(default_factory=dict)
    """Force on each plane and holder [N], shape [n, 3]."""

    @property
    def overlapping(self) -> BoolArray:
        """Steps at which chambers have passed through each other, shape [n]. With contact, a tenth of the gap
        at rest is allowed. The facing points that measure the gap may slide along the walls."""
        allowed = 0.0 if self.touching is None else OVERLAP * self.gap[0]
        with np.errstate(invalid="ignore"):
            return np.asarray(self.gap < -allowed)


def simulate_all(spec: ActuatorSpec) -> list[Direction]:
    """Simulate every direction of gravity at the declared pressures and at steps between them."""
    pressures, asked = schedule(spec.pressures)
    directions = []
    for name, g in spec.gravities.items():
        run = _simulated(spec, name, g, pressures, None)
        healed = None if spec.healed is None else _simulated(spec, name, g, pressures, spec.healed)
        gap, contact, forces = smallest_gap(run), touching(run), forces_outside(run)
        directions.append(Direction(name, run, healed, asked, gap, contact, forces))
    return directions


def _simulated(
    spec: ActuatorSpec, name: str, gravity: FloatArray, pressures: FloatArray, body: Solid | None
) -> Bending:
    """Equilibria step by step; each of them must be reached."""
    run = spec.actuator.simulate(gravity, pressures, constants=spec.actuator.constants(body=body))
    reached = 1e-5 * pressures[max(run.solution.reached - 1, 0)]
    run.solution.outcome.require(f"{name}, beyond {reached:.3g} bar")
    return run


def schedule(pressures: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps from 0 to the largest pressure or suction [Pa], with the indices of the given pressures."""
    step = float(pressures[-1]) / _FILM_STEPS
    ends = np.concatenate([[0.0], pressures[pressures != 0.0]])
    parts = [np.array([0.0])]
    for a, b in pairwise(ends):
        parts.append(np.linspace(a, b, max(1, int(np.ceil((b - a) / step - 1e-9))) + 1)[1:])
    steps = np.concatenate(parts)
    return steps, np.array([int(np.argmin(np.abs(steps - p))) for p in pressures])


LARGEST_LOAD = 5.0
"""Largest plausible pressure divided by the shear modulus [-]. If walls have half the chambers' width, their
stress is about twice the pressure. Rubbers tear at a few shear moduli."""


def implausible_load(pressure: float, shear_modulus: float) -> list[str]:
    """A warning if the pressure [Pa] is too large for a material of this shear modulus [Pa]. Empty
    otherwise."""
    share = abs(pressure) / shear_modulus
    if share <= LARGEST_LOAD:
        return []
    return [
        f"the largest pressure is {share:.3g} times the shear modulus, usual is at most {LARGEST_LOAD:g}: "
        "check the units of pressures and of the constants"
    ]


def warnings_of(directions: list[Direction]) -> list[str]:
    """Warnings about the bends."""
    first = directions[0].pristine
    model = first.solution.model
    warnings = implausible_load(float(np.abs(first.pressures).max()), float(model.solid.shear_modulus))
    for one in directions:
        through = np.flatnonzero(one.overlapping)
        if through.size:
            pressure = 1e-5 * float(one.pristine.pressures[through[0]].max())
            warnings.append(
                f"{one.name}: from {pressure:.3g} bar on neighbouring chambers overlap, which they cannot: "
                "the bends beyond are not those of the actuator; "
                + ("declare [contact]" if one.touching is None else "take more steps or a finer mesh")
            )
    return warnings


def relative_bend(one: Direction) -> FloatArray:
    """Relative change of the bend by healing: ratio of healed to pristine, both from rest, minus 1. At the
    declared pressures [-], shape [n_pressures]."""
    assert one.healed is not None
    before, after = (run.angle - run.angle[0] for run in (one.pristine, one.healed))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((after / before - 1.0)[one.asked])


TOLERANCE = 1e-4
"""Largest difference from the target angle [rad], and from the target tip over the length [-]."""
PRECISION = 1e-10
"""Relative change of pressures, sum of squares and gradient at which a search ends [-]."""
AT_BOUND = 1e-3
"""A pressure is at a bound if its distance from it is below this, as a share of the largest pressure [-]."""
RAMP = 4
"""Number of steps to the first pressure."""


class SearchEnd(StrEnum):
    """How a search for a pressure ended."""

    YES = "reached"
    ABOVE = "beyond the largest pressure"
    BELOW = "below the bend without pressure"
    NEAREST = "the nearest within the bounds"
    FAILED = "no equilibrium"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True)
class Inversion:
    """Result of a search for a pressure."""

    angle: float
    """The target angle [rad]."""
    pressures: FloatArray
    """Pressure of each cavity [Pa], shape [n_cavities]; NaN without an equilibrium."""
    found: float
    """The angle at these pressures [rad]."""
    slope: FloatArray
    """dTheta/dp at these pressures [rad/Pa], shape [n_cavities]."""
    ended: SearchEnd
    equilibria: int


def pressures_for(
    actuator: Actuator,
    gravity: Sequence[float] | FloatArray,
    *,
    angle: float,
    tip: Sequence[float] | FloatArray | None = None,
    most: float,
) -> Inversion:
    """Find the pressure of each cavity for a target angle [rad] and, if given, tip [m].

    ``gravity``: acceleration of free fall [m/s^2]. ``most``: largest pressure, or suction if below 0 [Pa].
    """
    count, size = len(actuator.cavities), float(np.ptp(actuator.mesh.points[:, 0]))
    last: Bending | None = None
    equilibria = 0

    def at(x: FloatArray) -> Bending:
        """The equilibrium at shares of the largest pressure, from the last one."""
        nonlocal last, equilibria
        pressures = most * x
        if last is not None and np.array_equal(last.pressures[-1], pressures):
            return last
        equilibria += 1
        steps = pressures[None] if last is not None else np.outer(np.arange(1, RAMP + 1) / RAMP, pressures)
        guess = None if last is None else last.solution.displacements[-1:]
        bend = actuator.simulate(gravity, steps, guess=guess)
        bend.solution.outcome.require("a trial")
        last = bend
        return bend

    def residual(x: FloatArray) -> FloatArray:
        chord = at(x).chord[-1]
        left = np.array([float(bend_of(chord)) - angle])
        return left if tip is None else np.concatenate([left, (chord - np.asarray(tip)) / size])

    def jacobian(x: FloatArray) -> FloatArray:
        near = at(x)
        by = most * near.chord_slopes()[-1].T
        top = bend_slope(near.chord[-1])[None] @ by
        return top if tip is None else np.concatenate([top, by / size])

    try:
        best = least_squares(
            residual, np.full(count, 0.4), jac=jacobian, bounds=(0.0, 1.0),
            xtol=PRECISION, ftol=PRECISION, gtol=PRECISION,
        )  # fmt: skip
    except ValueError:
        none = np.full(count, np.nan)
        return Inversion(angle, none, np.nan, none, SearchEnd.FAILED, equilibria)
    near = at(best.x)
    ended = SearchEnd.NEAREST if best.status > 0 else SearchEnd.NOT_CONVERGED
    if float(np.abs(best.fun).max()) <= TOLERANCE:
        ended = SearchEnd.YES
    elif count == 1 and tip is None and min(best.x[0], 1.0 - best.x[0]) < AT_BOUND:
        ended = SearchEnd.ABOVE if best.x[0] > 0.5 else SearchEnd.BELOW
    return Inversion(angle, near.pressures[-1], float(near.angle[-1]), near.slopes()[-1], ended, equilibria)
