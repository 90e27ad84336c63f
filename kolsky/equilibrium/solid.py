"""Materials for elements: named constants, energy, stress and tangent, and volumetric energies.

There are two solids. `Isotropic` is any law of `explicit.materials.laws` with a volumetric energy.
`CompressibleNeoHookean` is the neo-Hookean energy with a shear part that is not isochoric, as in Schumacher
and others (2020). One definition of the energy gives all functions of a solid.

Volumetric energies U(J) are

    "quadratic"      K/2 (J - 1)^2, as in `explicit.materials.volumetric`
    "polynomial"     D1 (J - 1)^2 + D2 (J - 1)^4 + D3 (J - 1)^6   (Schumacher and others 2020, Section III-C)
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from explicit.arrays import FloatArray
from explicit.materials.families import InvariantLaw
from explicit.materials.laws import AnyLaw
from kolsky.equilibrium.point_kernels import (
    compressible_neo_hookean,
    invariant_point_functions,
    stretch_point_functions,
    with_volume,
)

VOLUMETRIC_PARAMETERS: dict[str, tuple[str, ...]] = {"quadratic": ("K",), "polynomial": ("D1", "D2", "D3")}
"""Constants [Pa] of each form."""


@dataclass(frozen=True)
class Volumetric:
    """A form with its constants."""

    form: str
    """A name in `PARAMETERS`."""
    values: tuple[float, ...]
    """Its constants [Pa]."""

    def __post_init__(self) -> None:
        if self.form not in VOLUMETRIC_PARAMETERS:
            raise ValueError(
                f"volumetric form must be one of {sorted(VOLUMETRIC_PARAMETERS)}, got {self.form!r}"
            )
        names = VOLUMETRIC_PARAMETERS[self.form]
        if len(self.values) != len(names):
            raise ValueError(f"{self.form} has the constants {names}, got {len(self.values)} values")
        if not np.isfinite(self.values).all():
            raise ValueError(f"{self.form}: the constants must be finite, got {self.values}")
        if not self.values[0] > 0.0:
            raise ValueError(f"{self.form}: {names[0]} must be > 0 Pa, got {self.values[0]}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constants."""
        return VOLUMETRIC_PARAMETERS[self.form]

    @property
    def bulk_modulus(self) -> float:
        """K = U''(1) [Pa]."""
        return 2.0 * self.values[0] if self.form == "polynomial" else self.values[0]

    def of(self, values: FloatArray) -> Self:
        """The form with other constants."""
        return replace(self, values=tuple(float(x) for x in values))

    def energy(self, J: FloatArray) -> FloatArray:
        """U [Pa] of the volume ratio, shape [...]."""
        z = (np.asarray(J) - 1.0) ** 2
        if self.form == "quadratic":
            return np.asarray(0.5 * self.values[0] * z)
        return np.asarray(z * (self.values[0] + z * (self.values[1] + z * self.values[2])))

    def slope(self, J: FloatArray) -> FloatArray:
        """U'(J) [Pa], shape [...]."""
        return np.asarray(sum(c * by for c, by in zip(self.values, self.slope_by_constants(J), strict=True)))

    def curvature(self, J: FloatArray) -> FloatArray:
        """U''(J) [Pa], shape [...]."""
        if self.form == "quadratic":
            return np.full(np.shape(J), self.values[0])
        z = (np.asarray(J) - 1.0) ** 2
        d1, d2, d3 = self.values
        return np.asarray(2.0 * d1 + z * (12.0 * d2 + 30.0 * d3 * z))

    def slope_by_constants(self, J: FloatArray) -> tuple[FloatArray, ...]:
        """Derivatives of U'(J) by the constants [-], each of shape [...]. U'(J) is linear in the
        constants."""
        x = np.asarray(J) - 1.0
        return (x,) if self.form == "quadratic" else (2.0 * x, 4.0 * x**3, 6.0 * x**5)


def bulk(modulus: float) -> Volumetric:
    """The quadratic form with the bulk modulus K [Pa]."""
    return Volumetric("quadratic", (float(modulus),))


def polynomial(d1: float, d2: float = 0.0, d3: float = 0.0) -> Volumetric:
    """The polynomial with its constants [Pa]."""
    return Volumetric("polynomial", (float(d1), float(d2), float(d3)))


@dataclass(frozen=True)
class Isotropic:
    """A law of the isochoric invariants or stretches, and a volumetric energy."""

    law: AnyLaw
    """A member of `explicit.materials.LAWS`."""
    volumetric: Volumetric

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The law's constants, then the volumetric ones."""
        return (*(spec.name for spec in self.law.PARAMETERS), *self.volumetric.names)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus at rest [Pa]."""
        return self.law.shear_modulus

    def parameters(self) -> FloatArray:
        """The constants, in Pa or 1, shape [n_parameters]."""
        return np.concatenate([self.law.constants(), self.volumetric.values])

    def with_parameters(self, values: FloatArray) -> Self:
        """The material with other constants, in the order of `parameters`."""
        n = len(self.law.PARAMETERS)
        return replace(self, law=self.law.of(values[:n]), volumetric=self.volumetric.of(values[n:]))

    def scaled(self, factor: float) -> Self:
        """The material with every stress multiplied by a factor. Pure numbers do not change."""
        values = factor * np.asarray(self.volumetric.values)
        return replace(self, law=self.law.scaled(factor), volumetric=self.volumetric.of(values))

    def row(self) -> FloatArray:
        """The numbers that the Warp functions read: the law's row, then the volumetric constants."""
        return np.concatenate([self.law.parameters(), self.volumetric.values])

    def functions(self) -> tuple[Any, Any, Any]:
        """Warp functions ``(energy, stress, tangent)`` of ``(F, row)``."""
        return with_volume(self.isochoric_functions(), self.volumetric.form, len(self.law.parameters()))

    def isochoric_functions(self) -> tuple[Any, Any, Any]:
        """The functions without the volumetric energy, for a mixed formulation."""
        law: Any = type(self.law)  # a class is hashable, whatever its metaclass is taken for
        return (invariant_point_functions if isinstance(self.law, InvariantLaw) else stretch_point_functions)(
            law
        )


@dataclass(frozen=True)
class CompressibleNeoHookean:
    """mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2 (Schumacher and others 2020, Section III-C)."""

    mu: float
    """Shear modulus [Pa]."""
    lam: float
    """Lame's first constant [Pa]."""

    def __post_init__(self) -> None:
        if not (
            np.isfinite([self.mu, self.lam]).all() and self.mu > 0.0 and 3.0 * self.lam + 2.0 * self.mu > 0.0
        ):
            raise ValueError(f"mu and 3 lam + 2 mu must be > 0 Pa, got mu = {self.mu}, lam = {self.lam}")

    @classmethod
    def from_young(cls, young: float, poisson: float) -> Self:
        """The solid with Young's modulus E [Pa] and Poisson's ratio in (-1, 0.5)."""
        if not -1.0 < poisson < 0.5:
            raise ValueError(f"poisson must be in (-1, 0.5), got {poisson}")
        lam = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        return cls(young / (2.0 * (1.0 + poisson)), lam)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The names mu and lam."""
        return "mu", "lam"

    @property
    def shear_modulus(self) -> float:
        """Shear modulus at rest [Pa]."""
        return self.mu

    @property
    def volumetric(self) -> Volumetric | None:
        """None: shear and volume are coupled."""
        return None

    def parameters(self) -> FloatArray:
        """See `Isotropic`."""
        return np.array([self.mu, self.lam])

    def with_parameters(self, values: FloatArray) -> Self:
        """See `Isotropic`."""
        return replace(self, mu=float(values[0]), lam=float(values[1]))

    def scaled(self, factor: float) -> Self:
        """See `Isotropic`."""
        return self.with_parameters(factor * self.parameters())

    def row(self) -> FloatArray:
        """The constants mu and lam [Pa]."""
        return self.parameters()

    def functions(self) -> tuple[Any, Any, Any]:
        """See `Isotropic`."""
        return compressible_neo_hookean()

    def isochoric_functions(self) -> tuple[Any, Any, Any]:
        """Raise ValueError: there are none."""
        raise ValueError(
            "the compressible neo-Hookean energy has no separate volumetric part: take volumetric = "
            '"displacement", or Isotropic with the neo_hookean law'
        )


Solid = Isotropic | CompressibleNeoHookean
"""A hyperelastic material with named constants."""
