r"""An element in its reference coordinates: nodes, shape functions, faces.

The shape functions are the Lagrange basis of a space of monomials xi^e: with V_am = xi_a^(e_m) at the nodes,
N(xi) = V^-T xi^e. They are 1 at their node and 0 at the others, and they hold all polynomials of the space.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from explicit.arrays import FloatArray, IntArray
from implicit.elements.quadrature import hypercube_rule, simplex_rule

Shape = Literal["hypercube", "simplex"]


@dataclass(frozen=True)
class Face:
    """A face as an affine image of the reference face: xi = origin + tangents @ s.

    The normal that follows from the tangents (their cross product; in two dimensions the tangent turned by
    -90 degrees) points outwards.
    """

    origin: tuple[float, ...]
    """Point s = 0 in the element's coordinates [-], shape [d]."""
    tangents: tuple[tuple[float, ...], ...]
    """One tangent for each coordinate s of the face [-], shape [d - 1, d]."""


@dataclass(frozen=True, eq=False)
class Element:
    """A Lagrange element."""

    name: str
    """Its name in `implicit.elements.ELEMENTS`."""
    shape: Shape
    """ "hypercube": coordinates in [-1, 1]; "simplex": coordinates >= 0 with a sum <= 1."""
    nodes: FloatArray
    """Reference coordinates of the nodes, in the order of VTK [-], shape [k, d]."""
    exponents: IntArray
    """The monomials of the space, shape [k, d]."""
    faces: tuple[Face, ...]
    """Its faces (edges in two dimensions)."""
    gauss: int
    """Gauss points in each direction unless a model says otherwise [-]."""
    pressure_degree: int | None
    """Degree of the discontinuous pressure that is stable with it in a mixed formulation; None: none is."""
    vtk: int
    """Number of the cell type in VTK."""

    @property
    def dimension(self) -> int:
        """Number of coordinates d."""
        return int(self.nodes.shape[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes k."""
        return len(self.nodes)

    @cached_property
    def coefficients(self) -> FloatArray:
        """V^-1: column a holds the factors of the monomials in N_a, shape [k, k]."""
        vandermonde = (self.nodes[:, None, :] ** self.exponents[None]).prod(axis=-1)
        return np.asarray(np.linalg.inv(vandermonde))

    def values(self, points: FloatArray) -> FloatArray:
        """Shape functions N_a at points of shape [g, d], shape [g, k]."""
        monomials = (np.asarray(points)[:, None, :] ** self.exponents[None]).prod(axis=-1)
        return np.asarray(monomials @ self.coefficients)

    def gradients(self, points: FloatArray) -> FloatArray:
        """Their derivatives dN_a/dxi_j at points of shape [g, d], shape [g, k, d]."""
        points = np.asarray(points, dtype=float)
        columns = []
        for j in range(self.dimension):
            lowered = self.exponents.copy()
            lowered[:, j] = np.maximum(lowered[:, j] - 1, 0)
            monomials = self.exponents[:, j] * (points[:, None, :] ** lowered[None]).prod(axis=-1)
            columns.append(monomials @ self.coefficients)
        return np.stack(columns, axis=-1)

    def curvatures(self, points: FloatArray) -> FloatArray:
        """Their second derivatives d2N_a/dxi_i dxi_j at points of shape [g, d], shape [g, k, d, d]."""
        points = np.asarray(points, dtype=float)
        found = np.empty((len(points), self.n_nodes, self.dimension, self.dimension))
        for i in range(self.dimension):
            factor = self.exponents[:, i]
            once = self.exponents.copy()
            once[:, i] = np.maximum(once[:, i] - 1, 0)
            for j in range(self.dimension):
                twice = once.copy()
                twice[:, j] = np.maximum(twice[:, j] - 1, 0)
                monomials = factor * once[:, j] * (points[:, None, :] ** twice[None]).prod(axis=-1)
                found[:, :, i, j] = monomials @ self.coefficients
        return found

    def rule(self, gauss: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points [g, d] and weights [g] with `gauss` points in each direction."""
        rule = hypercube_rule if self.shape == "hypercube" else simplex_rule
        return rule(gauss, self.dimension)

    def face_rule(self, gauss: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points [g, d - 1] and weights [g] of the reference face."""
        rule = hypercube_rule if self.shape == "hypercube" else simplex_rule
        if self.dimension == 2 and self.shape == "simplex":  # an edge is [0, 1] there
            points, weights = hypercube_rule(gauss, 1)
            return 0.5 * (points + 1.0), 0.5 * weights
        return rule(gauss, self.dimension - 1)

    def nodes_on(self, face: Face) -> IntArray:
        """Local numbers of the nodes on a face, shape [m]."""
        tangents = np.asarray(face.tangents)
        if self.dimension == 3:
            normal = np.cross(tangents[0], tangents[1])
        else:
            normal = np.array([tangents[0, 1], -tangents[0, 0]])
        return np.flatnonzero(np.abs((self.nodes - np.asarray(face.origin)) @ normal) < 1e-9)


def complete(degree: int, dimension: int) -> IntArray:
    """Exponents of all monomials up to a total degree, shape [m, d]."""
    grid = np.stack(np.meshgrid(*[np.arange(degree + 1)] * dimension, indexing="ij"), axis=-1)
    flat = grid.reshape(-1, dimension)
    return np.asarray(flat[flat.sum(axis=1) <= degree], dtype=np.int64)


def tensor(degree: int, dimension: int) -> IntArray:
    """Exponents of all monomials up to a degree in each coordinate, shape [m, d]."""
    grid = np.stack(np.meshgrid(*[np.arange(degree + 1)] * dimension, indexing="ij"), axis=-1)
    return np.asarray(grid.reshape(-1, dimension), dtype=np.int64)
