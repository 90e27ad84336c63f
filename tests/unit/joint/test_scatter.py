"""Scatter between shots and its interval, against closed forms of one number a shot."""

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from doe.least_squares import Whitening
from kolsky.inverse.joint_search import LARGEST, expanded_scatter, restricted_deviance, restricted_scatter

VALUES = np.array([1.02, 1.10, 1.05, 1.13, 0.98])
SIGMA = 0.02


def problem(values: np.ndarray, sigma: float = SIGMA):  # type: ignore[no-untyped-def]
    """Shots that measure m itself: data m_k, slope 1, pattern of the k-th shot its own entry times m = 1."""
    n = len(values)

    def weights(more: np.ndarray) -> Whitening:
        return Whitening(np.full(n, sigma), more)

    return 1.0 - values, np.ones((n, 1)), np.eye(n), weights


def test_the_deviance_of_a_mean_is_that_of_the_textbook() -> None:
    residual, slopes, patterns, weights = problem(VALUES)
    # n equal variances v: (n - 1) ln v + ln n + sum (y - mean)^2 / v
    for s in (0.0, 0.03):
        v = SIGMA**2 + s**2
        squares = ((VALUES - VALUES.mean()) ** 2).sum()
        expected = 4.0 * np.log(v) + np.log(5.0) + squares / v
        found = restricted_deviance(residual, slopes, weights(s * patterns))
        assert found == pytest.approx(expected, rel=1e-12)


def test_the_scatter_is_what_is_left_of_the_variance() -> None:
    found = restricted_scatter(*problem(VALUES))
    # restricted maximum likelihood of a balanced design: s^2 = variance (n - 1) less sigma^2
    assert found.value == pytest.approx(np.sqrt(VALUES.var(ddof=1) - SIGMA**2), rel=1e-3)
    squares, least = ((VALUES - VALUES.mean()) ** 2).sum(), VALUES.var(ddof=1)
    for end in found.interval:
        v = SIGMA**2 + end**2
        rise = 4.0 * np.log(v / least) + squares * (1.0 / v - 1.0 / least)
        assert rise == pytest.approx(3.84, abs=1e-3)
    assert found.interval[0] < found.value < found.interval[1] < LARGEST


def test_shots_that_agree_have_none() -> None:
    close = 1.05 + 0.5 * SIGMA * np.array([-1.0, 1.0, 0.0, 1.0, -1.0])
    found = restricted_scatter(*problem(close))
    assert found.value == 0.0
    assert found.interval[0] == 0.0
    v, squares = SIGMA**2 + found.interval[1] ** 2, ((close - close.mean()) ** 2).sum()
    rise = 4.0 * np.log(v / SIGMA**2) + squares * (1.0 / v - 1.0 / SIGMA**2)
    assert rise == pytest.approx(3.84, abs=1e-3)


def test_few_shots_widen_the_interval_by_students_t() -> None:
    level = norm.cdf(2.0)
    assert expanded_scatter(0.03, 0.0, 3) == pytest.approx(0.06)
    assert expanded_scatter(0.03, 0.03, 3) == pytest.approx(0.03 * student.ppf(level, 2))
    # half of the variance between the shots: (n - 1) (sigma / between)^4 = 2 x 4 degrees of freedom
    assert expanded_scatter(0.03, 0.03 / np.sqrt(2.0), 3) == pytest.approx(0.03 * student.ppf(level, 8))
    assert expanded_scatter(0.0, 0.0, 3) == 0.0
