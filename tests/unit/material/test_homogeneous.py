"""Homogeneous tests: textbook closed forms, the derivative of the energy, compressible limits, measures."""

import numpy as np
import pytest

from explicit.materials import LAWS, bulk_modulus
from explicit.materials.laws.ogden import Ogden2
from explicit.materials.laws.polynomial import MooneyRivlin, NeoHookean
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.homogeneous import (
    Mode,
    compressible_stress,
    free_stretch,
    incompressible_stress,
    mode_named,
)

LAM = np.array([0.35, 0.7, 0.95, 1.0, 1.05, 1.8, 3.0])
GAMMA = np.array([-1.5, -0.2, 0.0, 0.3, 2.0])
FREE = (Mode.UNIAXIAL, Mode.EQUIBIAXIAL, Mode.PLANAR)
EVERY = pytest.mark.parametrize("law", [c.example() for c in LAWS.values()], ids=list(LAWS))


def test_mooney_rivlin_by_the_textbook():
    # Treloar 1975, Eqs. (10.6): uniaxial, equibiaxial, pure shear; simple shear 2 (C1 + C2) gamma.
    law, C1, C2 = MooneyRivlin(2e3, 7e2), 2e3, 7e2
    stress = {mode: incompressible_stress(law, mode, LAM) for mode in FREE}
    exact = {"rtol": 1e-12, "atol": 1e-9}  # round-off of stresses of some 1e3 to 1e5 Pa
    np.testing.assert_allclose(stress[Mode.UNIAXIAL], 2 * (LAM - LAM**-2) * (C1 + C2 / LAM), **exact)
    np.testing.assert_allclose(stress[Mode.EQUIBIAXIAL], 2 * (LAM - LAM**-5) * (C1 + C2 * LAM**2), **exact)
    np.testing.assert_allclose(stress[Mode.PLANAR], 2 * (LAM - LAM**-3) * (C1 + C2), **exact)
    np.testing.assert_allclose(
        incompressible_stress(law, Mode.SIMPLE_SHEAR, GAMMA), 2 * (C1 + C2) * GAMMA, **exact
    )


def test_ogden_by_its_own_formula():
    mu, alpha = np.array([3e3, 500.0]), np.array([1.3, 5.0])
    law = Ogden2.from_classical(mu, alpha)
    by_hand = sum(
        m * (LAM ** (a - 1) - LAM ** (-a / 2 - 1)) for m, a in zip(mu, alpha, strict=True)
    )  # Ogden 1972
    np.testing.assert_allclose(incompressible_stress(law, Mode.UNIAXIAL, LAM), by_hand, rtol=1e-12, atol=1e-9)


@EVERY
@pytest.mark.parametrize("mode", Mode)
def test_stress_is_the_derivative_of_the_energy(law, mode):
    at = GAMMA if mode is Mode.SIMPLE_SHEAR else LAM[1:-1]  # where Gent's example does not lock
    step = 1e-4
    # Five points: the error is step^4 times a fifth derivative, below 1e-9, and rounding 1e-16 W / step.
    w = [law.strain_energy(*mode.principal_stretches(at + k * step)) for k in (-2, -1, 1, 2)]
    slope = (w[0] - 8 * w[1] + 8 * w[2] - w[3]) / (12 * step)
    faces = 2.0 if mode is Mode.EQUIBIAXIAL else 1.0
    T = incompressible_stress(law, mode, at)
    np.testing.assert_allclose(faces * T, slope, rtol=1e-7, atol=1e-7 * law.shear_modulus)


@EVERY
def test_small_strains_have_the_textbook_moduli(law):
    e, mu = 1e-6, law.shear_modulus
    for mode, factor in (
        (Mode.UNIAXIAL, 3.0),
        (Mode.EQUIBIAXIAL, 6.0),
        (Mode.PLANAR, 4.0),
        (Mode.SIMPLE_SHEAR, 1.0),
    ):
        T = incompressible_stress(law, mode, mode.at_rest + e)
        np.testing.assert_allclose(T, factor * mu * e, rtol=1e-4)  # the next term is some ten times e


@pytest.mark.parametrize("form", ["quadratic", "logarithmic", "simo_taylor"])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_compressible_small_strains(form, nu):
    law = NeoHookean(1e4)
    volume = VolumetricLaw(float(bulk_modulus(1e4, nu)), form)
    e = 1e-6
    E = 2e4 * (1 + nu)
    moduli = {Mode.UNIAXIAL: E, Mode.EQUIBIAXIAL: E / (1 - nu), Mode.PLANAR: E / (1 - nu**2)}
    free = {Mode.UNIAXIAL: -nu, Mode.EQUIBIAXIAL: -2 * nu / (1 - nu), Mode.PLANAR: -nu / (1 - nu)}
    for mode in FREE:
        T = compressible_stress(law, volume, mode, 1.0 + e)
        np.testing.assert_allclose(T, moduli[mode] * e, rtol=1e-5)  # the next term is some times e
        assert free_stretch(law, volume, mode, 1.0 + e) - 1.0 == pytest.approx(free[mode] * e, abs=2e-11)


@EVERY
@pytest.mark.parametrize("mode", FREE)
def test_a_stiff_volume_gives_the_incompressible_stress(law, mode):
    at, mu = LAM[1:-1], law.shear_modulus
    exact = incompressible_stress(law, mode, at)
    off = []
    for K in (1e3, 1e4):
        T = compressible_stress(law, VolumetricLaw(K * mu), mode, at)
        off.append(np.abs(T - exact).max())
    assert off[1] < 0.02 * np.abs(exact).max()
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)  # first order in mu / K


def test_free_faces_are_free():
    law, volume = MooneyRivlin(2e3, 700.0, 50.0), VolumetricLaw(2e4)
    for mode in FREE:
        side = free_stretch(law, volume, mode, LAM)
        lam = {
            Mode.UNIAXIAL: (LAM, side, side),
            Mode.EQUIBIAXIAL: (LAM, LAM, side),
            Mode.PLANAR: (LAM, np.ones_like(LAM), side),
        }[mode]

        def energy(free, lam=lam):
            J = lam[0] * lam[1] * free
            bar = [x / np.cbrt(J) for x in (lam[0], lam[1], free)]
            return law.strain_energy(*bar) + volume.energy(J)

        # The energy is stationary in the stretch of face 3, to step^2 times third derivatives of 1e5 Pa.
        slope = (energy(side * (1 + 1e-5)) - energy(side * (1 - 1e-5))) / 2e-5
        np.testing.assert_allclose(slope, 0.0, atol=4e-3)


def test_nonsense_is_refused():
    law = NeoHookean(1e3)
    with pytest.raises(ValueError, match=r"uniaxial: stretch must be > 0 and finite, got -0.1"):
        incompressible_stress(law, Mode.UNIAXIAL, [1.0, -0.1])
    with pytest.raises(ValueError, match="amount of shear must be finite, got nan"):
        incompressible_stress(law, Mode.SIMPLE_SHEAR, np.nan)
    with pytest.raises(ValueError, match="no face is free"):
        free_stretch(law, VolumetricLaw(1e4), Mode.SIMPLE_SHEAR, 0.1)
    with pytest.raises(
        ValueError, match="'triaxial' is not one of uniaxial, equibiaxial, planar, simple shear"
    ):
        mode_named("triaxial")
    assert mode_named("Simple-Shear") is Mode.SIMPLE_SHEAR
