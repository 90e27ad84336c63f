"""Weights of data with common errors against the dense covariance."""

import numpy as np
import pytest

from doe.least_squares import Whitening

RNG = np.random.default_rng(11)
SIGMA = RNG.uniform(0.5, 3.0, 9)
PATTERNS = RNG.normal(size=(3, 9))
DENSE = np.diag(SIGMA**2) + PATTERNS.T @ PATTERNS
ROWS = RNG.normal(size=(4, 9))


def test_squares_of_whitened_rows_are_chi_square() -> None:
    white = Whitening(SIGMA, PATTERNS).apply(ROWS)
    expected = np.einsum("ik,kl,il->i", ROWS, np.linalg.inv(DENSE), ROWS)
    np.testing.assert_allclose((white**2).sum(axis=1), expected, rtol=1e-12)  # round-off
    # Not only their lengths: products of two rows too.
    np.testing.assert_allclose(white @ white.T, ROWS @ np.linalg.inv(DENSE) @ ROWS.T, rtol=1e-11)


def test_precision_and_determinant_are_the_dense_ones() -> None:
    one = Whitening(SIGMA, PATTERNS)
    np.testing.assert_allclose(one.precision(ROWS), ROWS @ np.linalg.inv(DENSE), rtol=1e-11)
    assert one.log_determinant == pytest.approx(np.linalg.slogdet(DENSE)[1], rel=1e-13)


def test_patterns_that_depend_on_each_other_and_large_ones() -> None:
    # One pattern as two of 3/5 and 4/5 of it is the same covariance; 1e4 standard deviations project it out.
    twice = np.vstack([0.6 * PATTERNS[:1], 0.8 * PATTERNS[:1], PATTERNS[1:]])
    np.testing.assert_allclose(
        Whitening(SIGMA, twice).apply(ROWS), Whitening(SIGMA, PATTERNS).apply(ROWS), rtol=1e-11
    )
    white = Whitening(SIGMA, 1e4 * PATTERNS)
    np.testing.assert_allclose(
        white.precision(ROWS) @ PATTERNS.T, 0.0, atol=1e-6
    )  # 1e-8 by the covariance, and the round-off of 1e8
    inner = np.eye(3) + 1e8 * (PATTERNS / SIGMA**2) @ PATTERNS.T
    expected = 2.0 * np.log(SIGMA).sum() + np.linalg.slogdet(inner)[1]
    assert white.log_determinant == pytest.approx(expected, rel=1e-12)  # round-off


def test_without_patterns_it_is_division_by_sigma() -> None:
    for one in (Whitening(SIGMA), Whitening(SIGMA, np.zeros((0, 9)))):
        np.testing.assert_array_equal(one.apply(ROWS), ROWS / SIGMA)
        np.testing.assert_allclose(one.precision(ROWS), ROWS / SIGMA**2, rtol=1e-15)
        assert one.log_determinant == pytest.approx(2.0 * np.log(SIGMA).sum(), rel=1e-15)


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="every sigma must be > 0, got 0"):
        Whitening(np.array([1.0, 0.0]))
    with pytest.raises(ValueError, match=r"patterns of shape \(1, 3\) do not fit \(2,\) sigmas"):
        Whitening(np.ones(2), np.ones((1, 3)))
