"""Upper half of a cylinder: biquadratic axisymmetric elements, internal forces and their derivatives."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from explicit.materials.law import Stretches, kirchhoff, tangent
from kolsky.base.arrays import FloatArray
from kolsky.equilibrium.meshes import Mesh, grid
from kolsky.equilibrium.points import geometry

GRADING = 4.0
"""Size of the largest element divided by that of the smallest [-]. The small ones lie at the side and at the
face."""


def half_cylinder(radius: float, height: float, n_radial: int, n_axial: int) -> Mesh:
    """Biquadratic elements between mid-height (z = 0) and the upper face at `height` [m].

    The lower half has the same number. The sets are "left" (axis), "right" (side), "bottom" (mid-height) and
    "top" (face), each in the order of its coordinate.
    """
    if not (radius > 0.0 and height > 0.0):
        raise ValueError(f"radius and height must be > 0 m, got {radius} and {height}")
    if n_radial < 2 or n_axial < 2:
        raise ValueError(f"a mesh needs 2 x 2 elements or more, got {n_radial} x {n_axial}")
    lines = []
    for length, n in ((radius, n_radial), (height, n_axial)):
        size = GRADING ** (-np.arange(n) / (n - 1))
        lines.append(np.concatenate([[0.0], np.cumsum(size)]) * (length / size.sum()))
    return grid(lines, np.ones((n_radial, n_axial), dtype=bool), kind="quad9")


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
    """Principal axes after the deformation, one per row, shape [n, q, 2, 2]."""
    right: FloatArray
    """Principal axes before the deformation, one per row, shape [n, q, 2, 2]."""

    @classmethod
    def of(cls, F: FloatArray) -> "Deformation":
        """Singular values of the in-plane part, by its angles in closed form."""
        a, b = 0.5 * (F[..., 0] + F[..., 3]), 0.5 * (F[..., 0] - F[..., 3])
        c, d = 0.5 * (F[..., 2] + F[..., 1]), 0.5 * (F[..., 2] - F[..., 1])
        whole, part = np.hypot(a, d), np.hypot(b, c)
        plus, minus = np.arctan2(c, b), np.arctan2(d, a)
        left, right = (
            np.stack([np.cos(x), np.sin(x), -np.sin(x), np.cos(x)], axis=-1).reshape(*x.shape, 2, 2)
            for x in (0.5 * (plus + minus), 0.5 * (plus - minus))
        )
        return cls(F, np.stack([whole + part, whole - part, F[..., 4]], axis=-1), left, right)

    @property
    def valid(self) -> bool:
        """True if every stretch is positive and finite."""
        return bool(np.isfinite(self.stretch).all() and (self.stretch > 0.0).all())

    @cached_property
    def axes(self) -> FloatArray:
        """Directions dF of the components (11, 12, 21, 22, hoop) in principal axes, shape [n, q, 5, 5]."""
        Q = np.zeros((*self.F.shape[:-1], 5, 5))
        pairs = np.einsum("...ik,...jl->...ijkl", self.left, self.right)
        Q[..., :4, :4] = pairs.reshape(*self.F.shape[:-1], 4, 4)
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
    A[..., [[0], [3], [4]], [0, 3, 4]] = H
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


class Body:
    """A mesh and a bulk modulus K [Pa]."""

    def __init__(self, mesh: Mesh, bulk: float) -> None:
        self.bulk = bulk
        self.dofs: NDArray[np.int64] = (2 * mesh.cells[:, :, None] + np.arange(2)).reshape(-1, 18)
        """Unknowns of each element, r and z node by node, shape [n_elements, 18]."""
        points = geometry(mesh, kinematics="axisymmetric", thickness=1.0, gauss=None)
        self.volumes = points.volumes
        """Volumes of the Gauss points [m^3], shape [n_elements, 9]."""
        self._B = np.zeros((*points.volumes.shape, 5, 18))
        self._B[:, :, 0, 0::2], self._B[:, :, 1, 0::2], self._B[:, :, 4, 0::2] = np.moveaxis(points.E, -1, 0)
        self._B[:, :, 2, 1::2], self._B[:, :, 3, 1::2] = self._B[:, :, 0, 0::2], self._B[:, :, 1, 0::2]
        # the pressure is linear in each element
        self._phi = np.column_stack([np.ones(len(points.points)), points.points])
        self._inverse_mass = np.linalg.inv(np.einsum("eq,qa,qb->eab", self.volumes, self._phi, self._phi))

    def deformation(self, u: FloatArray) -> Deformation:
        """Deformation of the displacements u [m], shape [2 n_nodes]."""
        return Deformation.of(UNDEFORMED + np.einsum("eqik,ek->eqi", self._B, u[self.dofs]))

    def forces(self, law: Stretches, state: Deformation) -> tuple[FloatArray, FloatArray]:
        """Internal forces of each element [N], shape [n, 18], and their derivatives [N/m], shape
        [n, 18, 18].
        """
        B, volume, phi, inverse = self._B, self.volumes, self._phi, self._inverse_mass
        J, dJ, d2J = _volume(state.F)
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
        """Forces of the isochoric energy of each element [N], shape [n, 18].

        No other forces depend on a law's constants.
        """
        P = isochoric_stress(law, state) * self.volumes[..., None]
        return np.asarray(np.einsum("eqik,eqi->ek", self._B, P, optimize=True))
