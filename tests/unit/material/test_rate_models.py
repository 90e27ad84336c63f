"""Selection of the rate dependence by the data: criteria by hand, and known materials."""

from dataclasses import replace
from math import exp, inf, log
from typing import Any

import numpy as np
import pytest

from explicit.materials import LAWS, neo_hookean
from explicit.relaxation import BergstromBoyce, PronySeries, bergstrom_boyce_stress
from kolsky.material.relaxation.rate_fit import DynamicTest, HistoryTest, RateModel, required_branches
from kolsky.studies.rate_models import (
    CURVE,
    NETWORK,
    Candidate,
    ModelComparison,
    compare_slow,
    comparison_table,
    fit_curve,
)

LAW = neo_hookean(20e3)
PRONY = RateModel(1.0, PronySeries((0.5,), (0.05,)))
CREEP = BergstromBoyce(0.8, 3e3)


def histories(truth: Any, seed: int) -> tuple[HistoryTest, ...]:
    """Two ramps of 0.01 and 1 s to 30 %, then held for 10 s; noise of 60 Pa."""
    rng, made = np.random.default_rng(seed), []
    for rise in (0.01, 1.0):
        time = np.concatenate([np.linspace(0.0, rise, 12), rise + np.geomspace(0.002, 10.0, 28)])
        stretch = 1.0 - 0.3 * np.minimum(time / rise, 1.0)
        test = HistoryTest(time, stretch, np.zeros(40), np.full(40, 60.0), label=f"ramp of {rise:g} s")
        if isinstance(truth, BergstromBoyce):
            stress = bergstrom_boyce_stress(LAW, truth, time, stretch)[0]
        else:
            stress = test.predict(LAW, [truth])[0]
        made.append(replace(test, stress=stress + 60.0 * rng.standard_normal(40)))
    return tuple(made)


@pytest.mark.parametrize(
    ("truth", "name"), [(RateModel(1.0, PronySeries((), ())), "elastic"), (PRONY, "prony"), (CREEP, NETWORK)]
)
def test_a_planted_material_is_chosen(truth: Any, name: str) -> None:
    slow = histories(truth, 5)
    found = compare_slow(LAW, slow, required_branches(LAW, slow, at_most=2).fits)
    assert found.chosen is not None, found.sentence
    assert found.chosen.name == name
    assert f"choose {name}" in found.sentence


def test_one_slow_ramp_chooses_nothing_beyond_elastic() -> None:
    """Of one slow ramp a fast branch is a stiffer spring: no model with a branch is chosen."""
    test = histories(PRONY, 6)[1]
    ramp = replace(test, time=100.0 * test.time[:12], stretch=test.stretch[:12], sigma=test.sigma[:12],
                   stress=test.stress[:12])  # fmt: skip
    found = compare_slow(LAW, (ramp,), required_branches(LAW, [ramp], at_most=1).fits)
    assert found.chosen is None or found.chosen.name == "elastic"


def test_a_law_that_is_wrong_in_strain_is_no_rate_dependence() -> None:
    """A stiffening rubber at one rate, held against a law that does not stiffen."""
    stiffening = LAWS["yeoh"].of([10e3, 20e3, 0.0])
    time = np.linspace(0.0, 100.0, 60)
    stretch = 1.0 - 0.5 * time / 100.0
    blank = HistoryTest(time, stretch, np.zeros(60), np.full(60, 60.0))
    stress = blank.predict(stiffening, [RateModel(1.0, PronySeries((), ()))])[0]
    noisy = replace(blank, stress=stress + 60.0 * np.random.default_rng(8).standard_normal(60))
    found = compare_slow(LAW, (noisy,), required_branches(LAW, [noisy], at_most=1).fits)
    assert found.chosen is not None
    assert found.chosen.name == CURVE
    assert "do not require rate dependence" in found.sentence
    # 60 values of their own noise, k of them used up: chi-square within 3.5 of its deviations
    k = found.chosen.parameters
    assert abs(found.chosen.deviance - (60 - k)) < 3.5 * np.sqrt(2.0 * (60 - k))
    # two rates that differ are no curve of the strain
    assert fit_curve(histories(PRONY, 6)).deviance > 10.0 * 80.0


def test_the_curve_weighs_each_value_by_its_own_noise() -> None:
    """One piece of a cubic spline is a cubic: its deviance is that of a weighted polynomial."""
    rng = np.random.default_rng(4)
    stretch, sigma = np.linspace(1.0, 0.7, 30), np.geomspace(10.0, 300.0, 30)
    stress = 1e4 * (stretch - stretch**-2) + sigma * rng.standard_normal(30)
    found = fit_curve((HistoryTest(np.linspace(0.0, 1.0, 30), stretch, stress, sigma),))
    assert found.parameters == 4
    cubic = np.polyfit(stretch - 0.85, stress, 3, w=1.0 / sigma)
    left = (np.polyval(cubic, stretch - 0.85) - stress) / sigma
    assert found.deviance == pytest.approx(float(left @ left), rel=1e-9)


def test_the_curve_is_no_rival_of_the_law() -> None:
    elastic, curve = CANDIDATES[0], Candidate(CURVE, 4, 95.0, {})
    assert ModelComparison((elastic, curve), 20, 1.0, {}).chosen is elastic
    prony = Candidate("prony", 3, 95.0, {})
    assert ModelComparison((curve, prony), 20, 1.0, {}).chosen is None


CANDIDATES = (Candidate("elastic", 1, 100.0, {}), Candidate("prony", 3, 80.0, {}))


def test_criteria_by_hand() -> None:
    """AICc = Q + 2 k + 2 k (k + 1) / (n - k - 1); BIC = Q + k ln n; weights exp(-dBIC / 2)."""
    elastic, prony = CANDIDATES
    assert elastic.aicc(20) == pytest.approx(100.0 + 2.0 + 4.0 / 18.0)
    assert prony.aicc(20) == pytest.approx(80.0 + 6.0 + 24.0 / 16.0)
    assert prony.aicc(4) == inf
    assert prony.bic(20) == pytest.approx(80.0 + 3.0 * log(20.0))
    found = ModelComparison(CANDIDATES, 20, 1.0, {})
    odds = exp(0.5 * (100.0 - 80.0 - 2.0 * log(20.0)))
    assert found.weights == pytest.approx((1.0 / (1.0 + odds), odds / (1.0 + odds)))
    table = comparison_table(found)
    assert table["BIC over the least (1)"] == pytest.approx([20.0 - 2.0 * log(20.0), 0.0])


def test_a_choice_needs_strong_evidence_and_no_doubt() -> None:
    elastic, prony = CANDIDATES
    n, pair = 20, (elastic, prony)
    assert ModelComparison(pair, n, 1.0, {}).chosen is prony  # BIC lower by 14.0
    near = replace(prony, deviance=100.0 - 2.0 * log(n) - 5.9)
    assert ModelComparison((elastic, near), n, 1.0, {}).chosen is None
    far = replace(prony, deviance=100.0 - 2.0 * log(n) - 6.1)
    assert ModelComparison((elastic, far), n, 1.0, {}).chosen is far
    doubtful = ModelComparison((elastic, replace(prony, doubt="at an end")), n, 1.0, {})
    assert doubtful.chosen is None  # it is better, and may not be chosen
    assert "at an end" in doubtful.sentence
    worse = ModelComparison((elastic, replace(prony, deviance=100.0, doubt="at an end")), n, 1.0, {})
    assert worse.chosen is elastic  # a doubtful model that is worse by BIC, by 6.0, hinders nothing
    assert ModelComparison(pair, n, 2.1, {}).chosen is None
    assert "none describes" in ModelComparison(pair, n, 2.1, {}).sentence
    # at n = 1e6 BIC prefers the smaller model where AICc prefers the larger: no choice
    small, large = Candidate("elastic", 1, 20.0, {}), Candidate("prony", 3, 0.0, {})
    assert ModelComparison((small, large), 10**6, 1.0, {}).chosen is None


def test_the_deviance_is_over_the_scatter_of_the_best_model() -> None:
    rng, omega = np.random.default_rng(7), np.geomspace(1.0, 400.0, 40)
    storage, loss = (
        60e3 * part(omega) + 130.0 * rng.standard_normal(40)
        for part in (PRONY.series.storage, PRONY.series.loss)
    )
    slow = DynamicTest(omega, storage, loss, np.full(40, 100.0), np.full(40, 100.0))
    fits = required_branches(LAW, [slow], at_most=1).fits
    found = compare_slow(LAW, (slow,), fits)
    best = fits[1].chi_square / (80 - 3)
    assert found.scatter == pytest.approx(best)
    assert found.scatter == pytest.approx(1.3**2, rel=0.4)  # 77 degrees of freedom: 2.5 x sqrt(2 / 77)
    assert found.candidates[0].deviance == pytest.approx(fits[0].chi_square / best)


def test_an_oscillation_leaves_the_network_out() -> None:
    omega, ones = np.geomspace(1.0, 100.0, 8), np.full(8, 100.0)
    shaken = DynamicTest(omega, 60e3 * np.ones(8), ones, ones, ones, label="dma")
    found = compare_slow(LAW, (shaken,), required_branches(LAW, [shaken], at_most=1).fits)
    assert NETWORK not in [one.name for one in found.candidates]
    assert "dma" in found.left_out[NETWORK]
