"""Laws that stiffen: chains of finite length, and exponentials of soft tissue.

Arruda and Boyce's (1993) eight chains are a series of five terms, W = mu sum_i c_i / lam_m^(2i-2) (I1_bar^i -
3^i). Its c = 1/2, 1/20, 11/1050, 19/7000, 519/673750 are those of the inverse Langevin function's series.
Near the locking stretch lam_m the series is softer than the function. Gent's (1996) W = -mu Jm / 2 ln(1 -
(I1_bar - 3) / Jm) locks at I1_bar = 3 + Jm. Humphrey and Yin's (1987) law is C1 (exp(k (I1_bar - 3)) - 1).
Veronda and Westmann (1970) subtract C1 k / 2 (I2_bar - 3) from it.
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
    """Shear modulus of chains that are far from their locking stretch [Pa]."""
    lambda_m: float
    """Locking stretch of the chains [-]."""

    @property
    def factors(self) -> FloatArray:
        """mu c_i / lam_m^(2i-2) [Pa], shape [5]."""
        return np.asarray(self.mu * SERIES / self.lambda_m ** (2.0 * np.arange(5)))

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        first = np.asarray(I1, dtype=float)
        return np.asarray(sum(a * (first**i - 3.0**i) for i, a in enumerate(self.factors, start=1)))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        first = np.asarray(I1, dtype=float)
        slope = sum(i * a * first ** (i - 1) for i, a in enumerate(self.factors, start=1))
        return np.asarray(slope), np.zeros(first.shape)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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
            # I^i - 3^i is x times a polynomial, which is accurate near rest.
            I = x + three
            third = row[2] * (nine + I * (three + I))
            fourth = row[3] * (n27 + I * (nine + I * (three + I)))
            fifth = row[4] * (n81 + I * (n27 + I * (nine + I * (three + I))))
            return x * (row[0] + row[1] * (three + I) + third + fourth + fifth)

        return slopes, curvatures, energy


@dataclass(frozen=True)
class Gent(InvariantLaw):
    """Two constants. Beyond locking the law is not defined, and stress and energy are NaN. A simulation
    beyond locking diverges, or ends as TABLE_EXCEEDED if `explicit.Model.past_data` is set to stop it."""

    NAME: ClassVar[str] = "gent"
    FORMULA: ClassVar[str] = r"-\frac{\mu J_m}{2} \ln\left(1 - \frac{x}{J_m}\right)"
    MODULUS: ClassVar[str] = r"\mu"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("mu", "Pa", 0.0, np.inf, 25e3, "initial shear modulus", strict=True),
        ParameterSpec("Jm", "1", 0.01, np.inf, 30.0, "I1_bar - 3 at which the law locks", strict=True),
    )

    mu: float
    """Initial shear modulus [Pa]."""
    Jm: float
    """I1_bar - 3 where the law locks [-]."""

    @property
    def data_limit(self) -> float:
        """s at the end of the data, or at locking, sqrt(Jm) [-]."""
        return min(self.fitted_s, float(np.sqrt(self.Jm)))

    def _room(self, I1: ArrayLike) -> FloatArray:
        """Jm - (I1 - 3), NaN beyond locking."""
        room = self.Jm - (np.asarray(I1, dtype=float) - 3.0)
        return np.where(room > 0.0, room, np.nan)

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """See `explicit.materials.families.InvariantLaw`; NaN past locking."""
        return np.asarray(-0.5 * self.mu * self.Jm * np.log(self._room(I1) / self.Jm))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`; NaN past locking."""
        room = self._room(I1)
        return np.asarray(0.5 * self.mu * self.Jm / room), np.zeros(room.shape)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.families.InvariantLaw`; NaN past locking."""
        room = self._room(I1)
        zero = np.zeros(room.shape)
        return np.asarray(0.5 * self.mu * self.Jm / room**2), zero, zero

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp functions of (I1_bar - 3, I2_bar - 3, row)."""
        real = precision.real
        zero, half, nowhere = real(0.0), real(0.5), real(float("nan"))

        @wp.func
        def room_of(x: real, row: wp.array(dtype=real)):
            room = row[1] - x
            if room <= zero:
                room = nowhere
            return room

        @wp.func
        def slopes(x: real, y: real, row: wp.array(dtype=real)):
            return half * row[0] * row[1] / room_of(x, row), zero

        @wp.func
        def curvatures(x: real, y: real, row: wp.array(dtype=real)):
            room = room_of(x, row)
            return half * row[0] * row[1] / (room * room), zero, zero

        @wp.func
        def energy(x: real, y: real, row: wp.array(dtype=real)):
            return -half * row[0] * row[1] * wp.log(room_of(x, row) / row[1])

        return slopes, curvatures, energy


LEAST_EXPONENT = 0.14
"""Smallest exponent. At 0.12 the energy of Veronda and Westmann is negative in equibiaxial tension."""


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
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self._C1 * (np.expm1(self._k * x) - self.SHARE * self._k * y))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        x = np.asarray(I1) - 3.0
        scale = self._C1 * self._k
        return np.asarray(scale * np.exp(self._k * x)), np.full(np.shape(x), -self.SHARE * scale)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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
