"""Modes and nominal stress of a hyperelastic law in homogeneous deformations, tension positive.

With beta_i = lam_i dW/dlam_i, the Kirchhoff stress of an incompressible solid is tau_i = beta_i - p. The free
face 3 has tau_3 = 0. Therefore p = beta_3, and the nominal stress is

    T = (beta_1 - beta_3) / lam,                        uniaxial, equibiaxial, planar,         (Q.2)
    T = (beta_1 - beta_3) / (lam_1 + 1 / lam_1),        simple shear, gamma = lam_1 - 1 / lam_1,   (Q.3)

Both are dW/d(deformation), half of it in equibiaxial tension, where two pairs of faces work. A compressible
solid has W(lam_i / J^(1/3)) + U(J) and

    tau_i = beta_i - (beta_1 + beta_2 + beta_3) / 3 + J U'(J),                                 (Q.4)

The stretch of the free faces is the root of tau_3 = 0, found here to the last digits. Simple shear keeps the
volume: its shear stress is Eq. (Q.3) for any U.

References: Ogden, Non-linear Elastic Deformations, 1984, ch. 7; Treloar, The Physics of Rubber Elasticity,
1975.
"""

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import elementwise

from explicit.materials.law import Stretches
from explicit.materials.volumetric import VolumetricLaw
from kolsky.base.arrays import FloatArray


class Mode(Enum):
    """A homogeneous test, with one variable: the stretch along the load, or the amount of simple shear."""

    UNIAXIAL = "uniaxial"
    """Tension or compression along 1; the sides 2 and 3 are free."""
    EQUIBIAXIAL = "equibiaxial"
    """Equal stretch along 1 and 2; face 3 is free."""
    PLANAR = "planar"
    """Load along 1, width 2 fixed, face 3 free. This is pure shear of a wide strip."""
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

        Direction 1 is that of the load. In simple shear, it is the one stretched by a positive gamma.
        Direction 3 is the free one. In simple shear, it is the one that is shortened.
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
    """The mode of a name, with blanks or hyphens."""
    modes = {mode.value: mode for mode in Mode}
    found = modes.get(text.strip().lower().replace("-", " "))
    if found is None:
        raise ValueError(f"mode {text!r} is not one of {', '.join(modes)}")
    return found


def check_deformation(mode: Mode, deformation: FloatArray) -> None:
    """Raise ValueError for a number that is not a possible deformation."""
    bad = ~np.isfinite(deformation)
    if mode is not Mode.SIMPLE_SHEAR:
        bad |= deformation <= 0.0
    if bad.any():
        worst = deformation[bad].flat[0]
        allowed = "finite" if mode is Mode.SIMPLE_SHEAR else "> 0 and finite"
        what = "amount of shear" if mode is Mode.SIMPLE_SHEAR else "stretch"
        raise ValueError(f"{mode.value}: {what} must be {allowed}, got {worst}")


def incompressible_stress(law: Stretches, mode: Mode, deformation: ArrayLike) -> FloatArray:
    """Nominal stress of an incompressible solid, Eqs. (Q.2) and (Q.3).

    ``deformation``: stretch along the load, or amount of shear [-], shape [...]. Returns: nominal stress,
    tension-positive [Pa]. Raises ValueError if a stretch is not > 0.
    """
    lam = mode.principal_stretches(deformation)
    slopes = law.principal(*lam)
    difference = lam[0] * slopes[0] - lam[2] * slopes[2]
    if mode is Mode.SIMPLE_SHEAR:
        return np.asarray(difference / (lam[0] + lam[2]))
    return np.asarray(difference / lam[0])


def compressible_stress(
    law: Stretches, volume: VolumetricLaw, mode: Mode, deformation: ArrayLike
) -> FloatArray:
    """Nominal stress of a compressible solid with free faces without stress [Pa], Eq. (Q.4).

    ``deformation``: stretch along the load, or amount of shear [-], shape [...].
    """
    if mode is Mode.SIMPLE_SHEAR:
        return incompressible_stress(law, mode, deformation)
    d = np.asarray(deformation, dtype=float)
    return np.asarray(_kirchhoff(law, volume, free_stretches(law, volume, mode, d))[0] / d)


def free_stretch(law: Stretches, volume: VolumetricLaw, mode: Mode, deformation: ArrayLike) -> FloatArray:
    """Stretch of the free faces of a compressible solid [-], shape [...]. It is the root of tau_3 = 0."""
    if mode is Mode.SIMPLE_SHEAR:
        raise ValueError("simple shear prescribes the whole deformation: no face is free")
    d = np.asarray(deformation, dtype=float)
    check_deformation(mode, d)
    start = np.log(mode.principal_stretches(d)[2])

    def side_stress(x: FloatArray, stretch: FloatArray) -> FloatArray:
        return _kirchhoff(law, volume, _stretches(mode, stretch, np.exp(x)))[2]

    with np.errstate(over="ignore", invalid="ignore"):
        bracket = elementwise.bracket_root(side_stress, start - 0.02, start + 0.02, args=(d,), maxiter=100)
        found = elementwise.find_root(
            side_stress,
            bracket.bracket,
            args=(d,),
            # The tolerance is in ln(lam_3), and therefore relative in lam_3. For a stiff volume, the stress
            # is no suitable measure.
            tolerances={"xatol": 1e-15, "xrtol": 0.0, "fatol": 0.0, "frtol": 0.0},
        )
    failed = ~np.asarray(bracket.success & found.success)
    if failed.any():
        worst = np.broadcast_to(d, failed.shape)[failed].flat[0]
        raise ValueError(
            f"{mode.value} at stretch {worst:.6g}: no stretch of the free faces leaves them without "
            "stress; the law is not stable there"
        )
    return np.asarray(np.exp(found.x))


def free_stretches(
    law: Stretches, volume: VolumetricLaw, mode: Mode, deformation: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Principal stretches of a compressible solid with free faces without stress [-]. See `free_stretch`."""
    d = np.asarray(deformation, dtype=float)
    return _stretches(mode, d, free_stretch(law, volume, mode, d))


def _stretches(mode: Mode, load: FloatArray, free: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    if mode is Mode.UNIAXIAL:
        return load, free, free
    return (load, load, free) if mode is Mode.EQUIBIAXIAL else (load, np.ones_like(load), free)


def _kirchhoff(
    law: Stretches, volume: VolumetricLaw, lam: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Principal Kirchhoff stresses [Pa], Eq. (Q.4)."""
    J = lam[0] * lam[1] * lam[2]
    bar = tuple(x / np.cbrt(J) for x in lam)
    beta = [x * slope for x, slope in zip(bar, law.principal(*bar), strict=True)]
    mean = (beta[0] + beta[1] + beta[2]) / 3.0
    pressure = J * volume.pressure(J)
    return beta[0] - mean + pressure, beta[1] - mean + pressure, beta[2] - mean + pressure
