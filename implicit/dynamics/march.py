"""The motion of a model under histories in time, by Newton's method in every step."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from implicit.dynamics.inertia import Instant, Scheme, element_masses, factor, following
from implicit.dynamics.relaxation import Prony, Relaxing
from implicit.equations import Equations, State
from implicit.linear.base import SingularError
from implicit.model import Model
from implicit.outcome import Outcome
from implicit.solve import checked_steps

ITERATIONS = 30
"""Most iterations of a step."""


@dataclass(frozen=True)
class Motion:
    """A motion; steps that were not reached hold NaN, and the outcome says why."""

    model: Model
    """The model."""
    time: FloatArray
    """Times [s], the first 0, shape [n + 1]."""
    displacements: FloatArray
    """Displacements [m], shape [n + 1, n_points, d]."""
    velocities: FloatArray
    """Velocities [m/s], of the same shape."""
    forces: FloatArray
    """Forces that supports exert on the points: internal and inertial ones less weight and pressure [N], of
    the same shape; 0 at the start."""
    outcome: Outcome
    """How it ended."""
    reached: int
    """Number of times reached, the start included."""

    def mean_displacement(self, where: str) -> FloatArray:
        """Mean displacement of a set of points [m], shape [n + 1, d]."""
        return np.asarray(self.displacements[:, self.model.mesh.nodes(where)].mean(axis=1))

    def reaction(self, where: str) -> FloatArray:
        """Sum of `forces` over a set of points [N], shape [n + 1, d]."""
        return np.asarray(self.forces[:, self.model.mesh.nodes(where)].sum(axis=1))


def march(
    model: Model,
    histories: Mapping[str, ArrayLike] | None,
    dt: float,
    *,
    density: float,
    scheme: Scheme = "backward_euler",
    prony: Prony | None = None,
    steps: int | None = None,
    start: FloatArray | None = None,
    start_histories: Mapping[str, float] | None = None,
    tolerance: float = 1e-8,
) -> Motion:
    """Step a model through time from rest.

    Parameters
    ----------
    model : Model
        The body with its supports and loads, without rigid planes.
    histories : mapping of str to array
        Value of each history at the end of each step, shape [n].
    dt : float
        Length of a step [s].
    density : float
        At rest [kg/m3].
    scheme : str
        "backward_euler" or "trapezoidal".
    prony : Prony, optional
        Relaxation of the stress.
    steps : int, optional
        Number of steps of a model without histories.
    start : array, shape [n_points, d], optional
        Displacements at the start [m], where nothing moves; None: undeformed.
    start_histories : mapping of str to float, optional
        Values of the histories at the start; None: those of the first step.
    tolerance : float
        Largest residual as a share of the internal, external or inertial forces [-].

    Raises
    ------
    ValueError
        If a history does not fit, dt is not > 0, the scheme is not known or there is a rigid plane.
    """
    table = checked_steps(model, histories)
    n = len(next(iter(table.values()))) if table else (steps or 1)
    equations = Equations(model, model.parameters())
    if not dt > 0.0 or scheme not in get_args(Scheme):
        raise ValueError(f"dt must be > 0 s and scheme one of {get_args(Scheme)}, got {dt} and {scheme!r}")
    if equations.contacts:
        raise ValueError("a motion with a rigid plane is not offered: remove the contact")
    masses = element_masses(model, density)
    relaxing = None if prony is None else Relaxing(equations.body, prony, dt)
    at = [{name: float(values[k]) for name, values in table.items()} for k in range(n)]
    u = np.zeros(model.n_dofs) if start is None else np.asarray(start, dtype=float).reshape(-1)
    first = equations.evaluate(u, at[0] if start_histories is None else dict(start_histories))
    if relaxing is not None:
        relaxing.accept(first.body)
    now = _at_rest(equations, first, masses, u)
    found = [now]
    shape = (n + 1, *model.mesh.points.shape)
    forces = np.full(shape, np.nan)
    forces[0] = 0.0
    outcome = Outcome.COMPLETED
    stepper = _Stepper(equations, masses, relaxing, scheme, dt, tolerance)
    for k in range(n):
        outcome, following_state, state = stepper.step(now, at[k])
        if not outcome.ok:
            break
        now = following_state
        inertia = equations.times(masses, now.a)
        added = 0.0 if relaxing is None else equations.body.pattern.vector(relaxing.forces(state.body))
        forces[k + 1] = (state.body.forces + added + inertia - state.carried).reshape(shape[1:])
        if relaxing is not None:
            relaxing.accept(state.body)
        found.append(now)
    moved, velocity = np.full(shape, np.nan), np.full(shape, np.nan)
    for k, one in enumerate(found):
        moved[k], velocity[k] = one.u.reshape(shape[1:]), one.v.reshape(shape[1:])
    time = np.asarray(dt * np.arange(n + 1), dtype=np.float64)
    return Motion(model, time, moved, velocity, forces, outcome, len(found))


def _at_rest(equations: Equations, state: State, masses: FloatArray, u: FloatArray) -> Instant:
    """The start: nothing moves, and the acceleration is that of the forces."""
    push = equations.factors(masses).solve(-state.residual)
    return Instant(u, np.zeros_like(u), equations.expanded(push))


class _Stepper:
    """One step of a motion."""

    def __init__(
        self,
        equations: Equations,
        masses: FloatArray,
        relaxing: Relaxing | None,
        scheme: Scheme,
        dt: float,
        tolerance: float,
    ) -> None:
        self.equations, self.masses, self.relaxing = equations, masses, relaxing
        self.scheme, self.dt, self.tolerance = scheme, dt, tolerance

    def step(self, before: Instant, at: dict[str, float]) -> tuple[Outcome, Instant, State]:
        """The end of a step, and its state."""
        equations = self.equations
        u = equations.with_prescribed(before.u, at)
        for _ in range(ITERATIONS):
            state = equations.evaluate(u, at)
            now = following(self.scheme, self.dt, before, u)
            if state.inverted:
                return Outcome.INVERTED, now, state
            inertia = equations.reduced(equations.times(self.masses, now.a))
            residual = state.residual + inertia
            if self.relaxing is not None:
                residual = residual + equations.reduced(
                    equations.body.pattern.vector(self.relaxing.forces(state.body))
                )
            sizes = [float(np.linalg.norm(x)) for x in (state.body.forces, state.external, inertia)]
            if float(np.linalg.norm(residual)) <= max(self.tolerance * max(sizes), equations.floor):
                closed = Outcome.COMPLETED if equations.closed(state) else Outcome.PENETRATION
                return closed, now, state
            elements = equations.stiffness(state) + factor(self.scheme, self.dt) * self.masses
            if self.relaxing is not None:
                elements = elements + self.relaxing.stiffness(equations.body.stiffness(state.body))
            try:
                change = equations.factors(elements, state).solve(-residual)
            except SingularError:
                return Outcome.SINGULAR, now, state
            u = u + equations.expanded(change)
        return Outcome.NOT_CONVERGED, now, state
