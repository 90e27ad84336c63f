"""The one-point axisymmetric quadrilateral as small Warp functions: corner forces, step bound, energy.

All drivers use this scalar source. It does not depend on batches, lanes and devices.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

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
from explicit.mesh import Mesh, element_geometry
from explicit.precision import Precision


@dataclass(frozen=True)
class OnePoint:
    """The "one_point" element: one stress point and hourglass control."""

    name: str = "one_point"

    def functions(
        self, law: type, precision: Precision, bound: str = "trace", volumetric: str = "quadratic"
    ) -> ElementFunctions:
        """See `explicit.elements.base.Element.functions`."""
        return element_functions(law, precision, bound, volumetric)

    def shapes(self, mesh: Mesh, density: float, dtype: np.dtype[Any]) -> NDArray[Any]:
        """See `explicit.elements.base.Element.shapes`; the constants are those of `explicit.mesh`."""
        geometry = element_geometry(mesh)
        shapes = np.zeros(mesh.n_elements, dtype=dtype)
        for field in ("volume", "gradient_r", "gradient_y", "hoop", "gamma", "hourglass_r", "hourglass_y"):
            shapes[field] = getattr(geometry, field)
        for way in ("r", "y"):
            pattern = getattr(geometry, f"hourglass_{way}")
            shapes[f"impedance_{way}"] = np.sqrt(pattern * density * geometry.volume)
        radial, axial = corner_inverse_mass(mesh, density, geometry.corner_volume)
        shapes["inverse_mass_r"], shapes["inverse_mass_y"] = radial, axial
        return shapes


@cache
def element_functions(law: type, precision: Precision, bound: str, volumetric: str) -> ElementFunctions:
    """Generate the element for a material law (a class with `kernel_functions`) and a precision."""
    law_stress, law_tangent, law_energy = law.kernel_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, three = real(0.0), real(0.5), real(1.0), real(2.0), real(3.0)
    third = real(1.0 / 3.0)
    inverted = real(INVERTED)
    isochoric_factor = isochoric_factor_function(precision)
    gradient_bounds = gradient_bounds_function(precision, bound)
    shear_bound = shear_bound_function(law_tangent, precision)
    volume_law = volumetric_functions(volumetric, precision)
    volume_pressure, volume_energy = volume_law.pressure, volume_law.energy
    volume_rank_one = volume_law.rank_one
    Solid = solid_struct(precision)

    @wp.struct
    class Shape:
        gradient_r: vec4
        gradient_y: vec4
        hoop: vec4
        gamma: vec4
        inverse_mass_r: vec4
        inverse_mass_y: vec4
        volume: real
        hourglass_r: real
        hourglass_y: real
        impedance_r: real
        impedance_y: real

    four, number, four_if = entries_function(real), entry_function(real), entries_if_function(real)

    @wp.func
    def read_shape(constants: wp.array2d(dtype=real), e: int, measure: int):
        sizes = four(constants, 24, e)
        return Shape(
            four(constants, 0, e),
            four(constants, 4, e),
            four(constants, 8, e),
            four(constants, 12, e),
            four_if(measure, constants, 16, e),
            four_if(measure, constants, 20, e),
            sizes[0],
            sizes[1],
            sizes[2],
            sizes[3],
            number(constants, 28, e),
        )

    @wp.func
    def pattern_viscosity(shape: Shape, solid: Solid):
        """Viscosities of the two hourglass patterns [N s/m]: stiffness-proportional damping plus viscous
        control."""
        radial = shape.hourglass_r * solid.hourglass_viscosity + shape.impedance_r * solid.hourglass_impedance
        axial = shape.hourglass_y * solid.hourglass_viscosity + shape.impedance_y * solid.hourglass_impedance
        return radial, axial

    @wp.func
    def twice_the_tangent(
        rr: real,
        yy: real,
        ry: real,
        tt: real,
        row: wp.array(dtype=real),
        solid: Solid,
        jacobian: real,
        dilatation: real,
    ):
        return two * solid.scale * law_tangent(rr, yy, ry, tt, row)

    @wp.func
    def shear_and_pressure(
        rr: real,
        yy: real,
        ry: real,
        tt: real,
        row: wp.array(dtype=real),
        solid: Solid,
        jacobian: real,
        dilatation: real,
    ):
        """It includes the pressure's work on rotations. The trace bound needs no separate term for it."""
        return (
            solid.scale * shear_bound(rr, yy, ry, tt, row)
            + wp.abs(volume_pressure(solid.bulk, jacobian, dilatation)) * jacobian
        )

    @wp.func
    def tangent_pair(radial: real, axial: real):
        return radial + axial

    @wp.func
    def larger(radial: real, axial: real):
        return wp.max(radial, axial)

    shear_of, spread_of = {
        "trace": (twice_the_tangent, tangent_pair),
        "eigenvalue": (shear_and_pressure, larger),
    }[bound]

    @wp.func
    def step_bound(
        shape: Shape,
        solid: Solid,
        b_r: vec4,
        b_y: vec4,
        c: vec4,
        jacobian: real,
        dilatation: real,
        shear: real,
    ):
        # The volumetric part has rank one, so its bound is sharp. The bound of |grad v|^2 limits the other
        # parts.
        rank_one, hourglass, dissipated = real(0.0), real(0.0), real(0.0)
        viscous_r, viscous_y = pattern_viscosity(shape, solid)
        for a in range(4):
            w_r, w_y = shape.inverse_mass_r[a], shape.inverse_mass_y[a]
            dilating = b_r[a] + c[a]
            rank_one += w_r * dilating * dilating + w_y * b_y[a] * b_y[a]
            squared = shape.gamma[a] * shape.gamma[a]
            hourglass += squared * (w_r * shape.hourglass_r + w_y * shape.hourglass_y)
            dissipated += squared * (w_r * viscous_r + w_y * viscous_y)
        radial, axial = gradient_bounds(shape.inverse_mass_r, shape.inverse_mass_y, b_r, b_y, c)
        spread = spread_of(radial, axial)
        bulk = volume_rank_one(solid.bulk, jacobian, dilatation)
        stiff = shape.volume * (bulk * rank_one + shear * spread)
        stiff += solid.hourglass * hourglass
        viscous = solid.bulk_viscosity * rank_one + two * solid.shear_viscosity * spread
        damp = shape.volume * jacobian * viscous
        damp += dissipated + solid.mass_damping
        # dt <= (2 / omega) (sqrt(1 + xi^2) - xi) with xi = damp / (2 omega); returned is the omega^2
        # of an undamped element with the same limit.
        xi = half * damp / wp.sqrt(stiff)
        factor = wp.sqrt(one + xi * xi) + xi
        return stiff * factor * factor

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
        h11, h12 = wp.dot(ur, shape.gradient_r), wp.dot(ur, shape.gradient_y)
        h21, h22 = wp.dot(uy, shape.gradient_r), wp.dot(uy, shape.gradient_y)
        h33 = wp.dot(ur, shape.hoop)
        k11, k12 = wp.dot(vr, shape.gradient_r), wp.dot(vr, shape.gradient_y)
        k21, k22 = wp.dot(vy, shape.gradient_r), wp.dot(vy, shape.gradient_y)
        k33 = wp.dot(vr, shape.hoop)
        q_r, q_y = wp.dot(shape.gamma, ur), wp.dot(shape.gamma, uy)
        p_r, p_y = wp.dot(shape.gamma, vr), wp.dot(shape.gamma, vy)
        # Hourglass control: stiffness and viscosity of the modes without strain at the stress point.
        viscous_r, viscous_y = pattern_viscosity(shape, solid)
        g_r = shape.hourglass_r * solid.hourglass * q_r + viscous_r * p_r
        g_y = shape.hourglass_y * solid.hourglass * q_y + viscous_y * p_y
        artificial = viscous_r * p_r * p_r + viscous_y * p_y * p_y
        # J - 1 from the displacement gradient has no cancellation; K multiplies it.
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        jacobian = one + dilatation
        omega_squared = real(0.0)
        if jacobian <= zero or plane <= -one:  # inverted: forces as in the undeformed element
            omega_squared = real(inverted)
            h11, h12, h21, h22, h33 = zero, zero, zero, zero, zero
            plane, dilatation, jacobian = zero, zero, one
        f11, f22, f33 = one + h11, one + h22, one + h33
        iso, inverse = isochoric_factor(jacobian, dilatation)
        rr = iso * (f11 * f11 + h12 * h12)
        yy = iso * (f22 * f22 + h21 * h21)
        ry = iso * (f11 * h21 + h12 * f22)
        tt = iso * f33 * f33
        tau = law_stress(rr, yy, ry, tt, row)
        # The inverse of F and the velocity gradient, from the rates of F.
        area = f33 * inverse
        i11, i12, i21, i22 = f22 * area, -h12 * area, -h21 * area, f11 * area
        i33 = (one + plane) * inverse
        d11, d22 = k11 * i11 + k12 * i21, k21 * i12 + k22 * i22
        d33 = k33 * i33
        d12 = half * (k11 * i12 + k12 * i22 + k21 * i11 + k22 * i21)
        # The damping stress 2 eta dev D + zeta tr D.
        rate = d11 + d22 + d33
        eta = two * solid.shear_viscosity * jacobian
        pressure_rate = solid.bulk_viscosity * jacobian * rate
        s11 = eta * (d11 - rate * third) + pressure_rate
        s22 = eta * (d22 - rate * third) + pressure_rate
        s33 = eta * (d33 - rate * third) + pressure_rate
        s12 = eta * d12
        pressure = volume_pressure(solid.bulk, jacobian, dilatation) * jacobian
        t11 = solid.scale * tau[0] + pressure + s11
        t22 = solid.scale * tau[1] + pressure + s22
        t12 = solid.scale * tau[2] + s12
        t33 = solid.scale * tau[3] + pressure + s33
        # Corner forces from the first Piola-Kirchhoff stress, with gradients in the reference configuration.
        volume = shape.volume
        w11, w12, w22 = volume * t11, volume * t12, volume * t22
        f_r = (w11 * i11 + w12 * i12) * shape.gradient_r + (w11 * i21 + w12 * i22) * shape.gradient_y
        f_r += (volume * t33 * i33) * shape.hoop + g_r * shape.gamma
        f_y = (w12 * i11 + w22 * i12) * shape.gradient_r + (w12 * i21 + w22 * i22) * shape.gradient_y
        f_y += g_y * shape.gamma
        power = volume * (s11 * d11 + s22 * d22 + s33 * d33 + two * s12 * d12)
        if measure == 1 and omega_squared == zero:
            shear = shear_of(rr, yy, ry, tt, row, solid, jacobian, dilatation)
            b_r = i11 * shape.gradient_r + i21 * shape.gradient_y
            b_y = i12 * shape.gradient_r + i22 * shape.gradient_y
            c = i33 * shape.hoop
            omega_squared = step_bound(shape, solid, b_r, b_y, c, jacobian, dilatation, shear)
        return f_r, f_y, omega_squared, power, artificial

    @wp.func
    def energies(shape: Shape, solid: Solid, row: wp.array(dtype=real), ur: vec4, uy: vec4):
        h11, h12 = wp.dot(ur, shape.gradient_r), wp.dot(ur, shape.gradient_y)
        h21, h22 = wp.dot(uy, shape.gradient_r), wp.dot(uy, shape.gradient_y)
        h33 = wp.dot(ur, shape.hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        f11, f22, f33 = one + h11, one + h22, one + h33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        rr = iso * (f11 * f11 + h12 * h12)
        yy = iso * (f22 * f22 + h21 * h21)
        tt = iso * f33 * f33
        isochoric = law_energy(rr, yy, iso * (f11 * h21 + h12 * f22), tt, row)
        volumetric_energy = volume_energy(solid.bulk, one + dilatation, dilatation)
        elastic = shape.volume * (solid.scale * isochoric + volumetric_energy)
        q_r, q_y = wp.dot(shape.gamma, ur), wp.dot(shape.gamma, uy)
        hourglass = half * solid.hourglass * (shape.hourglass_r * q_r * q_r + shape.hourglass_y * q_y * q_y)
        measure = wp.sqrt(wp.max(rr + yy + tt - three, zero))
        return elastic, hourglass, measure

    @wp.func
    def strains(shape: Shape, ur: vec4, uy: vec4):
        h11, h12 = wp.dot(ur, shape.gradient_r), wp.dot(ur, shape.gradient_y)
        h21, h22 = wp.dot(uy, shape.gradient_r), wp.dot(uy, shape.gradient_y)
        h33 = wp.dot(ur, shape.hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        f11, f22, f33 = one + h11, one + h22, one + h33
        squared = f11 * f11 + h12 * h12 + f22 * f22 + h21 * h21 + f33 * f33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        return one + wp.min(dilatation, plane), wp.sqrt(wp.max(iso * squared - three, zero))

    @wp.func
    def stress_point(shape: Shape, g: int):
        return shape.volume, shape.gradient_r, shape.gradient_y, shape.hoop

    return ElementFunctions(
        Shape=Shape, read_shape=read_shape, Solid=Solid, forces=forces, energies=energies, strains=strains,
        stress_point=stress_point, n_points=1,
    )  # fmt: skip
