"""The Mooney-Rivlin law with its mixed term.

W = C10 (I1_bar - 3) + C01 (I2_bar - 3) + C11 (I1_bar - 3)(I2_bar - 3) (Mooney 1940; Rivlin 1948; with C11 as
in Schumacher and others 2020, Table I).
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
class MooneyRivlin(InvariantLaw):
    """Three constants; mu_0 = 2 (C10 + C01)."""

    NAME: ClassVar[str] = "mooney_rivlin"
    FORMULA: ClassVar[str] = r"C_{10} x + C_{01} y + C_{11} x y"
    MODULUS: ClassVar[str] = r"2(C_{10} + C_{01})"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("C10", "Pa", 0.0, np.inf, 9e3, "factor of I1_bar - 3"),
        ParameterSpec("C01", "Pa", 0.0, np.inf, 3.5e3, "factor of I2_bar - 3"),
        ParameterSpec("C11", "Pa", 0.0, np.inf, 400.0, "factor of (I1_bar - 3)(I2_bar - 3)"),
    )

    C10: float
    """Factor of I1_bar - 3 [Pa]."""
    C01: float
    """Factor of I2_bar - 3 [Pa]."""
    C11: float = 0.0
    """Factor of their product [Pa]."""

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self.C10 * x + self.C01 * y + self.C11 * x * y)

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self.C10 + self.C11 * y), np.asarray(self.C01 + self.C11 * x)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        zero = np.zeros(np.broadcast_shapes(np.shape(I1), np.shape(I2)))
        return zero, zero + self.C11, zero

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero = real(0.0)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] + row[2] * y, row[1] + row[2] * x

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            return zero, row[2], zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return row[0] * x + row[1] * y + row[2] * x * y

        return slopes, curvatures, energy
