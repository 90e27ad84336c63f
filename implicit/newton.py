"""Newton's iteration for one equilibrium, with line search, and factors that are kept while they serve."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.equations import Equations, State
from implicit.linear.base import Factors, SingularError
from implicit.outcome import Outcome

KEPT = 0.2
"""Largest ratio of successive residuals with which factors are kept for the next iteration [-]."""
ROUNDING = 1e-14
"""Change of the displacements, as a share of them, that is rounding [-]."""
AUGMENTATIONS = 40
"""Most augmentations of contact multipliers in a step."""


@dataclass(frozen=True)
class Newton:
    """Options of the iteration."""

    tolerance: float = 1e-8
    """Largest residual as a share of the internal forces (2-norms) [-]."""
    iterations: int = 40
    """Most iterations of a step before it is halved."""
    halvings: int = 8
    """How often a step may be halved."""
    line_search: int = 8
    """Most lengths tried along a direction."""
    linear: str = "auto"
    """The linear solver, see `implicit.linear.solvers`."""
    single: bool = True
    """Whether tangents may be factorised in single precision: they only guide the iteration, whose residual
    is in double precision. Where that leads nowhere, and in mixed models, double precision is taken."""

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1e-2:
            raise ValueError(f"tolerance must be in (0, 0.01), got {self.tolerance}")
        if min(self.iterations, self.line_search) < 1 or self.halvings < 0:
            raise ValueError("iterations and line_search must be >= 1, halvings >= 0")


class Iteration:
    """Finds equilibria; counts what it needed."""

    def __init__(self, equations: Equations, options: Newton) -> None:
        self.equations, self.options = equations, options
        self.iterations = self.factorisations = 0
        self.single = options.single and equations.model.volumetric == "displacement"
        """Whether factors are in single precision, until they fail to guide the iteration."""
        self.last_factors: Factors | None = None
        """Factors of the last equilibrium's iteration, near its tangent."""

    def factorised(self, state: State) -> Factors:
        """Factors of the tangent of a state."""
        self.factorisations += 1
        if self.single:
            try:
                return self.equations.factors(self.equations.stiffness(state, single=True), state)
            except SingularError:
                self.single = False
        return self.equations.factors(self.equations.stiffness(state), state)

    def equilibrium(self, state: State) -> State | Outcome:
        """The equilibrium near a state, contacts closed; or why there is none."""
        try:
            for _ in range(AUGMENTATIONS):
                found = self._converged(state)
                if isinstance(found, Outcome):
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
        factors: Factors | None = None
        for _ in range(self.options.iterations):
            if state.inverted:
                return Outcome.INVERTED
            if self.equations.converged(state, self.options.tolerance):
                if factors is not None:
                    self.last_factors = factors
                return state
            fresh = factors is None
            if factors is None:
                factors = self.factorised(state)
            self.iterations += 1
            direction = factors.solve(-state.residual)
            if np.linalg.norm(direction) <= ROUNDING * np.linalg.norm(state.u):
                return state  # what is left of the residual is rounding
            following = self._line_search(state, direction)
            before, after = np.linalg.norm(state.residual), np.linalg.norm(following.residual)
            if not (fresh or after < before):
                factors = None  # old factors lead nowhere: once more from here with new ones
                continue
            if not after <= KEPT * before:
                factors = None
                self.single = self.single and not fresh
            state = following
        return Outcome.NOT_CONVERGED

    def _line_search(self, state: State, direction: FloatArray) -> State:
        """A state along the direction where the work of the residual on it has fallen enough."""
        equations = self.equations
        step = equations.expanded(direction)
        initial = float(state.residual @ direction)
        length, best = 1.0, None
        for _ in range(self.options.line_search):
            tried = equations.evaluate(state.u + length * step, state.at, like=state)
            if not tried.inverted:
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
