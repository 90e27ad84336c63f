"""Parts that elements share: a sample's moduli, and the isochoric part of a deformation."""

from functools import cache
from typing import Any

import warp as wp

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
