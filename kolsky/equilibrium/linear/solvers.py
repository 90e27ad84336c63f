"""Linear solvers by name.

"multifrontal" (`kolsky.equilibrium.linear.multifrontal`) eliminates element matrices in dense fronts and is
the usual choice. "amg" is the conjugate gradient method with an algebraic multigrid of smoothed aggregation
(Vanek, Mandel and Brezina 1996; PyAMG, the extra `amg`). It is for problems too large for a factorisation in
memory. Its near-null space is the rigid motions. `BridgedSolver` adds blocks between points of different
elements (contact).
"""

from itertools import combinations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import cg, gmres

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.linear.base import Factors, Pattern, SingularError
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


class _Multigrid:
    """A matrix and its multigrid hierarchy in place of factors."""

    def __init__(self, matrix: csr_array, rigid: FloatArray, *, symmetric: bool, tolerance: float) -> None:
        try:
            from pyamg import smoothed_aggregation_solver
        except ImportError as missing:
            raise ValueError('linear = "amg" needs the extra: pip install "kolsky[amg]"') from missing
        levels = smoothed_aggregation_solver(matrix, B=rigid, strength=("symmetric", {"theta": STRONG}))
        self.matrix, self.symmetric = matrix, symmetric
        self._options = {"rtol": tolerance, "maxiter": ITERATIONS, "M": levels.aspreconditioner()}

    def solve(self, right: FloatArray) -> FloatArray:
        found = []
        for column in np.asarray(right, dtype=float).reshape(len(right), -1).T:
            x, info = (cg if self.symmetric else gmres)(self.matrix, column, **self._options)
            if info != 0:
                raise SingularError(
                    f"{ITERATIONS} iterations with multigrid did not reach {self._options['rtol']:g}"
                )
            found.append(x)
        return np.stack(found, axis=1).reshape(np.shape(right))


def _rigid_motions(pattern: Pattern, points: FloatArray) -> FloatArray:
    """Translations and rotations of the unknowns, shape [count, 3 or 6]."""
    n, d = points.shape
    centred = points - points.mean(axis=0)
    motions = [np.tile(row, (n, 1)) for row in np.eye(d)]
    for i, j in combinations(range(d), 2):
        motions.append(np.zeros((n, d)))
        motions[-1][:, i], motions[-1][:, j] = centred[:, j], -centred[:, i]
    free = pattern.index >= 0
    rigid = np.zeros((pattern.count, len(motions)))
    rigid[pattern.index[free]] = np.stack([motion.ravel()[free] for motion in motions], axis=1)
    return rigid


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
        """Factorise the sum of element matrices [N/m] of shape [m, k d, k d].

        Raises SingularError if it is singular.
        """
        values = _finite(elements)
        return Multifrontal(self.fronts, self.assembly, values, self.count, symmetric=symmetric)


class MultigridSolver:
    """Solver that creates a hierarchy of grids for every matrix."""

    def __init__(self, pattern: Pattern, points: FloatArray) -> None:
        self.pattern, self.worth = pattern, 1
        self._rigid = _rigid_motions(pattern, points)

    def factors(self, elements: FloatArray, *, symmetric: bool) -> Factors:
        """See `MultifrontalSolver.factors`."""
        tolerance = GUIDE if elements.dtype == np.float32 else TOLERANCE
        matrix = self.pattern.matrix(_finite(elements))
        return _Multigrid(matrix, self._rigid, symmetric=symmetric, tolerance=tolerance)


LinearSolver = MultifrontalSolver | MultigridSolver
"""Factorises sums of element matrices of one mesh. `worth` solutions take about the time of one."""


def linear_solver(name: str, pattern: Pattern, points: FloatArray, cells: IntArray) -> LinearSolver:
    """Return a solver by name. "auto" selects one. Raises ValueError if there is no such solver."""
    if name in ("auto", "multifrontal"):
        direct = MultifrontalSolver(pattern, points[cells].mean(axis=1))
        if name == "multifrontal" or pattern.count <= MANY or direct.bytes <= LARGEST:
            return direct
        name = "amg"
    if name == "amg":
        return MultigridSolver(pattern, points)
    raise ValueError(f"linear must be one of auto, multifrontal, amg, got {name!r}")


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
