"""The complete polynomial of second order in both invariants.

W = C10 x + C01 y + C20 x^2 + C11 x y + C02 y^2 with x = I1_bar - 3 and y = I2_bar - 3 (Rivlin and Saunders
1951). With C11 = C02 = 0 it is the Mooney-Rivlin law of three terms that some programs call of second order.
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


@dataclass(frozen=True)
class Polynomial(InvariantLaw):
    """Five constants; mu_0 = 2 (C10 + C01)."""

    NAME: ClassVar[str] = "polynomial"
    FORMULA: ClassVar[str] = r"C_{10} x + C_{01} y + C_{20} x^2 + C_{11} x y + C_{02} y^2"
    MODULUS: ClassVar[str] = r"2(C_{10} + C_{01})"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("C10", "Pa", 0.0, np.inf, 9e3, "factor of I1_bar - 3"),
        ParameterSpec("C01", "Pa", 0.0, np.inf, 3.5e3, "factor of I2_bar - 3"),
        ParameterSpec("C20", "Pa", 0.0, np.inf, 300.0, "factor of (I1_bar - 3)^2"),
        ParameterSpec("C11", "Pa", 0.0, np.inf, 100.0, "factor of (I1_bar - 3)(I2_bar - 3)"),
        ParameterSpec("C02", "Pa", 0.0, np.inf, 30.0, "factor of (I2_bar - 3)^2"),
    )

    C10: float
    """Factor of I1_bar - 3 [Pa]."""
    C01: float
    """Factor of I2_bar - 3 [Pa]."""
    C20: float = 0.0
    """Factor of (I1_bar - 3)^2 [Pa]."""
    C11: float = 0.0
    """Factor of (I1_bar - 3)(I2_bar - 3) [Pa]."""
    C02: float = 0.0
    """Factor of (I2_bar - 3)^2 [Pa]."""

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(x * (self.C10 + self.C20 * x + self.C11 * y) + y * (self.C01 + self.C02 * y))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        first = self.C10 + 2.0 * self.C20 * x + self.C11 * y
        return np.asarray(first), np.asarray(self.C01 + self.C11 * x + 2.0 * self.C02 * y)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        zero = np.zeros(np.broadcast_shapes(np.shape(I1), np.shape(I2)))
        return zero + 2.0 * self.C20, zero + self.C11, zero + 2.0 * self.C02

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        two = real(2.0)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            first = row[0] + two * row[2] * x + row[3] * y
            second = row[1] + row[3] * x + two * row[4] * y
            return first, second

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            return two * row[2], row[3], two * row[4]

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return x * (row[0] + row[2] * x + row[3] * y) + y * (row[1] + row[4] * y)

        return slopes, curvatures, energy
