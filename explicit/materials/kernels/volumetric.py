"""The Warp functions of the volumetric law, a form each; `explicit.materials.volumetric` has the formulas."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.materials.volumetric import SMALL, checked_form
from explicit.precision import Precision


@dataclass(frozen=True)
class VolumetricFunctions:
    """Warp functions of a form; each takes ``(K, J, J - 1)``."""

    pressure: Any
    """U'(J) [Pa]."""
    stiffness: Any
    """U''(J), not below 0 [Pa]."""
    rank_one: Any
    """J (J U'' + U'): the factor of (tr L)^2 in the second variation, for the stable step [Pa]."""
    energy: Any
    """U(J) [Pa]."""


@cache
def volumetric_functions(form: str, precision: Precision) -> VolumetricFunctions:
    """Generate the functions of a form."""
    return {"quadratic": _quadratic, "logarithmic": _logarithmic, "simo_taylor": _simo_taylor}[
        checked_form(form)
    ](precision)


def _quadratic(precision: Precision) -> VolumetricFunctions:
    real = precision.real
    half, one, two = real(0.5), real(1.0), real(2.0)

    @wp.func
    def pressure(bulk: real, jacobian: real, dilatation: real):
        return bulk * dilatation

    @wp.func
    def stiffness(bulk: real, jacobian: real, dilatation: real):
        return bulk

    @wp.func
    def rank_one(bulk: real, jacobian: real, dilatation: real):
        return bulk * jacobian * wp.max(two * jacobian - one, half)

    @wp.func
    def energy(bulk: real, jacobian: real, dilatation: real):
        return half * bulk * dilatation * dilatation

    return VolumetricFunctions(pressure, stiffness, rank_one, energy)


@cache
def _logarithm_function(precision: Precision) -> Any:
    real = precision.real
    one = real(1.0)

    @wp.func
    def logarithm(jacobian: real, dilatation: real):
        """ln J with the digits of J - 1: what rounding J loses cancels in the quotient."""
        value = real(dilatation)
        if jacobian != one:
            value = dilatation * (wp.log(jacobian) / (jacobian - one))
        return value

    return logarithm


def _logarithmic(precision: Precision) -> VolumetricFunctions:
    real, logarithm = precision.real, _logarithm_function(precision)
    zero, half, one = real(0.0), real(0.5), real(1.0)

    @wp.func
    def pressure(bulk: real, jacobian: real, dilatation: real):
        return bulk * logarithm(jacobian, dilatation) / jacobian

    @wp.func
    def stiffness(bulk: real, jacobian: real, dilatation: real):
        return wp.max(bulk * (one - wp.log(jacobian)), zero) / (jacobian * jacobian)

    @wp.func
    def rank_one(bulk: real, jacobian: real, dilatation: real):
        return bulk

    @wp.func
    def energy(bulk: real, jacobian: real, dilatation: real):
        strain = logarithm(jacobian, dilatation)
        return half * bulk * strain * strain

    return VolumetricFunctions(pressure, stiffness, rank_one, energy)


def _simo_taylor(precision: Precision) -> VolumetricFunctions:
    real = precision.real
    quarter, half, one, two, small = real(0.25), real(0.5), real(1.0), real(2.0), real(SMALL)
    c3, c5, c6, c7 = real(2.0 / 3.0), real(2.0 / 5.0), real(1.0 / 3.0), real(2.0 / 7.0)

    @wp.func
    def pressure(bulk: real, jacobian: real, dilatation: real):
        return half * bulk * dilatation * (one + jacobian) / jacobian

    @wp.func
    def stiffness(bulk: real, jacobian: real, dilatation: real):
        return half * bulk * (one + one / (jacobian * jacobian))

    @wp.func
    def rank_one(bulk: real, jacobian: real, dilatation: real):
        return bulk * jacobian * jacobian

    @wp.func
    def energy(bulk: real, jacobian: real, dilatation: real):
        d = dilatation
        value = d * d * (two - d * (c3 - d * (half - d * (c5 - d * (c6 - d * c7)))))
        if wp.abs(d) > small:
            value = d * (two + d) - two * wp.log(jacobian)
        return quarter * bulk * value

    return VolumetricFunctions(pressure, stiffness, rank_one, energy)
