"""A bonded cylinder compressed by FElupe: biquadratic elements with a continuous pressure (Taylor and Hood).

FElupe is a separate program (https://felupe.readthedocs.io). It shares no code with this one: mesh, element,
law, contact and Newton iteration are different. The nodes of the side touch the platen one by one and do not
slip on it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray

Slope = Callable[[FloatArray], FloatArray]
"""A function of the first invariant."""
PENALTY = 100.0
"""Contact stiffness of a node over the mean stiffness of its elements [-]. With FElupe's default 1 the side
penetrates the platen."""
STEP = 0.01
"""Largest step of compression [-]."""


@dataclass(frozen=True)
class Invariants:
    """W = U(I1) + C01 (I2 - 3) + K/2 (J - 1)^2, with I1 and I2 of the isochoric deformation.

    The interface is that of FElupe's materials: arrays of shape [3, 3, ..., points, elements].
    """

    first: Slope
    """U' [Pa]."""
    second: Slope
    """U'' [Pa]."""
    C01: float
    """Constant of the second invariant, C01 [Pa]."""
    bulk: float
    """Bulk modulus K [Pa]."""
    x = (np.eye(3), np.zeros(0))
    """Shapes of the deformation gradient and of the (absent) state variables."""

    def gradient(self, x: list[FloatArray]) -> list[FloatArray | None]:
        """First Piola-Kirchhoff stress [Pa]."""
        F = x[0]
        J, T = _volume(F)
        I1 = np.einsum("ij...,ij...->...", F, F)
        cut = J ** (-2.0 / 3.0)
        P = self.first(cut * I1) * cut * (2.0 * F - 2.0 / 3.0 * I1 * T) + self.bulk * (J - 1.0) * J * T
        C = np.einsum("ki...,kj...->ij...", F, F)
        I2 = 0.5 * (I1**2 - np.einsum("ij...,ij...->...", C, C))
        G = 2.0 * (I1 * F - np.einsum("ik...,kj...->ij...", F, C))
        return [P + self.C01 * cut**2 * (G - 4.0 / 3.0 * I2 * T), None]

    def hessian(self, x: list[FloatArray]) -> list[FloatArray]:
        """dP/dF [Pa], shape [3, 3, 3, 3, ...]."""
        F = x[0]
        J, T = _volume(F)
        e = np.eye(3)
        I1 = np.einsum("ij...,ij...->...", F, F)
        cut = J ** (-2.0 / 3.0)
        one = np.einsum("ik,jl->ijkl", e, e)[(..., *(None,) * (F.ndim - 2))]
        TT, TX = _dyad(T, T), np.einsum("il...,kj...->ijkl...", T, T)
        d1 = cut * (2.0 * F - 2.0 / 3.0 * I1 * T)
        A = self.second(cut * I1) * _dyad(d1, d1) + self.first(cut * I1) * cut * (
            2.0 * one - 4.0 / 3.0 * (_dyad(F, T) + _dyad(T, F)) + I1 * (2.0 / 3.0 * TX + 4.0 / 9.0 * TT)
        )
        A += self.bulk * J * ((2.0 * J - 1.0) * TT - (J - 1.0) * TX)
        C, B = np.einsum("ki...,kj...->ij...", F, F), np.einsum("ik...,jk...->ij...", F, F)
        I2 = 0.5 * (I1**2 - np.einsum("ij...,ij...->...", C, C))
        G = 2.0 * (I1 * F - np.einsum("ik...,kj...->ij...", F, C))
        dG = 2.0 * (
            2.0 * _dyad(F, F)
            + I1 * one
            - np.einsum("ik...,jl->ijkl...", B, e)
            - np.einsum("il...,kj...->ijkl...", F, F)
            - np.einsum("ik,lj...->ijkl...", e, C)
        )
        more = dG - 4.0 / 3.0 * (_dyad(G, T) + _dyad(T, G)) + I2 * (4.0 / 3.0 * TX + 16.0 / 9.0 * TT)
        return [A + self.C01 * cut**2 * more]


def _dyad(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij...,kl...->ijkl...", a, b))


def _volume(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J and the inverse's transpose."""
    import felupe as fem

    J = fem.math.det(F)
    return J, fem.math.transpose(fem.math.inv(F, J))


def compression_force(
    law: Invariants, radius: float, length: float, strain: FloatArray, mesh: tuple[int, int]
) -> FloatArray:
    """Force [N] at nominal compressive strains, shape [n]. The mesh gives the elements across the radius and
    the half length."""
    import felupe as fem

    r, z = (_graded(side, n) for side, n in ((radius, mesh[0]), (0.5 * length, mesh[1])))
    row = r.size
    along, across = np.meshgrid(z, r, indexing="ij")
    corner = (row * np.arange(z.size - 1)[:, None] + np.arange(row - 1)).ravel()
    cells = np.column_stack([corner, corner + row, corner + row + 1, corner + 1])
    points = np.column_stack([along.ravel(), across.ravel()])
    linear = fem.Mesh(points, cells, "quad")
    fine = fem.mesh.convert(linear, order=2, calc_points=True, calc_midfaces=True)
    fine.update(points=np.vstack([fine.points, [[0.5 * length, 1.5 * radius]]]))
    fine.points_without_cells = fine.points_without_cells[:-1]  # this point of the platen may move
    field = fem.FieldsMixed(
        fem.RegionBiQuadraticQuad(fine), n=3, axisymmetric=True, mesh=linear, disconnect=False
    )
    body = fem.SolidBody(fem.ThreeFieldVariation(law), field)
    x, top, platen = fine.points, 0.5 * length, len(fine.points) - 1
    near = 1e-9 * length
    side = np.flatnonzero((np.abs(x[:, 1] - radius) < near) & (x[:, 0] < top - near))
    contact = fem.ContactRigidPlane(
        field,
        side,
        platen,
        [-1.0, 0.0],
        friction=np.inf,
        multiplier=PENALTY,
        multiplier_tangential=0.1 * PENALTY,
        items=[body],
    )
    bounds = {
        "axis": fem.Boundary(field[0], fy=0.0, skip=(1, 0)),
        "middle": fem.Boundary(field[0], fx=0.0, skip=(0, 1)),
        "glue": fem.Boundary(field[0], fx=top, skip=(1, 0)),
        "move": fem.Boundary(field[0], fx=top, skip=(0, 1)),
    }
    middle = np.flatnonzero(np.abs(x[:-1, 0]) < near)
    force, now = [], 0.0
    for end in strain:
        for to in np.linspace(now, end, int(np.ceil((end - now) / STEP - 1e-9)) + 1)[1:]:
            bounds["move"].update(-to * top)
            fixed, free = fem.dof.partition(field, bounds)
            given = fem.dof.apply(field, bounds, fixed)
            fem.newtonraphson(
                items=[body, contact], dof0=fixed, dof1=free, ext0=given, tol=1e-6, verbose=False, maxiter=30
            )
        now = end
        inner = body.assemble.vector(field).toarray().ravel()[: 2 * len(x)].reshape(-1, 2)
        force.append(float(inner[middle, 0].sum()))
    return np.array(force)


def _graded(length: float, n: int) -> FloatArray:
    """Corners of n elements whose length decreases to a fifth toward the end [m]."""
    size = 5.0 ** (-np.arange(n) / (n - 1))
    return np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()
