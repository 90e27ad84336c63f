"""A linear solver of element matrices and of blocks between points of different elements (contact)."""

import numpy as np

from explicit.arrays import FloatArray, IntArray
from implicit.integration.pattern import Pattern
from implicit.linear.base import Factors, LinearSolver
from implicit.linear.solvers import linear_solver


class BridgedSolver:
    """The solver of a pattern whose elements are joined by blocks; blocks met once keep their place."""

    def __init__(self, name: str, pattern: Pattern, points: FloatArray, cells: IntArray) -> None:
        self.name, self.pattern, self.points, self.cells = name, pattern, points, cells
        self._known: IntArray | None = None
        self._solver: LinearSolver | None = None

    def factors(
        self, elements: FloatArray, nodes: IntArray, blocks: FloatArray, *, symmetric: bool
    ) -> Factors:
        """Factors of the sum of element matrices [m, k d, k d] and blocks [b, j d, j d] of the points
        [b, j]."""
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
        """The solver of the cells and of the blocks as if they were cells; what is missing is held."""
        d, held = self.points.shape[1], len(self.pattern.index)
        own = self.pattern.dofs
        further = (known[..., None] * d + np.arange(d)).reshape(len(known), -1)
        width = max(own.shape[1], further.shape[1])
        dofs = np.full((len(own) + len(further), width), held)
        dofs[: len(own), : own.shape[1]] = own
        dofs[len(own) :, : further.shape[1]] = further
        # cells of one width; a point named more than once moves only the centre by which they are sorted
        count = max(self.cells.shape[1], known.shape[1])
        cells = np.concatenate([np.resize(row, count)[None] for row in (*self.cells, *known)])
        pattern = Pattern(dofs, np.append(self.pattern.index, -1), self.pattern.count)
        return linear_solver(self.name, pattern, self.points, cells)
