"""What a linear solver offers."""

from typing import Protocol

from explicit.arrays import FloatArray


class SingularError(ValueError):
    """The matrix is singular, or an iteration did not converge."""


class Factors(Protocol):
    """A factorised matrix."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Solutions of K x = b for columns b, shape [n] or [n, n_right]."""
        ...

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """Solutions of K^T x = b."""
        ...


class LinearSolver(Protocol):
    """Factorises sums of element matrices of one mesh."""

    worth: int
    """Solutions that take about the time of a factorisation."""

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """Factorise the sum of element matrices [N/m] of shape [m, k d, k d].

        Raises
        ------
        SingularError
            If it is singular.
        """
        ...
