"""Reference elements by name: nodes, shape functions, faces, Gauss rules; node order of VTK.

The shape functions are the Lagrange basis of a space of monomials xi^e. With V_am = xi_a^(e_m) at the nodes,
N(xi) = V^-T xi^e. They are 1 at their node and 0 at the others, and reproduce all polynomials of the space.

A hypercube uses the product of Gauss-Legendre points. A simplex uses Stroud's conical product of Gauss-Jacobi
points (Stroud 1971, section 2.4). It is exact to degree 2 n - 1 with n points in each direction. For n <= 2,
a simplex uses the smaller symmetric rules of 1 and d + 1 points, exact to degree 1 and 2.

To add an element, write an `Element` and one line in `ELEMENTS`. An `Element` has its nodes in reference
coordinates and the monomials of its shape functions. The patch tests cover the registry.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.special import roots_jacobi

from explicit.arrays import FloatArray, IntArray


def lattice(lines: Sequence[FloatArray | IntArray]) -> Any:
    """All points with one coordinate of each line, the last varying fastest, shape [n, d]."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(lines))


def hypercube_rule(gauss: int, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Points in [-1, 1]^d, shape [gauss^d, d], and weights of sum 2^d, shape [gauss^d]."""
    x, w = np.polynomial.legendre.leggauss(_checked(gauss))
    return lattice([x] * dimension), lattice([w] * dimension).prod(axis=1)


def simplex_rule(gauss: int, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Points in the unit simplex, shape [g, d], and weights of sum 1 / d!, shape [g]."""
    volume = 1.0 / (1.0, 1.0, 2.0, 6.0)[dimension]
    if _checked(gauss) == 1:
        return np.full((1, dimension), 1.0 / (dimension + 1)), np.array([volume])
    if gauss == 2:
        # a point on each line from the centre to a corner: exact for degree 2 (Stroud's Tn: 2-1)
        near = {2: 1.0 / 6.0, 3: (5.0 - 5.0**0.5) / 20.0}[dimension]
        points = np.full((dimension + 1, dimension), near)
        points[np.arange(dimension), np.arange(dimension)] = 1.0 - dimension * near
        return points, np.full(dimension + 1, volume / (dimension + 1))
    # x_1 = t_1, x_2 = (1 - t_1) t_2, x_3 = (1 - t_1)(1 - t_2) t_3 with the weight (1 - t_i)^(d - i)
    rules = [roots_jacobi(gauss, dimension - 1 - i, 0.0) for i in range(dimension)]
    t = lattice([0.5 * (x + 1.0) for x, _ in rules])
    weights = lattice([w * 0.5 ** (dimension - i) for i, (_, w) in enumerate(rules)])
    left = np.cumprod(np.column_stack([np.ones(len(t)), 1.0 - t[:, :-1]]), axis=1)
    return left * t, weights.prod(axis=1)


def _checked(gauss: int) -> int:
    if not 1 <= gauss <= 12:
        raise ValueError(f"gauss must be in [1, 12] points a direction, got {gauss}")
    return gauss


Shape = Literal["hypercube", "simplex"]


@dataclass(frozen=True)
class Face:
    """A face as an affine image of the reference face: xi = origin + tangents @ s. The normal from the
    tangents points outward. It is their cross product; in two dimensions, it is the tangent rotated by -90
    degrees."""

    origin: tuple[float, ...]
    """Point s = 0 in the element's coordinates [-], shape [d]."""
    tangents: tuple[tuple[float, ...], ...]
    """One tangent for each coordinate s of the face [-], shape [d - 1, d]."""

    def coordinates(self, xi: FloatArray) -> FloatArray:
        """The coordinates s of points of the face [-], shape [n, d - 1]."""
        return (xi - np.asarray(self.origin)) @ np.linalg.pinv(np.asarray(self.tangents))


@dataclass(frozen=True, eq=False)
class Element:
    """A Lagrange element."""

    name: str
    shape: Shape
    """ "hypercube": coordinates in [-1, 1]; "simplex": coordinates >= 0 with a sum <= 1."""
    nodes: FloatArray
    """Reference coordinates of the nodes, in the order of VTK [-], shape [k, d]."""
    exponents: IntArray
    """The monomials of the space, shape [k, d]."""
    faces: tuple[Face, ...]
    gauss: int
    """Default number of Gauss points in each direction [-]."""
    pressure_degree: int | None
    """Degree of the discontinuous pressure that is stable in a mixed formulation. None if no degree is
    stable."""
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
        """V^-1. Column a contains the factors of the monomials in N_a, shape [k, k]."""
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
    exponents = tensor(degree, dimension)
    return exponents[exponents.sum(axis=1) <= degree]


def tensor(degree: int, dimension: int) -> IntArray:
    """Exponents of all monomials up to a degree in each coordinate, shape [m, d]."""
    return np.asarray(lattice([np.arange(degree + 1)] * dimension), dtype=np.int64)


_QUAD = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]], dtype=float)
_EDGES = (
    Face((0.0, -1.0), ((1.0, 0.0),)),
    Face((1.0, 0.0), ((0.0, 1.0),)),
    Face((0.0, 1.0), ((-1.0, 0.0),)),
    Face((-1.0, 0.0), ((0.0, -1.0),)),
)
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_FACES = (
    Face((-1.0, 0.0, 0.0), (_Z, _Y)),
    Face((1.0, 0.0, 0.0), (_Y, _Z)),
    Face((0.0, -1.0, 0.0), (_X, _Z)),
    Face((0.0, 1.0, 0.0), (_Z, _X)),
    Face((0.0, 0.0, -1.0), (_Y, _X)),
    Face((0.0, 0.0, 1.0), (_X, _Y)),
)


def _hexahedron() -> FloatArray:
    corners = [[x, y, z] for z in (-1, 1) for x, y in _QUAD[:4]]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    middles = [np.mean([corners[a], corners[b]], axis=0) for a, b in edges]
    faces = [face.origin for face in _FACES]
    return np.array([*corners, *middles, *faces, [0.0, 0.0, 0.0]], dtype=float)


_HEX = _hexahedron()

QUAD4 = Element("quad4", "hypercube", _QUAD[:4], tensor(1, 2), _EDGES, 2, 0, 9)
QUAD8 = Element("quad8", "hypercube", _QUAD[:8], tensor(2, 2)[:-1], _EDGES, 3, 0, 23)
QUAD9 = Element("quad9", "hypercube", _QUAD, tensor(2, 2), _EDGES, 3, 1, 28)
HEX8 = Element("hex8", "hypercube", _HEX[:8], tensor(1, 3), _FACES, 2, 0, 12)
HEX27 = Element("hex27", "hypercube", _HEX, tensor(2, 3), _FACES, 3, 1, 29)


_TRIANGLE_EDGES = (
    Face((0.0, 0.0), ((1.0, 0.0),)),
    Face((1.0, 0.0), ((-1.0, 1.0),)),
    Face((0.0, 1.0), ((0.0, -1.0),)),
)
_ORIGIN = (0.0, 0.0, 0.0)
_TET_FACES = (
    Face(_ORIGIN, (_Y, _X)),
    Face(_ORIGIN, (_X, _Z)),
    Face(_ORIGIN, (_Z, _Y)),
    Face(_X, ((-1.0, 1.0, 0.0), (-1.0, 0.0, 1.0))),
)


def _with_middles(corners: FloatArray, edges: tuple[tuple[int, int], ...]) -> FloatArray:
    return np.vstack([corners, [0.5 * (corners[a] + corners[b]) for a, b in edges]])


_TRIANGLE = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
_TET = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)

TRI3 = Element("tri3", "simplex", _TRIANGLE, complete(1, 2), _TRIANGLE_EDGES, 1, None, 5)
TRI6 = Element(
    "tri6", "simplex", _with_middles(_TRIANGLE, ((0, 1), (1, 2), (2, 0))), complete(2, 2), _TRIANGLE_EDGES, 2,
    0, 22,
)  # fmt: skip
TET4 = Element("tet4", "simplex", _TET, complete(1, 3), _TET_FACES, 1, None, 10)
_TET10 = _with_middles(_TET, ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)))
# no pressure: a constant one fails the inf-sup condition in 3-D, because faces have no point of their own
TET10 = Element("tet10", "simplex", _TET10, complete(2, 3), _TET_FACES, 2, None, 24)


ELEMENTS: dict[str, Element] = {
    element.name: element for element in (TRI3, TRI6, QUAD4, QUAD8, QUAD9, TET4, TET10, HEX8, HEX27)
}


def element(name: str) -> Element:
    """Return an element by name. Raises ValueError for an unknown name. The message lists the elements."""
    if name not in ELEMENTS:
        raise ValueError(f"kind must be one of {sorted(ELEMENTS)}, got {name!r}")
    return ELEMENTS[name]
