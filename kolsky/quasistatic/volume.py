"""The solver's volumetric energy as homogeneous tests use it."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from explicit.materials import bulk_modulus
from kolsky.quasistatic.modes import FloatArray


@dataclass(frozen=True)
class QuadraticVolume:
    """U = K / 2 (J - 1)^2, that of the explicit solver."""

    bulk_modulus: float
    """K [Pa]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.bulk_modulus < float("inf"):
            raise ValueError(f"bulk_modulus must be > 0 Pa and finite, got {self.bulk_modulus}")

    @classmethod
    def of_poisson(cls, shear_modulus: float, poisson: float) -> Self:
        """By the shear modulus [Pa] and Poisson's ratio at rest.

        Raises
        ------
        ValueError
            If the ratio is outside [0, 0.49999].
        """
        return cls(float(bulk_modulus(shear_modulus, poisson)))

    def dU_dJ(self, J: ArrayLike, /) -> FloatArray:
        """U'(J) = K (J - 1) [Pa], shape [...]."""
        return self.bulk_modulus * (np.asarray(J, dtype=float) - 1.0)
