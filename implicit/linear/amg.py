"""Conjugate gradients with an algebraic multigrid of smoothed aggregation (Vanek, Mandel and Brezina 1996).

The near-null space is that of elasticity, the rigid motions of the points. PyAMG makes the hierarchy.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, cg, gmres

from explicit.arrays import FloatArray
from implicit.integration.pattern import Pattern
from implicit.linear.base import Factors, SingularError

TOLERANCE = 1e-10
"""Residual of a solution as a share of the right-hand side [-]."""
GUIDE = 1e-4
"""That of a solution with element matrices in single precision, which only guides an iteration."""
ITERATIONS = 500
"""Most iterations of a solution."""


class AmgFactors:
    """A hierarchy in place of factors."""

    def __init__(
        self, matrix: csr_array, rigid: FloatArray, *, symmetric: bool, tolerance: float = TOLERANCE
    ) -> None:
        try:
            from pyamg import smoothed_aggregation_solver
        except ImportError as missing:
            raise ValueError('linear = "amg" needs the extra: pip install "kolsky[amg]"') from missing
        self.matrix, self.symmetric, self.tolerance = matrix, symmetric, tolerance
        self._levels = smoothed_aggregation_solver(csr_array(matrix), B=rigid)

    def solve(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(self.matrix, right)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(self.matrix if self.symmetric else self.matrix.T, right)

    def _solve(self, matrix: csr_array, right: FloatArray) -> FloatArray:
        precondition: LinearOperator = self._levels.aspreconditioner()
        columns = np.asarray(right, dtype=float).reshape(len(right), -1)
        found = np.empty_like(columns)
        method = cg if self.symmetric else gmres
        for j, column in enumerate(columns.T):
            found[:, j], info = method(
                matrix, column, rtol=self.tolerance, maxiter=ITERATIONS, M=precondition
            )
            if info != 0:
                raise SingularError(
                    f"{ITERATIONS} iterations with multigrid did not reach {self.tolerance:g}"
                )
        return found.reshape(np.shape(right))


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

    def make(matrix: csr_array, symmetric: bool, guiding: bool) -> Factors:
        tolerance = GUIDE if guiding else TOLERANCE
        return AmgFactors(matrix, rigid, symmetric=symmetric, tolerance=tolerance)

    return make
