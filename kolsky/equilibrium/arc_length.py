r"""A path of equilibria past limit points of the load, by arc length.

The load p and the unknowns u follow from

    r(u, p) = 0,   t . (u - u_0) = ds,                                                         (L.1)

Here t is the unit tangent of the path at u_0 (Riks 1979; the plane normal to the tangent). With f = -dr/dp
each iteration solves K a = -r and K b = f. The increment is du = a + b dp with dp = (ds - t . (u - u_0) - t .
a) / t . b. The tangent is b / |b|, with the sign that continues the path. A step that fails is halved. The
step length is adapted to the number of iterations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from kolsky.equilibrium.equations import Equations, State
from kolsky.equilibrium.linear.base import SingularError
from kolsky.equilibrium.model import Model
from kolsky.equilibrium.solution import Outcome
from kolsky.equilibrium.solve import Iteration, Newton

ITERATIONS = 12
"""Maximum number of iterations of a step."""
WANTED = 5
"""Target number of iterations. The step length is adapted to it."""
SHORTEST = 1e-6
"""The path ends if the step length is below this, as a share of the first."""


@dataclass(frozen=True)
class ArcPath:
    """Equilibria in the order of the path."""

    model: Model
    load: FloatArray
    """Common value of the histories that increase together, shape [n]. The first value is 0."""
    displacements: FloatArray
    """Displacements [m], shape [n, n_points, d]."""
    arc: FloatArray
    """Length of the path in the space of the unknown displacements [m], shape [n]."""
    outcome: Outcome

    @property
    def limits(self) -> FloatArray:
        """Loads at limit points, in their order, shape [...]. At a limit point, the load has an extremum. It
        is computed from the parabola through three equilibria."""
        found = []
        for k in range(1, len(self.load) - 1):
            if (self.load[k] - self.load[k - 1]) * (self.load[k + 1] - self.load[k]) < 0.0:
                curve = np.polynomial.Polynomial.fit(
                    self.arc[k - 1 : k + 2], self.load[k - 1 : k + 2], 2, domain=[]
                )
                found.append(float(curve(curve.deriv().roots()[0].real)))
        return np.array(found)

    def crossings(self, loads: Sequence[float] | FloatArray) -> FloatArray:
        """Interpolated displacements at increasing `loads`, [len(loads), n_points, d].

        They are close to the equilibria.

        Past a limit point, an increasing load jumps along the path to the point at which the path first
        reaches this load.

        Raises ValueError if the path does not reach a load.
        """
        found, start = [], 0
        for load in loads:
            rising = (self.load[:-1] <= load) & (self.load[1:] >= load)
            rising[:start] = False
            if not rising.any():
                raise ValueError(f"the path does not reach a load of {load:g}")
            start = int(np.argmax(rising))
            span = self.load[start + 1] - self.load[start]
            share = (load - self.load[start]) / span if span > 0.0 else 0.0
            ends = self.displacements[start : start + 2]
            found.append(ends[0] + share * (ends[1] - ends[0]))
        return np.array(found)


def follow(
    model: Model,
    histories: Sequence[str],
    *,
    until: float,
    first: float,
    others: Mapping[str, float] | None = None,
    parameters: ArrayLike | None = None,
    steps: int = 200,
    longest: float = 4.0,
) -> ArcPath:
    """Follow equilibria from load 0 until the load first reaches `until`.

    ``model``: the body with its supports and loads. ``histories``: histories of loads that all have the value
    of the load. Histories of prescribed displacements are not allowed. ``until``: load at which the path
    ends, > 0. ``first``: load of the first step, > 0. ``others``: values of the other histories, such as that
    of the weight. ``parameters``: as for `kolsky.equilibrium.solve.solve`. ``steps``: maximum number of
    steps. ``longest``: largest length of a step divided by that of the first [-]. Raises ValueError if a
    history is missing, unknown or one of displacements, or if a number is not > 0.
    """
    fixed = {} if others is None else dict(others)
    if set(fixed) | set(histories) != set(model.histories) or set(fixed) & set(histories):
        raise ValueError(f"histories and others must be {sorted(model.histories)}, each once")
    if any(name in histories for _, name, _ in model.unknowns.prescribed):
        raise ValueError("a path follows loads, not prescribed displacements")
    if not (until > 0.0 and first > 0.0 and steps >= 1 and longest >= 1.0):
        raise ValueError(f"until, first must be > 0, steps, longest >= 1, got {until, first, steps, longest}")
    equations = Equations(model, model.parameters(parameters))
    if equations.contacts:
        raise ValueError("a path by arc length meets no rigid plane: remove it")
    newton = Newton()

    def at(load: float) -> dict[str, float]:
        return {**fixed, **dict.fromkeys(histories, load)}

    def push(state: State) -> FloatArray:
        """f: change of the external forces per unit of load. They are linear in the load."""
        return equations.external_change(state, {k: v + (k in histories) for k, v in state.at.items()})

    def step(start: State, load: float, change: float) -> tuple[State, float, int] | Outcome:
        """The equilibrium after an arc length, its load and the iterations; the outcome of a failed step."""
        moved, p = length * tangent, load + change
        for number in range(ITERATIONS + 1):
            state = equations.evaluate(start.u + equations.expanded(moved), at(p), like=start)
            if state.inverted:
                return Outcome.INVERTED
            if equations.converged(state, newton.tolerance) and number > 0:
                return (state, p, number) if equations.closed(state) else Outcome.PENETRATION
            try:
                factors = equations.factors(equations.stiffness(state), state)
            except SingularError:
                return Outcome.SINGULAR
            a, b = factors.solve(np.stack([-state.residual, push(state)], axis=-1)).T
            dp = (length - float(tangent @ moved) - float(tangent @ a)) / float(tangent @ b)
            moved, p = moved + a + b * dp, p + dp
            if not np.isfinite(p):
                return Outcome.NOT_CONVERGED
        return Outcome.NOT_CONVERGED

    state: State | Outcome = equations.evaluate(np.zeros(model.n_dofs), at(0.0))
    assert isinstance(state, State)
    if state.external.any():  # otherwise it is at rest
        state = Iteration(equations, newton).equilibrium(state)
    loads, found, arcs = [0.0], [np.zeros(model.n_dofs)], [0.0]
    if isinstance(state, Outcome):
        return _path(model, loads, [np.full(model.n_dofs, np.nan)], arcs, state)
    found[0] = state.u
    outcome, before, length, most, least = Outcome.UNFINISHED, None, 0.0, np.inf, 0.0
    for _ in range(steps):
        try:
            slope = equations.factors(equations.stiffness(state), state).solve(push(state))  # b
        except SingularError:
            outcome = Outcome.SINGULAR
            break
        size = float(np.linalg.norm(slope))
        if before is None:
            length = first * size
            most, least = longest * length, SHORTEST * length
        sign = 1.0 if before is None or float(before @ slope) > 0.0 else -1.0
        tangent = sign * slope / size
        while True:
            reached = step(state, loads[-1], sign * length / size)
            if not isinstance(reached, Outcome):
                break
            length *= 0.5
            if length < least:
                return _path(model, loads, found, arcs, reached)
        state, load, needed = reached
        before = tangent
        loads.append(load)
        found.append(state.u)
        arcs.append(arcs[-1] + length)
        if load >= until:
            outcome = Outcome.COMPLETED
            break
        length = min(most, length * float(np.clip(np.sqrt(WANTED / max(needed, 1)), 0.5, 1.5)))
    return _path(model, loads, found, arcs, outcome)


def _path(
    model: Model, loads: list[float], found: list[FloatArray], arcs: list[float], outcome: Outcome
) -> ArcPath:
    shape = (len(found), *model.mesh.points.shape)
    return ArcPath(model, np.array(loads), np.array(found).reshape(shape), np.array(arcs), outcome)
