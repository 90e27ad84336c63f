r"""Upper half of a cylinder in biquadratic axisymmetric elements, with all that never changes in a run.

The deformation gradient of an axisymmetric motion is (F_rr, F_rz, F_zr, F_zz, F_tt); it is linear in the
nodes' displacements, :math:`F = F_0 + B u`, and B is kept for every Gauss point. The pressure of an element
is linear and discontinuous (the Q2/P1 element, which passes the inf-sup condition; Boffi, Brezzi and Fortin,
Mixed Finite Element Methods and Applications, 2013, 8.6).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray

GAUSS = 3
"""Gauss points along each side of an element."""


@dataclass(frozen=True)
class HalfCylinder:
    """Elements between mid-height (z = 0) and the upper face, equal in the lower half."""

    radius: float
    """Undeformed radius [m]."""
    height: float
    """Half of the undeformed length [m]."""
    n_radial: int
    """Elements across the radius."""
    n_axial: int
    """Elements along the half length."""
    grading: float = 4.0
    """Largest over smallest element; the small ones lie at the side and at the face [-]."""

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.height > 0.0):
            raise ValueError(f"radius and height must be > 0 m, got {self.radius} and {self.height}")
        if self.n_radial < 2 or self.n_axial < 2:
            raise ValueError(f"a mesh needs 2 x 2 elements or more, got {self.n_radial} x {self.n_axial}")
        if not self.grading >= 1.0:
            raise ValueError(f"the grading must be >= 1, got {self.grading}")

    @cached_property
    def nodes(self) -> FloatArray:
        """Undeformed r and z of the nodes [m], shape [n_nodes, 2], row by row from mid-height."""
        r = _graded(self.radius, self.n_radial, self.grading)
        z = _graded(self.height, self.n_axial, self.grading)
        return np.column_stack([np.tile(r, z.size), np.repeat(z, r.size)])

    @cached_property
    def elements(self) -> NDArray[np.int64]:
        """Nodes of each element, row by row from its lower inner corner, shape [n_elements, 9]."""
        row = 2 * self.n_radial + 1
        first = (2 * row * np.arange(self.n_axial)[:, None] + 2 * np.arange(self.n_radial)).ravel()
        local = (row * np.arange(3)[:, None] + np.arange(3)).ravel()
        return np.asarray(first[:, None] + local)

    @cached_property
    def dofs(self) -> NDArray[np.int64]:
        """Unknowns of each element, r and z node by node, shape [n_elements, 18]."""
        return (2 * self.elements[:, :, None] + np.arange(2)).reshape(len(self.elements), 18)

    @property
    def row(self) -> int:
        """Nodes across the radius."""
        return 2 * self.n_radial + 1

    @cached_property
    def face(self) -> NDArray[np.int64]:
        """Nodes of the upper face from the axis outward, its edge included."""
        return np.arange(len(self.nodes) - self.row, len(self.nodes))

    @cached_property
    def side(self) -> NDArray[np.int64]:
        """Nodes of the side from mid-height upward, the edge included."""
        return np.arange(self.row - 1, len(self.nodes), self.row)

    @cached_property
    def axis(self) -> NDArray[np.int64]:
        """Nodes of the axis."""
        return np.arange(0, len(self.nodes), self.row)

    @cached_property
    def middle(self) -> NDArray[np.int64]:
        """Nodes at mid-height."""
        return np.arange(self.row)

    @cached_property
    def gauss(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """B, shape [n_elements, 9, 5, 18] [1/m]; volumes of the points [m^3], shape [n_elements, 9]; linear
        functions of the pressure (1, xi, eta), shape [9, 3]."""
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        eta, xi = (g.ravel() for g in np.meshgrid(points, points, indexing="ij"))
        weight = np.outer(weights, weights).ravel()
        N1, D1 = _quadratic(xi)
        N2, D2 = _quadratic(eta)
        shape = (N2[:, :, None] * N1[:, None, :]).reshape(-1, 9)
        along = np.stack(
            [
                (N2[:, :, None] * D1[:, None, :]).reshape(-1, 9),
                (D2[:, :, None] * N1[:, None, :]).reshape(-1, 9),
            ]
        )
        x = self.nodes[self.elements]
        jacobian = np.einsum("aqn,eni->eqai", along, x)
        slopes = np.einsum("eqia,aqn->eqin", np.linalg.inv(jacobian), along)
        r = np.einsum("qn,en->eq", shape, x[:, :, 0])
        B = np.zeros((*r.shape, 5, 18))
        B[:, :, 0, 0::2], B[:, :, 1, 0::2] = slopes[:, :, 0], slopes[:, :, 1]
        B[:, :, 2, 1::2], B[:, :, 3, 1::2] = slopes[:, :, 0], slopes[:, :, 1]
        B[:, :, 4, 0::2] = shape / r[:, :, None]
        volume = np.linalg.det(jacobian) * weight * 2.0 * np.pi * r
        return B, volume, np.column_stack([np.ones(xi.size), xi, eta])

    @cached_property
    def areas(self) -> FloatArray:
        """Undeformed area of face and side that belongs to each node [m^2], shape [n_nodes]."""
        found = np.zeros(len(self.nodes))
        for line in (self.face, self.side):
            x = self.nodes[line]
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(x, axis=0).T))])
            between = np.concatenate([[0.0], 0.5 * (length[1:] + length[:-1]), length[-1:]])
            r = np.maximum(x[:, 0], 0.25 * x[1, 0])
            found[line] += 2.0 * np.pi * r * np.diff(between)
        return found


def _graded(length: float, n: int, ratio: float) -> FloatArray:
    """Corner and middle nodes of n elements whose sizes shrink geometrically towards the end."""
    size = ratio ** (-np.arange(n) / (n - 1))
    corner = np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()
    return np.sort(np.concatenate([corner, 0.5 * (corner[1:] + corner[:-1])]))


def _quadratic(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Quadratic functions of nodes at -1, 0, 1 and their derivatives, shape [n, 3]."""
    value = np.column_stack([0.5 * x * (x - 1.0), 1.0 - x**2, 0.5 * x * (x + 1.0)])
    return value, np.column_stack([x - 0.5, -2.0 * x, x + 0.5])
