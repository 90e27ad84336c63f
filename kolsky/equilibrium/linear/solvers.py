"""Linear solvers by name.

"multifrontal" (`kolsky.equilibrium.linear.multifrontal`) eliminates element matrices in dense fronts and is
the usual choice. "superlu" is SciPy's. "amg" is the conjugate gradient method with an algebraic multigrid of
smoothed aggregation (Vanek, Mandel and Brezina 1996; PyAMG, the extra `amg`). It is for problems too large
for a factorisation in memory. Its near-null space is the rigid motions. `BridgedSolver` adds blocks between
points of different elements (contact).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, cg, gmres, splu

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.linear.base import Factors, LinearSolver, Pattern, SingularError
from kolsky.equilibrium.linear.multifrontal import Assembly, Multifrontal, dissect
from kolsky.equilibrium.meshes import components

TOLERANCE = 1e-10
"""Residual of a solution as a share of the right-hand side [-]."""
GUIDE = 1e-3
"""Residual of a solution with element matrices in single precision [-]. Such a solution only guides an
iteration."""
ITERATIONS = 500
"""Maximum number of iterations of a solution."""
STRONG = 0.03
"""Couplings |k_ij| below this share of sqrt(k_ii k_jj) do not join points in an aggregate [-]."""
AGED = 3.0
"""A hierarchy is reused until a solution needs this many times the iterations of its first solution [-]."""


class Hierarchy:
    """A multigrid hierarchy that is reused for later matrices."""

    def __init__(self, rigid: FloatArray) -> None:
        """Store the rigid motions of the unknowns, shape [N, 3 or 6]."""
        self.rigid = rigid
        self._levels: Any = None
        self._first: dict[float, int] = {}

    def preconditioner(self, matrix: csr_array) -> LinearOperator:
        """The preconditioner of the hierarchy. If there is no hierarchy, it is made from this matrix."""
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
        """True if a hierarchy exists."""
        return self._levels is not None

    def served(self, iterations: int, tolerance: float) -> None:
        """Record the iterations of a solution to a tolerance. If they are too many, the hierarchy is
        removed."""
        if iterations > AGED * self._first.setdefault(tolerance, iterations):
            self.drop()

    def drop(self) -> None:
        """Remove the hierarchy; the next matrix makes a new one."""
        self._levels, self._first = None, {}


class _AmgFactors:
    """A matrix and a hierarchy that replace factors."""

    def __init__(
        self, matrix: csr_array, hierarchy: Hierarchy, *, symmetric: bool, tolerance: float = TOLERANCE
    ) -> None:
        self.matrix, self.symmetric, self.tolerance = matrix, symmetric, tolerance
        self._hierarchy = hierarchy

    def solve(self, right: FloatArray) -> FloatArray:
        """See `kolsky.equilibrium.linear.base.Factors`."""
        return self._solve(self.matrix, right)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `kolsky.equilibrium.linear.base.Factors`."""
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
            calls: list[object] = []
            found, info = method(
                matrix, right, rtol=self.tolerance, maxiter=ITERATIONS,
                M=hierarchy.preconditioner(self.matrix), callback=calls.append,
                **({} if self.symmetric else {"callback_type": "pr_norm"}),
            )  # fmt: skip
            if info == 0:
                hierarchy.served(len(calls), self.tolerance)
                return np.asarray(found)
        raise SingularError(f"{ITERATIONS} iterations with multigrid did not reach {self.tolerance:g}")


def _amg_factors(pattern: Pattern, points: FloatArray) -> Callable[[csr_array, bool, bool], Factors]:
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
        return _AmgFactors(matrix, hierarchy, symmetric=symmetric, tolerance=tolerance)

    return make


MANY = 300_000
"""Up to this number of unknowns "auto" selects "multifrontal" for any mesh."""
LARGEST = 8e9
"""For more unknowns, largest factors of "multifrontal" [bytes in double precision]. Above this size, "amg" is
used."""

DIRECT = 8
"""Number of iterations with a reused tangent that take about the time of one factorisation. Creating a
multigrid hierarchy takes less time than a solution with it."""


class MultifrontalSolver:
    """Solver with fronts that are computed once and used for many factorisations."""

    def __init__(self, pattern: Pattern, centres: FloatArray) -> None:
        self.fronts = dissect(centres, pattern.index[pattern.dofs], pattern.count)
        self.assembly = Assembly(self.fronts)
        self.count, self.worth = pattern.count, DIRECT

    @property
    def bytes(self) -> float:
        """Size of the factors of a symmetric matrix in double precision [bytes]."""
        return 8.0 * sum(front.eliminated * len(front.unknowns) for front in self.fronts)

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """See `kolsky.equilibrium.linear.base.LinearSolver`."""
        values = _finite(elements)
        return Multifrontal(self.fronts, self.assembly, values, self.count, symmetric=symmetric)


class SparseSolver:
    """A solver of matrices in CSR."""

    def __init__(
        self, pattern: Pattern, factorise: Callable[[csr_array, bool, bool], Factors], *, worth: int
    ) -> None:
        self.pattern, self._factorise, self.worth = pattern, factorise, worth

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """See `kolsky.equilibrium.linear.base.LinearSolver`."""
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


def linear_solver(name: str, pattern: Pattern, points: FloatArray, cells: IntArray) -> LinearSolver:
    """Return a solver by name. "auto" selects one. Raises ValueError if there is no such solver."""
    if name in ("auto", "multifrontal"):
        direct = MultifrontalSolver(pattern, points[cells].mean(axis=1))
        if name == "multifrontal" or pattern.count <= MANY or direct.bytes <= LARGEST:
            return direct
        name = "amg"
    if name == "superlu":
        return SparseSolver(pattern, _SuperLU, worth=DIRECT)
    if name == "amg":
        return SparseSolver(pattern, _amg_factors(pattern, points), worth=1)
    raise ValueError(f"linear must be one of auto, multifrontal, superlu, amg, got {name!r}")


def _finite(elements: FloatArray) -> FloatArray:
    if not np.isfinite(elements).all():
        raise SingularError("the stiffness has entries that are not finite")
    return elements


class BridgedSolver:
    """The solver of a pattern with elements connected by blocks. Known blocks keep their positions."""

    def __init__(self, name: str, pattern: Pattern, points: FloatArray, cells: IntArray) -> None:
        self.name, self.pattern, self.points, self.cells = name, pattern, points, cells
        self._known: IntArray | None = None
        self._solver: LinearSolver | None = None

    def factors(
        self, elements: FloatArray, nodes: IntArray, blocks: FloatArray, *, symmetric: bool
    ) -> Factors:
        """Factors of the sum of element matrices [m, k d, k d] and blocks [b, j d, j d] of the points
        [b, j].
        """
        rows = nodes if self._known is None else np.concatenate([self._known, nodes])
        known, where = np.unique(rows, axis=0, return_inverse=True)
        if self._solver is None or self._known is None or len(known) > len(self._known):
            self._known, self._solver = known, self._joined(known)
        d = self.points.shape[1]
        width = max(elements.shape[1], d * known.shape[1])
        together = np.zeros((len(elements) + len(known), width, width), elements.dtype)
        own = elements.shape[1]
        together[: len(elements), :own, :own] = elements
        further = together[len(elements) :, : blocks.shape[1], : blocks.shape[1]]
        np.add.at(further, where.ravel()[len(rows) - len(nodes) :], blocks.astype(elements.dtype))
        return self._solver.factors(together, symmetric=symmetric)

    def _joined(self, known: IntArray) -> LinearSolver:
        """The solver of the cells, with the blocks as further cells; missing components are fixed."""
        held = len(self.pattern.index)
        own = self.pattern.dofs
        further = components(known, self.points.shape[1])
        width = max(own.shape[1], further.shape[1])
        dofs = np.full((len(own) + len(further), width), held)
        dofs[: len(own), : own.shape[1]] = own
        dofs[len(own) :, : further.shape[1]] = further
        # cells of one width; a repeated point moves only the centre by which they are sorted
        count = max(self.cells.shape[1], known.shape[1])
        cells = np.concatenate([np.resize(row, count)[None] for row in (*self.cells, *known)])
        pattern = Pattern(dofs, np.append(self.pattern.index, -1), self.pattern.count)
        return linear_solver(self.name, pattern, self.points, cells)
