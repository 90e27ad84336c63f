"""Exponential laws of soft tissue: Humphrey's and that of Veronda and Westmann.

Both have C1 (exp(k (I1_bar - 3)) - 1); Veronda and Westmann (1970) take C1 k / 2 (I2_bar - 3) off it,
Humphrey and Yin (1987) nothing.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.families import InvariantLaw
from explicit.materials.law import ParameterSpec
from explicit.precision import Precision

LEAST_EXPONENT = 0.14
"""Below it the energy of Veronda and Westmann is negative in equibiaxial tension (at 0.12 it is)."""


class _Exponential(InvariantLaw):
    """C1 (exp(k (I1_bar - 3)) - 1) - `SHARE` C1 k (I2_bar - 3)."""

    SHARE: ClassVar[float] = 0.0

    @property
    def _C1(self) -> float:
        return float(self.constants()[0])

    @property
    def _k(self) -> float:
        return float(self.constants()[1])

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self._C1 * (np.expm1(self._k * x) - self.SHARE * self._k * y))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x = np.asarray(I1) - 3.0
        scale = self._C1 * self._k
        return np.asarray(scale * np.exp(self._k * x)), np.full(np.shape(x), -self.SHARE * scale)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x = np.asarray(I1) - 3.0
        zero = np.zeros(np.shape(x))
        return np.asarray(self._C1 * self._k**2 * np.exp(self._k * x)), zero, zero

    def parameters(self) -> FloatArray:
        """The kernels' row: C1, the exponent, and the factor of I2_bar - 3."""
        return np.array([self._C1, self._k, -self.SHARE * self._C1 * self._k])

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero, one = real(0.0), real(1.0)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] * row[1] * wp.exp(row[1] * x), row[2]

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] * row[1] * row[1] * wp.exp(row[1] * x), zero, zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] * (wp.exp(row[1] * x) - one) + row[2] * y

        return slopes, curvatures, energy


@dataclass(frozen=True)
class Humphrey(_Exponential):
    """W = C1 (exp(C2 (I1_bar - 3)) - 1); mu_0 = 2 C1 C2."""

    NAME: ClassVar[str] = "humphrey"
    FORMULA: ClassVar[str] = r"C_1\left(e^{C_2 x} - 1\right)"
    MODULUS: ClassVar[str] = r"2 C_1 C_2"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("C1", "Pa", 0.0, np.inf, 50e3, "factor of the exponential", strict=True),
        ParameterSpec("C2", "1", 1e-6, np.inf, 0.25, "factor of I1_bar - 3 in the exponent", strict=True),
    )

    C1: float
    """Factor of the exponential [Pa]."""
    C2: float
    """Factor of I1_bar - 3 in the exponent [-]."""


@dataclass(frozen=True)
class VerondaWestmann(_Exponential):
    """W = C1 (exp(alpha (I1_bar - 3)) - 1) - C1 alpha / 2 (I2_bar - 3); mu_0 = C1 alpha."""

    NAME: ClassVar[str] = "veronda_westmann"
    FORMULA: ClassVar[str] = r"C_1\left(e^{\alpha x} - 1\right) - \frac{C_1\alpha}{2} y"
    MODULUS: ClassVar[str] = r"C_1\alpha"
    SHARE: ClassVar[float] = 0.5
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("C1", "Pa", 0.0, np.inf, 60e3, "factor of the exponential", strict=True),
        ParameterSpec("alpha", "1", LEAST_EXPONENT, np.inf, 0.4, "factor of I1_bar - 3 in the exponent"),
    )

    C1: float
    """Factor of the exponential [Pa]."""
    alpha: float
    """Factor of I1_bar - 3 in the exponent [-]."""
