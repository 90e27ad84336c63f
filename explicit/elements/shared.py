"""What every element reads of a sample, and how it takes the volume out of a deformation."""

from functools import cache
from typing import Any

import warp as wp

from explicit.places import entry_function
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
def inverse_cube_root_squared(precision: Precision) -> Any:
    """Generate ``f(J, J - 1) -> J^(-2/3)`` [-], the factor that makes b isochoric."""
    real = precision.real
    one, third = real(1.0), real(1.0 / 3.0)
    two_ninths, four_thirds = real(2.0 / 9.0), real(4.0 / 3.0)
    # Two Newton steps from the series are exact to round-off there: error 2e-5 -> 1e-9 -> 1e-18.
    near_one = real(0.05)

    @wp.func
    def inverse_cube_root_squared(jacobian: real, dilatation: real):
        """J^(-2/3); near J = 1, where a nearly incompressible solid lives, by Newton from a series."""
        y = one - dilatation * (third - two_ninths * dilatation)
        if wp.abs(dilatation) < near_one:
            y = y * (four_thirds - third * jacobian * y * y * y)
            y = y * (four_thirds - third * jacobian * y * y * y)
        else:
            y = one / wp.cbrt(jacobian)
        return y * y

    return inverse_cube_root_squared


@cache
def four_numbers(precision: Precision) -> Any:
    """Generate ``f(constants, k, e) -> vec4``: numbers k to k + 3 of element e."""
    real, vec4 = precision.real, precision.vec4
    number = entry_function(real)

    @wp.func
    def four(constants: wp.array2d(dtype=real), k: int, e: int):
        return vec4(
            number(constants, k, e),
            number(constants, k + 1, e),
            number(constants, k + 2, e),
            number(constants, k + 3, e),
        )

    return four
