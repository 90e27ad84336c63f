"""Drucker's criterion against closed forms and against differences of the stress itself."""

from math import inf

import numpy as np
import pytest

from explicit.materials import LAWS
from explicit.materials.laws.ogden import Ogden1
from explicit.materials.laws.polynomial import MooneyRivlin, ReducedPolynomial
from explicit.materials.laws.stiffening import Gent
from kolsky.material.fits.compare import Stability, drucker, least_stiffness, stable_over
from kolsky.material.fits.homogeneous import Mode, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest

EVERY = pytest.mark.parametrize("law", [c.example() for c in LAWS.values()], ids=list(LAWS))


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
