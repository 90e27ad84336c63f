r"""Volumetric energies U(J): those of `explicit.materials.volumetric` and a polynomial.

"quadratic"      K/2 (J - 1)^2
"logarithmic"    K/2 (ln J)^2
"simo_taylor"    K/4 (J^2 - 1 - 2 ln J)
"polynomial"     D1 (J - 1)^2 + D2 (J - 1)^4 + D3 (J - 1)^6   (Schumacher and others 2020, Section III-C)
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from explicit.arrays import FloatArray
from explicit.materials.volumetric import VolumetricLaw

PARAMETERS: dict[str, tuple[str, ...]] = {
    "quadratic": ("K",),
    "logarithmic": ("K",),
    "simo_taylor": ("K",),
    "polynomial": ("D1", "D2", "D3"),
}
"""Constants [Pa] of each form."""


@dataclass(frozen=True)
class Volumetric:
    """A form with its constants."""

    form: str
    """A name in `PARAMETERS`."""
    values: tuple[float, ...]
    """Its constants [Pa]."""

    def __post_init__(self) -> None:
        if self.form not in PARAMETERS:
            raise ValueError(f"volumetric form must be one of {sorted(PARAMETERS)}, got {self.form!r}")
        names = PARAMETERS[self.form]
        if len(self.values) != len(names):
            raise ValueError(f"{self.form} has the constants {names}, got {len(self.values)} values")
        if not np.isfinite(self.values).all():
            raise ValueError(f"{self.form}: the constants must be finite, got {self.values}")
        if not self.values[0] > 0.0:
            raise ValueError(f"{self.form}: {names[0]} must be > 0 Pa, got {self.values[0]}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constants."""
        return PARAMETERS[self.form]

    @property
    def bulk_modulus(self) -> float:
        """K = U''(1) [Pa]."""
        return 2.0 * self.values[0] if self.form == "polynomial" else self.values[0]

    def of(self, values: FloatArray) -> Self:
        """The form with other constants."""
        return replace(self, values=tuple(float(x) for x in values))

    def energy(self, J: FloatArray) -> FloatArray:
        """U [Pa] of the volume ratio, shape [...]."""
        if self.form != "polynomial":
            return VolumetricLaw(self.values[0], self.form).energy(J)  # type: ignore[arg-type]
        z = (np.asarray(J) - 1.0) ** 2
        return np.asarray(z * (self.values[0] + z * (self.values[1] + z * self.values[2])))

    def slope(self, J: FloatArray) -> FloatArray:
        """U'(J) [Pa], shape [...]."""
        if self.form != "polynomial":
            return VolumetricLaw(self.values[0], self.form).pressure(J)  # type: ignore[arg-type]
        return np.asarray(sum(c * by for c, by in zip(self.values, self.slope_by_constants(J), strict=True)))

    def curvature(self, J: FloatArray) -> FloatArray:
        """U''(J) [Pa], shape [...]."""
        if self.form != "polynomial":
            return VolumetricLaw(self.values[0], self.form).stiffness(J)  # type: ignore[arg-type]
        z = (np.asarray(J) - 1.0) ** 2
        d1, d2, d3 = self.values
        return np.asarray(2.0 * d1 + z * (12.0 * d2 + 30.0 * d3 * z))

    def slope_by_constants(self, J: FloatArray) -> tuple[FloatArray, ...]:
        """Derivatives of U'(J) by the constants, on which it depends linearly [-], each of shape [...]."""
        if self.form != "polynomial":
            return (VolumetricLaw(1.0, self.form).pressure(J),)  # type: ignore[arg-type]
        x = np.asarray(J) - 1.0
        return 2.0 * x, 4.0 * x**3, 6.0 * x**5


def bulk(modulus: float, form: str = "quadratic") -> Volumetric:
    """A form of one constant, the bulk modulus K [Pa]."""
    return Volumetric(form, (float(modulus),))


def polynomial(d1: float, d2: float = 0.0, d3: float = 0.0) -> Volumetric:
    """The polynomial with its constants [Pa]."""
    return Volumetric("polynomial", (float(d1), float(d2), float(d3)))
