"""Newton's iteration for one equilibrium, with line search, and tangents that are kept while they serve."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.equations import Equations, State
from implicit.linear.base import SingularError
from implicit.outcome import Outcome
from implicit.quasi_newton import KeptTangent

SERVED = 0.2
"""Largest ratio of successive residuals in the first iteration with a tangent in single precision that is
good [-]; two that are not, one after the other, end single precision."""
BEYOND = 0.1
"""Share of the tolerance that iterations with a kept tangent go on to: they converge step by step, where a
new tangent's last iteration ends far below the tolerance [-]."""
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
        self.kept: KeptTangent | None = None
        """The last tangent that was factorised, also near an equilibrium before, while it serves."""
        self._poor = 0

    def factorised(self, state: State) -> FloatArray:
        """Factorise the tangent of a state and keep it; the element matrices that were factorised."""
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
        self.kept = KeptTangent(factors, learns=self.equations.symmetric and self.equations.smooth)

    def equilibrium(self, state: State) -> State | Outcome:
        """The equilibrium near a state, contacts closed; or why there is none."""
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
        for _ in range(self.options.iterations):
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
                return state  # what is left of the residual is rounding
            following, length = self._line_search(state, direction)
            before, after = float(np.linalg.norm(state.residual)), float(np.linalg.norm(following.residual))
            if self.kept.uses > 0 and not after < before:
                self.kept = None  # an old tangent leads nowhere: once more from here with a new one
                continue
            self.kept.learn(length * direction, following.residual - state.residual)
            tolerance = self.options.tolerance * (1.0 if self.kept.uses == 1 else BEYOND)
            self._judge(following, after / before)
            state = following
        return Outcome.NOT_CONVERGED

    def _judge(self, state: State, ratio: float) -> None:
        """Drop a tangent with which residuals that fall on by this ratio take longer than with a new one."""
        assert self.kept is not None
        if self.kept.uses == 1:
            self._poor = 0 if ratio <= SERVED else self._poor + 1
            self.single = self.single and self._poor < 2
        if not self.equations.smooth:
            serves = ratio <= SERVED
        elif self.kept.uses == 1 and self.equations.worth > 1:
            serves = ratio < 1.0  # the second iteration knows of the first
        else:
            excess = self.equations.excess(state, BEYOND * self.options.tolerance)
            serves = excess * ratio**self.equations.worth <= 1.0
        if not serves:
            self.kept = None

    def _line_search(self, state: State, direction: FloatArray) -> tuple[State, float]:
        """State and length along the direction where the work of the residual on it has fallen enough."""
        equations = self.equations
        step = equations.expanded(direction)
        initial = float(state.residual @ direction)
        length, best = 1.0, None
        for _ in range(self.options.line_search):
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
