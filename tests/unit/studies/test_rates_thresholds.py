"""Rates: degrees of freedom, leverage, shared parts and limits of a slope, each tested on both sides."""

import numpy as np
import pytest
from ratedshots import baseline, rated
from scipy.stats import chi2
from scipy.stats import t as student

from kolsky.studies.rates.comparison import common_parts, compare
from kolsky.studies.rates.records import StrainHistory
from kolsky.studies.rates.scatter import Slope, SlopeVerdict, mixed_fit, pool, slope

Y = np.array([1.18, 1.04, 1.09, 0.94, 1.02])
S = np.full(5, 0.02)


def test_degrees_of_freedom_are_values_less_coefficients() -> None:
    X = np.column_stack([np.ones(5), np.arange(5.0)])
    assert mixed_fit(Y, S, np.ones((5, 1))).freedom == 4
    fit = mixed_fit(Y, S, X)
    assert fit.freedom == 3
    # With tau from Q at the final weights Knapp and Hartung's factor is one, with n - p degrees of freedom.
    assert fit.scale == pytest.approx(1.0, rel=1e-9)
    # Closed form of Q with alike uncertainties: residual sum of squares over s^2.
    rest = Y - X @ np.linalg.lstsq(X, Y, rcond=None)[0]
    assert fit.q == pytest.approx(rest @ rest / 0.02**2, rel=1e-9)
    assert fit.i_squared == pytest.approx(1.0 - 3.0 / fit.q, rel=1e-12)
    assert fit.between**2 == pytest.approx(rest @ rest / 3.0 - 0.02**2, rel=1e-9)


def test_knapp_and_hartungs_factor_by_hand() -> None:
    # Values that agree better than their uncertainties: tau = 0 and Q / (n - p) = (2 x 0.01^2 / 0.05^2) / 2.
    fit = mixed_fit(np.array([1.0, 1.01, 0.99]), np.full(3, 0.05), np.ones((3, 1)))
    assert fit.between == 0.0
    assert fit.scale == pytest.approx(0.04, rel=1e-9)
    assert fit.sigma(0) == pytest.approx(0.05 / np.sqrt(3.0), rel=1e-12)  # the factor never narrows


def test_pooled_mean_prediction_and_probability() -> None:
    found = pool(Y, S)
    own = Y.std(ddof=1) / np.sqrt(5.0)
    assert found.scatter == pytest.approx(Y.std(ddof=1), rel=1e-15)
    assert found.sigma == pytest.approx(own, rel=1e-9)
    assert found.sigma_common == 0.0
    t = student.ppf(0.975, 4)  # 2.776
    assert found.interval == pytest.approx((Y.mean() - t * own, Y.mean() + t * own), rel=1e-9)
    # Eq. (S.7): tau^2 = s^2 - u^2, and the mean's own variance s^2 / n.
    half = t * np.sqrt(Y.var(ddof=1) * 1.2 - 0.02**2)
    assert found.prediction == pytest.approx((Y.mean() - half, Y.mean() + half), rel=1e-9)
    expected = chi2.sf(4.0 * Y.var(ddof=1) / 0.02**2, 4)
    assert found.probability == pytest.approx(expected, rel=1e-9, abs=0.0)  # some 1e-15


def test_half_of_what_is_left_after_sharing_is_by_welch_and_satterthwaite() -> None:
    found = pool(Y, S, common=np.full((1, 5), 0.03))
    own = Y.var(ddof=1) / 5.0
    freedom = 4.0 * (1.0 + 0.0009 / own) ** 2
    half = student.ppf(0.975, freedom) * np.sqrt(own + 0.0009)
    assert found.interval[1] - found.mean == pytest.approx(half, rel=1e-9)
    assert found.sigma_common == pytest.approx(0.03, rel=1e-9)


# Slopes

DEVIATIONS = np.array([0.004, -0.006, 0.003, 0.002, -0.005, 0.002])


def line(rates: np.ndarray, m: np.ndarray, *, spread: float = 0.05, sigma: float = 0.005) -> Slope:
    return slope(rates, np.full(rates.size, spread), m, np.full(rates.size, sigma))


def names(found: Slope) -> list[str]:
    return [c.name for c in found.criteria if not c.met]


def test_a_slope_needs_four_shots() -> None:
    rates = np.geomspace(100.0, 1000.0, 4)
    assert names(line(rates, 1.1 + DEVIATIONS[:4])) == []
    assert names(line(rates[:3] * 1.0, 1.1 + DEVIATIONS[:3], spread=0.01))[0] == "shots"


@pytest.mark.parametrize(("span", "refused"), [(0.51, []), (0.49, ["span of the rates"])])
def test_a_slope_needs_half_a_decade(span: float, refused: list[str]) -> None:
    assert names(line(100.0 * np.logspace(0.0, span, 6), 1.1 + DEVIATIONS)) == refused


@pytest.mark.parametrize(("spread", "refused"), [(0.24, 0), (0.26, 1)])
def test_a_slope_needs_four_times_the_spread_inside_a_test(spread: float, refused: int) -> None:
    found = line(np.geomspace(100.0, 1000.0, 6), 1.1 + DEVIATIONS, spread=spread)
    assert names(found) == ["span over the spread of the rate inside a test"] * refused


@pytest.mark.parametrize(("lever", "refused"), [(0.89, 0), (0.91, 1)])
def test_one_shot_may_hold_nine_tenths_of_the_lever(lever: float, refused: int) -> None:
    # Six shots, one at x = 1 and five at -0.2, two of them moved by a: the leverage of the first is
    # 1 / 6 + x^2 / S with the sum of squares S = 1 + 5 x 0.04 + 2 a^2.
    a = np.sqrt(0.5 * (1.0 / (lever - 1.0 / 6.0) - 1.2))
    places = np.array([-0.2 - a, -0.2 + a, -0.2, -0.2, -0.2, 1.0])
    found = line(300.0 * 10.0**places, 1.1 + DEVIATIONS)
    assert found.fit.leverage.max() == pytest.approx(lever, rel=1e-6)
    assert names(found) == ["largest leverage of one shot"] * refused


def no_slope() -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Rates, their decades from the mean, deviations without a slope and its half width at 95 %."""
    rates = np.geomspace(100.0, 1000.0, 6)
    x = np.log10(rates) - np.log10(rates).mean()
    away = DEVIATIONS - DEVIATIONS.mean()
    away -= x * (x @ away) / (x @ x)
    return rates, x, away, student.ppf(0.975, 4) * np.sqrt(away @ away / 4.0 / (x @ x))


@pytest.mark.parametrize(("share", "refused"), [(0.98, 0), (1.02, 1)])
def test_a_slope_may_be_uncertain_by_the_mean_per_decade(share: float, refused: int) -> None:
    rates, _, away, unit = no_slope()  # wanted over a mean of 1.1
    found = line(rates, 1.1 + away * share * 1.1 / unit)
    criterion = found.criteria[-1]
    assert criterion.value == pytest.approx(share, rel=1e-6)  # the root's tolerance
    assert len(names(found)) == refused


def test_the_sign_of_a_slope_is_claimed_where_its_interval_leaves_zero_out() -> None:
    rates, x, away, half = no_slope()
    for factor, verdict in ((0.99, SlopeVerdict.NONE_SEEN), (1.01, SlopeVerdict.SENSITIVE)):
        assert line(rates, 1.1 + away + factor * half * x, sigma=1e-5).verdict is verdict


# What shots share


def test_own_and_shared_parts() -> None:
    shot = rated("a", 1.1, 300.0, own=0.03, curve=0.04)
    assert shot.sigma_own == pytest.approx(0.03)
    assert shot.sigma == pytest.approx(0.05)
    assert shot.common_parts() == {("material curve", baseline().source): pytest.approx(0.04)}
    parts = common_parts([shot, rated("b", 1.2, 400.0)], 0.01)
    np.testing.assert_allclose(parts["declared", "all shots"], [0.011, 0.012])
    np.testing.assert_allclose(parts["material curve", baseline().source], [0.04, 0.0])


def test_the_rate_of_a_test_is_as_uncertain_as_its_spread_and_its_noise() -> None:
    history = StrainHistory(
        time=np.array([0.0, 1.0]),
        strain=np.array([0.0, 0.5]),
        span=(0.0, 1.0),
        nominal_rate=200.0,
        sigma_rate=200.0 * np.log(10.0) * 0.04,
        true_rate=(200.0, 400.0),
        spread=0.03,
    )
    assert history.sigma_decades == pytest.approx(0.05)


def test_the_long_lever_starts_at_one_by_definition() -> None:
    shots = [rated(f"s{i}", m, 100.0) for i, m in enumerate(Y)]
    (group,) = compare(shots).groups
    lever, pooled = group.long_lever, group.pooled
    assert pooled is not None
    # The curve of the helper is at 0.01 1/s: four decades below 100 1/s.
    assert lever.decades == pytest.approx(4.0)
    assert lever.slope == pytest.approx((pooled.mean - 1.0) / 4.0)
    assert lever.interval == pytest.approx(tuple((end - 1.0) / 4.0 for end in pooled.interval))


@pytest.mark.parametrize(("slow", "there"), [(9.9, True), (10.1, False)])
def test_the_long_lever_needs_a_decade(slow: float, there: bool) -> None:
    shots = [rated(f"s{i}", m, 100.0, quasi_static=baseline(slow)) for i, m in enumerate(Y)]
    assert (compare(shots).groups[0].long_lever is not None) is there


@pytest.mark.parametrize(("share", "said"), [(0.019, False), (0.021, True)])
def test_sizes_that_differ_by_two_per_cent_are_said(share: float, said: bool) -> None:
    from dataclasses import replace

    shots = [rated(f"s{i}", m, 100.0) for i, m in enumerate(Y)]
    diameter, length = shots[0].specimen
    shots[0] = replace(shots[0], specimen=(diameter * (1.0 + share), length))
    remarks = compare(shots).groups[0].remarks
    assert any("the specimens' diameters differ" in text for text in remarks) is said
