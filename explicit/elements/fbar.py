"""The fully integrated axisymmetric quadrilateral with a mean dilatation (F-bar), as small Warp functions.

The forces are the exact gradient of

    W = sum_g w_g U(I1_bar(F_g)) + V K / 2 (J_m - 1)^2,    J_m = (1 / V) sum_g w_g det F_g = v / V

over the 2 x 2 Gauss points. The F of each point gives the isochoric part. F_bar = (J_m / J)^(1/3) F does not
change this part. The volume v of the deformed ring gives the pressure (Nagtegaal, Parks and Rice 1974; Simo,
Taylor and Pister 1985). docs/theory/solver.md explains why J at the centre is not used. Over a full turn (2
pi R dA) the integrands of the weak form are of degree 2 in each local coordinate. Two points in each
direction are therefore exact, also on distorted elements and on the axis.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.elements.base import (
    INVERTED,
    ElementFunctions,
    corner_inverse_mass,
    gradient_bounds_function,
    isochoric_factor_function,
    shear_bound_function,
    solid_struct,
)
from explicit.layout.structs import entries_function, entries_if_function, entry_function
from explicit.materials.volumetric import volumetric_functions
from explicit.mesh import CORNERS, Mesh, bilinear
from explicit.precision import Precision


@dataclass(frozen=True)
class PointFunctions:
    """Warp functions of one of the four stress points."""

    forces: Any
    """``forces(weight, gradient_r, gradient_y, hoop, inverse_mass_r, inverse_mass_y, solid, row, ur, uy, vr,
    vy, measure)``: isochoric and deviatoric viscous forces, gradient of the deformed volume, w (J - 1), the
    smaller of J and its planar part, power, and the bounds of `ElementFunctions.forces`."""
    energy: Any
    """``energy(gradient_r, gradient_y, hoop, row, ur, uy)``: U(I1_bar), I1_bar - 3 and J - 1."""
    strains: Any
    """``strains(gradient_r, gradient_y, hoop, ur, uy)``: the smaller of J and its planar part, I1_bar - 3."""


@cache
def fbar_point_functions(law: type, precision: Precision, bound: str) -> PointFunctions:
    """Generate the functions for a material law and a precision."""
    law_stress, law_tangent, law_energy = law.kernel_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, three = real(0.0), real(0.5), real(1.0), real(2.0), real(3.0)
    third = real(1.0 / 3.0)
    isochoric_factor = isochoric_factor_function(precision)
    gradient_bounds = gradient_bounds_function(precision, bound)
    shear_bound = shear_bound_function(law_tangent, precision)
    Solid = solid_struct(precision)

    @wp.func
    def point(
        weight: real,
        gradient_r: vec4,
        gradient_y: vec4,
        hoop: vec4,
        inverse_mass_r: vec4,
        inverse_mass_y: vec4,
        solid: Solid,
        row: wp.array(dtype=real),
        ur: vec4,
        uy: vec4,
        vr: vec4,
        vy: vec4,
        measure: int,
    ):
        """Returns the isochoric and deviatoric viscous forces, the gradient of the deformed volume, and w (J
        - 1). Also the smaller of J and its planar part, the power, and the bounds of `forces`."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        # J - 1 from the displacement gradient has no cancellation; K multiplies it.
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        jacobian = one + dilatation
        upright = wp.min(jacobian, one + plane)
        f_r, f_y, g_r, g_y = vec4(), vec4(), vec4(), vec4()
        power, bounds = real(0.0), vec4()
        if upright > zero:
            f11, f22, f33 = one + h11, one + h22, one + h33
            iso, inverse = isochoric_factor(jacobian, dilatation)
            rr = iso * (f11 * f11 + h12 * h12)
            yy = iso * (f22 * f22 + h21 * h21)
            ry = iso * (f11 * h21 + h12 * f22)
            tt = iso * f33 * f33
            tau = law_stress(rr, yy, ry, tt, row)
            area = f33 * inverse
            b_r = (f22 * gradient_r - h21 * gradient_y) * area
            b_y = (f11 * gradient_y - h12 * gradient_r) * area
            c = hoop * ((one + plane) * inverse)
            # Velocity gradient and the deviatoric damping stress 2 eta dev D.
            d11, d22, d33 = wp.dot(vr, b_r), wp.dot(vy, b_y), wp.dot(vr, c)
            d12 = half * (wp.dot(vr, b_y) + wp.dot(vy, b_r))
            mean = (d11 + d22 + d33) * third
            eta = two * solid.shear_viscosity * jacobian
            s11, s22, s33, s12 = eta * (d11 - mean), eta * (d22 - mean), eta * (d33 - mean), eta * d12
            t11 = weight * (solid.scale * tau[0] + s11)
            t22 = weight * (solid.scale * tau[1] + s22)
            t12 = weight * (solid.scale * tau[2] + s12)
            t33 = weight * (solid.scale * tau[3] + s33)
            f_r = t11 * b_r + t12 * b_y + t33 * c
            f_y = t12 * b_r + t22 * b_y
            deformed = weight * jacobian
            g_r = deformed * (b_r + c)
            g_y = deformed * b_y
            power = weight * (s11 * d11 + s22 * d22 + s33 * d33 + two * s12 * d12)
            if measure == 1:
                radial, axial = gradient_bounds(inverse_mass_r, inverse_mass_y, b_r, b_y, c)
                shear = weight * solid.scale * shear_bound(rr, yy, ry, tt, row)
                bounds = vec4(shear * radial, shear * axial, deformed * radial, deformed * axial)
        return f_r, f_y, g_r, g_y, weight * dilatation, upright, power, bounds

    @wp.func
    def point_energy(
        gradient_r: vec4, gradient_y: vec4, hoop: vec4, row: wp.array(dtype=real), ur: vec4, uy: vec4
    ):
        """U(I1_bar), I1_bar - 3 and J - 1."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        f11, f22, f33 = one + h11, one + h22, one + h33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        rr = iso * (f11 * f11 + h12 * h12)
        yy = iso * (f22 * f22 + h21 * h21)
        tt = iso * f33 * f33
        return law_energy(rr, yy, iso * (f11 * h21 + h12 * f22), tt, row), rr + yy + tt - three, dilatation

    @wp.func
    def point_strains(gradient_r: vec4, gradient_y: vec4, hoop: vec4, ur: vec4, uy: vec4):
        """The smaller of J and its planar part, and I1_bar - 3."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        f11, f22, f33 = one + h11, one + h22, one + h33
        squared = f11 * f11 + h12 * h12 + f22 * f22 + h21 * h21 + f33 * f33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        return one + wp.min(dilatation, plane), iso * squared - three

    return PointFunctions(point, point_energy, point_strains)


@dataclass(frozen=True)
class GaussPoints:
    """Constants of the four points of every element, point 0 nearest to corner 0 and so on."""

    volume: FloatArray
    """Volume of each point [m^3], shape [n_elements, 4 points]."""
    gradient_r: FloatArray
    """dN/dR of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    gradient_y: FloatArray
    """dN/dY of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    hoop: FloatArray
    """N/R of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    interpolation: FloatArray
    """N of each corner [-], shape [4 points, 4 corners]."""


def gauss_points(mesh: Mesh) -> GaussPoints:
    """Evaluate the shape functions of every element at its Gauss points."""
    corners = mesh.nodes[mesh.quads]
    at_points = [bilinear(xi, eta) for xi, eta in CORNERS / np.sqrt(3.0)]
    shape, local = (np.stack(parts) for parts in zip(*at_points, strict=True))
    jacobian = np.einsum("gai,eaj->egij", local, corners)
    det = np.linalg.det(jacobian)
    if (det <= 0.0).any():
        bad = int(np.argmax((det <= 0.0).any(axis=1)))
        raise ValueError(
            f"element {bad} has Jacobian {det[bad].min():.3g} <= 0: number its corners counter-clockwise"
        )
    slope = np.einsum("egij,gaj->egai", np.linalg.inv(jacobian), local)
    radius = np.einsum("ga,ea->eg", shape, corners[:, :, 0])
    return GaussPoints(
        volume=2.0 * np.pi * radius * det,
        gradient_r=slope[..., 0],
        gradient_y=slope[..., 1],
        hoop=shape[None] / radius[..., None],
        interpolation=shape,
    )


@dataclass(frozen=True)
class FBar:
    """The "fbar" element: four stress points, one volume, no hourglass control."""

    name: str = "fbar"

    def functions(
        self, law: type, precision: Precision, bound: str = "trace", volumetric: str = "quadratic"
    ) -> ElementFunctions:
        """See `explicit.elements.base.Element.functions`."""
        return element_functions(law, precision, bound, volumetric)

    def shapes(self, mesh: Mesh, density: float, dtype: np.dtype[Any]) -> NDArray[Any]:
        """See `explicit.elements.base.Element.shapes`; the constants are `explicit.elements.fbar`'s."""
        points = gauss_points(mesh)
        shapes = np.zeros(mesh.n_elements, dtype=dtype)
        shapes["volume"] = points.volume.sum(axis=1)
        shapes["weight"] = points.volume
        for g in range(4):
            shapes[f"gradient_r{g}"] = points.gradient_r[:, g]
            shapes[f"gradient_y{g}"] = points.gradient_y[:, g]
            shapes[f"hoop{g}"] = points.hoop[:, g]
        radial, axial = corner_inverse_mass(mesh, density, points.volume @ points.interpolation)
        shapes["inverse_mass_r"], shapes["inverse_mass_y"] = radial, axial
        return shapes


@cache
def element_functions(law: type, precision: Precision, bound: str, volumetric: str) -> ElementFunctions:
    """Generate the element for a material law (a class with `kernel_functions`) and a precision."""
    points = fbar_point_functions(law, precision, bound)
    point, point_energy, point_strains = points.forces, points.energy, points.strains
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    inverted = real(INVERTED)
    volume_law = volumetric_functions(volumetric, precision)
    volume_pressure, volume_energy = volume_law.pressure, volume_law.energy
    volume_stiffness = volume_law.stiffness
    Solid = solid_struct(precision)

    @wp.struct
    class Shape:
        weight: vec4
        gradient_r0: vec4
        gradient_r1: vec4
        gradient_r2: vec4
        gradient_r3: vec4
        gradient_y0: vec4
        gradient_y1: vec4
        gradient_y2: vec4
        gradient_y3: vec4
        hoop0: vec4
        hoop1: vec4
        hoop2: vec4
        hoop3: vec4
        inverse_mass_r: vec4
        inverse_mass_y: vec4
        volume: real

    four, number, four_if = entries_function(real), entry_function(real), entries_if_function(real)

    @wp.func
    def read_shape(constants: wp.array2d(dtype=real), e: int, measure: int):
        return Shape(
            four(constants, 0, e),
            four(constants, 4, e),
            four(constants, 8, e),
            four(constants, 12, e),
            four(constants, 16, e),
            four(constants, 20, e),
            four(constants, 24, e),
            four(constants, 28, e),
            four(constants, 32, e),
            four(constants, 36, e),
            four(constants, 40, e),
            four(constants, 44, e),
            four(constants, 48, e),
            four_if(measure, constants, 52, e),
            four_if(measure, constants, 56, e),
            number(constants, 60, e),
        )

    @wp.func
    def forces(
        shape: Shape,
        solid: Solid,
        row: wp.array(dtype=real),
        ur: vec4,
        uy: vec4,
        vr: vec4,
        vy: vec4,
        measure: int,
    ):
        m_r, m_y = shape.inverse_mass_r, shape.inverse_mass_y
        r0, y0, p0, q0, j0, u0, w0, k0 = point(
            shape.weight[0], shape.gradient_r0, shape.gradient_y0, shape.hoop0,
            m_r, m_y, solid, row, ur, uy, vr, vy, measure,
        )  # fmt: skip
        r1, y1, p1, q1, j1, u1, w1, k1 = point(
            shape.weight[1], shape.gradient_r1, shape.gradient_y1, shape.hoop1,
            m_r, m_y, solid, row, ur, uy, vr, vy, measure,
        )  # fmt: skip
        r2, y2, p2, q2, j2, u2, w2, k2 = point(
            shape.weight[2], shape.gradient_r2, shape.gradient_y2, shape.hoop2,
            m_r, m_y, solid, row, ur, uy, vr, vy, measure,
        )  # fmt: skip
        r3, y3, p3, q3, j3, u3, w3, k3 = point(
            shape.weight[3], shape.gradient_r3, shape.gradient_y3, shape.hoop3,
            m_r, m_y, solid, row, ur, uy, vr, vy, measure,
        )  # fmt: skip
        f_r, f_y = vec4(), vec4()
        omega_squared, power = real(inverted), real(0.0)
        # det F is linear over the element: it is positive at the centre if it is positive at the four points.
        if wp.min(wp.min(u0, u1), wp.min(u2, u3)) > zero:
            g_r, g_y = p0 + p1 + p2 + p3, q0 + q1 + q2 + q3
            dilatation = (j0 + j1 + j2 + j3) / shape.volume
            growth = wp.dot(g_r, vr) + wp.dot(g_y, vy)
            viscosity = solid.bulk_viscosity / (shape.volume * (one + dilatation))
            pressure = volume_pressure(solid.bulk, one + dilatation, dilatation)
            total = pressure + viscosity * growth
            f_r = r0 + r1 + r2 + r3 + total * g_r
            f_y = y0 + y1 + y2 + y3 + total * g_y
            power = w0 + w1 + w2 + w3 + viscosity * growth * growth
            omega_squared = real(0.0)
            if measure == 1:
                # The volumetric part has rank one, so its bound is sharp. The bound of |grad v|^2 limits the
                # other parts, also the pressure's work on the second variation of J, -|L|^2 J to 2 |L|^2 J.
                rank_one = real(0.0)
                for a in range(4):
                    rank_one += m_r[a] * g_r[a] * g_r[a] + m_y[a] * g_y[a] * g_y[a]
                bounds = k0 + k1 + k2 + k3
                turning = wp.max(two * pressure, -pressure)
                bulk = volume_stiffness(solid.bulk, one + dilatation, dilatation)
                stiff = bulk / shape.volume * rank_one
                stiff += wp.max(bounds[0] + turning * bounds[2], bounds[1] + turning * bounds[3])
                damp = two * solid.shear_viscosity * wp.max(bounds[2], bounds[3])
                damp += viscosity * rank_one + solid.mass_damping
                # As in the one-point element: the omega^2 of an undamped element with the same limit.
                xi = half * damp / wp.sqrt(stiff)
                factor = wp.sqrt(one + xi * xi) + xi
                omega_squared = stiff * factor * factor
        artificial = real(0.0)
        return f_r, f_y, omega_squared, power, artificial

    @wp.func
    def energies(shape: Shape, solid: Solid, row: wp.array(dtype=real), ur: vec4, uy: vec4):
        e0, i0, j0 = point_energy(shape.gradient_r0, shape.gradient_y0, shape.hoop0, row, ur, uy)
        e1, i1, j1 = point_energy(shape.gradient_r1, shape.gradient_y1, shape.hoop1, row, ur, uy)
        e2, i2, j2 = point_energy(shape.gradient_r2, shape.gradient_y2, shape.hoop2, row, ur, uy)
        e3, i3, j3 = point_energy(shape.gradient_r3, shape.gradient_y3, shape.hoop3, row, ur, uy)
        dilatation = wp.dot(shape.weight, vec4(j0, j1, j2, j3)) / shape.volume
        isochoric = wp.dot(shape.weight, vec4(e0, e1, e2, e3))
        stored = volume_energy(solid.bulk, one + dilatation, dilatation)
        elastic = solid.scale * isochoric + shape.volume * stored
        measure = wp.sqrt(wp.max(wp.max(wp.max(i0, i1), wp.max(i2, i3)), zero))
        hourglass = real(0.0)
        return elastic, hourglass, measure

    @wp.func
    def strains(shape: Shape, ur: vec4, uy: vec4):
        j0, i0 = point_strains(shape.gradient_r0, shape.gradient_y0, shape.hoop0, ur, uy)
        j1, i1 = point_strains(shape.gradient_r1, shape.gradient_y1, shape.hoop1, ur, uy)
        j2, i2 = point_strains(shape.gradient_r2, shape.gradient_y2, shape.hoop2, ur, uy)
        j3, i3 = point_strains(shape.gradient_r3, shape.gradient_y3, shape.hoop3, ur, uy)
        measure = wp.sqrt(wp.max(wp.max(wp.max(i0, i1), wp.max(i2, i3)), zero))
        return wp.min(wp.min(j0, j1), wp.min(j2, j3)), measure

    @wp.func
    def stress_point(shape: Shape, g: int):
        weight, b_r, b_y, c = real(0.0), vec4(), vec4(), vec4()
        if g == 0:
            weight = shape.weight[0]
            b_r = shape.gradient_r0
            b_y = shape.gradient_y0
            c = shape.hoop0
        if g == 1:
            weight = shape.weight[1]
            b_r = shape.gradient_r1
            b_y = shape.gradient_y1
            c = shape.hoop1
        if g == 2:
            weight = shape.weight[2]
            b_r = shape.gradient_r2
            b_y = shape.gradient_y2
            c = shape.hoop2
        if g == 3:
            weight = shape.weight[3]
            b_r = shape.gradient_r3
            b_y = shape.gradient_y3
            c = shape.hoop3
        return weight, b_r, b_y, c

    return ElementFunctions(
        Shape=Shape, read_shape=read_shape, Solid=Solid, forces=forces, energies=energies, strains=strains,
        stress_point=stress_point, n_points=4,
    )  # fmt: skip
