"""Common errors of outline points, compared with closed forms and dense covariances."""

from dataclasses import replace

import numpy as np
import pytest
from test_objective import NOISE_SHAPE, linear, objective

from doe.least_squares import Whitening
from kolsky.inverse.objective import (
    Objective,
    correlated_in_blocks,
    most_likely_amplitude,
    residual_without_common,
    slow_patterns,
)


def seen(points_per_frame: int = 4) -> Objective:
    """60 force bins and 240 outline points at heights of their own, without misfit."""
    one = objective(np.zeros(60), np.zeros(240), points_per_frame)
    line = replace(one.observations.centre_line, y=np.tile(np.linspace(1e-3, 5e-3, points_per_frame), 60))
    return replace(one, observations=replace(one.observations, centre_line=line), slowly=True)


def test_patterns_are_products_of_legendre_polynomials_with_a_mean_square_of_one() -> None:
    y, t = np.meshgrid(np.linspace(2.0, 3.0, 5), np.linspace(0.0, 1e-3, 7))
    found = slow_patterns(y.ravel(), t.ravel())
    assert found.shape == (16, 35)
    assert (found**2).sum(axis=0).mean() == pytest.approx(1.0)
    u, v = 2.0 * (y.ravel() - 2.5), 2.0 * (t.ravel() - 5e-4) / 1e-3
    np.testing.assert_allclose(found[0], found[0, 0])  # a zero that is off
    np.testing.assert_allclose(found[4 * 1 + 2] / found[0], u * (1.5 * v**2 - 0.5), atol=1e-12)


def test_fewer_patterns_where_points_tell_fewer_apart() -> None:
    assert slow_patterns(np.zeros(6), np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0])).shape == (3, 6)
    assert slow_patterns(np.empty(0), np.empty(0)).shape == (0, 0)


def test_the_most_likely_amplitude_of_patterns_that_do_not_overlap() -> None:
    # Each pattern is two entries of 3 at a noise of 2: h = (r1 + r2) / (2 sqrt 2) has the variance
    # 1 + s^2 4.5, whose most likely value is the mean of h^2: here (6^2 + 2^2) / 2 = 20.
    patterns = np.array([[3.0, 3.0, 0.0, 0.0], [0.0, 0.0, 3.0, 3.0]])
    residual = np.sqrt(2.0) * np.array([6.0, 6.0, -2.0, -2.0])
    other = Whitening(np.full(4, 2.0))
    assert most_likely_amplitude(residual, patterns, other) == pytest.approx((19.0 / 4.5) ** 0.5, rel=1e-4)
    assert most_likely_amplitude(0.2 * residual, patterns, other) == 0.0  # mean of h^2 of 0.8
    assert most_likely_amplitude(residual, np.empty((0, 4)), other) == 0.0


def test_an_offset_of_all_points_is_slow_and_no_scatter() -> None:
    one, rng = seen(), np.random.default_rng(1)
    scatter = NOISE_SHAPE * rng.standard_normal(240)
    found = one.with_discrepancy(one.data + np.concatenate([np.zeros(60), 5e-6 + scatter]))
    # One of sixteen coefficients has all of it, and the patterns take it whole off the residual.
    assert found.slow_discrepancy > 1e-6
    left = found.unexplained(np.concatenate([np.zeros(60), np.full(240, 5e-6)]))
    assert abs(left[60:].mean()) < 0.1e-6
    assert found.shape_discrepancy < 0.5 * NOISE_SHAPE
    plain = replace(one, slowly=False).with_discrepancy(
        one.data + np.concatenate([np.zeros(60), 5e-6 + scatter])
    )
    assert plain.shape_discrepancy == pytest.approx(5e-6, rel=0.2)
    assert plain.slow_discrepancy == 0.0


def test_weights_and_covariance_are_those_of_the_dense_covariance() -> None:
    one = replace(seen(), slow_discrepancy=3e-6)
    J, noise = linear(60, 240, np.random.default_rng(3))
    S = 3e-6 * one.slow_patterns
    C = np.diag(noise**2) + S.T @ S
    r = noise * np.random.default_rng(4).standard_normal(300)
    assert one.chi2(one.data + r) == pytest.approx(float(r @ np.linalg.solve(C, r)))
    np.testing.assert_allclose(one.sigma, np.sqrt(np.diag(C)))
    # An exact fit has no sandwich: the covariance is that of least squares with C.
    expected = np.linalg.inv(J.T @ np.linalg.solve(C, J))
    np.testing.assert_allclose(one.residual_covariance(J, one.data), expected, rtol=1e-6)
    gain = one.gain(J)
    np.testing.assert_allclose(one.spread(gain), gain @ C, rtol=1e-9, atol=1e-25)
    # The force has no part in it.
    assert not one.slow_patterns[:, :60].any()


def test_what_common_errors_explain_is_taken_off_as_a_dense_inverse_would() -> None:
    rng = np.random.default_rng(7)
    common, own, r = rng.normal(size=(3, 20)), rng.uniform(0.5, 2.0, 20), rng.normal(size=20)
    D, C = np.diag(own**2), np.diag(own**2) + common.T @ common
    left, variance = residual_without_common(r, common, own)
    np.testing.assert_allclose(left, D @ np.linalg.solve(C, r), rtol=1e-9)
    np.testing.assert_allclose(variance, np.diag(D - D @ np.linalg.solve(C, D)), rtol=1e-9)


def test_blocks_of_two_that_go_together_double_the_variance() -> None:
    # 20 blocks of +1 +1 and -1 -1: 20 sums of 4 over 20 - 1; independent entries would give 40.
    score = np.tile([[1.0, 1.0, -1.0, -1.0]], (1, 10))
    found = correlated_in_blocks(score, np.arange(40), np.array([[40.0]]), np.array([[5.0]]))
    assert found[0, 0] == pytest.approx(20 * 4.0 * 20 / 19 + 5.0)
