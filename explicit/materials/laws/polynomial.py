"""Polynomials in the invariants, with x = I1_bar - 3 and y = I2_bar - 3.

The neo-Hookean law is W = mu/2 x (Treloar 1943). Yeoh's law is W = C10 x + C20 x^2 + C30 x^3 (Yeoh 1993); the
one of order 2 has no C30. Mooney-Rivlin with its mixed term is W = C10 x + C01 y + C11 x y (Mooney 1940;
Rivlin 1948; with C11 as in Schumacher and others 2020, Table I). The complete polynomial of second order is W
= C10 x + C01 y + C20 x^2 + C11 x y + C02 y^2 (Rivlin and Saunders 1951). With C11 = C02 = 0 it is the
Mooney-Rivlin law of three terms, which some programs call the law of second order.
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
class NeoHookean(InvariantLaw):
    """One constant. In simple shear its stiffness is the same at any strain."""

    NAME: ClassVar[str] = "neo_hookean"
    FORMULA: ClassVar[str] = r"\frac\mu2 (\bar I_1 - 3)"
    MODULUS: ClassVar[str] = r"\mu"
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]] = (
        ParameterSpec("mu", "Pa", 0.0, np.inf, 25e3, "shear modulus", strict=True),
    )

    mu: float
    """Shear modulus [Pa]."""

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        return np.asarray(0.5 * self.mu * (np.asarray(I1) - 3.0))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        zero = np.zeros(np.shape(I1))
        return zero + 0.5 * self.mu, zero

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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


_C10 = ParameterSpec("C10", "Pa", 0.0, np.inf, 12.5e3, "half the initial shear modulus", strict=True)
_C20 = ParameterSpec("C20", "Pa", 0.0, np.inf, 300.0, "factor of (I1_bar - 3)^2")
_C30 = ParameterSpec("C30", "Pa", 0.0, np.inf, 20.0, "factor of (I1_bar - 3)^3")


class _Yeoh(InvariantLaw):
    C10: float
    C20: float
    C30: float

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        x = np.asarray(I1) - 3.0
        return np.asarray(x * (self.C10 + x * (self.C20 + x * self.C30)))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        x = np.asarray(I1) - 3.0
        return np.asarray(self.C10 + x * (2.0 * self.C20 + x * 3.0 * self.C30)), np.zeros(np.shape(x))

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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
class ReducedPolynomial(_Yeoh):
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
        """Always 0, because the law has no term of third order."""
        return 0.0


@dataclass(frozen=True)
class Yeoh(_Yeoh):
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
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self.C10 * x + self.C01 * y + self.C11 * x * y)

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(self.C10 + self.C11 * y), np.asarray(self.C01 + self.C11 * x)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        return np.asarray(x * (self.C10 + self.C20 * x + self.C11 * y) + y * (self.C01 + self.C02 * y))

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        x, y = np.asarray(I1) - 3.0, np.asarray(I2) - 3.0
        first = self.C10 + 2.0 * self.C20 * x + self.C11 * y
        return np.asarray(first), np.asarray(self.C01 + self.C11 * x + 2.0 * self.C02 * y)

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
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
