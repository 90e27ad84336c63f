"""Strain and stress measures of a uniaxial test, tension-positive throughout.

A stretch below one is compression; its nominal strain, logarithmic strain and both stresses are negative. The
true stress of compression is *smaller* in size than the nominal one, because the section grows.
"""

import numpy as np
from numpy.typing import ArrayLike

from kolsky.base.arrays import FloatArray
from kolsky.material.fits.modes import Mode, check_deformation


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
