r"""Arruda and Boyce's eight-chain law in its series of five terms (Arruda and Boyce 1993).

W = mu sum_i c_i / lam_m^(2i-2) (I1_bar^i - 3^i) with c = 1/2, 1/20, 11/1050, 19/7000, 519/673750, the inverse
Langevin function's series. Near the locking stretch lam_m the series is softer than the function.
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

SERIES = np.array([1.0 / 2.0, 1.0 / 20.0, 11.0 / 1050.0, 19.0 / 7000.0, 519.0 / 673750.0])
"""c_i of the inverse Langevin function [-], shape [5]."""


@dataclass(frozen=True)
class ArrudaBoyce(InvariantLaw):
    """Two constants; mu_0 is `mu` times a series in 1 / lam_m^2."""

    NAME: ClassVar[str] = "arruda_boyce"
    FORMULA: ClassVar[str] = r"\mu \sum_{i=1}^5 \frac{c_i}{\lambda_m^{2i-2}} (\bar I_1^i - 3^i)"
    MODULUS: ClassVar[str] = r"\mu\left(1 + \frac{3}{5\lambda_m^2} + \dots\right)"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("mu", "Pa", 0.0, np.inf, 24e3, "shear modulus of long chains", strict=True),
        ParameterSpec("lambda_m", "1", 1.0, np.inf, 3.0, "locking stretch of the chains", strict=True),
    )

    mu: float
    """Shear modulus of chains that are nowhere near their length [Pa]."""
    lambda_m: float
    """Locking stretch of the chains [-]."""

    @property
    def factors(self) -> FloatArray:
        """mu c_i / lam_m^(2i-2) [Pa], shape [5]."""
        return np.asarray(self.mu * SERIES / self.lambda_m ** (2.0 * np.arange(5)))

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`."""
        first = np.asarray(I1, dtype=float)
        return np.asarray(sum(a * (first**i - 3.0**i) for i, a in enumerate(self.factors, start=1)))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        first = np.asarray(I1, dtype=float)
        slope = sum(i * a * first ** (i - 1) for i, a in enumerate(self.factors, start=1))
        return np.asarray(slope), np.zeros(first.shape)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`."""
        first = np.asarray(I1, dtype=float)
        rise = sum(i * (i - 1) * a * first ** (i - 2.0) for i, a in enumerate(self.factors, start=1))
        zero = np.zeros(first.shape)
        return np.asarray(rise), zero, zero

    def parameters(self) -> FloatArray:
        """The kernels' row: `factors`."""
        return self.factors

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero, two, three, four, five = real(0.0), real(2.0), real(3.0), real(4.0), real(5.0)
        six, nine, twelve, twenty = real(6.0), real(9.0), real(12.0), real(20.0)
        n27, n81 = real(27.0), real(81.0)

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            I = x + three
            high = three * row[2] + I * (four * row[3] + I * five * row[4])
            return row[0] + I * (two * row[1] + I * high), zero

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            I = x + three
            return two * row[1] + I * (six * row[2] + I * (twelve * row[3] + I * twenty * row[4])), zero, zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            # I^i - 3^i is x times a polynomial, which keeps its digits near rest.
            I = x + three
            third = row[2] * (nine + I * (three + I))
            fourth = row[3] * (n27 + I * (nine + I * (three + I)))
            fifth = row[4] * (n81 + I * (n27 + I * (nine + I * (three + I))))
            return x * (row[0] + row[1] * (three + I) + third + fourth + fifth)

        return slopes, curvatures, energy
