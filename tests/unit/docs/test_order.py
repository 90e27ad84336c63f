"""The convergence fit, compared with exact power laws, scipy's regression, and series that must fail."""

import numpy as np
import pytest
from order import assert_order, fitted_order
from scipy.stats import linregress

H = np.array([0.8, 0.4, 0.2, 0.1])


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
def test_exact_power_law(order):
    fit = fitted_order(H, 3.0 * H**order)
    assert fit.order == pytest.approx(order, abs=1e-12)  # round-off of log and of the sums
    assert fit.standard_error < 1e-12
    np.testing.assert_allclose(fit.local, order, atol=1e-12)


def test_slope_and_standard_error_are_those_of_scipy():
    rng = np.random.default_rng(3)
    error = 2.0 * H**2 * np.exp(0.1 * rng.standard_normal(H.size))
    reference = linregress(np.log(H), np.log(error))
    fit = fitted_order(H, error)
    assert fit.order == pytest.approx(reference.slope, rel=1e-12)  # same sums, other order
    assert fit.standard_error == pytest.approx(reference.stderr, rel=1e-9)


def test_wrong_order_fails_with_the_table():
    with pytest.raises(AssertionError, match=r"order 1\.000.*wanted = 2.*the slope is wrong") as caught:
        assert_order(H, H, 2.0, 0.2)
    assert str(caught.value).count("1.000") == 4  # the slope and the three local orders


def test_noise_floor_fails_even_where_the_mean_slope_fits():
    error = H**4 + 2e-3  # local orders 3.9, 2.7, 0.8: the mean looks like something in between
    mean = fitted_order(H, error).order
    with pytest.raises(AssertionError, match="not one power law"):
        assert_order(H, error, mean, 0.2)


def test_at_least_lets_a_better_order_pass_and_a_worse_one_fail():
    assert_order(H, H**2, 1.0, 0.1, at_least=True)
    with pytest.raises(AssertionError, match="wanted >= 1"):
        assert_order(H, H**0.5, 1.0, 0.1, at_least=True)
