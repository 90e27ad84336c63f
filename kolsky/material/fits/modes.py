"""Homogeneous deformations: what is loaded, what is held, what is free."""

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from kolsky.base.arrays import FloatArray


class Mode(Enum):
    """A homogeneous test. Its one number is the stretch along the load, or the amount of simple shear."""

    UNIAXIAL = "uniaxial"
    """Tension or compression along 1, the sides 2 and 3 free."""
    EQUIBIAXIAL = "equibiaxial"
    """Equal stretch along 1 and 2, face 3 free."""
    PLANAR = "planar"
    """Load along 1, width 2 held, face 3 free: pure shear, the wide strip."""
    SIMPLE_SHEAR = "simple shear"
    """Parallel faces slide on each other by the amount of shear gamma = tan(angle)."""

    @property
    def symbol(self) -> str:
        """Symbol of its number: lambda or gamma."""
        return "γ" if self is Mode.SIMPLE_SHEAR else "λ"

    @property
    def at_rest(self) -> float:
        """Its number in the reference state [-]."""
        return 0.0 if self is Mode.SIMPLE_SHEAR else 1.0

    def strain(self, deformation: ArrayLike) -> FloatArray:
        """Nominal strain lambda - 1, or the amount of shear [-], shape [...]."""
        return np.asarray(deformation, dtype=float) - self.at_rest

    def principal_stretches(self, deformation: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Principal stretches of the incompressible solid [-], each of shape [...], Eq. (Q.1).

        Direction 1 is that of the load (in simple shear the one stretched by a positive gamma), direction 3
        the free one (in simple shear the one that is shortened).

        Raises
        ------
        ValueError
            If a stretch is not > 0 or a number is not finite.
        """
        d = np.asarray(deformation, dtype=float)
        check_deformation(self, d)
        if self is Mode.UNIAXIAL:
            side = d**-0.5
            return d, side, side.copy()
        if self is Mode.EQUIBIAXIAL:
            return d, d.copy(), d**-2.0
        if self is Mode.PLANAR:
            return d, np.ones_like(d), 1.0 / d
        first = np.exp(np.arcsinh(0.5 * d))  # gamma = lam - 1 / lam without cancellation for gamma < 0
        return first, np.ones_like(d), 1.0 / first


def mode_named(text: str) -> Mode:
    """The mode of a name, with blanks or hyphens.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    for mode in Mode:
        if text.strip().lower().replace("-", " ") == mode.value:
            return mode
    raise ValueError(f"mode {text!r} is not one of {', '.join(mode.value for mode in Mode)}")


def check_deformation(mode: Mode, deformation: FloatArray) -> None:
    """Refuse a number that is no deformation.

    Raises
    ------
    ValueError
        If a stretch is not > 0 or a number is not finite.
    """
    bad = ~np.isfinite(deformation)
    if mode is not Mode.SIMPLE_SHEAR:
        bad |= deformation <= 0.0
    if bad.any():
        worst = deformation[bad].flat[0]
        allowed = "finite" if mode is Mode.SIMPLE_SHEAR else "> 0 and finite"
        what = "amount of shear" if mode is Mode.SIMPLE_SHEAR else "stretch"
        raise ValueError(f"{mode.value}: {what} must be {allowed}, got {worst}")
