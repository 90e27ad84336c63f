"""Points of face and side that can touch a platen, each carried by the three nodes of its boundary element.

The side touches at Gauss points, so that it rolls onto the platen by small shares of an element and not node
by node; the face, which lies on the platen from the beginning, at its nodes: as many as there are radial
displacements, since more points than that stick and slip in turn without end.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from kolsky.base.arrays import FloatArray
from kolsky.material.compression.mesh import HalfCylinder

GAUSS = 5
"""Gauss points of the side in each boundary element."""


@dataclass(frozen=True)
class ContactPoints:
    """Places on the body's boundary and their share of its undeformed area."""

    nodes: NDArray[np.int64]
    """Nodes that carry each point, shape [n, 3]."""
    shape: FloatArray
    """Their share in it [-], shape [n, 3]."""
    areas: FloatArray
    """Undeformed area of each point [m^2], shape [n]."""
    n_nodes: int
    """Nodes of the mesh."""

    @classmethod
    def of(cls, mesh: HalfCylinder, *, face: bool) -> "ContactPoints":
        """Points of the side, and those of the face if it can move."""
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        N = np.column_stack([0.5 * points * (points - 1.0), 1.0 - points**2, 0.5 * points * (points + 1.0)])
        line = mesh.side
        three = np.stack([line[:-2:2], line[1:-1:2], line[2::2]], axis=1)
        length = mesh.nodes[three[:, 2], 1] - mesh.nodes[three[:, 0], 1]
        nodes = np.repeat(three, GAUSS, axis=0)
        shape = np.tile(N, (len(three), 1))
        areas = (np.pi * mesh.radius * length[:, None] * weights).ravel()
        if face:
            nodes = np.concatenate([nodes, np.repeat(mesh.face[:, None], 3, axis=1)])
            shape = np.concatenate([shape, np.tile([1.0, 0.0, 0.0], (mesh.face.size, 1))])
            areas = np.concatenate([areas, mesh.areas[mesh.face]])
        return cls(nodes, shape, areas, len(mesh.nodes))

    @cached_property
    def matrix(self) -> csr_array:
        """Values at the points from values at the nodes, shape [n, n_nodes]."""
        n = len(self.nodes)
        rows = np.repeat(np.arange(n), 3)
        return csr_array((self.shape.ravel(), (rows, self.nodes.ravel())), shape=(n, self.n_nodes))

    def at(self, values: FloatArray) -> FloatArray:
        """Values at the points of nodal ones, shape [n_nodes, ...]."""
        return np.asarray(self.matrix @ values)

    def shared(self, forces: FloatArray) -> FloatArray:
        """Forces on the points as forces on the nodes, shape [n_nodes, ...]."""
        return np.asarray(self.matrix.T @ forces)

    @cached_property
    def pairs(self) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
        """Pairs of nodes of each point, and the product of their shares, shape [n, 9] each."""
        first, second = np.divmod(np.arange(9), 3)
        return (
            self.nodes[:, first],
            self.nodes[:, second],
            self.shape[:, first] * self.shape[:, second],
        )
