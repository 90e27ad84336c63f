"""Equilibria of a model along a history, by Newton's method with line search and step halving."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from implicit.equations import Equations, State
from implicit.linear.base import SingularError
from implicit.model import Model
from implicit.newton import Iteration, Newton
from implicit.outcome import Outcome
from implicit.solution import Solution

DEGREE = 5
"""Highest degree of the polynomial that continues the states so far."""


def solve(
    model: Model,
    steps: Mapping[str, ArrayLike] | None = None,
    parameters: ArrayLike | None = None,
    *,
    newton: Newton | None = None,
    guess: FloatArray | None = None,
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
    guess : array, shape [n_steps, n, d], optional
        Displacements from which the iteration of each step starts [m], such as those at other constants; a
        step where that leads nowhere is reached from the one before.

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
    if guess is not None and guess.shape != shape:
        raise ValueError(f"guess must have shape {shape}, got {guess.shape}")
    displacements, forces = np.full(shape, np.nan), np.full(shape, np.nan)
    energy = np.full(n_steps, np.nan)
    equations = Equations(model, table, linear=options.linear)
    path = _Path(equations, options)
    multipliers = [np.full((n_steps, len(c.nodes)), np.nan) for c in equations.contacts]
    outcome, reached = Outcome.COMPLETED, 0
    for step in range(n_steps):
        target = {name: float(values[step]) for name, values in histories.items()}
        outcome = path.to(target, None if guess is None else guess[step].reshape(-1))
        if not outcome.ok:
            break
        state = path.state
        displacements[step] = state.u.reshape(shape[1:])
        forces[step] = (state.body.forces - state.carried).reshape(shape[1:])
        energy[step] = equations.body.energy(state.body)
        for found, values in zip(multipliers, equations.augmented(state)[0], strict=True):
            found[step] = values
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
        path.iteration.iterations,
        path.iteration.factorisations,
        tuple(multipliers),
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
        self.iteration = Iteration(equations, options)
        self.state: State = equations.rest()
        self.before: list[State] = []

    def to(self, target: dict[str, float], guess: FloatArray | None) -> Outcome:
        """Go to the target, halving the way where an iteration fails."""
        if guess is not None:
            state = self.equations.evaluate(
                self.equations.with_prescribed(guess, target), target, like=self.state
            )
            found = self.iteration.equilibrium(state)
            if isinstance(found, State):
                self._reached(found)
                return Outcome.COMPLETED
        origin, done, length, halvings = dict(self.state.at), 0.0, 1.0, 0
        while done < 1.0:
            share = min(1.0, done + length)
            at = {name: origin[name] + share * (target[name] - origin[name]) for name in target}
            if share == 1.0:
                at = dict(target)
            found = self._next(at)
            if isinstance(found, State):
                self._reached(found)
                done = share
                continue
            halvings += 1
            if halvings > self.options.halvings:
                return found
            length *= 0.5
        return Outcome.COMPLETED

    def _reached(self, state: State) -> None:
        self.before = [*self.before[1 - DEGREE :], self.state]
        self.state = state

    def _next(self, at: dict[str, float]) -> State | Outcome:
        """The next equilibrium, from the states before continued or the tangent's answer to the change."""
        guess = self._continued(at)
        if guess is not None:
            moved = self.equations.with_prescribed(guess, at)
            state = self.equations.evaluate(moved, at, like=self.state)
            if not state.inverted:
                found = self.iteration.equilibrium(state)
                if isinstance(found, State):
                    return found
        try:
            state = self._predicted(at)
        except SingularError:
            return Outcome.SINGULAR
        return self.iteration.equilibrium(state)

    def _predicted(self, at: dict[str, float]) -> State:
        """K du = -r - K_fc du_c with the tangent of the last state under the new loads."""
        equations = self.equations
        last = equations.evaluate(self.state.u, at, like=self.state)
        moved = equations.with_prescribed(last.u, at)
        elements = self.iteration.factorised(last)
        self.iteration.iterations += 1
        right = last.residual + equations.reduced(equations.times(elements, moved - last.u))
        assert self.iteration.kept is not None
        change = self.iteration.kept.direction(right)
        return equations.evaluate(moved + equations.expanded(change), at, like=last)

    def _continued(self, at: dict[str, float]) -> FloatArray | None:
        """The path continued as a polynomial, if the histories go straight on."""
        states = [*self.before, self.state]
        if len(states) < 2:
            return None
        names = list(at)
        here = np.array([self.state.at[n] for n in names])
        way = np.array([at[n] for n in names]) - here
        size = float(way @ way)
        if size == 0.0:
            return None
        # places on the way: the next is at 1, this at 0
        places: list[float] = []
        kept: list[FloatArray] = []
        for state in reversed(states):
            back = np.array([state.at[n] for n in names]) - here
            place = float(back @ way) / size
            if np.linalg.norm(back - place * way) > 1e-6 * np.sqrt(size):
                break
            if places and not -8.0 < place < places[-1] - 0.05:
                break
            places.append(place)
            kept.append(state.u)
        if len(places) < 2:
            return None
        return continued(places, kept)


def continued(places: list[float], states: list[FloatArray]) -> FloatArray:
    """The polynomial through the last states, the latest first, at place 1.

    Its degree is one that would have met the latest state best from those before it, and one more where that
    was the highest that could be tried: a history with kinks is continued by few states.
    """
    latest, errors = states[0], [np.linalg.norm(states[1] - states[0])]
    for degree in range(1, len(states) - 1):
        met = _extrapolated(places[1 : degree + 2], states[1 : degree + 2], places[0])
        errors.append(np.linalg.norm(met - latest))
    best = int(np.argmin(errors))
    degree = best + 1 if best == len(errors) - 1 else max(best, 1)
    return _extrapolated(places[: degree + 1], states[: degree + 1], 1.0)


def _extrapolated(places: list[float], states: list[FloatArray], to: float) -> FloatArray:
    """Lagrange's polynomial through the states, at a place."""
    found = np.zeros_like(states[0])
    for i, u in enumerate(states):
        others = [x for j, x in enumerate(places) if j != i]
        found += u * float(np.prod([(to - x) / (places[i] - x) for x in others]))
    return found
