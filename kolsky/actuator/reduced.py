"""The reduced model of an actuator with one pressure: bend and slope in milliseconds, and how wrong it is.

It is made from the equilibria at every second of a row of pressures and judged at those between, which it has
not seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from implicit.outcome import Outcome
from implicit.reduction.model import ReducedModel, ReducedState, reduce
from kolsky.actuator.gaps import smallest_gap
from kolsky.actuator.model import WEIGHT, Actuator, Bending, bend_of, bend_slope
from kolsky.base.arrays import FloatArray

SEEN = 13
"""Pressures that the basis is made from; one less lie between them."""


@dataclass(frozen=True)
class ReducedBend:
    """An equilibrium of the reduced actuator."""

    angle: float
    """Bending angle [rad]."""
    slope: float
    """dTheta/dp [rad/Pa]."""
    state: ReducedState
    """The equilibrium."""

    @property
    def ok(self) -> bool:
        """Whether there is one."""
        return self.state.outcome is Outcome.COMPLETED


class ReducedActuator:
    """Bend over pressure from a reduced model."""

    def __init__(self, reduced: ReducedModel) -> None:
        self.reduced = reduced
        mesh = reduced.model.mesh
        tip, origin = (mesh.points[mesh.nodes(where)].mean(axis=0) for where in ("tip", "origin"))
        self._rest = tip - origin
        self._modes = reduced.rows("tip") - reduced.rows("origin")
        self._rows = reduced.constants()

    def bend(
        self, pressure: float, *, start: FloatArray | None = None, tolerance: float = 1e-9
    ) -> ReducedBend:
        """The bend under a pressure [Pa], from amplitudes near it."""
        state = self.reduced.equilibrium([pressure], start=start, rows=self._rows, tolerance=tolerance)
        chord = self._rest + self._modes @ state.q
        slope = float(bend_slope(chord) @ (self._modes @ state.slopes[:, 0]))
        return ReducedBend(float(bend_of(chord)), slope, state)


@dataclass(frozen=True)
class Reduction:
    """A reduced actuator with its error."""

    model: ReducedActuator
    """The reduced actuator."""
    pressure: FloatArray
    """Pressures between those that it is made from [Pa], shape [n]."""
    angle: FloatArray
    """Angle of the whole model there [rad], shape [n]."""
    error: FloatArray
    """Angle of the reduced model less that of the whole one [rad], shape [n]."""
    gap: float
    """Smallest distance of neighbouring chambers of the whole model at any pressure [m]; NaN without gaps."""

    @property
    def largest_error(self) -> float:
        """Largest error at an unseen pressure [rad]."""
        return float(np.abs(self.error).max())


def reduce_actuator(
    actuator: Actuator,
    gravity: Sequence[float] | FloatArray,
    *,
    most: float,
    modes: int,
    tolerance: float,
    seen: int = SEEN,
) -> Reduction:
    """Reduce an actuator with one cavity for pressures in [0, most].

    Raises
    ------
    ValueError
        If it has several cavities, or an equilibrium is not found.
    """
    if len(actuator.cavities) != 1:
        raise ValueError("the reduced model and its loop have one pressure: set separate = false")
    if actuator.contacts:
        raise ValueError("the reduced model has no contact of chambers: remove [contact]")
    pressures = np.linspace(0.0, most, 2 * seen - 1)
    whole = actuator.simulate(gravity, pressures)
    outcome = whole.solution.outcome
    if not outcome.ok:
        reached = 1e-5 * pressures[max(whole.solution.reached - 1, 0)]
        raise ValueError(f"beyond {reached:.3g} bar: {outcome.cause}; {outcome.cure}")
    first, between = _every(whole, 0), _every(whole, 1)
    made = ReducedActuator(reduce([first.solution], modes=modes, tolerance=tolerance, gravity=WEIGHT))
    found, start = [], None
    for pressure in between.pressures[:, 0]:
        bend = made.bend(float(pressure), start=start)
        if not bend.ok:
            raise ValueError(f"the reduced model at {1e-5 * pressure:.3g} bar: {bend.state.outcome.cause}")
        found.append(bend.angle)
        start = bend.state.q
    gaps = smallest_gap(whole)
    gap = float("nan") if np.isnan(gaps).all() else float(np.nanmin(gaps))
    at, angle = between.pressures[:, 0], between.angle
    return Reduction(made, at, angle, np.array(found) - angle, gap)


def _every(whole: Bending, offset: int) -> Bending:
    """Every second step."""
    s = whole.solution
    part = slice(offset, None, 2)
    cut = replace(
        s,
        steps={name: values[part] for name, values in s.steps.items()},
        displacements=s.displacements[part],
        forces=s.forces[part],
        energy=s.energy[part],
        reached=len(s.displacements[part]),
    )
    return Bending(cut, whole.pressures[part])
