"""Polynomials in I1_bar: the reduced polynomial of order 2 and Yeoh's law of order 3.

W = C10 x + C20 x^2 + C30 x^3 with x = I1_bar - 3 (Yeoh 1993). Both are one polynomial; that of order 2 has no
C30.
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

_C10 = ParameterSpec("C10", "Pa", 0.0, np.inf, 12.5e3, "half the initial shear modulus", strict=True)
_C20 = ParameterSpec("C20", "Pa", 0.0, np.inf, 300.0, "factor of (I1_bar - 3)^2")
_C30 = ParameterSpec("C30", "Pa", 0.0, np.inf, 20.0, "factor of (I1_bar - 3)^3")


class _Polynomial(InvariantLaw):
    C10: float
    C20: float
    C30: float

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        x = np.asarray(I1) - 3.0
        return np.asarray(x * (self.C10 + x * (self.C20 + x * self.C30)))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x = np.asarray(I1) - 3.0
        return np.asarray(self.C10 + x * (2.0 * self.C20 + x * 3.0 * self.C30)), np.zeros(np.shape(x))

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x = np.asarray(I1) - 3.0
        zero = np.zeros(np.shape(x))
        return np.asarray(2.0 * self.C20 + x * 6.0 * self.C30), zero, zero

    def parameters(self) -> FloatArray:
        """The kernels' row: C10, C20, C30."""
        return np.array([self.C10, self.C20, self.C30])

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero, two, three, six = real(0.0), real(2.0), real(3.0), real(6.0)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] + x * (two * row[1] + x * three * row[2]), zero

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            return two * row[1] + x * six * row[2], zero, zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return x * (row[0] + x * (row[1] + x * row[2]))

        return slopes, curvatures, energy


@dataclass(frozen=True)
class ReducedPolynomial(_Polynomial):
    """The reduced polynomial of order 2; mu_0 = 2 C10."""

    NAME: ClassVar[str] = "reduced_polynomial"
    FORMULA: ClassVar[str] = r"C_{10} x + C_{20} x^2"
    MODULUS: ClassVar[str] = r"2 C_{10}"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (_C10, _C20)

    C10: float
    """Half the initial shear modulus [Pa]."""
    C20: float
    """Factor of (I1_bar - 3)^2 [Pa]."""

    @property
    def C30(self) -> float:  # type: ignore[override]
        """There is none."""
        return 0.0


@dataclass(frozen=True)
class Yeoh(_Polynomial):
    """Yeoh's law of order 3; mu_0 = 2 C10."""

    NAME: ClassVar[str] = "yeoh"
    FORMULA: ClassVar[str] = r"C_{10} x + C_{20} x^2 + C_{30} x^3"
    MODULUS: ClassVar[str] = r"2 C_{10}"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (_C10, _C20, _C30)

    C10: float
    """Half the initial shear modulus [Pa]."""
    C20: float
    """Factor of (I1_bar - 3)^2 [Pa]."""
    C30: float
    """Factor of (I1_bar - 3)^3 [Pa]."""
