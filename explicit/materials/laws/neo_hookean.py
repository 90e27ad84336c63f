"""The neo-Hookean law W = mu/2 (I1_bar - 3) (Treloar 1943)."""

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
class NeoHookean(InvariantLaw):
    """One constant; the same stiffness at any strain in simple shear."""

    NAME: ClassVar[str] = "neo_hookean"
    FORMULA: ClassVar[str] = r"\frac\mu2 (\bar I_1 - 3)"
    MODULUS: ClassVar[str] = r"\mu"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("mu", "Pa", 0.0, np.inf, 25e3, "shear modulus", strict=True),
    )

    mu: float
    """Shear modulus [Pa]."""

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        return np.asarray(0.5 * self.mu * (np.asarray(I1) - 3.0))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        zero = np.zeros(np.shape(I1))
        return zero + 0.5 * self.mu, zero

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        zero = np.zeros(np.shape(I1))
        return zero, zero, zero

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero, half = real(0.0), real(0.5)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            return half * row[0], zero

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            return zero, zero, zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return half * row[0] * x

        return slopes, curvatures, energy
