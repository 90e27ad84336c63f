"""Equilibria of a model along a history: Newton's method with line search and step halving.

A factorised tangent is reused as long as it converges fast enough. Later changes of the residual correct it
(Matthies and Strang 1979): the two recursions of the BFGS formula start with the inverse of the old tangent.
An iteration then needs one solution and no factorisation.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from kolsky.equilibrium.equations import Equations, State
from kolsky.equilibrium.linear.base import Factors, SingularError
from kolsky.equilibrium.model import Model
from kolsky.equilibrium.solution import Outcome, Solution

PAIRS = 16
"""Maximum number of stored changes."""


class QuasiNewtonTangent:
    """An approximate inverse of the tangent."""

    def __init__(self, factors: Factors, *, learns: bool) -> None:
        """Store the factors. Only symmetric tangents of smooth problems are updated (`learns`)."""
        self.factors, self.learns = factors, learns
        self.uses = 0
        """Iterations made with it."""
        self._pairs: list[tuple[FloatArray, FloatArray, float]] = []

    def direction(self, residual: FloatArray) -> FloatArray:
        """Step of an iteration [m]: minus the approximate inverse times the residual [N]."""
        left, shares = residual.copy(), []
        for step, change, work in reversed(self._pairs):
            shares.append(float(step @ left) / work)
            left -= shares[-1] * change
        found = self.factors.solve(left)
        for (step, change, work), share in zip(self._pairs, reversed(shares), strict=True):
            found += (share - float(change @ found) / work) * step
        return -found

    def learn(self, step: FloatArray, change: FloatArray) -> None:
        """Store the change of the residual, `change` [N], along `step` [m]. A pair with a stiffness that is
        not positive is not stored. The formula does not allow it."""
        self.uses += 1
        work = float(step @ change)
        if self.learns and work > 0.0:
            self._pairs = [*self._pairs[1 - PAIRS :], (step, change, work)]


SERVED = 0.2
"""Largest acceptable ratio of successive residuals in the first iteration with a tangent in single precision
[-]. After two larger ratios in succession, double precision is used."""
BEYOND = 0.1
"""Share of the tolerance at which iterations with a reused tangent end [-]. They converge linearly. With a
new tangent, the last iteration ends far below the tolerance."""
ROUNDING = 1e-14
"""Relative change of the displacements that is round-off [-]."""
ITERATIONS, LENGTHS = 40, 8
"""Maximum number of iterations of a step before it is halved, and of step lengths tried along a direction."""
AUGMENTATIONS = 40
"""Maximum number of augmentations of contact multipliers in a step."""


@dataclass(frozen=True)
class Newton:
    """Options of the iteration."""

    tolerance: float = 1e-8
    """Largest residual as a share of the internal forces (2-norms) [-]."""
    halvings: int = 8
    """How often a step may be halved."""
    linear: str = "auto"
    """The linear solver, see `kolsky.equilibrium.linear.solvers`."""
    single: bool = True
    """True if tangents may be factorised in single precision. They only guide the iteration; its residual is
    in double precision. If the iteration fails, and in mixed models, double precision is used."""

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1e-2:
            raise ValueError(f"tolerance must be in (0, 0.01), got {self.tolerance}")
        if self.halvings < 0:
            raise ValueError(f"halvings must be >= 0, got {self.halvings}")


class Iteration:
    """Finds equilibria, and counts iterations and factorisations."""

    def __init__(self, equations: Equations, options: Newton) -> None:
        self.equations, self.options = equations, options
        self.iterations = self.factorisations = 0
        self.single = options.single and equations.model.volumetric == "displacement"
        """True while factors are in single precision.

        It ends if they fail to guide the iteration."""
        self.kept: QuasiNewtonTangent | None = None
        """The last factorised tangent, possibly from an earlier equilibrium; None if there is none."""
        self._poor = 0

    def factorised(self, state: State) -> FloatArray:
        """Factorise the tangent of a state and keep it. Returns the factorised element matrices."""
        self.factorisations += 1
        equations = self.equations
        if self.single:
            elements = equations.stiffness(state, single=True)
            try:
                self._keep(elements, state)
            except SingularError:
                self.single = False
            else:
                return elements
        elements = equations.stiffness(state)
        self._keep(elements, state)
        return elements

    def _keep(self, elements: FloatArray, state: State) -> None:
        factors = self.equations.factors(elements, state)
        self.kept = QuasiNewtonTangent(factors, learns=self.equations.symmetric and self.equations.smooth)

    def equilibrium(self, state: State) -> State | Outcome:
        """The equilibrium near a state, with contacts within tolerance. If the iteration fails, the
        outcome."""
        try:
            for _ in range(AUGMENTATIONS):
                found = self._converged(state)
                if isinstance(found, Outcome):
                    self.kept = None
                    return found
                if not self.equations.closed(found):
                    return Outcome.PENETRATION
                if not self.equations.contacts:
                    return found
                multipliers, closed = self.equations.augmented(found)
                if closed:
                    return found
                state = self.equations.evaluate(found.u, found.at, like=found, multipliers=multipliers)
        except SingularError:
            return Outcome.SINGULAR
        return Outcome.PENETRATION

    def _converged(self, state: State) -> State | Outcome:
        tolerance = self.options.tolerance
        if not self.equations.smooth:
            self.kept = None
        for _ in range(ITERATIONS):
            if state.inverted:
                return Outcome.INVERTED
            if self.equations.converged(state, tolerance):
                return state
            if self.kept is None:
                self.factorised(state)
            assert self.kept is not None
            self.iterations += 1
            direction = self.kept.direction(state.residual)
            if np.linalg.norm(direction) <= ROUNDING * np.linalg.norm(state.u):
                return state  # the remaining residual is round-off
            following, length = self._line_search(state, direction)
            before, after = float(np.linalg.norm(state.residual)), float(np.linalg.norm(following.residual))
            if self.kept.uses > 0 and not after < before:
                self.kept = None  # an old tangent fails: repeat from here with a new one
                continue
            self.kept.learn(length * direction, following.residual - state.residual)
            tolerance = self.options.tolerance * (1.0 if self.kept.uses == 1 else BEYOND)
            self._judge(following, after / before)
            state = following
        return Outcome.NOT_CONVERGED

    def _judge(self, state: State, ratio: float) -> None:
        """Remove the tangent if a new one would be faster at this ratio of successive residuals."""
        assert self.kept is not None
        if self.kept.uses == 1:
            self._poor = 0 if ratio <= SERVED else self._poor + 1
            self.single = self.single and self._poor < 2
        if not self.equations.smooth:
            serves = ratio <= SERVED
        elif self.kept.uses == 1 and self.equations.worth > 1:
            serves = ratio < 1.0  # the second iteration has the update of the first
        else:
            excess = self.equations.excess(state, BEYOND * self.options.tolerance)
            serves = excess * ratio**self.equations.worth <= 1.0
        if not serves:
            self.kept = None

    def _line_search(self, state: State, direction: FloatArray) -> tuple[State, float]:
        """State and step length at which the residual's work along the direction is small enough."""
        equations = self.equations
        step = equations.expanded(direction)
        initial = float(state.residual @ direction)
        length, best = 1.0, None
        for _ in range(LENGTHS):
            tried = equations.evaluate(state.u + length * step, state.at, like=state)
            if not tried.inverted:
                work = float(tried.residual @ direction)
                if best is None or abs(work) < best[0]:
                    best = abs(work), tried, length
                if abs(work) <= 0.9 * abs(initial):
                    return tried, length
                if work * initial < 0.0:  # passed: the secant
                    length *= float(np.clip(initial / (initial - work), 0.1, 0.7))
                    continue
            length *= 0.5
        return (tried, length) if best is None else best[1:]


DEGREE = 5
"""Highest degree of the polynomial that extrapolates the last states."""


def solve(
    model: Model,
    steps: Mapping[str, ArrayLike] | None = None,
    parameters: ArrayLike | None = None,
    *,
    newton: Newton | None = None,
    guess: FloatArray | None = None,
    like: Solution | None = None,
) -> Solution:
    """Find the equilibrium at each step.

    ``model``: the body with its supports and loads. ``steps``: value of each of the model's histories at each
    step, shape [n_steps]. Before the first step all are 0. None for a model without histories: one step.
    ``parameters``: constants of each region, shape [n_regions, n_parameters] or, for one region,
    [n_parameters]. None: those of the material. ``newton``: options. ``guess``: initial displacements for the
    iteration of each step [m], such as those at other constants. If the iteration fails, the step is computed
    from the previous one. ``like``: A solution of the same model at other constants. Its geometry and fronts
    are reused. Raises ValueError if a history is missing, unknown, of different length or not finite, or if
    `like` has another model.
    """
    if like is not None and like.model is not model:
        raise ValueError("like must be a solution of the same model")
    options = Newton() if newton is None else newton
    table = model.parameters(parameters)
    histories = checked_steps(model, steps)
    n_steps = len(next(iter(histories.values()))) if histories else 1
    shape = (n_steps, *model.mesh.points.shape)
    if guess is not None and guess.shape != shape:
        raise ValueError(f"guess must have shape {shape}, got {guess.shape}")
    displacements, forces = np.full(shape, np.nan), np.full(shape, np.nan)
    energy = np.full(n_steps, np.nan)
    if like is None:
        equations = Equations(model, table, linear=options.linear)
    else:
        equations = like.equations.with_parameters(table)
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
        model, table, histories, displacements, forces, energy, outcome, reached, path.iteration.iterations,
        path.iteration.factorisations, tuple(multipliers), equations,
    )  # fmt: skip


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
    """The states that were reached, and the steps to the next one."""

    def __init__(self, equations: Equations, options: Newton) -> None:
        self.equations, self.options = equations, options
        self.iteration = Iteration(equations, options)
        self.state: State = equations.rest()
        self.before: list[State] = []

    def to(self, target: dict[str, float], guess: FloatArray | None) -> Outcome:
        """Go to the target. The step is halved if an iteration fails."""
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
        """The next equilibrium, from extrapolated states or from the tangent's prediction."""
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
        """The path extrapolated by a polynomial; None unless the histories continue straight."""
        states = [*self.before, self.state]
        if len(states) < 2:
            return None
        names = list(at)
        here = np.array([self.state.at[n] for n in names])
        way = np.array([at[n] for n in names]) - here
        size = float(way @ way)
        if size == 0.0:
            return None
        # positions on the path: the next state is at 1, this one at 0
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
    """The polynomial through the last states, the latest first, at position 1. Its degree is the one that
    would have predicted the latest state best from earlier states. If this is the highest possible degree,
    the next higher one is used. A history with kinks is thus extrapolated from few states."""
    latest, errors = states[0], [np.linalg.norm(states[1] - states[0])]
    for degree in range(1, len(states) - 1):
        met = _extrapolated(places[1 : degree + 2], states[1 : degree + 2], places[0])
        errors.append(np.linalg.norm(met - latest))
    best = int(np.argmin(errors))
    degree = best + 1 if best == len(errors) - 1 else max(best, 1)
    return _extrapolated(places[: degree + 1], states[: degree + 1], 1.0)


def _extrapolated(places: list[float], states: list[FloatArray], to: float) -> FloatArray:
    """Lagrange's polynomial through the states, at a position."""
    found = np.zeros_like(states[0])
    for i, u in enumerate(states):
        others = [x for j, x in enumerate(places) if j != i]
        found += u * float(np.prod([(to - x) / (places[i] - x) for x in others]))
    return found
