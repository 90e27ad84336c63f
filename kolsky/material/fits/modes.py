"""Homogeneous deformations and the strain and stress measures of a uniaxial test, tension-positive.

A stretch below one is compression; its nominal strain, logarithmic strain and both stresses are negative. The
true stress of compression is *smaller* in size than the nominal one, because the section grows.
"""

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


def stretch_of_nominal(strain: ArrayLike) -> FloatArray:
    """Stretch 1 + e of a nominal strain e > -1 [-], shape [...].

    Raises
    ------
    ValueError
        If a strain is not > -1.
    """
    return _checked(1.0 + np.asarray(strain, dtype=float))


def stretch_of_logarithmic(strain: ArrayLike) -> FloatArray:
    """Stretch exp(e) of a logarithmic strain [-], shape [...]."""
    return _checked(np.exp(np.asarray(strain, dtype=float)))


def logarithmic_strain(stretch: ArrayLike) -> FloatArray:
    """Logarithmic ("true") strain ln(stretch) [-], shape [...].

    Raises
    ------
    ValueError
        If a stretch is not > 0.
    """
    return np.asarray(np.log(_checked(np.asarray(stretch, dtype=float))))


def side_stretch(stretch: ArrayLike, *, poisson: float = 0.5) -> FloatArray:
    """Stretch across the load at a constant logarithmic Poisson's ratio, lam^-nu [-], shape [...].

    That ratio is 0.5 for an incompressible solid at any stretch. The linear rule 1 - nu e holds for small
    strains only: at e = 1.28 and nu = 0.44 it takes away 56 % of the volume, this one adds 10 %.

    Raises
    ------
    ValueError
        If a stretch is not > 0 or `poisson` is outside [0, 0.5].
    """
    if not 0.0 <= poisson <= 0.5:
        raise ValueError(f"poisson must be in [0, 0.5], got {poisson}")
    return np.asarray(_checked(np.asarray(stretch, dtype=float)) ** -poisson)


def true_of_nominal(nominal: ArrayLike, stretch: ArrayLike, *, side: ArrayLike | None = None) -> FloatArray:
    """True (Cauchy) stress T / lam_t^2 of a nominal stress T [Pa], shape [...], Eq. (Q.5).

    Parameters
    ----------
    nominal
        Force over the undeformed section, tension-positive [Pa].
    stretch
        Stretch along the load [-].
    side
        Stretch across it [-]; that of an incompressible solid, lam^-1/2, if not given.

    Raises
    ------
    ValueError
        If a stretch is not > 0.
    """
    return np.asarray(np.asarray(nominal, dtype=float) / _section(stretch, side))


def nominal_of_true(true: ArrayLike, stretch: ArrayLike, *, side: ArrayLike | None = None) -> FloatArray:
    """Nominal stress sigma lam_t^2 of a true stress; see `true_of_nominal`."""
    return np.asarray(np.asarray(true, dtype=float) * _section(stretch, side))


def _section(stretch: ArrayLike, side: ArrayLike | None) -> FloatArray:
    """Deformed over undeformed section [-]."""
    lam = _checked(np.asarray(stretch, dtype=float))
    if side is None:
        return np.asarray(1.0 / lam)
    return np.asarray(_checked(np.asarray(side, dtype=float)) ** 2)


def _checked(stretch: FloatArray) -> FloatArray:
    check_deformation(Mode.UNIAXIAL, np.atleast_1d(stretch))
    return stretch
