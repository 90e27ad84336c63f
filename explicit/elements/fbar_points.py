"""One stress point of the F-bar element: isochoric forces, energy and strain, gradient of the volume."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements.bounds import gradient_bounds_function, shear_bound_function
from explicit.elements.shared import isochoric_factor_function, solid_struct
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
        """Isochoric and deviatoric viscous forces, gradient of the deformed volume, w (J - 1), the smaller
        of J and its planar part, power, and the bounds of `forces`."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        # J - 1 from the displacement gradient keeps its digits where K multiplies it.
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
