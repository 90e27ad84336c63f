r"""The linear limit of a law, in one place: mu_0, E_0, K, nu and the two D1 in use.

    E_0 = 9 K mu_0 / (3 K + mu_0),  nu = (3 K - 2 mu_0) / (6 K + 2 mu_0),  lambda = K - 2 mu_0 / 3,    (L.10)
    K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu))

A volumetric energy is written D1 (J - 1)^2 by some, with K = 2 D1 (Schumacher and others 2020, Table I), and
(J - 1)^2 / D1 by others, with K = 2 / D1 (Abaqus and most published fits). The names say which is meant.
"""

from dataclasses import dataclass
from typing import Self

from explicit.materials.volumetric import bulk_modulus


@dataclass(frozen=True)
class LinearLimit:
    """The isotropic linear elastic solid that a law is at rest."""

    shear_modulus: float
    """mu_0 [Pa]."""
    bulk: float
    """K [Pa]; infinity for an incompressible solid."""

    def __post_init__(self) -> None:
        if not 0.0 < self.shear_modulus < float("inf"):
            raise ValueError(f"shear_modulus must be > 0 Pa and finite, got {self.shear_modulus}")
        if not self.bulk > 0.0:
            raise ValueError(f"bulk must be > 0 Pa, got {self.bulk}")

    @property
    def poisson(self) -> float:
        """nu [-]."""
        if self.bulk == float("inf"):
            return 0.5
        return (3.0 * self.bulk - 2.0 * self.shear_modulus) / (6.0 * self.bulk + 2.0 * self.shear_modulus)

    @property
    def youngs_modulus(self) -> float:
        """E_0 = 2 mu_0 (1 + nu) [Pa]."""
        return 2.0 * self.shear_modulus * (1.0 + self.poisson)

    @property
    def lame(self) -> float:
        """Lame's first constant [Pa]."""
        return self.bulk - 2.0 * self.shear_modulus / 3.0

    @property
    def factor_d1(self) -> float:
        """D1 of D1 (J - 1)^2, K / 2 [Pa]."""
        return self.bulk / 2.0

    @property
    def divisor_d1(self) -> float:
        """D1 of (J - 1)^2 / D1, 2 / K [1/Pa]; 0 for an incompressible solid."""
        return 2.0 / self.bulk

    @classmethod
    def from_poisson(cls, shear_modulus: float, poisson: float) -> Self:
        """The limit of a law with mu_0 that is given Poisson's ratio (Schumacher's reparameterisation).

        Raises
        ------
        ValueError
            If nu is outside [0, 0.49999] or mu_0 is not > 0.
        """
        return cls(float(shear_modulus), float(bulk_modulus(shear_modulus, poisson)))

    @classmethod
    def from_youngs_modulus(cls, youngs_modulus: float, poisson: float) -> Self:
        """The limit with E_0 and nu; mu_0 = E_0 / (2 (1 + nu)).

        Raises
        ------
        ValueError
            As `from_poisson`.
        """
        return cls.from_poisson(youngs_modulus / (2.0 * (1.0 + poisson)), poisson)

    @classmethod
    def from_factor_d1(cls, shear_modulus: float, d1: float) -> Self:
        """The limit with the volumetric energy D1 (J - 1)^2, D1 in Pa."""
        return cls(shear_modulus, 2.0 * d1)

    @classmethod
    def from_divisor_d1(cls, shear_modulus: float, d1: float) -> Self:
        """The limit with the volumetric energy (J - 1)^2 / D1, D1 in 1/Pa; 0 is incompressible.

        Raises
        ------
        ValueError
            If D1 is negative or mu_0 is not > 0.
        """
        if not d1 >= 0.0:
            raise ValueError(f"D1 must be >= 0 1/Pa, got {d1}")
        return cls(shear_modulus, 2.0 / d1 if d1 > 0.0 else float("inf"))
