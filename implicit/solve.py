"""Equilibria of a model along a history, by Newton's method with line search and step halving."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from implicit.equations import Equations, State
from implicit.linear.factorise import Factors, SingularError
from implicit.model import Model
from implicit.outcome import Outcome
from implicit.solution import Solution


@dataclass(frozen=True)
class Newton:
    """Options of the iteration."""

    tolerance: float = 1e-9
    """Largest residual as a share of the internal forces (2-norms) [-]."""
    iterations: int = 25
    """Most iterations of a step before it is halved."""
    halvings: int = 8
    """How often a step may be halved."""
    line_search: int = 8
    """Most lengths tried along a direction."""

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1e-2:
            raise ValueError(f"tolerance must be in (0, 0.01), got {self.tolerance}")
        if min(self.iterations, self.line_search) < 1 or self.halvings < 0:
            raise ValueError("iterations and line_search must be >= 1, halvings >= 0")


def solve(
    model: Model,
    steps: Mapping[str, ArrayLike] | None = None,
    parameters: ArrayLike | None = None,
    *,
    newton: Newton | None = None,
    first: FloatArray | None = None,
) -> Solution:
    """Find the equilibrium at each step.

    Parameters
    ----------
    model : Model
        The body with its supports and loads.
    steps : mapping of str to array
        Value of each of the model's histories at each step, shape [n_steps]; before the first all are 0.
        None for a model without histories: one step.
    parameters : array, optional
        Constants of each region, shape [n_regions, n_parameters] or, of one region, [n_parameters]; None: the
        material's own.
    newton : Newton, optional
        Options.
    first : array, shape [n, d], optional
        Displacements from which the first step's iteration starts [m], such as those at other constants.

    Raises
    ------
    ValueError
        If a history is missing, unknown, of another length or not finite.
    """
    options = Newton() if newton is None else newton
    table = model.parameters(parameters)
    histories = checked_steps(model, steps)
    n_steps = len(next(iter(histories.values()))) if histories else 1
    shape = (n_steps, *model.mesh.points.shape)
    displacements, forces = np.full(shape, np.nan), np.full(shape, np.nan)
    energy = np.full(n_steps, np.nan)
    equations = Equations(model, table)
    path = _Path(equations, options)
    outcome, reached = Outcome.COMPLETED, 0
    for step in range(n_steps):
        target = {name: float(values[step]) for name, values in histories.items()}
        start = first.reshape(-1) if first is not None and step == 0 else None
        outcome = path.to(target, start)
        if not outcome.ok:
            break
        displacements[step] = path.state.u.reshape(shape[1:])
        forces[step] = path.state.internal.reshape(shape[1:])
        energy[step] = equations.body.energy(path.state.body)
        reached = step + 1
    return Solution(
        model,
        table,
        histories,
        displacements,
        forces,
        energy,
        outcome,
        reached,
        path.iterations,
        path.factorisations,
    )


def checked_steps(model: Model, steps: Mapping[str, ArrayLike] | None) -> dict[str, FloatArray]:
    """Histories as arrays of one length; see `solve`."""
    given = {} if steps is None else {name: np.atleast_1d(np.asarray(v, float)) for name, v in steps.items()}
    wanted = model.histories
    if set(given) != set(wanted):
        raise ValueError(f"steps must have the histories {sorted(wanted)}, got {sorted(given)}")
    if len({len(values) for values in given.values()}) > 1:
        raise ValueError(
            "all histories must have one number of steps, got " + str({k: len(v) for k, v in given.items()})
        )
    for name, values in given.items():
        if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
            raise ValueError(f"steps[{name!r}] must be finite numbers, at least one, in one dimension")
    return given


class _Path:
    """The states reached so far, and the way to the next."""

    def __init__(self, equations: Equations, options: Newton) -> None:
        self.equations, self.options = equations, options
        zero = dict.fromkeys(equations.model.histories, 0.0)
        self.state: State = equations.rest(zero)
        self.before: State | None = None
        self.iterations = self.factorisations = 0

    def to(self, target: dict[str, float], start: FloatArray | None) -> Outcome:
        """Go to the target, halving the way where an iteration fails."""
        origin, done, length = dict(self.state.at), 0.0, 1.0
        halvings = 0
        while done < 1.0:
            share = min(1.0, done + length)
            at = {name: origin[name] + share * (target[name] - origin[name]) for name in target}
            if share == 1.0:
                at = dict(target)
            found = self._equilibrium(at, start if share == 1.0 else None)
            if isinstance(found, State):
                self.before, self.state = self.state, found
                done, start = share, None
                continue
            if start is not None:  # the given start was no help
                start = None
                continue
            halvings += 1
            if halvings > self.options.halvings:
                return found
            length *= 0.5
        return Outcome.COMPLETED

    def _equilibrium(self, at: dict[str, float], start: FloatArray | None) -> State | Outcome:
        equations, options = self.equations, self.options
        try:
            state = self._first(at, start)
            for _ in range(options.iterations):
                if state.body.inverted:
                    return Outcome.INVERTED
                if equations.converged(state, options.tolerance):
                    return state
                factors = self._factors(state)
                self.iterations += 1
                state = self._line_search(state, factors.solve(-state.residual))
        except SingularError:
            return Outcome.SINGULAR
        if state.body.inverted:
            return Outcome.INVERTED
        return state if equations.converged(state, options.tolerance) else Outcome.NOT_CONVERGED

    def _factors(self, state: State) -> Factors:
        self.factorisations += 1
        return self.equations.factors(state)

    def _first(self, at: dict[str, float], start: FloatArray | None) -> State:
        """First guess: the one given, the states before continued, or the tangent's answer to the change."""
        equations = self.equations
        if start is not None:
            return equations.evaluate(equations.with_prescribed(start, at), at)
        guess = self._continued(at)
        if guess is not None:
            state = equations.evaluate(equations.with_prescribed(guess, at), at)
            if not state.body.inverted:
                return state
        moved = equations.with_prescribed(self.state.u, at)
        if np.array_equal(moved, self.state.u):
            return equations.evaluate(moved, at, like=self.state)
        # K du = -r - K_fc du_c with the tangent of the last state
        residual = self.state.residual + equations.stiffness_times(self.state, moved - self.state.u)
        residual -= equations.external_change(self.state, at)
        self.factorisations += 1
        change = equations.factors(self.state).solve(-residual)
        self.iterations += 1
        return equations.evaluate(moved + equations.expanded(change), at)

    def _continued(self, at: dict[str, float]) -> FloatArray | None:
        if self.before is None or not at:
            return None
        names = list(at)
        last = np.array([self.state.at[n] - self.before.at[n] for n in names])
        following = np.array([at[n] - self.state.at[n] for n in names])
        size = float(last @ last)
        if size == 0.0:
            return None
        factor = float(following @ last) / size
        if not 0.0 < factor < 4.0 or np.linalg.norm(following - factor * last) > 1e-6 * np.linalg.norm(
            following
        ):
            return None
        return self.state.u + factor * (self.state.u - self.before.u)

    def _line_search(self, state: State, direction: FloatArray) -> State:
        """A state along the direction where the work of the residual on it has fallen enough."""
        equations = self.equations
        step = equations.expanded(direction)
        initial = float(state.residual @ direction)
        length, best = 1.0, None
        for _ in range(self.options.line_search):
            tried = equations.evaluate(state.u + length * step, state.at, like=state)
            if not tried.body.inverted:
                work = float(tried.residual @ direction)
                if best is None or abs(work) < best[0]:
                    best = abs(work), tried
                if abs(work) <= 0.9 * abs(initial):
                    return tried
                if work * initial < 0.0:  # passed: the secant
                    length *= float(np.clip(initial / (initial - work), 0.1, 0.7))
                    continue
            length *= 0.5
        return tried if best is None else best[1]
