"""Warp functions of the volumetric energies; `implicit.laws.volumetric` has the formulas."""

from functools import cache
from typing import Any

import warp as wp

f64 = wp.float64


@cache
def volumetric_functions(form: str, start: int) -> tuple[Any, Any]:
    """``(energy, slopes)`` of a form whose constants stand at ``row[start]`` and following: U(J), and the
    pair U'(J), U''(J)."""
    at = int(start)
    half, quarter, one, two = f64(0.5), f64(0.25), f64(1.0), f64(2.0)
    three, five, six = f64(3.0), f64(5.0), f64(6.0)

    @wp.func
    def quadratic_energy(J: f64, row: wp.array(dtype=f64)):
        return half * row[at] * (J - one) * (J - one)

    @wp.func
    def quadratic(J: f64, row: wp.array(dtype=f64)):
        return row[at] * (J - one), row[at]

    @wp.func
    def logarithmic_energy(J: f64, row: wp.array(dtype=f64)):
        return half * row[at] * wp.log(J) * wp.log(J)

    @wp.func
    def logarithmic(J: f64, row: wp.array(dtype=f64)):
        l = wp.log(J)
        return row[at] * l / J, row[at] * (one - l) / (J * J)

    @wp.func
    def simo_taylor_energy(J: f64, row: wp.array(dtype=f64)):
        return quarter * row[at] * ((J - one) * (J + one) - two * wp.log(J))

    @wp.func
    def simo_taylor(J: f64, row: wp.array(dtype=f64)):
        return half * row[at] * (J - one / J), half * row[at] * (one + one / (J * J))

    @wp.func
    def polynomial_energy(J: f64, row: wp.array(dtype=f64)):
        z = (J - one) * (J - one)
        return z * (row[at] + z * (row[at + 1] + z * row[at + 2]))

    @wp.func
    def polynomial(J: f64, row: wp.array(dtype=f64)):
        z = (J - one) * (J - one)
        slope = two * (J - one) * (row[at] + z * (two * row[at + 1] + z * three * row[at + 2]))
        return slope, two * (row[at] + z * (six * row[at + 1] + z * three * five * row[at + 2]))

    return {
        "quadratic": (quadratic_energy, quadratic),
        "logarithmic": (logarithmic_energy, logarithmic),
        "simo_taylor": (simo_taylor_energy, simo_taylor),
        "polynomial": (polynomial_energy, polynomial),
    }[form]
