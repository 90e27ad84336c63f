"""Uncertainties, criteria and verdicts of the material's curves and fits, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from explicit.relaxation import PronySeries
from kolsky.base.apparatus import Specimen
from kolsky.material import reference_curve as reference
from kolsky.material.end_friction.problem import EndFriction
from kolsky.material.fits.compare import Candidate, Comparison, PathStability, Row, Stability
from kolsky.material.fits.fit import FitOutcome
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.reference_curve import Treatment, reference_curve
from kolsky.material.relaxation import rate_fit as prony_fit
from kolsky.material.relaxation.rate_fit import HistoryTest, RateFit, RateModel, RateVerdict, apparent_moduli
from kolsky.material.uniaxial import (
    CurveBand,
    Toe,
    UniaxialTest,
    apparent_modulus,
    correct_toe,
    loading_ramps,
    student_factor,
)

STRAIN = np.linspace(0.01, 0.4, 100)
SPECIMEN = Specimen(diameter=9.5e-3, length=6.5e-3, density=1000.0)


def compressed(stress, strain=STRAIN, name="a", **more):
    return UniaxialTest(name, strain, stress, compression=True, **more)


# The curve and its band


def test_students_factor_is_the_quotient_of_the_tables():
    """Student's t at 95.45 %: 13.97, 4.53, 2.87, 2.28 for 1, 2, 4, 10 degrees of freedom (GUM, table G.2)."""
    found = [2.0 * student_factor(nu) for nu in (1, 2, 4, 10)]
    np.testing.assert_allclose(found, [13.97, 4.53, 2.87, 2.28], atol=0.006)
    with pytest.raises(ValueError, match="at least 1 degree of freedom, got 0"):
        student_factor(0)


def test_sigma_of_a_toe_is_that_of_a_lines_zero():
    """The zero of y = b (x - c): s^2 / b^2 (1 / n + (mean x - c)^2 / Sxx), s^2 with n - 2."""
    e = np.linspace(0.02, 0.08, 31)
    ripple = 40.0 * np.where(np.arange(31) % 2, 1.0, -1.0)
    stress = 5e4 * (e - 0.012) + ripple
    begun = correct_toe(compressed(stress, e), Toe("line", 0.02, 0.08))
    b, a = np.polyfit(e, stress, 1)
    zero = -a / b
    s2 = np.sum((stress - a - b * e) ** 2) / 29
    spread = np.sum((e - e.mean()) ** 2)
    assert begun.offset == pytest.approx(zero, abs=1e-8)
    assert begun.sigma == pytest.approx(
        np.sqrt(s2 / b**2 * (1 / 31 + (e.mean() - zero) ** 2 / spread)), rel=1e-5
    )


@pytest.mark.parametrize(("offset", "refused"), [(0.0199, False), (0.0201, True)])
def test_a_toe_ends_before_the_range_it_is_continued_from(offset, refused):
    e = np.linspace(0.0, 0.1, 101)
    test = compressed(np.maximum(5e4 * (e - offset), -1e3), e)
    if refused:
        with pytest.raises(ValueError, match=r"the stress is zero at 0\.0201, inside the range"):
            correct_toe(test, Toe("line", 0.02, 0.08))
    else:
        assert correct_toe(test, Toe("line", 0.02, 0.08)).offset == pytest.approx(offset, abs=1e-6)


@pytest.mark.parametrize(("back", "ramps"), [(0.04, 1), (0.06, 2)])
def test_a_ramp_ends_where_the_strain_goes_back_by_a_twentieth(back, ramps):
    strain = np.concatenate([np.linspace(0.0, 0.6, 61), [0.6 - back], np.linspace(0.6 - back, 1.0, 50)[1:]])
    assert len(loading_ramps(compressed(strain, strain))) == ramps


def test_a_mean_modulus_adds_common_parts_and_averages_noise():
    """Two modes of 3 % and 4 % of E_a, opposite in sign over the halves, and noise."""
    stress = 1e4 * (1 / (1 - STRAIN) ** 2 - (1 - STRAIN))
    half = np.where(np.arange(100) < 50, 1.0, -1.0)
    modes = np.stack([0.03 * stress, 0.04 * half * stress])
    band = CurveBand(STRAIN, stress, 0.05 * stress, modes, ("scale", "shape"))
    found = apparent_modulus(band, compression=True)
    np.testing.assert_allclose(found.modulus, 3e4)
    np.testing.assert_allclose(found.sigma, 3e4 * np.sqrt(0.03**2 + 0.04**2 + 0.05**2))
    assert found.mean_sigma == pytest.approx(3e4 * np.hypot(0.03, 0.05 / 10))  # the second mode cancels
    np.testing.assert_allclose(found.interval()[1] - found.modulus, 2 * found.sigma)
    np.testing.assert_allclose(band.parts()["noise"], 0.05 * stress)


def test_one_test_has_the_toes_sigma_and_the_declared_scale():
    e = np.linspace(0.0, 0.4, 401)
    ripple = 1.0 * np.where(np.arange(401) % 2, 1.0, -1.0)
    stress = 5e4 * (e - 0.005) + ripple
    found = reference_curve([compressed(stress, e)], Treatment(toe=Toe("line", 0.02, 0.2), scale_sigma=0.03))
    band = found.apparent
    assert band.names == ("toe", "force and section")
    np.testing.assert_allclose(band.modes[0], found.tests[0].sigma * 5e4, rtol=2e-3)  # slope of the mean
    np.testing.assert_allclose(band.modes[1], 0.03 * band.stress)
    # Each sample lies 2 N/m^2 off its neighbours' line, sqrt(1.5) of the noise.
    assert band.noise[0] == pytest.approx(2.0 / np.sqrt(1.5) / norm.ppf(0.75), rel=1e-3)
    assert found.remarks == ("one test: the scatter between specimens is unknown and not in the band",)


@pytest.mark.parametrize(("past", "remarks"), [(0.24, 0), (0.26, 1)])
def test_a_specimen_past_the_curves_end_is_remarked(past, remarks, monkeypatch):
    given = {}

    def corrected(band, specimen, ends, **options):
        given.update(options)
        return SimpleNamespace(band=band, past_data=past, remarks=())

    monkeypatch.setattr(reference, "correct_friction", corrected)
    stress = 1e4 * STRAIN
    bulge = np.full(100, 5e-3)
    tests = [compressed(f * stress, name=f"s{f}", bulge=bulge) for f in (0.9, 1.0, 1.1, 1.0)]
    found = reference_curve(tests, Treatment(specimen=SPECIMEN, ends=EndFriction("bonded"), bulge_sigma=8e-6))
    assert len(found.remarks) == remarks
    assert given["bulge_sigma"] == pytest.approx(4e-6)  # the mean of four radii
    np.testing.assert_allclose(given["bulge"], 5e-3)


# Which law, and whether it is stable


def row(name, *, aic=0.0, bic=0.0, outcome=FitOutcome.DETERMINED, stable=True):
    path = PathStability(Mode.UNIAXIAL, "tension", Stability.STABLE if stable else Stability.UNSTABLE, 0.5)
    return Row(Candidate(name, None), SimpleNamespace(aic=aic, bic=bic, outcome=outcome), (path,), (path,))


def best(*rows):
    found = Comparison((), None, True, None, rows).best
    return found and found.candidate.name


def test_the_best_law_has_the_least_bic_of_those_that_hold():
    assert best(row("rich", aic=1.0, bic=9.0), row("plain", aic=2.0, bic=8.0)) == "plain"
    assert best(row("a", bic=1.0, stable=False), row("b", bic=2.0)) == "b"
    assert best(row("a", bic=1.0, outcome=FitOutcome.NOT_DETERMINED), row("b", bic=2.0)) == "b"
    assert best(row("a", bic=1.0, outcome=FitOutcome.UNCONFIRMED), row("b", bic=2.0)) == "b"
    assert best(row("a", bic=1.0, outcome=FitOutcome.AT_BOUND), row("b", bic=2.0)) == "a"
    assert best(Row(Candidate("none", None), None, (), (), "no fit")) is None


# Rate dependence


def rate_fit(chi_square, n_parameters, *, n_data=21, at_bound=()):
    names = ("factor", "strength 1", "time 1", "strength 2", "time 2")[:n_parameters]
    return RateFit(
        RateModel(1.0, PronySeries((), ())), names, np.full(n_parameters, 2.0), 0.09 * np.eye(n_parameters),
        chi_square, n_data, (), at_bound,
    )  # fmt: skip


def test_criteria_of_a_rate_fit_by_hand():
    fit = rate_fit(36.0, 3)
    assert fit.scatter == pytest.approx(2.0)  # 36 over 21 - 3
    assert rate_fit(9.0, 3).scatter == 1.0
    assert fit.aic == pytest.approx(42.0)
    assert fit.bic == pytest.approx(36.0 + 3 * np.log(21))
    assert fit.interval("time 1") == pytest.approx((2.0 * np.exp(-0.6), 2.0 * np.exp(0.6)))


@pytest.mark.parametrize(
    ("probability", "chi_square", "bound", "branches"),
    [
        (0.0099, 10.0, (), 1),
        (0.0101, 10.0, (), 0),
        (0.001, 15.9, (), 1),  # AIC 20 + 2 against 15.9 + 6
        (0.001, 16.1, (), 0),
        (0.001, 10.0, ("time 1",), 0),
    ],
)
def test_a_branch_is_significant_lowers_aic_and_is_determined(probability, chi_square, bound, branches):
    verdict = RateVerdict((rate_fit(20.0, 1), rate_fit(chi_square, 3, at_bound=bound)), (probability,))
    assert verdict.branches == branches
    assert verdict.fit is verdict.fits[branches]
    assert verdict.sentence.startswith("the data require 1 branch (" if branches else "the data do not need")
    if not branches:
        assert f"AIC {chi_square + 6 - 22:+.1f}" in verdict.sentence


def test_a_gain_is_weighed_by_the_scatter_with_two_degrees_of_freedom(monkeypatch):
    fits = {0: rate_fit(60.0, 1), 1: rate_fit(36.0, 3), 2: rate_fit(32.0, 5)}
    monkeypatch.setattr(prony_fit, "fit_prony", lambda law, evidence, n, **options: fits[n])
    verdict = prony_fit.required_branches(None, [])
    # The richest has 32 over 21 - 5 = 2: gains 24 / 2 and 4 / 2, of two parameters: exp(-gain / 2).
    assert verdict.probabilities == pytest.approx((np.exp(-6.0), np.exp(-1.0)))
    assert verdict.probabilities[0] == pytest.approx(chi2.sf(12.0, 2))


@pytest.mark.parametrize(("stretch", "shown"), [(0.981, False), (0.979, True)])
def test_a_modulus_is_shown_from_two_percent_of_strain(stretch, shown):
    test = HistoryTest.relaxation([0.1, 1.0], [-1e3, -1e3], [50.0, 50.0], stretch=stretch)
    if not shown:
        with pytest.raises(ValueError, match=r"a strain of 0\.02 or more"):
            apparent_moduli(test)
        return
    found = apparent_moduli(test)
    gauss = 3.0 / (stretch - stretch**-2)
    np.testing.assert_allclose(found.modulus, -1e3 * gauss)
    np.testing.assert_allclose(found.sigma, 50.0 * abs(gauss))
    np.testing.assert_allclose(found.age, [0.1, 1.0])
