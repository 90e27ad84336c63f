"""The volumetric law in three common forms, and its Warp functions.

    "quadratic"      U = K/2 (J - 1)^2               (Sussman and Bathe 1987)
    "logarithmic"    U = K/2 (ln J)^2                (Simo, Taylor and Pister 1985)
    "simo_taylor"    U = K/4 (J^2 - 1 - 2 ln J)      (Simo and Taylor 1991)                   (L.9)

They agree to second order in J - 1. The logarithmic form softens in dilatation and is not convex beyond J =
e.

    K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu)) at rest                                                       (L.10)
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_args

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.precision import Precision

Form = Literal["quadratic", "logarithmic", "simo_taylor"]
"""Names of the forms."""
POISSON_LIMIT = 0.49999
"""Largest Poisson's ratio. A larger one only changes the time step, see `explicit.incompressible`."""
SMALL = 0.02
"""Below this |J - 1| the kernels compute the energy of Simo and Taylor's form by a series."""


@dataclass(frozen=True)
class VolumetricLaw:
    """U(J) and its derivatives, Eq. (L.9)."""

    bulk: float
    """Bulk modulus K [Pa]."""
    form: Form = "quadratic"
    """Name of the form."""

    def __post_init__(self) -> None:
        if not 0.0 < self.bulk < np.inf:
            raise ValueError(f"bulk must be > 0 Pa and finite, got {self.bulk}")
        checked_form(self.form)

    def energy(self, J: ArrayLike) -> FloatArray:
        """U [Pa] of the volume ratio J, shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.asarray(0.5 * self.bulk * (J - 1.0) ** 2)
        if self.form == "logarithmic":
            return np.asarray(0.5 * self.bulk * np.log(J) ** 2)
        return np.asarray(0.25 * self.bulk * ((J - 1.0) * (J + 1.0) - 2.0 * np.log(J)))

    def pressure(self, J: ArrayLike) -> FloatArray:
        """U'(J), the mean Cauchy stress, tension-positive [Pa], shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.asarray(self.bulk * (J - 1.0))
        if self.form == "logarithmic":
            return np.asarray(self.bulk * np.log(J) / J)
        return np.asarray(0.5 * self.bulk * (J - 1.0 / J))

    def stiffness(self, J: ArrayLike) -> FloatArray:
        """U''(J) [Pa], shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.full(J.shape, self.bulk)
        if self.form == "logarithmic":
            return np.asarray(self.bulk * (1.0 - np.log(J)) / J**2)
        return np.asarray(0.5 * self.bulk * (1.0 + 1.0 / J**2))


def checked_form(form: str) -> str:
    """The name of a form."""
    if form not in get_args(Form):
        raise ValueError(f"volumetric must be one of {sorted(get_args(Form))}, got {form!r}")
    return form


def bulk_modulus(shear_modulus: FloatArray | float, poisson: FloatArray | float) -> FloatArray:
    """Bulk modulus of the initial state, K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu)) [Pa].

    Raises
    ------
    ValueError
        If a Poisson ratio is outside [0, 0.49999].
    """
    nu = np.asarray(poisson, dtype=float)
    if not ((nu >= 0.0) & (nu <= POISSON_LIMIT)).all():
        worst = nu[~((nu >= 0.0) & (nu <= POISSON_LIMIT))].flat[0]
        raise ValueError(
            f"poisson must be in [0, {POISSON_LIMIT}], got {worst}: an explicit run needs slight "
            "compressibility; 0.499 stands for an incompressible elastomer"
        )
    return 2.0 * np.asarray(shear_modulus) * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))


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
        """ln J to the accuracy of J - 1: the rounding error of J cancels in the quotient."""
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
