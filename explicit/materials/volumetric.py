r"""The volumetric law in three common forms, and its modulus.

    "quadratic"      U = K/2 (J - 1)^2               (Sussman and Bathe 1987)
    "logarithmic"    U = K/2 (ln J)^2                (Simo, Taylor and Pister 1985)
    "simo_taylor"    U = K/4 (J^2 - 1 - 2 ln J)      (Simo and Taylor 1991)                   (L.9)

They agree to second order in J - 1. The logarithmic one softens in dilatation and is not convex beyond J = e.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray

Form = Literal["quadratic", "logarithmic", "simo_taylor"]
"""Names of the forms."""
POISSON_LIMIT = 0.49999
"""Largest Poisson's ratio: beyond it nothing changes but the step, see `explicit.incompressible`."""
SMALL = 0.02
"""Below this |J - 1| the kernels take the energy of Simo and Taylor's form from a series."""


@dataclass(frozen=True)
class VolumetricLaw:
    """U(J) and its derivatives, Eq. (L.9)."""

    bulk: float
    """Bulk modulus K [Pa]."""
    form: Form = "quadratic"
    """Which of the forms."""

    def __post_init__(self) -> None:
        if not 0.0 < self.bulk < np.inf:
            raise ValueError(f"bulk must be > 0 Pa and finite, got {self.bulk}")
        checked_form(self.form)

    def energy(self, J: ArrayLike) -> FloatArray:
        """U [Pa] of the volume ratio J, shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.asarray(0.5 * self.bulk * (J - 1.0) ** 2)
        if self.form == "logarithmic":
            return np.asarray(0.5 * self.bulk * np.log(J) ** 2)
        return np.asarray(0.25 * self.bulk * ((J - 1.0) * (J + 1.0) - 2.0 * np.log(J)))

    def pressure(self, J: ArrayLike) -> FloatArray:
        """U'(J), the mean Cauchy stress, tension-positive [Pa], shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.asarray(self.bulk * (J - 1.0))
        if self.form == "logarithmic":
            return np.asarray(self.bulk * np.log(J) / J)
        return np.asarray(0.5 * self.bulk * (J - 1.0 / J))

    def stiffness(self, J: ArrayLike) -> FloatArray:
        """U''(J) [Pa], shape [...]."""
        J = np.asarray(J, dtype=float)
        if self.form == "quadratic":
            return np.full(J.shape, self.bulk)
        if self.form == "logarithmic":
            return np.asarray(self.bulk * (1.0 - np.log(J)) / J**2)
        return np.asarray(0.5 * self.bulk * (1.0 + 1.0 / J**2))


def checked_form(form: str) -> str:
    """The name of a form.

    Raises
    ------
    ValueError
        If there is no such form; the message lists those there are.
    """
    if form not in get_args(Form):
        raise ValueError(f"volumetric must be one of {sorted(get_args(Form))}, got {form!r}")
    return form


def bulk_modulus(shear_modulus: FloatArray | float, poisson: FloatArray | float) -> FloatArray:
    """Bulk modulus of the initial state, K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu)) [Pa].

    Raises
    ------
    ValueError
        If a Poisson ratio is outside [0, 0.49999].
    """
    nu = np.asarray(poisson, dtype=float)
    if not ((nu >= 0.0) & (nu <= POISSON_LIMIT)).all():
        worst = nu[~((nu >= 0.0) & (nu <= POISSON_LIMIT))].flat[0]
        raise ValueError(
            f"poisson must be in [0, {POISSON_LIMIT}], got {worst}: an explicit run needs slight "
            "compressibility; 0.499 stands for an incompressible elastomer"
        )
    return 2.0 * np.asarray(shear_modulus) * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
