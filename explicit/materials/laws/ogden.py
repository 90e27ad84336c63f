r"""Ogden's law of one to three terms (Ogden 1972).

W = sum_p 2 mu_p / alpha_p^2 (lam_1^alpha_p + lam_2^alpha_p + lam_3^alpha_p - 3). Hence mu_0 is the sum of the
mu_p. In Ogden's paper the factor before the bracket is mu_p / alpha_p; `from_classical` converts these
constants. A term with mu_p > 0 is positive for any alpha_p, because the mean of the powers is at least the
root of their product, 1.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.families import StretchLaw, curvature_functions
from explicit.materials.law import ParameterSpec
from explicit.precision import Precision

LEAST_EXPONENT = 1e-3
"""Smallest |alpha_p| [-]: at 0 the term is not defined."""
NARROW = 0.3
"""Below this half difference of max(1, |alpha| / 2) ln b a series gives the quotient of Eq. (L.7)."""


def _specs(terms: int) -> tuple[ParameterSpec, ...]:
    examples = ((20e3, 1.8), (4e3, 4.5), (1e3, -2.0))
    specs: list[ParameterSpec] = []
    for p, (mu, alpha) in enumerate(examples[:terms], start=1):
        specs.append(ParameterSpec(f"mu{p}", "Pa", 0.0, np.inf, mu, f"share {p} of the shear modulus"))
        specs.append(ParameterSpec(f"alpha{p}", "1", -40.0, 40.0, alpha, f"exponent {p}, not 0", strict=True))
    return tuple(specs)


class _Ogden(StretchLaw):
    FORMULA: ClassVar[str] = (
        r"\sum_p \frac{2\mu_p}{\alpha_p^2} \left(\sum_i \bar\lambda_i^{\alpha_p} - 3\right)"
    )
    MODULUS: ClassVar[str] = r"\sum_p \mu_p"
    TERMS: ClassVar[int]

    def __post_init__(self) -> None:
        _, exponents = self.terms
        if (np.abs(exponents) < LEAST_EXPONENT).any():
            worst = exponents[np.abs(exponents) < LEAST_EXPONENT][0]
            raise ValueError(
                f"{self.NAME}: |alpha| must be >= {LEAST_EXPONENT}, got {worst:g}: leave the term out, or "
                "fit with fewer terms"
            )
        super().__post_init__()

    @property
    def terms(self) -> tuple[FloatArray, FloatArray]:
        """(mu_p [Pa], alpha_p [-]), each of shape [n_terms]."""
        mu, alpha = self.constants().reshape(-1, 2).T
        return mu, alpha

    @classmethod
    def from_classical(cls, mu: ArrayLike, alpha: ArrayLike) -> Self:
        """The law sum_p mu_p / alpha_p (sum_i lam_i^alpha_p - 3) with Ogden's own constants, shape
        [n_terms]."""
        moduli, exponents = np.atleast_1d(np.asarray(mu, float)), np.atleast_1d(np.asarray(alpha, float))
        if len(moduli) != cls.TERMS or len(exponents) != cls.TERMS:
            raise ValueError(
                f"{cls.NAME} has {cls.TERMS} terms, got {len(moduli)} moduli and {len(exponents)} exponents"
            )
        return cls.of(np.column_stack([moduli * exponents / 2.0, exponents]))

    def w(self, lam: FloatArray) -> FloatArray:
        mu, alpha = self.terms
        power = np.expm1(alpha * np.log(np.asarray(lam, dtype=float))[..., None])
        return np.asarray((2.0 * mu / alpha**2 * power).sum(axis=-1))

    def dw(self, lam: FloatArray) -> FloatArray:
        mu, alpha = self.terms
        return np.asarray((2.0 * mu / alpha * np.asarray(lam)[..., None] ** (alpha - 1.0)).sum(axis=-1))

    def d2w(self, lam: FloatArray) -> FloatArray:
        mu, alpha = self.terms
        factor = 2.0 * mu * (alpha - 1.0) / alpha
        return np.asarray((factor * np.asarray(lam)[..., None] ** (alpha - 2.0)).sum(axis=-1))

    def quotient(self, b1: FloatArray, b2: FloatArray) -> FloatArray:
        """See `explicit.materials.families.StretchLaw`: with eta = ln(b_1 / b_2) / 2 each term is
        (b_1 b_2)^((a - 1) / 2) sinh(a eta) / sinh(eta), a = alpha / 2."""
        mu, alpha = self.terms
        a = alpha / 2.0
        log1, log2 = np.log(np.asarray(b1))[..., None], np.log(np.asarray(b2))[..., None]
        eta, middle = 0.5 * (log1 - log2), 0.5 * (log1 + log2)
        ratio = a * _sinhc(a * eta) / _sinhc(eta)
        return np.asarray((2.0 * mu / alpha * np.exp((a - 1.0) * middle) * ratio).sum(axis=-1))

    def parameters(self) -> FloatArray:
        """The kernels' row: 2 mu / alpha, alpha / 2, 2 mu and 2 mu / alpha^2 of each term."""
        mu, alpha = self.terms
        return np.column_stack([2.0 * mu / alpha, alpha / 2.0, 2.0 * mu, 2.0 * mu / alpha**2]).ravel()

    @classmethod
    def kernel_functions(cls, precision: Precision) -> tuple[Any, Any, Any]:
        return _kernel_functions(cls.TERMS, precision)

    @classmethod
    def stretch_functions(cls, precision: Precision) -> tuple[Any, Any]:
        return _stretch_functions(cls.TERMS, precision)


def _sinhc(x: FloatArray) -> FloatArray:
    safe = np.where(np.abs(x) < 1e-4, 1.0, x)
    return np.where(np.abs(x) < 1e-4, 1.0 + x**2 / 6.0, np.sinh(safe) / safe)


@dataclass(frozen=True)
class Ogden1(_Ogden):
    """One term."""

    NAME: ClassVar[str] = "ogden1"
    TERMS: ClassVar[int] = 1
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = _specs(1)

    mu1: float
    """Shear modulus [Pa]."""
    alpha1: float
    """Exponent [-]."""


@dataclass(frozen=True)
class Ogden2(_Ogden):
    """Two terms."""

    NAME: ClassVar[str] = "ogden2"
    TERMS: ClassVar[int] = 2
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = _specs(2)

    mu1: float
    """Share of the shear modulus [Pa]."""
    alpha1: float
    """Exponent [-]."""
    mu2: float
    """Share of the shear modulus [Pa]."""
    alpha2: float
    """Exponent [-]."""


@dataclass(frozen=True)
class Ogden3(_Ogden):
    """Three terms."""

    NAME: ClassVar[str] = "ogden3"
    TERMS: ClassVar[int] = 3
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = _specs(3)

    mu1: float
    """Share of the shear modulus [Pa]."""
    alpha1: float
    """Exponent [-]."""
    mu2: float
    """Share of the shear modulus [Pa]."""
    alpha2: float
    """Exponent [-]."""
    mu3: float
    """Share of the shear modulus [Pa]."""
    alpha3: float
    """Exponent [-]."""


@cache
def _kernel_functions(n_terms: int, precision: Precision) -> tuple[Any, Any, Any]:
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, three = real(0.0), real(0.5), real(1.0), real(2.0), real(3.0)
    third, ninth = real(1.0 / 3.0), real(1.0 / 9.0)
    s6, s20, s42, s72 = real(1.0 / 6.0), real(1.0 / 20.0), real(1.0 / 42.0), real(1.0 / 72.0)
    narrow, terms = real(NARROW), int(n_terms)
    shared = curvature_functions(precision)
    in_plane, as_tangent, largest_of = shared.in_plane, shared.as_tangent, shared.largest

    @wp.func
    def sinhc(x: real):
        z = x * x
        return one + z * s6 * (one + z * s20 * (one + z * s42 * (one + z * s72)))

    @wp.func
    def quotient(e1: real, e2: real, b1: real, b2: real, eta: real, a: real):
        """(b_1^a - b_2^a) / (b_1 - b_2). The error is that of the series, 1e-15, or a few roundings."""
        value = real(0.0)
        if wp.max(wp.abs(a), one) * eta < narrow:
            value = a * wp.sqrt(e1 * e2 / (b1 * b2)) * sinhc(a * eta) / sinhc(eta)
        else:
            value = (e1 - e2) / (b1 - b2)
        return value

    @wp.func
    def stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        b1, b2 = in_plane(rr, yy, ry, tt)
        l1, l3 = wp.log(b1), wp.log(tt)
        l2 = -(l1 + l3)
        eta, middle = half * (l1 - l2), half * (rr + yy)
        plane, hoop, G = real(0.0), real(0.0), real(0.0)
        for p in range(terms):
            c, a = real(row[4 * p]), real(row[4 * p + 1])
            e1, e2, e3 = wp.exp(a * l1), wp.exp(a * l2), wp.exp(a * l3)
            plane += c * half * (e1 + e2)
            hoop += c * e3
            G += c * quotient(e1, e2, b1, b2, eta, a)
        # Without the mean, the plane has a third of the difference and the hoop twice this.
        level = (plane - hoop) * third
        return vec4(level + G * (rr - middle), level + G * (yy - middle), G * ry, -two * level)

    @wp.func
    def tangent(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        b1, b2 = in_plane(rr, yy, ry, tt)
        l1, l3 = wp.log(b1), wp.log(tt)
        l2 = -(l1 + l3)
        eta = half * (l1 - l2)
        w1, w2, w3, h1, h2, h3, G = zero, zero, zero, zero, zero, zero, zero
        for p in range(terms):
            c, a, m = real(row[4 * p]), real(row[4 * p + 1]), real(row[4 * p + 2])
            e1, e2, e3 = wp.exp(a * l1), wp.exp(a * l2), wp.exp(a * l3)
            w1 += c * e1
            w2 += c * e2
            w3 += c * e3
            h1 += m * e1
            h2 += m * e2
            h3 += m * e3
            G += c * quotient(e1, e2, b1, b2, eta, a)
        # Eq. (L.2), whose H is diagonal, less tau on the diagonal.
        mean, ends = (w1 + w2 + w3) * third, (h1 + h2 + h3) * ninth
        n11 = h1 * third + ends - (w1 - mean)
        n22 = h2 * third + ends - (w2 - mean)
        n33 = h3 * third + ends - (w3 - mean)
        n12, n13, n23 = ends - (h1 + h2) * third, ends - (h1 + h3) * third, ends - (h2 + h3) * third
        most = largest_of(vec4(n11, n22, n33, G), n12, n13, n23, b1, b2, w2 - mean)
        return as_tangent(most, rr, yy, ry, tt)

    @wp.func
    def energy(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        b1, _b2 = in_plane(rr, yy, ry, tt)
        l1, l3 = wp.log(b1), wp.log(tt)
        total = real(0.0)
        for p in range(terms):
            a = real(row[4 * p + 1])
            total += row[4 * p + 3] * (wp.exp(a * l1) + wp.exp(-a * (l1 + l3)) + wp.exp(a * l3) - three)
        return total

    return stress, tangent, energy


@cache
def _stretch_functions(n_terms: int, precision: Precision) -> tuple[Any, Any]:
    real = precision.real
    zero, one, terms = real(0.0), real(1.0), int(n_terms)

    @wp.func
    def slopes(log_b: real, row: wp.array(dtype=real)):
        t, h = zero, zero
        for p in range(terms):
            power = wp.exp(row[4 * p + 1] * log_b)
            t += row[4 * p] * power
            h += row[4 * p + 2] * power
        return t, h

    @wp.func
    def energy(log_b: real, row: wp.array(dtype=real)):
        total = zero
        for p in range(terms):
            total += row[4 * p + 3] * (wp.exp(row[4 * p + 1] * log_b) - one)
        return total

    return slopes, energy
