"""Kernels that evaluate a law at all Gauss points of a mesh.

An element's gradients E[cell, point, node, column] hold dN/dX_J; in an axisymmetric model the third column
holds N / R, so that the pairs (i, J) of a radial displacement include the hoop stretch as (0, 2) and the pair
(1, 2) is empty. P and A then contract with E alike in every kinematics.
"""

from functools import cache
from typing import Any

import warp as wp

from implicit.laws.kernels.compressible import add_pressure
from implicit.laws.kernels.tensors import cofactor, f64, mat33

KINEMATICS = {"3d": (3, 3), "plane_strain": (2, 2), "plane_stress": (2, 2), "axisymmetric": (2, 3)}
"""Displacement components d and columns of the gradients D of each kinematics."""
THICKNESS_STEPS = 60
"""Most iterations for the thickness stretch of plane stress."""


@cache
def deformation_function(kinematics: str) -> Any:
    """``F(u, cells, E, cell, point, thickness_stretch)`` as a 3 x 3 matrix."""
    d = int(KINEMATICS[kinematics][0])
    hoop, stretched = kinematics == "axisymmetric", kinematics == "plane_stress"

    @wp.func
    def deformation(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        c: int,
        g: int,
        thickness: f64,
    ):
        F = wp.identity(n=3, dtype=f64)
        if wp.static(stretched):
            F[2, 2] = thickness
        for a in range(cells.shape[1]):
            node = cells[c, a]
            if wp.static(hoop):
                F[2, 2] = F[2, 2] + u[node, 0] * E[c, g, a, 2]
            for i in range(wp.static(d)):
                for j in range(wp.static(d)):
                    F[i, j] = F[i, j] + u[node, i] * E[c, g, a, j]
        return F

    return deformation


@cache
def place_function(kinematics: str) -> Any:
    """Number in 0..8 of the pair that component ``m = i D + J`` is; -1 for the empty one."""
    columns, hoop = int(KINEMATICS[kinematics][1]), kinematics == "axisymmetric"

    @wp.func
    def place(m: int):
        i = m // wp.static(columns)
        j = m - wp.static(columns) * i
        value = 3 * i + j
        if wp.static(hoop) and j == 2:
            value = wp.where(i == 0, 8, -1)
        return value

    return place


@cache
def point_kernel(functions: tuple[Any, Any, Any], kinematics: str, *, mixed: bool, single: bool) -> Any:
    """P, A dV, dJ/dF, J and the energy density at every Gauss point; launched over (cells, points).

    A is written in single precision if that is wanted. In a mixed model `pressure` [Pa] enters P and A as
    that of the volumetric part; otherwise it is not read. In plane stress H holds A_iJ33 / A_3333, by which
    the thickness follows, in place of dJ/dF.
    """
    energy_of, stress_of, tangent_of = functions
    deformation, place = deformation_function(kinematics), place_function(kinematics)
    d, columns = KINEMATICS[kinematics]
    size = int(d * columns)
    plane_stress = kinematics == "plane_stress"
    kind = wp.float32 if single else wp.float64
    zero, half, tiny = f64(0.0), f64(0.5), f64(1e-14)

    @wp.kernel(module="unique", enable_backward=False)
    def points(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        rows: wp.array2d(dtype=f64),
        pressure: wp.array2d(dtype=f64),
        volumes: wp.array2d(dtype=f64),
        thickness: wp.array2d(dtype=f64),
        want_tangent: int,
        P: wp.array3d(dtype=f64),
        A: wp.array4d(dtype=kind),
        H: wp.array3d(dtype=f64),
        J: wp.array2d(dtype=f64),
        W: wp.array2d(dtype=f64),
    ):
        c, g = wp.tid()
        row = rows[c]
        F = deformation(u, cells, E, c, g, thickness[c, g])
        if wp.static(plane_stress):
            stretch = F[2, 2]
            change = stretch
            step = int(0)
            while step < wp.static(THICKNESS_STEPS) and wp.abs(change) > tiny * stretch:
                F[2, 2] = stretch
                P33 = stress_of(F, row)
                A33 = tangent_of(F, row)
                for m in range(size):
                    H[c, g, m] = A33[place(m), 8] / A33[8, 8]
                change = wp.clamp(-P33[2, 2] / A33[8, 8], -half * stretch, stretch)
                stretch += change
                step += 1
            F[2, 2] = stretch
            thickness[c, g] = stretch
        volume = wp.determinant(F)
        J[c, g] = volume
        stress = stress_of(F, row)
        area = cofactor(F)
        W[c, g] = energy_of(F, row)
        if wp.static(mixed):
            stress += pressure[c, g] * area
            for m in range(size):
                at = place(m)
                H[c, g, m] = wp.where(at >= 0, area[wp.max(at, 0) // 3, wp.max(at, 0) % 3], zero)
        for m in range(size):
            at = place(m)
            P[c, g, m] = wp.where(at >= 0, stress[wp.max(at, 0) // 3, wp.max(at, 0) % 3], zero)
        if want_tangent == 1:
            whole = tangent_of(F, row)
            if wp.static(mixed):
                whole = add_pressure(whole, F, pressure[c, g], zero)
            for m in range(size):
                at = place(m)
                for n in range(size):
                    to = place(n)
                    value = f64(0.0)
                    if at >= 0 and to >= 0:
                        value = whole[at, to]
                        if wp.static(plane_stress):  # P_33 = 0 holds the thickness
                            value -= whole[at, 8] * whole[8, to] / whole[8, 8]
                    A[c, g, m, n] = kind(value * volumes[c, g])

    return points


@cache
def volume_kernel(kinematics: str) -> Any:
    """J at every Gauss point."""
    deformation = deformation_function(kinematics)
    one = f64(1.0)

    @wp.kernel(module="unique", enable_backward=False)
    def volumes(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        J: wp.array2d(dtype=f64),
    ):
        c, g = wp.tid()
        J[c, g] = wp.determinant(deformation(u, cells, E, c, g, one))

    return volumes


@cache
def stress_kernel(stress_of: Any, kinematics: str) -> Any:
    """P at every Gauss point, each with a row of its own: the reverse of this kernel gives dP/drow."""
    deformation = deformation_function(kinematics)

    @wp.kernel(module="unique", enable_backward=False)
    def deformations(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        thickness: wp.array2d(dtype=f64),
        F: wp.array2d(dtype=mat33),
    ):
        c, g = wp.tid()
        F[c, g] = deformation(u, cells, E, c, g, thickness[c, g])

    @wp.kernel(module="unique")
    def stresses(F: wp.array(dtype=mat33), rows: wp.array2d(dtype=f64), P: wp.array2d(dtype=f64)):
        g = wp.tid()
        stress = stress_of(F[g], rows[g])
        for m in range(9):
            P[g, m] = stress[m // 3, m % 3]

    return deformations, stresses
