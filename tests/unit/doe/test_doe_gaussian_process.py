"""Gaussian processes: likelihood, prediction and leave-one-out against direct formulas; the variance."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from doe import Box, sobol
from doe.surrogates import ProcessSurrogate, SurrogateError
from doe.surrogates.process import (
    CORRELATIONS,
    GaussianProcess,
    Hyperparameters,
    _loss,
    _tail,
    squared_differences,
    with_lengths,
    with_slopes,
)

FloatArray = NDArray[np.float64]
KINDS = sorted(CORRELATIONS)
LENGTHS = np.array([0.4, 0.9])


def runs(n: int = 14) -> tuple[FloatArray, FloatArray]:
    """Points of the unit square and two smooth columns."""
    u = np.random.default_rng(3).random((n, 2))
    return u, np.stack([np.sin(3.0 * u[:, 0] + u[:, 1]), np.exp(-u[:, 0]) * (1.0 + u[:, 1] ** 2)], axis=1)


def given(kind: str, nugget: float = 1e-6) -> GaussianProcess:
    return GaussianProcess.with_hyperparameters(*runs(), Hyperparameters(kind, LENGTHS, nugget))


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_by_differences(kind: str) -> None:
    u, _ = runs()
    squares, h = squared_differences(u, u), 1e-5
    _, slopes = with_slopes(kind, squares, LENGTHS)
    for j in range(2):
        up, down = LENGTHS.copy(), LENGTHS.copy()
        up[j] *= np.exp(h)
        down[j] *= np.exp(-h)
        by_differences = (with_lengths(kind, squares, up) - with_lengths(kind, squares, down)) / (2.0 * h)
        # h^2 of a third derivative of order 1, and round-off eps / h.
        np.testing.assert_allclose(slopes[j], by_differences, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_gradient_of_the_likelihood_by_differences(kind: str) -> None:
    u, values = runs()
    squares, tail = squared_differences(u, u), _tail(u)
    place, h = np.log([0.5, 1.1, 1e-3]), 1e-5
    _, gradient = _loss(place, kind, squares, tail, values)
    by_differences = [
        (_loss(place + e, kind, squares, tail, values)[0] - _loss(place - e, kind, squares, tail, values)[0])
        / (2.0 * h)
        for e in h * np.eye(3)
    ]
    np.testing.assert_allclose(gradient, by_differences, rtol=1e-5)  # h^2, and eps * 100 / h of the loss


@pytest.mark.parametrize("kind", KINDS)
def test_restricted_likelihood_is_that_of_contrasts(kind: str) -> None:
    """REML is the likelihood of A^T f, A an orthonormal basis of the complement of the trend (Harville)."""
    u, values = runs()
    process = given(kind, nugget=1e-3)
    tail = _tail(u)
    contrasts = np.linalg.svd(tail)[0][:, tail.shape[1] :]
    correlation = with_lengths(kind, squared_differences(u, u), LENGTHS) + 1e-3 * np.eye(len(u))
    total = 0.0
    for column, variance in zip(values.T, process.variance, strict=True):
        covariance = variance * contrasts.T @ correlation @ contrasts
        total += multivariate_normal.logpdf(contrasts.T @ column, cov=covariance, allow_singular=False)
    # They differ by a constant of the design, which another correlation of the same design shares.
    other = GaussianProcess.with_hyperparameters(u, values, Hyperparameters(kind, 1.7 * LENGTHS, 1e-2))
    correlation = with_lengths(kind, squared_differences(u, u), 1.7 * LENGTHS) + 1e-2 * np.eye(len(u))
    again = 0.0
    for column, variance in zip(values.T, other.variance, strict=True):
        covariance = variance * contrasts.T @ correlation @ contrasts
        again += multivariate_normal.logpdf(contrasts.T @ column, cov=covariance)
    # Digits of matrices whose condition is about 1e4.
    assert process.log_likelihood - other.log_likelihood == pytest.approx(total - again, abs=1e-8)
    assert abs(total - again) > 1.0


@pytest.mark.parametrize("kind", KINDS)
def test_prediction_is_the_conditional_distribution(kind: str) -> None:
    """A trend with an almost flat prior: the joint normal distribution, conditioned on the runs."""
    u, values = runs()
    process = given(kind, nugget=1e-3)
    at = np.array([[0.2, 0.7], [0.9, 0.1], [1.2, 0.5]])
    everywhere = np.concatenate([u, at])
    tail = _tail(everywhere)
    prior = with_lengths(kind, squared_differences(everywhere, everywhere), LENGTHS) + 1e7 * tail @ tail.T
    n = len(u)
    among = prior[:n, :n] + 1e-3 * np.eye(n)
    weights = np.linalg.solve(among, prior[:n, n:])
    # A prior of 1e7 instead of infinity, and 1e-16 * 1e7 * 1e3 of round-off.
    np.testing.assert_allclose(process.predict(at), weights.T @ values, rtol=1e-4)
    share = np.diag(prior[n:, n:] - prior[n:, :n] @ weights)
    np.testing.assert_allclose(process.sigma(at), np.sqrt(np.outer(share, process.variance)), rtol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_leave_one_out_is_the_refit(kind: str) -> None:
    u, values = runs()
    whole = given(kind, nugget=1e-4)
    for i in (0, 7, 13):
        rest = np.arange(len(u)) != i
        other = GaussianProcess.with_hyperparameters(
            u[rest], values[rest], whole.hyperparameters, variance=whole.variance
        )
        # The condition number is below 1e5.
        np.testing.assert_allclose(
            whole.loo_residuals[i], values[i] - other.predict(u[i : i + 1])[0], atol=1e-9
        )
        # A run has the nugget's variance beside that of the mean.
        spread = np.sqrt(other.sigma(u[i : i + 1])[0] ** 2 + 1e-4 * whole.variance)
        np.testing.assert_allclose(whole.loo_sigma[i], spread, rtol=1e-6)


def test_a_plane_is_reproduced_anywhere_and_a_run_is_missed_by_the_nugget() -> None:
    u, _ = runs()
    process = GaussianProcess.with_hyperparameters(
        u, (2.0 + u @ [3.0, -1.0])[:, None], Hyperparameters(KINDS[0], LENGTHS, 1e-8)
    )
    at = np.array([[0.5, 0.5], [-2.0, 4.0]])
    # Round-off times a condition number of 1e8.
    np.testing.assert_allclose(process.predict(at)[:, 0], 2.0 + at @ [3.0, -1.0], atol=1e-6)
    u, values = runs()
    process = given(KINDS[0], nugget=1e-3)
    # (R + nugget I) w + P b = f, and the mean at the runs is R w + P b.
    np.testing.assert_allclose(values - process.predict(u), 1e-3 * process.weights, atol=1e-10)


def test_the_likelihood_finds_the_lengths_of_a_drawn_process() -> None:
    rng = np.random.default_rng(8)
    u = rng.random((80, 2))
    truth = np.array([0.3, 1.2])
    covariance = with_lengths("matern 5/2", squared_differences(u, u), truth) + 1e-9 * np.eye(80)
    values = np.linalg.cholesky(covariance) @ rng.standard_normal((80, 12))
    found = GaussianProcess.fit(u, values).hyperparameters
    assert found.kind == "matern 5/2"
    # Twelve draws know a length to about 5 % where it is short, 10 % where it exceeds the box.
    np.testing.assert_allclose(found.lengths, truth, rtol=0.25)


def test_its_own_error_is_honest() -> None:
    box = Box(("x", "y"), (0.0, 0.0), (1.0, 1.0))
    time = np.linspace(0.0, 1.0, 30)

    def response(points: FloatArray) -> FloatArray:
        return np.sin(4.0 * points[:, :1] * time + 2.0 * points[:, 1:]) + points[:, 1:] * time

    points = sobol(box, 32, rng=0).points
    surrogate = ProcessSurrogate.fit(box, points, response(points), scale=0.01)
    at = sobol(Box(("x", "y"), (0.1, 0.1), (0.9, 0.9)), 64, rng=5).points
    truth = surrogate.components.scores(response(at))
    z = (truth - surrogate.scores(at)) / surrogate.score_sigma(at)
    # Of the leading components; the share beyond two sigma of a normal distribution is 5 %, and the
    # errors of neighbouring points hang together.
    assert np.mean(np.abs(z[:, :3]) > 2.0) < 0.25
    assert np.sqrt(np.mean(z[:, :3] ** 2)) > 0.1  # nor is it far too large

    def sigma(of: ProcessSurrogate, x: np.ndarray) -> np.ndarray:
        return np.sqrt(of.score_sigma(x) ** 2 @ of.components.basis**2)

    # The error falls at a run, and where a run is believed.
    assert np.all(sigma(surrogate, points) < 0.2 * sigma(surrogate, at).max(axis=0))
    believing = surrogate.believing(at[:1])
    # A run has the nugget beside it, which here is most of the error that is left (1e-5 of the response).
    assert np.all(sigma(believing, at[:1]) < 0.8 * sigma(surrogate, at[:1]))
    # ... while the mean stays, up to what nugget and conditioning (1e10) leave.
    np.testing.assert_allclose(believing.predict(at), surrogate.predict(at), atol=1e-3)


def test_a_rough_response_has_a_nugget() -> None:
    box = Box(("x",), (0.0,), (1.0,))
    points = np.linspace(0.0, 1.0, 40)[:, None]
    rng = np.random.default_rng(2)
    noise = 0.05 * rng.standard_normal(40)
    surrogate = ProcessSurrogate.fit(box, points, np.sin(3.0 * points) + noise[:, None])
    h, variance = surrogate.processes[0].hyperparameters, surrogate.processes[0].variance[0]
    # In units of the response; 40 values know a standard deviation to 11 %.
    assert np.sqrt(h.nugget * variance) == pytest.approx(0.05, rel=0.35)
    smooth = surrogate.predict(points)[:, 0] - np.sin(3.0 * points[:, 0])
    assert np.sqrt(np.mean(smooth**2)) < 0.03  # it averages, and does not follow every run


def test_what_cannot_carry_a_process_is_refused() -> None:
    box = Box(("x", "y"), (0.0, 0.0), (1.0, 1.0))
    few = sobol(box, 4, rng=0).points
    with pytest.raises(SurrogateError, match="at least 5 runs for 2"):
        ProcessSurrogate.fit(box, few, np.ones((4, 1)))
    with pytest.raises(SurrogateError, match="needs runs, got none"):
        ProcessSurrogate.fit(box, few[:0], np.ones((0, 1)))
    line = np.column_stack([np.linspace(0.0, 1.0, 8)] * 2)
    with pytest.raises(SurrogateError, match="do not determine a linear trend"):
        ProcessSurrogate.fit(box, line, np.ones((8, 1)))
