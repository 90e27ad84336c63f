r"""Internal forces of a hyperelastic body and their derivatives by displacements and by a law's constants.

The isochoric energy :math:`\hat W(\lambda_i) = W(J^{-1/3}\lambda_i)` gives in the axes of
:math:`F = U \Sigma V^T`, with :math:`F' = U^T F V` and subscripts for derivatives by the stretches,

.. math::
   P'_{ii} = \hat W_i, \qquad dP'_{ii} = \hat W_{ij}\, dF'_{jj}, \qquad
   dP'_{12} \pm dP'_{21} = \frac{\hat W_1 \mp \hat W_2}{\lambda_1 \mp \lambda_2} (dF'_{12} \pm dF'_{21})

(Ogden 1984, 6.1). The volumetric part is :math:`\tfrac K 2 (\theta - 1)^2` of the volume ratio projected on
the element's linear functions :math:`\phi`, with the pressure :math:`p = K (\theta - 1)`: forces
:math:`\int p\, \delta J`, stiffness :math:`\int p\, \delta^2 J + K g^T M^{-1} g`,
:math:`g = \int \phi\, \delta J`, :math:`M = \int \phi \phi^T`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from explicit.materials.law import Stretches
from explicit.materials.principal import kirchhoff, tangent
from kolsky.base.arrays import FloatArray
from kolsky.material.compression.mesh import HalfCylinder

MEET = 1e-7
"""Relative distance below which two stretches count as equal in the quotient of the shear terms."""
AT_REST = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
"""The deformation gradient without displacements."""


@dataclass(frozen=True)
class Deformation:
    """Deformation at the Gauss points."""

    F: FloatArray
    """(F_rr, F_rz, F_zr, F_zz, F_tt) [-], shape [n, q, 5]."""
    stretch: FloatArray
    """Principal stretches, the hoop's last [-], shape [n, q, 3]."""
    left: FloatArray
    """(cos, sin) of the angle of U, shape [n, q, 2]."""
    right: FloatArray
    """Of V, likewise."""

    @classmethod
    def of(cls, F: FloatArray) -> "Deformation":
        """Singular values of the part in the plane, by its angles in closed form."""
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
    near = np.abs(apart) < MEET * lam[..., 0]
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
    """The elements."""
    bulk: float
    """K [Pa]."""

    @cached_property
    def _inverse_mass(self) -> FloatArray:
        _, volume, phi = self.mesh.gauss
        return np.linalg.inv(np.einsum("eq,qa,qb->eab", volume, phi, phi))

    def deformation(self, u: FloatArray) -> Deformation:
        """Deformation of the displacements u [m], shape [2 n_nodes]."""
        B, _, _ = self.mesh.gauss
        return Deformation.of(AT_REST + np.einsum("eqik,ek->eqi", B, u[self.mesh.dofs]))

    def forces(self, law: Stretches, state: Deformation) -> tuple[FloatArray, FloatArray]:
        """Internal forces of each element [N], shape [n, 18], and their derivatives [N/m], shape
        [n, 18, 18]."""
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
        """Forces of the isochoric energy alone, which a law's constants enter [N], shape [2 n_nodes]."""
        B, volume, _ = self.mesh.gauss
        P = isochoric_stress(law, state) * volume[..., None]
        return self.assembled(np.einsum("eqik,eqi->ek", B, P, optimize=True))

    def assembled(self, force: FloatArray) -> FloatArray:
        """Forces of elements summed at the nodes [N], shape [2 n_nodes]."""
        size = 2 * len(self.mesh.nodes)
        return np.asarray(
            np.bincount(self.mesh.dofs.ravel(), weights=force.ravel(), minlength=size), dtype=np.float64
        )
