"""Upper half of a cylinder: biquadratic axisymmetric elements, internal forces and their derivatives."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from explicit.materials.law import Stretches, kirchhoff, tangent
from kolsky.base.arrays import FloatArray

GAUSS = 3
"""Gauss points along each side of an element."""


@dataclass(frozen=True)
class HalfCylinder:
    """Elements between mid-height (z = 0) and the upper face. The lower half has the same number."""

    radius: float
    """Undeformed radius [m]."""
    height: float
    """Half of the undeformed length [m]."""
    n_radial: int
    """Elements across the radius."""
    n_axial: int
    """Elements along the half length."""
    grading: float = 4.0
    """Size of the largest element divided by that of the smallest [-]. The small ones lie at the side and at
    the face."""

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
        """Nodes of the upper face from the axis outward, with its edge."""
        return np.arange(len(self.nodes) - self.row, len(self.nodes))

    @cached_property
    def side(self) -> NDArray[np.int64]:
        """Nodes of the side from mid-height upward, with the edge."""
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
        functions of the pressure (1, xi, eta), shape [9, 3].
        """
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        eta, xi = (g.ravel() for g in np.meshgrid(points, points, indexing="ij"))
        weight = np.outer(weights, weights).ravel()
        N1, D1 = quadratic_functions(xi)
        N2, D2 = quadratic_functions(eta)
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
    """Corner and middle nodes of n elements with sizes that decrease geometrically toward the end."""
    size = ratio ** (-np.arange(n) / (n - 1))
    corner = np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()
    return np.sort(np.concatenate([corner, 0.5 * (corner[1:] + corner[:-1])]))


def quadratic_functions(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Quadratic functions of nodes at -1, 0, 1 and their derivatives, shape [n, 3]."""
    value = np.column_stack([0.5 * x * (x - 1.0), 1.0 - x**2, 0.5 * x * (x + 1.0)])
    return value, np.column_stack([x - 0.5, -2.0 * x, x + 0.5])


EQUAL_STRETCHES = 1e-7
"""Relative distance below which two stretches are equal in the quotient of the shear terms."""
UNDEFORMED = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
"""The deformation gradient without displacements."""


@dataclass(frozen=True)
class Deformation:
    """Deformation at the Gauss points."""

    F: FloatArray
    """(F_rr, F_rz, F_zr, F_zz, F_tt) [-], shape [n, q, 5]."""
    stretch: FloatArray
    """Principal stretches, that of the hoop last [-], shape [n, q, 3]."""
    left: FloatArray
    """(cos, sin) of the angle of U, shape [n, q, 2]."""
    right: FloatArray
    """(cos, sin) of the angle of V, shape [n, q, 2]."""

    @classmethod
    def of(cls, F: FloatArray) -> "Deformation":
        """Singular values of the in-plane part, by its angles in closed form."""
        a, b = 0.5 * (F[..., 0] + F[..., 3]), 0.5 * (F[..., 0] - F[..., 3])
        c, d = 0.5 * (F[..., 2] + F[..., 1]), 0.5 * (F[..., 2] - F[..., 1])
        whole, part = np.hypot(a, d), np.hypot(b, c)
        plus, minus = np.arctan2(c, b), np.arctan2(d, a)
        u, v = 0.5 * (plus + minus), 0.5 * (plus - minus)
        return cls(
            F,
            np.stack([whole + part, whole - part, F[..., 4]], axis=-1),
            np.stack([np.cos(u), np.sin(u)], axis=-1),
            np.stack([np.cos(v), np.sin(v)], axis=-1),
        )

    @property
    def valid(self) -> bool:
        """True if every stretch is positive and finite."""
        return bool(np.isfinite(self.stretch).all() and (self.stretch > 0.0).all())

    @cached_property
    def axes(self) -> FloatArray:
        """Directions dF of the components (11, 12, 21, 22, hoop) in principal axes, shape [n, q, 5, 5]."""
        (cu, su), (cv, sv) = np.moveaxis(self.left, -1, 0), np.moveaxis(self.right, -1, 0)
        u, v = ((cu, su), (-su, cu)), ((cv, sv), (-sv, cv))
        Q = np.zeros((*self.F.shape[:-1], 5, 5))
        for i in range(2):
            for j in range(2):
                for k in range(4):
                    Q[..., 2 * i + j, k] = u[i][k // 2] * v[j][k % 2]
        Q[..., 4, 4] = 1.0
        return Q


def isochoric_stress(law: Stretches, state: Deformation) -> FloatArray:
    """First Piola-Kirchhoff stress of the isochoric energy [Pa], shape [n, q, 5]."""
    slope = kirchhoff(law, state.stretch) / state.stretch
    return np.einsum("...i,...ik->...k", slope, state.axes[..., (0, 3, 4), :])


def isochoric_tangent(law: Stretches, state: Deformation) -> FloatArray:
    """dP/dF of the isochoric energy [Pa], shape [n, q, 5, 5]."""
    lam = state.stretch
    tau = kirchhoff(law, lam)
    slope = tau / lam
    H = (tangent(law, lam) - np.eye(3) * tau[..., None]) / (lam[..., :, None] * lam[..., None, :])
    A = np.zeros((*lam.shape[:-1], 5, 5))
    for i, k in enumerate((0, 3, 4)):
        for j, m in enumerate((0, 3, 4)):
            A[..., k, m] = H[..., i, j]
    apart = lam[..., 0] - lam[..., 1]
    near = np.abs(apart) < EQUAL_STRETCHES * lam[..., 0]
    limit = H[..., 0, 0] - H[..., 0, 1]
    alpha = np.where(near, limit, (slope[..., 0] - slope[..., 1]) / np.where(near, 1.0, apart))
    beta = (slope[..., 0] + slope[..., 1]) / (lam[..., 0] + lam[..., 1])
    A[..., 1, 1] = A[..., 2, 2] = 0.5 * (alpha + beta)
    A[..., 1, 2] = A[..., 2, 1] = 0.5 * (alpha - beta)
    return np.asarray(np.swapaxes(state.axes, -1, -2) @ A @ state.axes)


def _volume(F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """J, its derivative by F, shape [..., 5], and its second derivative, shape [..., 5, 5]."""
    rr, rz, zr, zz, tt = np.moveaxis(F, -1, 0)
    plane = rr * zz - rz * zr
    first = np.stack([zz * tt, -zr * tt, -rz * tt, rr * tt, plane], axis=-1)
    second = np.zeros((*F.shape[:-1], 5, 5))
    for i, j, value in ((0, 3, tt), (1, 2, -tt), (0, 4, zz), (1, 4, -zr), (2, 4, -rz), (3, 4, rr)):
        second[..., i, j] = second[..., j, i] = value
    return plane * tt, first, second


@dataclass(frozen=True)
class Body:
    """A mesh and a bulk modulus."""

    mesh: HalfCylinder
    bulk: float
    """Bulk modulus K [Pa]."""

    @cached_property
    def _inverse_mass(self) -> FloatArray:
        _, volume, phi = self.mesh.gauss
        return np.linalg.inv(np.einsum("eq,qa,qb->eab", volume, phi, phi))

    def deformation(self, u: FloatArray) -> Deformation:
        """Deformation of the displacements u [m], shape [2 n_nodes]."""
        B, _, _ = self.mesh.gauss
        return Deformation.of(UNDEFORMED + np.einsum("eqik,ek->eqi", B, u[self.mesh.dofs]))

    def forces(self, law: Stretches, state: Deformation) -> tuple[FloatArray, FloatArray]:
        """Internal forces of each element [N], shape [n, 18], and their derivatives [N/m], shape
        [n, 18, 18].
        """
        B, volume, phi = self.mesh.gauss
        J, dJ, d2J = _volume(state.F)
        inverse = self._inverse_mass
        theta = np.einsum("eab,eq,qb,eq->ea", inverse, volume, phi, J, optimize=True)
        p = self.bulk * (theta @ phi.T - 1.0)
        P = isochoric_stress(law, state) + p[..., None] * dJ
        A = isochoric_tangent(law, state) + p[..., None, None] * d2J
        force = np.einsum("eqik,eqi->ek", B, P * volume[..., None], optimize=True)
        n, flat = len(B), B.reshape(len(B), -1, 18)
        AB = (A * volume[..., None, None]) @ B
        stiffness = np.swapaxes(flat, 1, 2) @ AB.reshape(n, -1, 18)
        g = np.einsum("qa,eqi,eqik->eak", phi, dJ * volume[..., None], B, optimize=True)
        stiffness += self.bulk * np.swapaxes(g, 1, 2) @ inverse @ g
        return force, stiffness

    def isochoric_forces(self, law: Stretches, state: Deformation) -> FloatArray:
        """Forces of the isochoric energy [N], shape [2 n_nodes].

        No other forces depend on a law's constants.
        """
        B, volume, _ = self.mesh.gauss
        P = isochoric_stress(law, state) * volume[..., None]
        return self.assembled(np.einsum("eqik,eqi->ek", B, P, optimize=True))

    def assembled(self, force: FloatArray) -> FloatArray:
        """Forces of elements summed at the nodes [N], shape [2 n_nodes]."""
        size = 2 * len(self.mesh.nodes)
        return np.asarray(
            np.bincount(self.mesh.dofs.ravel(), weights=force.ravel(), minlength=size), dtype=np.float64
        )
