"""Intervals, correlations and verdicts of fitted constants, from small problems by hand."""

import numpy as np
import pytest
from scipy.stats import chi2, t

from kolsky.bodies.errors_in_variables import Reduced
from kolsky.bodies.specimen_fit import ConstantVerdict, inflation, intervals, neighbour_correlation

FREE = (np.array([0.0, 0.0]), np.array([np.inf, np.inf]))
J = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0], [1.0, 4.0], [1.0, 5.0]])
"""A straight line: (J^T J)^-1 = [[55, -15], [-15, 6]] / 105."""
ALTERNATING = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def _found(residual: np.ndarray, jacobian: np.ndarray = J, **options: object) -> object:
    given = {"at_bound": (False, False), "bounds": FREE, **options}
    return intervals(("a", "b"), np.array([10.0, 8.0]), Reduced(residual, jacobian), (residual,), **given)  # type: ignore[arg-type]


def test_covariance_of_a_line_with_declared_noise() -> None:
    found = _found(0.5 * ALTERNATING)  # chi2 = 1.5 on 4 degrees: the declared noise holds
    assert found.scale == 1.0
    assert found.covariance == pytest.approx(np.array([[55.0, -15.0], [-15.0, 6.0]]) / 105.0)
    half = t.ppf(0.975, 4) * np.sqrt(6.0 / 105.0)
    assert (found.estimates[1].low, found.estimates[1].high) == pytest.approx((8.0 - half, 8.0 + half))
    assert found.correlation[0, 1] == pytest.approx(-15.0 / np.sqrt(330.0))
    assert found.probability == pytest.approx(chi2.sf(1.5, 4))
    assert found.explained


def test_larger_residuals_widen_it() -> None:
    found = _found(4.0 * ALTERNATING)  # chi2 = 96 on 4 degrees
    assert found.scale == pytest.approx(24.0)
    assert found.covariance[1, 1] == pytest.approx(24.0 * 6.0 / 105.0)
    assert not found.explained


def test_like_neighbours_widen_it() -> None:
    residual = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    assert neighbour_correlation(residual) == pytest.approx(3.0 / 6.0)
    assert inflation(0.5) == pytest.approx(3.0)
    assert inflation(-0.8) == 1.0
    assert _found(residual).scale == pytest.approx(1.5 * 3.0)


def test_a_correlation_is_said() -> None:
    # Nearly parallel columns; correlation of a and b is -0.998.
    rho = 0.998
    jacobian = np.linalg.cholesky(np.array([[1.0, rho], [rho, 1.0]])).T
    stacked = np.concatenate([jacobian] * 50) * 3.0
    found = _found(np.zeros(100), stacked)
    assert found.correlation[0, 1] == pytest.approx(-rho)
    assert found.estimates[0].verdict is ConstantVerdict.TOGETHER
    assert "b (correlation -0.998)" in found.estimates[0].sentence


def test_limit_of_a_correlation() -> None:
    for rho, verdict in ((0.94, ConstantVerdict.IDENTIFIED), (0.96, ConstantVerdict.TOGETHER)):
        jacobian = np.linalg.cholesky(np.array([[1.0, rho], [rho, 1.0]])).T
        # sigma^2 = 1 / (30 s^2 (1 - rho^2)): a half width of 1.5, 0.15 of the value, takes s = sigma_1 /
        # 0.75.
        size = t.ppf(0.975, 58) / 1.5 / np.sqrt(30.0 * (1.0 - rho**2))
        assert _found(np.zeros(60), np.concatenate([jacobian] * 30) * size).estimates[0].verdict is verdict
        narrow = _found(np.zeros(60), np.concatenate([jacobian] * 30) * 1.6 * size).estimates[0]
        assert narrow.verdict is ConstantVerdict.IDENTIFIED


def test_constants_at_a_bound_have_no_interval_and_do_not_blur_the_rest() -> None:
    found = _found(0.5 * ALTERNATING, at_bound=(False, True))
    assert found.estimates[1].verdict is ConstantVerdict.AT_BOUND
    assert found.estimates[1].sigma is None
    assert found.covariance[0, 0] == pytest.approx(1.0 / 6.0)
    assert found.degrees == 5


def test_a_wide_interval_and_an_unseen_direction() -> None:
    wide = _found(0.5 * ALTERNATING, 0.1 * J)
    assert wide.estimates[1].verdict is ConstantVerdict.HARDLY
    assert wide.estimates[1].low == pytest.approx(8.0 - t.ppf(0.975, 4) * np.sqrt(600.0 / 105.0))
    blind = _found(0.5 * ALTERNATING, np.stack([J[:, 0], 2.0 * J[:, 0]], -1))
    assert blind.estimates[0].verdict is ConstantVerdict.NOT_SEEN
    assert np.isnan(blind.covariance).all()
