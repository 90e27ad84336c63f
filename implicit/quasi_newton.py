"""A tangent that was factorised before, brought up to date by the changes of residuals seen since.

Matthies and Strang (1979), The solution of nonlinear finite element equations: the inverse of the old tangent
starts the two recursions of the BFGS formula, so that an iteration costs one solution and no factorisation.
"""

from explicit.arrays import FloatArray
from implicit.linear.base import Factors

PAIRS = 16
"""Most changes that are remembered."""


class KeptTangent:
    """An approximate inverse of the tangent."""

    def __init__(self, factors: Factors, *, learns: bool) -> None:
        """Take the factors; only symmetric tangents of smooth problems learn, others stay as they are."""
        self.factors, self.learns = factors, learns
        self.uses = 0
        """Iterations made with it."""
        self._pairs: list[tuple[FloatArray, FloatArray, float]] = []

    def direction(self, residual: FloatArray) -> FloatArray:
        """What the approximate inverse answers to a residual [N], with the sign of an iteration [m]."""
        left, shares = residual.copy(), []
        for step, change, work in reversed(self._pairs):
            shares.append(float(step @ left) / work)
            left -= shares[-1] * change
        found = self.factors.solve(left)
        for (step, change, work), share in zip(self._pairs, reversed(shares), strict=True):
            found += (share - float(change @ found) / work) * step
        return -found

    def learn(self, step: FloatArray, change: FloatArray) -> None:
        """Remember that the residual changed by `change` [N] along `step` [m].

        A pair along which the stiffness is not positive would spoil the formula and is not remembered.
        """
        self.uses += 1
        work = float(step @ change)
        if self.learns and work > 0.0:
            self._pairs = [*self._pairs[1 - PAIRS :], (step, change, work)]
