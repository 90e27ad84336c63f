"""The linear equations of a Newton step: their fixed pattern, their values, their factors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from kolsky.base.arrays import FloatArray
from kolsky.material.compression.mesh import HalfCylinder
from kolsky.material.compression.platen import ContactForces, Platen


class Equations:
    """Stiffness of body, contact and drag on the free displacements.

    Parameters
    ----------
    mesh
        The body.
    platen
        What it touches.
    free
        Free displacements, shape [n].
    """

    def __init__(self, mesh: HalfCylinder, platen: Platen, free: NDArray[np.int64]) -> None:
        size = 2 * len(mesh.nodes)
        rows = np.repeat(mesh.dofs, 18, axis=1).ravel()
        columns = np.tile(mesh.dofs, (1, 18)).ravel()
        first, second, self.paired = platen.points.pairs
        first, second = 2 * first.ravel(), 2 * second.ravel()
        every = np.arange(size)
        rows = np.concatenate([rows, first, first, first + 1, every])
        columns = np.concatenate([columns, second, second + 1, second + 1, every])
        place = np.full(size, -1)
        place[free] = np.arange(free.size)
        self.kept = (place[rows] >= 0) & (place[columns] >= 0)
        key = place[columns[self.kept]] * free.size + place[rows[self.kept]]
        unique, self.slot = np.unique(key, return_inverse=True)
        self.row = unique % free.size
        self.start = np.searchsorted(unique // free.size, np.arange(free.size + 1))
        weight = np.zeros(len(mesh.nodes))
        np.add.at(weight, mesh.elements, mesh.gauss[1].sum(axis=1)[:, None] / 9.0)
        # Drag that equals the stiffness of the whole body per displacement, shared out by volume.
        stiffness = 3.0 * platen.modulus * np.pi * mesh.radius**2 / mesh.height
        self.drag_unit: FloatArray = np.repeat(weight / weight.sum(), 2) * stiffness

    def factor(self, stiffness: FloatArray, contact: ContactForces, drag: float) -> Any:
        """Factors of the matrix, which `solve` right-hand sides.

        Parameters
        ----------
        stiffness
            Of the elements [N/m], shape [n_elements, 18, 18].
        contact
            Contact forces with their derivatives.
        drag
            Viscous drag in units of `drag_unit` [-].
        """
        c = -contact.stiffness[:, :, :, None] * self.paired[:, None, None, :]
        touch = (c[:, i, j].ravel() for i, j in ((0, 0), (0, 1), (1, 1)))
        data = np.concatenate([stiffness.ravel(), *touch, drag * self.drag_unit])[self.kept]
        n = self.start.size - 1
        values = np.bincount(self.slot, weights=data, minlength=self.row.size)
        matrix = csc_array((values, self.row, self.start), shape=(n, n))
        # The pattern is symmetric, and so is most of the matrix: orderings of A + A^T fill in least.
        return splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True}
        )
