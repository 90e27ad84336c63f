"""Fits of Prony series to synthetic histories with known answers."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries
from kolsky.material.relaxation.evidence import DynamicTest, Evidence, HistoryTest, RateModel
from kolsky.material.relaxation.rate_fit import fit_prony, required_branches

LAW = neo_hookean(20e3)
TRUTH = RateModel(1.1, PronySeries((0.4, 0.25), (3e-3, 0.2)))
ELASTIC = RateModel(0.9, PronySeries((), ()))
TIMES = np.geomspace(1e-3, 2.0, 60)
OMEGA = np.geomspace(1.0, 2000.0, 20)


def evidence(truth: RateModel, seed: int) -> list[Evidence]:
    """Relaxation after a ramp, and oscillations; noise of 60 and 400 Pa."""
    rng = np.random.default_rng(seed)
    held = HistoryTest.relaxation(TIMES, np.zeros(60), 60.0, stretch=0.8, rise=5e-4)
    stress = held.predict(LAW, [truth])[0] + 60.0 * rng.standard_normal(len(held.time))
    noise = np.full(20, 400.0)
    shaken = DynamicTest(OMEGA, noise, noise, noise, noise)
    moduli = shaken.predict(LAW, [truth])[0] + 400.0 * rng.standard_normal(40)
    return [replace(held, stress=stress), replace(shaken, storage=moduli[:20], loss=moduli[20:])]


def test_two_branches_are_found_and_a_third_is_not_asked_for() -> None:
    verdict = required_branches(LAW, evidence(TRUTH, 1), at_most=3)
    assert verdict.branches == 2
    assert "2 branches" in verdict.sentence
    fit = verdict.fit
    planted = np.log([1.1, 0.4, 0.25, 3e-3, 0.2])
    errors = (np.log(fit.values) - planted) / np.sqrt(np.diag(fit.covariance))
    assert np.abs(errors).max() < 3.5  # five normal numbers: beyond that once in 400
    assert fit.n_data == 100
    assert 60.0 < fit.chi_square < 140.0  # 95 +- 3.3 sqrt(190)
    low, high = fit.interval("time 1")
    assert low < 3e-3 < high
    assert (high / low) < 1.1


def test_elastic_data_do_not_ask_for_a_branch() -> None:
    asked = [required_branches(LAW, evidence(ELASTIC, seed), at_most=1) for seed in range(3)]
    assert [verdict.branches for verdict in asked] == [0, 0, 0]
    assert all("do not need" in verdict.sentence for verdict in asked)
    factors = [verdict.fit.model.factor for verdict in asked]
    np.testing.assert_allclose(factors, 0.9, rtol=3e-3)  # 100 values, each to 60 Pa of 12 kPa


def test_a_normalised_error_has_unit_size_over_many_draws() -> None:
    errors = []
    for seed in range(30):
        fit = fit_prony(LAW, evidence(TRUTH, 100 + seed), 2, start=TRUTH)
        planted = np.log([1.1, 0.4, 0.25, 3e-3, 0.2])
        errors.append((np.log(fit.values) - planted) / np.sqrt(np.diag(fit.covariance) / fit.scatter))
    # 150 correlated numbers; independent ones would scatter by 0.06
    assert 0.8 < np.sqrt(np.mean(np.square(errors))) < 1.2


def test_noiseless_oscillations_alone_give_the_series_back() -> None:
    moduli = [TRUTH.factor * 60e3 * f(OMEGA) for f in (TRUTH.series.storage, TRUTH.series.loss)]
    shaken = DynamicTest(OMEGA, moduli[0], moduli[1], np.full(20, 1.0), np.full(20, 1.0))
    fit = fit_prony(LAW, [shaken], 2)
    np.testing.assert_allclose(fit.values, [1.1, 0.4, 0.25, 3e-3, 0.2], rtol=1e-5)  # where the search stops


def test_a_time_that_no_test_reaches_is_said_to_be_at_its_bound() -> None:
    """Two slow tests see an instantaneous branch as a part that has gone: nothing is left of it."""
    slow = HistoryTest.relaxation(np.linspace(10.0, 100.0, 20), np.zeros(20), 50.0, stretch=0.8, rise=1.0)
    fast = RateModel(1.0, PronySeries((0.5,), (1e-4,)))
    made = replace(slow, stress=slow.predict(LAW, [fast])[0])
    assert required_branches(LAW, [made], at_most=1).branches == 0


def test_errors_name_what_is_wrong() -> None:
    ones = np.ones(3)
    with pytest.raises(ValueError, match="needs evidence"):
        fit_prony(LAW, [], 1)
    with pytest.raises(ValueError, match="n_branches must be >= 0"):
        fit_prony(LAW, evidence(TRUTH, 0), -1)
    with pytest.raises(ValueError, match="more than 5 measured values, got 3"):
        fit_prony(LAW, [HistoryTest(np.arange(3.0), ones, ones, ones)], 2)
    with pytest.raises(ValueError, match="sigma of stress must be > 0"):
        HistoryTest(np.arange(3.0), ones, ones, 0.0 * ones)
    with pytest.raises(ValueError, match="one value per sample"):
        HistoryTest(np.arange(3.0), ones, np.ones(2), ones)
    with pytest.raises(ValueError, match="angular_frequency must be > 0"):
        DynamicTest(np.array([0.0, 1.0, 2.0]), ones, ones, ones, ones)
    with pytest.raises(ValueError, match="times must be >= the rise"):
        HistoryTest.relaxation([0.1, 1.0], ones[:2], ones[:2], stretch=0.8, rise=0.5)
    with pytest.raises(ValueError, match="parameter must be one of factor"):
        fit_prony(LAW, evidence(ELASTIC, 0), 0).interval("time 1")
