"""Conjugate gradients with an algebraic multigrid of smoothed aggregation (Vanek, Mandel and Brezina 1996).

The near-null space is that of elasticity, the rigid motions of the points. PyAMG makes the hierarchy.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, cg, gmres

from explicit.arrays import FloatArray
from implicit.integration.pattern import Pattern
from implicit.linear.base import Factors, SingularError

TOLERANCE = 1e-10
"""Residual of a solution as a share of the right-hand side [-]."""
GUIDE = 1e-3
"""That of a solution with element matrices in single precision, which only guides an iteration."""
ITERATIONS = 500
"""Most iterations of a solution."""
STRONG = 0.03
"""Couplings |k_ij| below this share of sqrt(k_ii k_jj) join no points in an aggregate [-]."""
AGED = 3.0
"""A hierarchy serves until a solution takes so many times the iterations of its first [-]."""


class Hierarchy:
    """A multigrid that outlives the matrix that it was made of."""

    def __init__(self, rigid: FloatArray) -> None:
        """Take the rigid motions of the unknowns, shape [N, 3 or 6]."""
        self.rigid = rigid
        self._levels: Any = None
        self._first: dict[float, int] = {}

    def preconditioner(self, matrix: csr_array) -> LinearOperator:
        """That of the hierarchy; made of this matrix if there is none."""
        if self._levels is None:
            try:
                from pyamg import smoothed_aggregation_solver
            except ImportError as missing:
                raise ValueError('linear = "amg" needs the extra: pip install "kolsky[amg]"') from missing
            strength = ("symmetric", {"theta": STRONG})
            self._levels = smoothed_aggregation_solver(csr_array(matrix), B=self.rigid, strength=strength)
        return self._levels.aspreconditioner()

    @property
    def made(self) -> bool:
        """Whether there is one."""
        return self._levels is not None

    def served(self, iterations: int, tolerance: float) -> None:
        """Hear of a solution to a tolerance; drop the hierarchy if it has aged."""
        if iterations > AGED * self._first.setdefault(tolerance, iterations):
            self.drop()

    def drop(self) -> None:
        """Let the next matrix make a new one."""
        self._levels, self._first = None, {}


class AmgFactors:
    """A matrix and a hierarchy in place of factors."""

    def __init__(
        self, matrix: csr_array, hierarchy: Hierarchy, *, symmetric: bool, tolerance: float = TOLERANCE
    ) -> None:
        self.matrix, self.symmetric, self.tolerance = matrix, symmetric, tolerance
        self._hierarchy = hierarchy

    def solve(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(self.matrix, right)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(self.matrix if self.symmetric else self.matrix.T, right)

    def _solve(self, matrix: csr_array, right: FloatArray) -> FloatArray:
        columns = np.asarray(right, dtype=float).reshape(len(right), -1)
        found = [self._column(matrix, column) for column in columns.T]
        return np.stack(found, axis=1).reshape(np.shape(right))

    def _column(self, matrix: csr_array, right: FloatArray) -> FloatArray:
        hierarchy, method = self._hierarchy, cg if self.symmetric else gmres
        for old in (hierarchy.made, False):
            if not old:
                hierarchy.drop()
            count = _Count()
            found, info = method(
                matrix,
                right,
                rtol=self.tolerance,
                maxiter=ITERATIONS,
                M=hierarchy.preconditioner(self.matrix),
                callback=count,
                **({} if self.symmetric else {"callback_type": "pr_norm"}),
            )
            if info == 0:
                hierarchy.served(count.calls, self.tolerance)
                return np.asarray(found)
        raise SingularError(f"{ITERATIONS} iterations with multigrid did not reach {self.tolerance:g}")


class _Count:
    """Counts its calls."""

    calls = 0

    def __call__(self, _: object) -> None:
        self.calls += 1


def amg_factors(pattern: Pattern, points: FloatArray) -> Callable[[csr_array, bool, bool], Factors]:
    """A function that makes the hierarchy of a matrix, with the rigid motions of its points."""
    n, d = points.shape
    centred = points - points.mean(axis=0)
    motions = []
    for axis in range(d):
        motion = np.zeros((n, d))
        motion[:, axis] = 1.0
        motions.append(motion)
    for i in range(d):
        for j in range(i):
            motion = np.zeros((n, d))
            motion[:, i], motion[:, j] = centred[:, j], -centred[:, i]
            motions.append(motion)
    rigid = np.zeros((pattern.count, len(motions)))
    free = pattern.index >= 0
    for column, motion in enumerate(motions):
        rigid[pattern.index[free], column] = motion.ravel()[free]

    hierarchy = Hierarchy(rigid)

    def make(matrix: csr_array, symmetric: bool, guiding: bool) -> Factors:
        tolerance = GUIDE if guiding else TOLERANCE
        return AmgFactors(matrix, hierarchy, symmetric=symmetric, tolerance=tolerance)

    return make
