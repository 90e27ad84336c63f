"""Gent's law W = -mu Jm / 2 ln(1 - (I1_bar - 3) / Jm), which locks at I1_bar = 3 + Jm (Gent 1996)."""

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
class Gent(InvariantLaw):
    """Two constants. Past locking there is no law: stress and energy are not numbers, and a simulation that
    gets there diverges, or ends as TABLE_EXCEEDED where it is told to stop (`explicit.Model.past_data`)."""

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
        """s where the data end or the law locks, at sqrt(Jm) [-]."""
        return min(self.fitted_s, float(np.sqrt(self.Jm)))

    def _room(self, I1: ArrayLike) -> FloatArray:
        """Jm - (I1 - 3), not a number past locking."""
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
