"""Linear solvers by name.

"multifrontal" (`implicit.linear.multifrontal`) eliminates element matrices in dense fronts and is the usual
choice; "superlu" is SciPy's; "pardiso" is Intel's, for who has installed the extra `pardiso`; "amg" is the
method of conjugate gradients with smoothed aggregation (PyAMG, the extra `amg`), for more unknowns than a
factorisation has memory for.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from explicit.arrays import FloatArray, IntArray
from implicit.integration.pattern import Pattern
from implicit.linear.amg import amg_factors
from implicit.linear.assembly import Assembly
from implicit.linear.base import Factors, LinearSolver, SingularError
from implicit.linear.dissection import dissect
from implicit.linear.multifrontal import Multifrontal

MANY = 300_000
"""Unknowns up to which "auto" takes "multifrontal" whatever the mesh is."""
LARGEST = 8e9
"""Largest factors that "auto" keeps beyond them [bytes in double precision]; larger ones: "amg"."""

DIRECT = 8
"""Iterations with a kept tangent that take about the time of a factorisation; a multigrid's hierarchy takes
less than a solution with it."""


class MultifrontalSolver:
    """Fronts found once, factorised often."""

    def __init__(self, pattern: Pattern, centres: FloatArray) -> None:
        self.fronts = dissect(centres, pattern.index[pattern.dofs], pattern.count)
        self.assembly = Assembly(self.fronts)
        self.count, self.worth = pattern.count, DIRECT

    @property
    def bytes(self) -> float:
        """Of the factors of a symmetric matrix in double precision."""
        return 8.0 * sum(front.eliminated * len(front.unknowns) for front in self.fronts)

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """See `implicit.linear.base.LinearSolver`."""
        values = _finite(elements)
        return Multifrontal(self.fronts, self.assembly, values, self.count, symmetric=symmetric)


class SparseSolver:
    """A solver of matrices in CSR."""

    def __init__(
        self,
        pattern: Pattern,
        factorise: Callable[[csr_array, bool, bool], Factors],
        *,
        worth: int,
    ) -> None:
        self.pattern, self._factorise, self.worth = pattern, factorise, worth

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """See `implicit.linear.base.LinearSolver`."""
        guiding = elements.dtype == np.float32
        return self._factorise(self.pattern.matrix(_finite(elements)), symmetric, guiding)


class _SuperLU:
    def __init__(self, matrix: csr_array, symmetric: bool, guiding: bool) -> None:
        options = {"SymmetricMode": True} if symmetric else {}
        try:
            self._factors = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A" if symmetric else "COLAMD",
                diag_pivot_thresh=0.0 if symmetric else 1.0,
                options=options,
            )
        except RuntimeError as problem:
            raise SingularError(str(problem)) from problem

    def solve(self, right: FloatArray) -> FloatArray:
        return np.asarray(self._factors.solve(right))

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        return np.asarray(self._factors.solve(right, trans="T"))


class _Pardiso:
    def __init__(self, matrix: csr_array, symmetric: bool, guiding: bool) -> None:
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as missing:
            raise ValueError('linear = "pardiso" needs the extra: pip install "kolsky[pardiso]"') from missing
        self._matrix, self._symmetric = matrix, symmetric
        self._solver, self._transposed = PyPardisoSolver(), None
        self._solver.factorize(matrix)
        self._make = PyPardisoSolver

    def solve(self, right: FloatArray) -> FloatArray:
        return np.asarray(self._solver.solve(self._matrix, np.asfortranarray(right)))

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        if self._symmetric:
            return self.solve(right)
        transposed = self._matrix.T.tocsr()
        return np.asarray(self._make().solve(transposed, np.asfortranarray(right)))


def linear_solver(name: str, pattern: Pattern, points: FloatArray, cells: IntArray) -> LinearSolver:
    """Look a solver up by name, "auto" for the usual choice.

    Raises
    ------
    ValueError
        If there is no such solver.
    """
    if name in ("auto", "multifrontal"):
        direct = MultifrontalSolver(pattern, points[cells].mean(axis=1))
        if name == "multifrontal" or pattern.count <= MANY or direct.bytes <= LARGEST:
            return direct
        name = "amg"
    if name == "superlu":
        return SparseSolver(pattern, _SuperLU, worth=DIRECT)
    if name == "pardiso":
        return SparseSolver(pattern, _Pardiso, worth=DIRECT)
    if name == "amg":
        return SparseSolver(pattern, amg_factors(pattern, points), worth=1)
    raise ValueError(f"linear must be one of auto, multifrontal, superlu, pardiso, amg, got {name!r}")


def _finite(elements: FloatArray) -> FloatArray:
    if not np.isfinite(elements).all():
        raise SingularError("the stiffness has entries that are not finite")
    return elements
