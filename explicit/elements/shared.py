"""What every element reads of a sample, and how it takes the volume out of a deformation."""

from functools import cache
from typing import Any

import warp as wp

from explicit.elements.base import BY_EIGENVALUE
from explicit.precision import Precision


@cache
def solid_struct(precision: Precision) -> Any:
    """Generate the struct of one sample's moduli [Pa], viscosities [Pa s], drag [1/s] and the root of the
    modulus that scales viscous hourglass control [Pa^(1/2)]."""
    real = precision.real

    @wp.struct
    class Solid:
        scale: real
        bulk: real
        hourglass: real
        shear_viscosity: real
        bulk_viscosity: real
        hourglass_viscosity: real
        hourglass_impedance: real
        mass_damping: real

    return Solid


@cache
def isochoric_factor_function(precision: Precision) -> Any:
    """Generate ``f(J, J - 1) -> (J^(-2/3), 1 / J)`` [-], the factor that makes b isochoric, and what comes
    with it for less than a division.

    Near J = 1, where a nearly incompressible solid lives, J^(-1/3) comes from a series in J - 1, corrected by
    the series of (1 - e)^(-1/3) in its own error e.
    """
    real = precision.real
    one, third = real(1.0), real(1.0 / 3.0)
    two_ninths, next_term = real(2.0 / 9.0), real(14.0 / 81.0)
    near_one = real(0.05)  # e is below 7e-5 there, so what the corrected series leaves out is below 1e-17

    @wp.func
    def isochoric_factor(jacobian: real, dilatation: real):
        y = one - dilatation * (third - two_ninths * dilatation)
        e = one - (jacobian * y) * (y * y)
        y = y + (y * e) * (third + e * (two_ninths + e * next_term))
        if wp.abs(dilatation) > near_one:
            y = one / wp.cbrt(jacobian)
        return y * y, y * y * y

    return isochoric_factor


@cache
def gradient_bounds_function(precision: Precision) -> Any:
    """Generate ``f(w_r, w_y, b_r, b_y, c, measure) -> (radial, axial)``: the most that |grad v|^2 can be of
    sum v^2 / w over the corners, in radial and in axial motion, which do not couple [1/(kg m^2)].

    The quadratic form is a sum of squares (b . v)^2 of a few vectors b, and its largest eigenvalue that of
    their Gram matrix. `measure` `BY_TRACE` bounds it by the matrix's trace, `BY_EIGENVALUE` by the largest sum
    of a row's absolute values (Gershgorin), which is the eigenvalue itself where an element is a rectangle
    far from the axis.
    """
    real, vec4 = precision.real, precision.vec4
    by_eigenvalue = int(BY_EIGENVALUE)

    @wp.func
    def gradient_bounds(w_r: vec4, w_y: vec4, b_r: vec4, b_y: vec4, c: vec4, measure: int):
        along, across, around, axial_along, axial_across = real(0.0), real(0.0), real(0.0), real(0.0), real(0.0)
        for a in range(4):
            along += w_r[a] * b_r[a] * b_r[a]
            across += w_r[a] * b_y[a] * b_y[a]
            around += w_r[a] * c[a] * c[a]
            axial_along += w_y[a] * b_r[a] * b_r[a]
            axial_across += w_y[a] * b_y[a] * b_y[a]
        radial, axial = along + across + around, axial_along + axial_across
        if measure == by_eigenvalue:
            rs, rt, st, axial_rs = real(0.0), real(0.0), real(0.0), real(0.0)
            for a in range(4):
                rs += w_r[a] * b_r[a] * b_y[a]
                rt += w_r[a] * b_r[a] * c[a]
                st += w_r[a] * b_y[a] * c[a]
                axial_rs += w_y[a] * b_r[a] * b_y[a]
            rs, rt, st = wp.abs(rs), wp.abs(rt), wp.abs(st)
            rows = wp.max(wp.max(along + rs + rt, across + rs + st), around + rt + st)
            radial = wp.min(radial, rows)
            axial = wp.min(axial, wp.max(axial_along, axial_across) + wp.abs(axial_rs))
        return radial, axial

    return gradient_bounds


@cache
def shear_bound_function(law_tangent: Any, precision: Precision) -> Any:
    """Generate ``f(rr, yy, ry, tt, row)``: the most that the second variation of U(I1_bar) can be of
    |grad v|^2 [Pa].

    It is 2U' [L b L + I1/3 tr L^2 - 4/3 tr L (dev b L) - 2/9 I1 tr^2 L] and a part with U''. The law bounds b
    and the latter; the rest, at its worst in tr L, comes here.
    """
    real = precision.real
    one, two, third, two_thirds = real(1.0), real(2.0), real(1.0 / 3.0), real(2.0 / 3.0)

    @wp.func
    def shear_bound(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        largest = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        factor = one + (mean + two_thirds * squared / mean) / largest
        return factor * law_tangent(rr, yy, ry, tt, row)

    return shear_bound
