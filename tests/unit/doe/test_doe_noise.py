"""Noise models: known autoregressions found again, whitening against the full covariance, refusals."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from doe.uncertainty import AutoRegression, fit_noise

A1, A2 = (0.7,), (1.1, -0.4)


def noise(coefficients: tuple[float, ...], shape: tuple[int, int], seed: int) -> np.ndarray:
    """Samples by SciPy's recursive filter, 500 samples after its start from rest."""
    e = np.random.default_rng(seed).standard_normal((shape[0], shape[1] + 500))
    return lfilter([1.0], [1.0, *(-a for a in coefficients)], e)[:, 500:]


@pytest.mark.parametrize("coefficients", [(), A1, A2])
def test_order_coefficients_and_size_are_found(coefficients: tuple[float, ...]) -> None:
    records = 3.0 + 0.2 * noise(coefficients, (8, 1000), 4)
    fit = fit_noise(records)
    assert fit.correlation.order == len(coefficients)
    # Standard error of a coefficient is at most 1 / sqrt(8000) = 0.011; four of them.
    np.testing.assert_allclose(fit.correlation.coefficients, coefficients, atol=0.045)
    # Closed form of the AR variance (Box and Jenkins, eq. 3.2.28).
    a1, a2 = (*coefficients, 0.0, 0.0)[:2]
    variance = 0.2**2 * (1 - a2) / ((1 + a2) * ((1 - a2) ** 2 - a1**2))
    # 8000 samples, correlated over some ten: standard error of sigma below 2.5 %; three of them.
    assert fit.sigma == pytest.approx(np.sqrt(variance), rel=0.075)
    assert fit.whiteness > 1e-3  # a right model is refused once in a thousand seeds


def test_two_lags_do_not_explain_a_long_memory() -> None:
    e = np.random.default_rng(1).standard_normal((2, 2000))
    slow = lfilter([1.0, *[0.0] * 5, 0.8], [1.0], e)  # an echo six samples later
    assert fit_noise(slow).whiteness < 1e-6


@pytest.mark.parametrize("coefficients", [(), A1, A2])
def test_whitening_is_the_inverse_of_the_covariance(coefficients: tuple[float, ...]) -> None:
    model = AutoRegression(coefficients)
    z = np.random.default_rng(2).standard_normal((3, 40))
    R = toeplitz(model.correlation(40))
    white = model.whiten(z)
    exact = np.einsum("ij,ij->i", z, np.linalg.solve(R, z.T).T)
    np.testing.assert_allclose((white**2).sum(axis=1), exact, rtol=1e-10)  # condition of R is about 1e3


def test_correlation_at_lag_one_and_two() -> None:
    # Yule-Walker: rho1 = a1 / (1 - a2) = 1.1 / 1.4, rho2 = a1 rho1 + a2.
    rho = AutoRegression(A2).correlation(3)
    np.testing.assert_allclose(rho, [1.0, 1.1 / 1.4, 1.1**2 / 1.4 - 0.4], rtol=1e-14)


@pytest.mark.parametrize("coefficients", [(1.0,), (0.5, 0.6), (0.1, -1.0), (0.1, 0.1, 0.1)])
def test_what_is_not_stationary_is_refused(coefficients: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"stationary|at most 2"):
        AutoRegression(coefficients)


@pytest.mark.parametrize(
    ("records", "message"),
    [
        (np.full(500, 0.1), "do not vary"),
        (np.arange(50.0), "too few"),
        (np.array([1.0, np.nan] * 100), "finite"),
    ],
)
def test_records_without_noise_are_refused(records: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit_noise(records)
