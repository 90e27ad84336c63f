"""Apparent moduli of tests of every kind on one axis of time."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries
from kolsky.material.relaxation.evidence import DynamicTest, HistoryTest, RateModel
from kolsky.material.relaxation.rate_fit import (
    ApparentModuli,
    apparent_moduli,
    dynamic_modulus,
    fit_prony,
    fitted_modulus,
)
from kolsky.report.canvas import build
from kolsky.report.figures import MODULI
from kolsky.report.figures.rates import TimeScales

LAW, YOUNG = neo_hookean(20e3), 60e3
MODEL = RateModel(1.1, PronySeries((0.4,), (0.05,)))


def relaxed(stretch: float) -> HistoryTest:
    times = np.geomspace(1e-3, 1.0, 40)
    test = HistoryTest.relaxation(times, np.zeros(40), 20.0, stretch=stretch)
    return replace(test, stress=test.predict(LAW, [MODEL])[0])


@pytest.mark.parametrize("stretch", [0.48, 0.85, 1.4])
def test_a_held_step_shows_the_relaxation_modulus_at_any_strain(stretch: float) -> None:
    shown = apparent_moduli(relaxed(stretch))
    times = np.geomspace(1e-3, 1.0, 40)
    np.testing.assert_allclose(shown.age, times, rtol=1e-12)
    # neo-Hookean: strain and time separate, as the paper's Fig. 11 relies on
    np.testing.assert_allclose(shown.modulus, 1.1 * YOUNG * MODEL.series.relaxation(times), rtol=1e-10)
    np.testing.assert_allclose(shown.sigma, 60.0 / abs(stretch - stretch**-2), rtol=1e-12)


def test_a_steady_ramp_is_half_as_old_as_it_lasts() -> None:
    time = np.linspace(0.0, 4.0, 81)
    ramp = HistoryTest(time, np.exp(-0.1 * time), -np.ones(81), np.ones(81), "ramp")
    shown = apparent_moduli(ramp)
    np.testing.assert_allclose(shown.age, 0.5 * time[-len(shown.age) :], rtol=1e-12)
    assert np.abs(shown.strain).min() >= 0.02


def test_an_oscillation_and_a_shot_have_their_places() -> None:
    omega = np.array([1.0, 100.0])
    shown = apparent_moduli(DynamicTest(omega, np.array([6e4, 7e4]), omega, np.ones(2), np.ones(2)))
    np.testing.assert_array_equal(shown.age, [1.0, 0.01])
    np.testing.assert_array_equal(shown.modulus, [6e4, 7e4])
    # Mates et al. (2012): m = 1.05 +- 0.09 of 74 kPa
    shot = dynamic_modulus(
        factor=1.05, sigma_factor=0.09, young=74e3, strain=-0.6, duration=1.5e-3, label="mean"
    )
    assert shot.modulus[0] == pytest.approx(77.7e3)
    assert shot.sigma[0] == pytest.approx(6.66e3)
    assert abs(shot.strain[0]) / shot.age[0] == pytest.approx(800.0)


def test_the_fitted_curve_has_the_spread_of_its_draws() -> None:
    rng, test = np.random.default_rng(2), relaxed(0.8)
    noise = np.where(np.isfinite(test.sigma), test.sigma, 0.0)
    fit = fit_prony(LAW, [replace(test, stress=test.stress + noise * rng.standard_normal(len(noise)))], 1)
    age = np.array([1e-3, 0.03, 0.1, 1.0])
    modulus, sigma = fitted_modulus(fit, YOUNG, age)
    logs = rng.multivariate_normal(np.log(fit.values), fit.covariance, size=4000)
    drawn = np.exp(logs)
    curves = YOUNG * drawn[:, :1] * (1.0 + drawn[:, 1:2] * np.exp(-age / drawn[:, 2:]))
    np.testing.assert_allclose(sigma, curves.std(axis=0), rtol=0.08)  # 4000 draws: 1.1 %; and what is curved
    assert (np.abs(modulus - 1.1 * YOUNG * MODEL.series.relaxation(age)) < 4.0 * sigma).all()


def test_what_has_no_age_is_refused() -> None:
    time = np.linspace(0.0, 1.0, 5)
    cycle = HistoryTest(time, np.array([1.0, 0.9, 0.8, 0.9, 1.0]), np.zeros(5), np.ones(5), "cycle")
    with pytest.raises(ValueError, match="cycle: the stretch turns back at sample 3"):
        apparent_moduli(cycle)
    tiny = HistoryTest(time, np.linspace(1.0, 0.99, 5), np.zeros(5), np.ones(5), "tiny")
    with pytest.raises(ValueError, match="tiny: no sample"):
        apparent_moduli(tiny)
    with pytest.raises(ValueError, match="duration must be > 0"):
        dynamic_modulus(factor=1.0, sigma_factor=0.1, young=1.0, strain=-0.5, duration=0.0, label="x")


def test_every_kind_of_test_stands_on_one_axis() -> None:
    step = relaxed(0.8)
    omega = np.array([1.0, 100.0])
    dynamic = DynamicTest(omega, np.array([6e4, 7e4]), omega, np.ones(2), np.ones(2))
    shot = dynamic_modulus(
        factor=1.1, sigma_factor=0.01, young=YOUNG, strain=-0.6, duration=1e-3, label="shot"
    )
    fit, age = fit_prony(LAW, [step], 1), np.geomspace(1e-3, 1.0, 20)
    shown = TimeScales(
        (apparent_moduli(step), apparent_moduli(dynamic), shot),
        ApparentModuli("fitted", age, np.zeros(20), *fitted_modulus(fit, YOUNG, age)),
    )
    kind = MODULI["rate-moduli"]
    assert kind.applies(shown)
    assert not kind.applies(TimeScales(()))
    (ax,) = build(kind, shown).axes
    assert ax.get_xscale() == "log"
    assert len(ax.containers) == 3
    drawn = ax.containers[2].lines[0]
    assert float(drawn.get_xdata()[0]) == shot.age[0]
    assert float(drawn.get_ydata()[0]) == pytest.approx(1e-3 * shot.modulus[0])
