"""Random-effects means and meta-regression against published numbers, another program and closed forms."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import linregress
from scipy.stats import t as student

from kolsky.studies.rates.scatter import METHODS, mixed_fit, pool

# R. N. Kacker, "Combining information from interlaboratory evaluations using a random effects model",
# Metrologia 41 (2004) 132, Table 1: nine laboratories' means and variances.
KACKER = np.array([61.00, 61.40, 62.21, 62.30, 62.34, 62.60, 62.70, 62.84, 65.90])
VARIANCE = np.array([0.2025, 1.2100, 0.0900, 0.2025, 0.3844, 0.5625, 0.0676, 0.0225, 1.8225])


def test_the_published_scatter_of_nine_laboratories():
    found = pool(KACKER, np.sqrt(VARIANCE))
    # The table prints four digits; its DerSimonian-Laird value is rounded in an earlier step there, 0.5359.
    assert found.fit.between == pytest.approx(0.8399, abs=6e-5)
    assert found.others["dersimonian-laird"][1] == pytest.approx(0.5359, abs=1e-3)


def test_another_program_gives_the_same_digits():
    # R, metafor::rma on the same data: method "PM" (tolerance 1e-9), "DL", "DL" with test = "knha", and "FE".
    found = pool(KACKER, np.sqrt(VARIANCE))
    assert found.mean == pytest.approx(62.4076199113286, abs=1e-9)
    assert found.fit.between**2 == pytest.approx(0.705395309224248, abs=1e-9)
    assert np.sqrt(found.fit.covariance[0, 0]) == pytest.approx(0.338030602684471, abs=1e-9)
    assert found.fit.q == pytest.approx(24.801897741835, abs=1e-9)
    assert found.probability == pytest.approx(0.00167935146372742, abs=1e-9)
    assert found.fit.i_squared == pytest.approx(0.67744403741711, abs=1e-9)
    laird = mixed_fit(KACKER, np.sqrt(VARIANCE), np.ones((9, 1)), method="dersimonian-laird")
    assert laird.coefficients[0] == pytest.approx(62.3901386044504, abs=1e-9)
    assert laird.sigma(0) == pytest.approx(0.29477605699879, abs=1e-9)
    assert laird.interval(0) == pytest.approx((61.710383798052, 63.0698934108488), abs=1e-9)


def test_the_restricted_likelihood_is_largest_there():
    fit = mixed_fit(KACKER, np.sqrt(VARIANCE), np.ones((9, 1)), method="reml")

    def minus_log_likelihood(tau2: float) -> float:
        w = 1.0 / (VARIANCE + tau2)
        mean = np.sum(w * KACKER) / np.sum(w)
        return 0.5 * (np.sum(w * (KACKER - mean) ** 2) - np.sum(np.log(w)) + np.log(np.sum(w)))

    best = minimize_scalar(
        minus_log_likelihood, bounds=(0.0, 10.0), method="bounded", options={"xatol": 1e-9}
    )
    # A maximum is flat: the search places it to the square root of its own round-off.
    assert fit.between**2 == pytest.approx(best.x, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_alike_uncertainties_give_the_arithmetic_mean(method):
    y, s = np.array([1.18, 1.04, 1.09, 0.94, 1.02]), np.full(5, 0.02)
    fit = mixed_fit(y, s, np.ones((5, 1)), method=method)
    # Closed form, exact up to round-off and the root's tolerance: s^2 of the values is sigma^2 + tau^2.
    assert fit.coefficients[0] == pytest.approx(y.mean(), rel=1e-12)
    assert fit.between**2 == pytest.approx(y.var(ddof=1) - 0.02**2, rel=1e-9)
    assert fit.scale == pytest.approx(1.0, rel=1e-9)
    half = student.ppf(0.975, 4) * y.std(ddof=1) / np.sqrt(5.0)
    assert fit.interval(0) == pytest.approx((y.mean() - half, y.mean() + half), rel=1e-9)
    assert fit.leverage == pytest.approx(np.full(5, 0.2), rel=1e-12)


def test_alike_uncertainties_give_the_line_of_least_squares():
    rng = np.random.default_rng(3)
    x = np.linspace(-1.0, 1.0, 7)
    y = 1.1 + 0.3 * x + 0.05 * rng.standard_normal(7)
    fit = mixed_fit(y, np.full(7, 1e-4), np.column_stack([np.ones(7), x]))
    least = linregress(x, y)
    assert fit.coefficients == pytest.approx([least.intercept, least.slope], rel=1e-9)
    assert fit.sigma(1) == pytest.approx(least.stderr, rel=1e-7)  # the root's tolerance
    assert fit.leverage.sum() == pytest.approx(2.0, rel=1e-12)  # the trace of a hat matrix


def test_shots_that_agree_are_not_made_more_certain_by_it():
    y, s = np.array([1.0, 1.001, 0.999, 1.0]), np.full(4, 0.05)
    fit = mixed_fit(y, s, np.ones((4, 1)))
    assert fit.between == 0.0
    assert fit.scale < 0.01
    assert fit.sigma(0) == pytest.approx(0.05 / 2.0, rel=1e-12)


def test_what_is_shared_does_not_average_out():
    y, s = np.array([1.0, 1.2, 1.1, 0.9]), np.full(4, 0.01)
    alone = mixed_fit(y, s, np.ones((4, 1)))
    fit = mixed_fit(y, s, np.ones((4, 1)), common=np.full((1, 4), 0.05))
    # Equal weights: u^2 = s^2 / n + c^2, and Welch and Satterthwaite with infinite freedom for c.
    own = y.var(ddof=1) / 4.0
    assert fit.coefficients == pytest.approx(alone.coefficients)
    assert fit.sigma(0) ** 2 == pytest.approx(own + 0.05**2, rel=1e-9)
    assert fit.effective_freedom(0) == pytest.approx(3.0 * ((own + 0.05**2) / own) ** 2, rel=1e-9)
    line = np.column_stack([np.ones(4), np.arange(4.0)])
    moved = mixed_fit(y, s, line, common=np.full((1, 4), 0.05))
    assert moved.common[1, 1] < 1e-20  # what moves all alike moves no slope
    tilted = mixed_fit(y, s, line, common=0.05 * np.arange(4.0)[None])
    assert np.sqrt(tilted.common[1, 1]) == pytest.approx(0.05, rel=1e-9)


def test_the_mean_without_each_shot_is_that_of_the_others():
    found = pool(KACKER, np.sqrt(VARIANCE), common=0.1 * np.eye(9))
    without = found.leave_one_out[8]
    assert without is not None
    rest = pool(KACKER[:8], np.sqrt(VARIANCE[:8]), common=0.1 * np.eye(9)[:, :8])
    assert without.coefficients == pytest.approx(rest.fit.coefficients)
    assert without.sigma(0) == pytest.approx(rest.sigma)
    assert pool(KACKER[:2], np.sqrt(VARIANCE[:2])).leave_one_out == (None, None)


def test_the_interval_holds_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(11)
    held, draws = 0, 500
    for _ in range(draws):
        s = rng.uniform(0.02, 0.06, 5)
        y = 1.1 + np.hypot(s, 0.05) * rng.standard_normal(5)
        low, high = mixed_fit(y, s, np.ones((5, 1))).interval(0)
        held += low <= 1.1 <= high
    # 95 % of 500 is 475 with a standard deviation of 5; the variance is not allowed below the shots' own, so
    # that it may hold more often. Normal quantiles would hold some 90 %.
    assert 460 <= held <= 500


@pytest.mark.parametrize(
    ("y", "s", "X", "message"),
    [
        ([1.0, 2.0], [0.1, 0.0], [[1.0], [1.0]], "must be > 0"),
        ([1.0, np.nan], [0.1, 0.1], [[1.0], [1.0]], "finite"),
        ([1.0], [0.1], [[1.0]], "at least 2 values"),
        ([1.0, 2.0, 3.0], [0.1, 0.1, 0.1], [[1.0, 2.0]] * 3, "go together"),
        ([1.0, 2.0], [0.1], [[1.0], [1.0]], "got"),
    ],
)
def test_what_cannot_be_fitted_is_refused(y, s, X, message):
    with pytest.raises(ValueError, match=message):
        mixed_fit(np.array(y), np.array(s), np.array(X))


def test_an_unknown_estimator_is_refused():
    with pytest.raises(ValueError, match="there are paule-mandel"):
        mixed_fit(KACKER, np.sqrt(VARIANCE), np.ones((9, 1)), method="guess")  # type: ignore[arg-type]


def test_one_shot_has_no_scatter():
    with pytest.raises(ValueError, match="at least 2"):
        pool(np.array([1.0]), np.array([0.1]))


CASES = {
    # values and standard uncertainties of Hartung and others' kind: agreeing, scattered, uneven
    "agreeing": ([1.0, 1.1, 0.9, 1.05], [0.2, 0.3, 0.25, 0.2]),
    "scattered": ([1.12, 1.31, 0.98, 1.22, 1.4], [0.02, 0.05, 0.03, 0.02, 0.04]),
    "uneven": ([3.0, 3.4, 2.1], [0.01, 0.5, 0.2]),
}


@pytest.mark.parametrize("name", CASES)
def test_the_scatter_between_values_is_that_of_statsmodels(name: str) -> None:
    analysis = pytest.importorskip("statsmodels.stats.meta_analysis", reason="needs statsmodels")
    values, sigma = (np.array(row) for row in CASES[name])
    oracle = analysis.combine_effects(values, sigma**2, method_re="iterated", atol=1e-12)
    found = mixed_fit(values, sigma, np.ones((values.size, 1)))
    np.testing.assert_allclose(found.between**2, oracle.tau2, rtol=1e-4, atol=1e-9)  # its root's tolerance
    np.testing.assert_allclose(found.coefficients[0], oracle.mean_effect_re, rtol=1e-6)
