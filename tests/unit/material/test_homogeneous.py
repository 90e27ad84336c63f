"""Homogeneous tests and Drucker's criterion, against closed forms."""

from math import inf

import numpy as np
import pytest

from explicit.materials import LAWS, bulk_modulus
from explicit.materials.laws.ogden import Ogden1, Ogden2
from explicit.materials.laws.polynomial import MooneyRivlin, NeoHookean, ReducedPolynomial
from explicit.materials.laws.stiffening import Gent
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits.compare import Stability, drucker, least_stiffness, stable_over
from kolsky.material.fits.homogeneous import (
    Mode,
    compressible_stress,
    free_stretch,
    incompressible_stress,
    mode_named,
)
from kolsky.material.fits.homogeneous_test import HomogeneousTest

# Homogeneous tests: textbook closed forms, the derivative of the energy, compressible limits, measures.

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


# Drucker's criterion against closed forms and against differences of the stress itself.


def paths(law, **options):
    return {(p.mode, p.direction): p for p in drucker(law, **options)}


@EVERY
def test_at_rest_it_is_twice_the_shear_modulus(law):
    for mode in Mode:
        # d tau = 2 mu d eps in the plane of steps that keep the volume, in every direction.
        assert least_stiffness(law, mode, np.array(mode.at_rest)) == pytest.approx(2.0 * law.shear_modulus)


@EVERY
def test_it_is_the_hessian_of_the_energy_over_logarithmic_strains(law):
    rng = np.random.default_rng(3)
    h = 1e-4
    for mode in (Mode.UNIAXIAL, Mode.PLANAR, Mode.EQUIBIAXIAL):
        at = float(rng.uniform(1.1, 1.7))
        eps = np.log([x.item() for x in mode.principal_stretches(at)])
        axes = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])

        def W(a, b, eps=eps, axes=axes):
            return law.strain_energy(*np.exp(eps + a * axes[0] + b * axes[1]))

        aa = (W(h, 0) - 2 * W(0, 0) + W(-h, 0)) / h**2
        bb = (W(0, h) - 2 * W(0, 0) + W(0, -h)) / h**2
        ab = (W(h, h) - W(h, -h) - W(-h, h) + W(-h, -h)) / (4 * h**2)
        least = np.linalg.eigvalsh(np.array([[aa, ab], [ab, bb]]).reshape(2, 2))[0]
        # h^2 fourth derivatives and 1e-16 W / h^2: both some 1e-7.
        assert least_stiffness(law, mode, np.array(at)) == pytest.approx(least, rel=1e-5)


def test_a_negative_mooney_constant_fails_where_the_closed_form_says():
    # Uniaxial, C01 = -r C10. The step across, eps_2 = -eps_3 = d, has W = ... + 2 cosh(2 d) (C10 lam2^2 +
    # C01 / lam2^2) and so no stiffness left where lam2^4 = lam^-2 = r; the step along the path is stiffer.
    r = 0.25
    found = paths(MooneyRivlin(4e3, -r * 4e3))
    tension = found[Mode.UNIAXIAL, "tension"]
    across = 1.0 / np.sqrt(r)
    assert tension.outcome is Stability.UNSTABLE
    assert 1.0 + tension.strain == pytest.approx(across, rel=1e-9)


def test_the_same_deformation_fails_at_the_same_place():
    law = ReducedPolynomial(5e3, -300.0)
    found = paths(law)
    # Uniaxial compression by lam is equibiaxial tension by lam^-1/2, and the reverse; planar compression and
    # simple shear are planar tension.
    for one, other in (("compression", "tension"), ("tension", "compression")):
        a, b = found[Mode.UNIAXIAL, one], found[Mode.EQUIBIAXIAL, other]
        assert a.outcome is b.outcome is Stability.UNSTABLE
        assert 1.0 + a.strain == pytest.approx((1.0 + b.strain) ** -2, rel=1e-9)
    planar = 1.0 + found[Mode.PLANAR, "tension"].strain
    assert 1.0 + found[Mode.PLANAR, "compression"].strain == pytest.approx(1.0 / planar, rel=1e-9)
    assert found[Mode.SIMPLE_SHEAR, "shear"].strain == pytest.approx(planar - 1.0 / planar, rel=1e-9)


def test_a_falling_true_stress_is_never_called_stable():
    law = ReducedPolynomial(5e3, -300.0)
    at = 1.0 + paths(law)[Mode.UNIAXIAL, "tension"].strain
    lam = np.linspace(1.0, 4.0, 4001)
    tau = lam * incompressible_stress(law, Mode.UNIAXIAL, lam)
    falls = lam[1:][np.diff(tau) < 0.0][0]
    assert (
        at <= falls + 1e-3
    )  # the grid's step; the criterion looks at more steps than the one along the path


def test_positive_constants_are_stable_and_gent_ends_where_it_locks():
    # The steep one has stiffnesses of 1e15 and 1e-7 in one tensor at stretch 10, and none may be lost.
    for law in (MooneyRivlin(3e3, 1e3), Ogden1(1e4, 3.0), Ogden1(1e4, -3.0), Ogden1(3e3, 14.8)):
        assert {p.outcome for p in drucker(law, most=20.0)} == {Stability.STABLE}
    Jm = 30.0
    end = paths(Gent(1e4, Jm))[Mode.UNIAXIAL, "tension"]
    assert end.outcome is Stability.UNDEFINED
    lam = 1.0 + end.strain
    assert lam**2 + 2.0 / lam - 3.0 == pytest.approx(Jm, rel=1e-9)


def test_over_the_data_only():
    law = ReducedPolynomial(5e3, -300.0)
    limit = paths(law)[Mode.UNIAXIAL, "tension"].strain

    def test(end):
        lam = np.linspace(0.9, 1.0 + end, 9)
        return HomogeneousTest("t", Mode.UNIAXIAL, lam, lam - 1.0)

    assert [p.outcome for p in stable_over(law, [test(0.95 * limit)])] == [Stability.STABLE] * 2
    beyond = stable_over(law, [test(1.05 * limit)])
    assert [p.outcome for p in beyond] == [Stability.STABLE, Stability.UNSTABLE]
    assert beyond[1].strain == pytest.approx(limit, rel=1e-9)
    assert str(beyond[1]) == f"uniaxial tension: unstable from {limit:.4g}"


@pytest.mark.parametrize("most", [1.0, inf])
def test_a_path_has_an_end(most):
    with pytest.raises(ValueError, match="most must be > 1 and finite"):
        drucker(Ogden1(1e4, 2.0), most=most)
