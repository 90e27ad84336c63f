"""Moduli, ratios, fracture, recovery; agreeing starts, the cost of bounds, compressible paths."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from explicit.materials import LAWS, bulk_modulus
from explicit.materials.volumetric import VolumetricLaw
from kolsky.material.fits import fit
from kolsky.material.fits.compare import Stability, drucker, least_compressible_stiffness
from kolsky.material.fits.fit import FitOutcome, fit_law
from kolsky.material.fits.homogeneous import Mode, compressible_stress, free_stretch
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.properties import fracture, healing, poissons_ratio, recovery, youngs_modulus
from kolsky.material.fits.search import search
from kolsky.material.fits.tables import remarks


def test_youngs_modulus_is_the_regression_to_five_percent():
    """Four points +-1 Pa about 2000 Pa/unit: residuals known by hand; the point at 10 % has no part."""
    strain = np.array([0.0, 0.02, 0.03, 0.05, 0.10])
    off = np.array([1.0, -1.0, -1.0, 1.0, 900.0])
    found = youngs_modulus(strain, 2000.0 * strain + 7.0 + off)
    x = strain[:4] - 0.025
    rest = off[:4] - (x @ off[:4]) / (x @ x) * x
    assert found.value == pytest.approx(2000.0 + (x @ off[:4]) / (x @ x))
    assert found.sigma == pytest.approx(np.sqrt(rest @ rest / 2 / (x @ x)))
    assert youngs_modulus(strain[:2], strain[:2]) is None


def test_poissons_ratio_is_of_logarithmic_strains():
    stretch = np.array([0.6, 0.8, 1.0, 1.2, 1.5])
    assert poissons_ratio(stretch, stretch**-0.47).value == pytest.approx(0.47)
    assert poissons_ratio(stretch[2:4], stretch[2:4]) is None


def test_fracture_is_the_largest_stress_before_a_fifth_is_lost():
    strain = np.linspace(0.0, 1.0, 11)
    broken = np.array([0, 1, 2, 3, 4, 5, 6, 7, 5.7, 5.65, 5.59]) * 1e4
    assert (fracture(strain, broken).stress, fracture(strain, broken).strain) == (7e4, pytest.approx(0.7))
    assert fracture(strain, np.where(broken == 5.59e4, 5.61e4, broken)) is None  # 19.9 % are lost


def test_unloading_is_no_fracture():
    strain = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5])
    stress = np.array([0.0, 2, 4, 6, 8, 5.0, 3.0]) * 1e4
    assert fracture(strain, stress) is None
    # The same fall while the specimen springs back by less than a fiftieth.
    assert fracture(np.array([0.0, 0.25, 0.5, 0.75, 1.0, 0.985, 0.981]), stress).strain == 1.0
    assert fracture(np.array([0.0, 0.25, 0.5, 0.75, 1.0, 0.979, 0.97]), stress) is None


def test_points_past_a_fracture_are_said():
    strain = np.linspace(0.0, 1.0, 11)
    broken = np.array([0, 1, 2, 3, 4, 5, 6, 7, 3, 2, 1]) * 1e4
    (said,) = remarks(
        SimpleNamespace(
            rows=[], best=None, tests=[HomogeneousTest("pull", Mode.UNIAXIAL, 1.0 + strain, broken)]
        )
    )[:-1]
    assert said.startswith("pull breaks at strain 0.7 (70 kPa), and its 3 points after that are fitted too")


def test_a_healing_efficiency_has_the_uncertainty_of_both_means():
    """Undamaged 100 +- 2 (two of 98 and 102), healed 90 +- 3 (87 and 93)."""
    found = recovery([98.0, 102.0], [87.0, 93.0])
    assert found.efficiency.value == pytest.approx(0.9)
    assert found.efficiency.sigma == pytest.approx(0.9 * np.hypot(2.0 / 100.0, 3.0 / 90.0))


def test_what_has_not_healed_is_not_known_exactly_nor_is_one_specimen():
    """A healed mean of 0 +- 3 over 100 is 0 +- 0.03; one specimen does not tell its scatter."""
    none = recovery([98.0, 102.0], [-3.0, 3.0]).efficiency
    assert (none.value, none.sigma) == (0.0, pytest.approx(0.03))
    assert np.isnan(recovery([98.0, 102.0], [90.0]).efficiency.sigma)


def test_a_minimum_that_one_start_alone_reached_is_not_determined(monkeypatch):
    law, lam = LAWS["gent"].example(), np.linspace(1.1, 3.0, 12)
    test = HomogeneousTest("t", Mode.UNIAXIAL, lam, 1e4 * (lam - lam**-2))
    made = SimpleNamespace(unknowns=None, chi2=1.0, jacobian=np.eye(12, 2), at_bound=(False, False),
                           ends=(1.0, 2.0), agreeing=1, unbounded=np.nan)  # fmt: skip
    made.unknowns = law.constants() / np.array([test.stress.max(), 1.0])
    monkeypatch.setattr(fit, "search", lambda *a, **k: made)
    assert fit_law(LAWS["gent"], [test]).outcome is FitOutcome.UNCONFIRMED
    made.agreeing = 2
    assert fit_law(LAWS["gent"], [test]).outcome is FitOutcome.DETERMINED


def test_what_a_bound_costs_is_said():
    """C20 < 0 meets the data exactly, C20 = 0 does not: the cost is the quotient of the sums of squares."""
    lam = np.linspace(1.05, 1.6, 12)
    T = 2 * (lam - lam**-2) * (2e4 - 2e3 * (lam**2 + 2 / lam - 3)) * (1 + 1e-3 * np.sin(40 * lam))
    test = HomogeneousTest("t", Mode.UNIAXIAL, lam, T)
    held, free = (fit_law(LAWS["reduced_polynomial"], [test], bounded=b) for b in (True, False))
    assert held.at_bound == ("C20",)
    assert held.bounds_cost == pytest.approx(held.chi2 / free.chi2, rel=1e-4)
    assert held.bounds_cost > 10.0
    assert free.bounds_cost == 1.0


def test_poissons_ratio_is_found_from_lateral_stretches():
    law, lam, nu = LAWS["neo_hookean"].of([2e4]), np.linspace(0.5, 0.95, 12), 0.44
    volume = VolumetricLaw(float(bulk_modulus(2e4, nu)))
    test = HomogeneousTest(
        "t", Mode.UNIAXIAL, lam, compressible_stress(law, volume, Mode.UNIAXIAL, lam),
        lateral=free_stretch(law, volume, Mode.UNIAXIAL, lam),
    )  # fmt: skip
    found = fit_law(LAWS["neo_hookean"], [test], free_poisson=True, starts=3)
    assert found.poisson == pytest.approx(nu, abs=1e-6)
    assert found.law.shear_modulus == pytest.approx(2e4, rel=1e-5)
    assert found.bulk_modulus == pytest.approx(
        2e4 * 2 * 1.44 / (3 * 0.12), rel=1e-4
    )  # 2 mu (1 + nu) / 3 (1 - 2 nu)
    assert pytest.approx(2.0 / found.bulk_modulus) == found.D1
    with pytest.raises(ValueError, match="free only where a test has lateral stretches"):
        fit_law(
            LAWS["neo_hookean"], [HomogeneousTest("u", Mode.UNIAXIAL, lam, test.stress)], free_poisson=True
        )


def test_compressible_stiffness_at_rest_is_that_of_elasticity():
    """2 mu twice and 3 K: the least is 2 mu, or 3 K of an auxetic solid."""
    law, rest = LAWS["neo_hookean"].of([1e4]), np.ones(1)
    assert least_compressible_stiffness(law, VolumetricLaw(5e4), Mode.UNIAXIAL, rest) == pytest.approx(
        2e4, rel=1e-6
    )
    assert least_compressible_stiffness(law, VolumetricLaw(3e3), Mode.UNIAXIAL, rest) == pytest.approx(
        9e3, rel=1e-6
    )


def test_a_soft_volume_loses_stability_where_an_incompressible_solid_keeps_it():
    law = LAWS["neo_hookean"].of([1e4])
    assert all(path.outcome is Stability.STABLE for path in drucker(law, most=2.0))
    paths = drucker(law, most=8.0, volume=VolumetricLaw(float(bulk_modulus(1e4, 0.2))))
    assert any(path.outcome is not Stability.STABLE for path in paths)


def test_free_searches_are_never_worse_than_bounded_ones():
    from kolsky.material.fits.search import Residuals

    lam = np.linspace(1.1, 4.0, 15)
    test = HomogeneousTest("t", Mode.UNIAXIAL, lam, 1e4 * (lam - lam**-2) * (1 + 0.1 * np.sin(3 * lam)))
    problem = Residuals(LAWS["gent"], (test,))
    bounded, free = (search(problem, bounded=b, starts=2, seed=5) for b in (True, False))
    assert free.chi2 <= bounded.chi2 * (1.0 + 1e-9)


ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests" / "validation"))

import healing_page as page  # noqa: E402
from page_values import evaluated, stored  # noqa: E402


def test_the_page_is_what_its_numbers_make():
    assert stored(page.PAGE) == evaluated(page.PAGE, vars(page) | page.shown())


def test_numbers_of_the_page_by_hand():
    # 0.2555 / 0.0195 squared and 0.2565 / 0.0185 squared.
    assert page.points(0.256, 0.019) == pytest.approx((171.68, 192.23), abs=0.01)
    # mu = 0.218, K = 2 / 1.15 = 1.7391: (5.2174 - 0.436) / (10.4348 + 0.436).
    assert page.ratio_at_rest(0.109, 1.15) == pytest.approx(0.43984, abs=1e-5)
    # Small strains: E = 2 mu (1 + nu) = 0.62777 MPa.
    assert page.nominal(0.109, 1.15, 1e-5) == pytest.approx(0.62777e-5, rel=1e-4)
    side = page.narrowing(0.109, 1.15, 1e-4)
    assert (1.0 - side) / 1e-4 == pytest.approx(0.43984, rel=1e-3)


def test_no_specimen_no_efficiency():
    with pytest.raises(ValueError, match="needs undamaged and healed specimens"):
        healing([], [])
    with pytest.raises(ValueError, match="a mean needs at least one specimen"):
        recovery([1.0], [])


def test_a_figure_that_no_specimen_shows_is_named_with_its_cause():
    """Points from 6 % strain on, no fracture: only the law's constant is compared."""
    stretch = np.linspace(1.06, 1.5, 12)
    stress = 1e5 * (stretch - stretch**-2.0)
    tests = [HomogeneousTest(name, Mode.UNIAXIAL, stretch, stress) for name in ("a", "b")]
    found = healing(tests[:1], tests[1:])
    assert set(found.rows) == {"mu"}
    said = " / ".join(found.remarks)
    assert "Young's modulus to 5 % has no figure: no undamaged and no healed specimen shows it" in said
    assert "at least 3 points are needed up to 5 % strain" in said
    assert "fracture stress has no figure" in said
    assert "the stress must fall by 20 % after its largest value" in said


def test_a_constant_at_zero_has_no_efficiency_and_says_so():
    stretch = np.linspace(1.005, 1.5, 40)
    test = HomogeneousTest("a", Mode.UNIAXIAL, stretch, 1e5 * (stretch - stretch**-2.0) * stretch**0.5)
    found = healing([test], [test], law="mooney_rivlin")  # stiffens: C01 ends at its bound 0
    assert "C10" in found.rows
    assert "C01" not in found.rows
    assert "C01 has no figure: the mean of the undamaged specimens is not above 0" in found.remarks
