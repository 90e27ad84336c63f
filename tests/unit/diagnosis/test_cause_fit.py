"""Least squares with one input changed, against dense algebra and by hand."""

import numpy as np
import pytest
from scipy.stats import t as student

from kolsky.diagnosis.cause_fit import (
    BLOCKS,
    Allowances,
    ExpectedResidual,
    chance,
    evidence,
    explained_share,
    fit_linear,
    holm,
    solve_linear,
)

K = 60  # Entries: the first half are the force's


def expected(
    patterns: np.ndarray | None = None, *, tau: tuple[float, float] = (0.0, 0.0)
) -> ExpectedResidual:
    rng = np.random.default_rng(3)
    return ExpectedResidual(
        sigma=rng.uniform(0.5, 2.0, K), patterns=np.zeros((K, 0)) if patterns is None else patterns,
        channel=(np.arange(K) >= K // 2).astype(np.int64), block=np.arange(K) % (K // 2), tau=np.array(tau),
    )  # fmt: skip


def dense(e: ExpectedResidual) -> np.ndarray:
    """C of the module's head, formed."""
    tau = np.where(np.arange(K) < K // 2, e.tau[0], e.tau[1])
    return np.diag(e.sigma**2 + tau**2) + e.patterns @ e.patterns.T


def test_weights_are_those_of_the_dense_covariance() -> None:
    rng = np.random.default_rng(1)
    e = expected(rng.standard_normal((K, 5)), tau=(0.7, 0.2))
    x = rng.standard_normal((K, 3))
    np.testing.assert_allclose(e.weighted(x), np.linalg.solve(dense(e), x), rtol=1e-10)
    np.testing.assert_allclose(e.weighted(x[:, 0]), np.linalg.solve(dense(e), x[:, 0]), rtol=1e-10)
    # Of r the patterns brought V V^T C^-1 r, the mean of their part given r.
    brought = e.patterns @ e.patterns.T @ np.linalg.solve(dense(e), x[:, 0])
    np.testing.assert_allclose(e.independent(x[:, 0]), x[:, 0] - brought, rtol=1e-9, atol=1e-12)


def test_misfit_of_a_channel_is_its_own_mean_square_without_tau() -> None:
    rng = np.random.default_rng(2)
    e = expected(rng.standard_normal((K, 4)), tau=(3.0, 3.0))
    r = rng.standard_normal(K)
    for channel, use in enumerate((slice(None, K // 2), slice(K // 2, None))):
        C = np.diag(e.sigma[use] ** 2) + e.patterns[use] @ e.patterns[use].T
        wanted = r[use] @ np.linalg.solve(C, r[use]) / (K // 2)
        assert e.misfits(r)[channel] == pytest.approx(wanted, rel=1e-10)


def test_tau_is_what_the_noise_does_not_explain() -> None:
    e = expected()
    r = np.full(K, 5.0)
    tau = e.with_tau(r).tau
    assert tau[0] == pytest.approx(np.sqrt(25.0 - np.mean(e.sigma[: K // 2] ** 2)), rel=1e-12)
    assert tau[1] == pytest.approx(np.sqrt(25.0 - np.mean(e.sigma[K // 2 :] ** 2)), rel=1e-12)
    assert e.with_tau(np.full(K, 0.1)).tau == pytest.approx([0.0, 0.0])


def test_a_planted_cause_is_found_with_its_value_and_sigma() -> None:
    """Exact data: the step undoes what was planted, and its covariance is that of least squares."""
    rng = np.random.default_rng(4)
    A = rng.standard_normal((K, 2)) * [1.0, 1e-5]  # units differ as those of inputs do
    planted = np.array([0.3, 2e4])
    e = expected()
    fit = fit_linear(A @ planted, A, e)
    np.testing.assert_allclose(fit.step, -planted, rtol=1e-9)
    np.testing.assert_allclose(fit.residual, 0.0, atol=1e-10)
    # No residual is left: neither tau nor correlation adds to it.
    wanted = np.linalg.inv(A.T @ (A / e.sigma[:, None] ** 2))
    own = (A / e.sigma[:, None] ** 2 @ wanted).T
    np.testing.assert_allclose(fit.covariance, wanted - own * e.sigma**2 @ own.T + wanted, rtol=1e-9)


def test_a_step_without_its_uncertainty_is_that_of_the_whole_fit() -> None:
    rng = np.random.default_rng(9)
    e, A, r = expected(rng.standard_normal((K, 4))), rng.standard_normal((K, 2)), 3.0 * rng.standard_normal(K)
    allowed = Allowances(rng.standard_normal((K, 1)), np.full(1, -0.1), np.full(1, 0.1))
    for columns in (A, A[:, :0], np.column_stack([A, np.zeros(K)])):
        whole, step = fit_linear(r, columns, e, allowed), solve_linear(r, columns, e, allowed)
        np.testing.assert_array_equal(step.step, whole.step)
        np.testing.assert_array_equal(step.residual, whole.residual)


def test_weights_are_those_of_the_tau_they_are_asked_for_with() -> None:
    """What is kept of one tau must not serve another; the same tau is the same object."""
    rng = np.random.default_rng(10)
    e = expected(rng.standard_normal((K, 4)))
    x = rng.standard_normal(K)
    np.testing.assert_allclose(e.weighted(x), np.linalg.solve(dense(e), x), rtol=1e-10)
    before = e.misfits(x)
    other = e.with_tau(5.0 * x)
    assert (other.tau > 0.0).all()
    np.testing.assert_allclose(other.weighted(x), np.linalg.solve(dense(other), x), rtol=1e-10)
    np.testing.assert_array_equal(other.misfits(x), before)  # whatever tau is
    assert e.with_tau(1e-3 * x) is e
    assert other.with_tau(1e-3 * x).tau == pytest.approx([0.0, 0.0])


def test_patterns_are_amplitudes_with_a_unit_prior() -> None:
    """The same as least squares with the amplitudes as unknowns and a row a = 0 for each."""
    rng = np.random.default_rng(5)
    V, A = 3.0 * rng.standard_normal((K, 3)), rng.standard_normal((K, 2))
    e = expected(V)
    r = 0.1 * e.sigma * rng.standard_normal(K)  # below the noise: tau stays 0
    W = 1.0 / e.sigma[:, None]
    rows = np.block([[A * W, V * W], [np.zeros((3, 2)), np.eye(3)]])
    wanted = np.linalg.lstsq(rows, -np.concatenate([r / e.sigma, np.zeros(3)]), rcond=None)[0]
    np.testing.assert_allclose(fit_linear(r, A, e).step, wanted[:2], rtol=1e-8)


def test_a_direction_without_effect_takes_no_step() -> None:
    A = np.column_stack([np.ones(K), np.zeros(K)])
    fit = fit_linear(np.ones(K), A, expected())
    assert fit.step[1] == 0.0
    assert np.isinf(fit.covariance[1, 1])
    assert fit.inflation == 1.0


def test_residuals_of_a_block_may_be_correlated() -> None:
    """The mean of a series whose values keep their sign over 8 times: by hand, from the blocks' sums."""
    n = 256
    sign = np.repeat(np.random.default_rng(6).permutation(np.repeat([1.0, -1.0], n // 16)), 8)
    e = ExpectedResidual(np.ones(n), np.zeros((n, 0)), np.zeros(n, dtype=np.int64), np.arange(n), np.zeros(2))
    fit = fit_linear(10.0 * sign, np.ones((n, 1)), e)
    sums = {length: (10.0 * sign).reshape(-1, length).sum(axis=1) for length in BLOCKS}
    wanted = max((s**2).sum() * len(s) / (len(s) - 1.0) / n**2 for s in sums.values())
    assert fit.covariance[0, 0] == pytest.approx(wanted, rel=1e-9)
    assert fit.inflation == pytest.approx(wanted / (100.0 / n), rel=1e-9)  # sigma^2 + tau^2 = 100


def test_evidence_counts_times_and_stops_at_what_is_expected() -> None:
    times = np.array([10, 20])
    assert evidence(np.array([100.0, 0.5]), np.array([1.0, 0.4]), times) == pytest.approx(10 * np.log(100.0))
    assert evidence(np.array([100.0, 0.5]), np.array([0.2, 0.4]), times) == pytest.approx(10 * np.log(100.0))
    assert evidence(np.array([1.0, 2.0]), np.array([1.0, 4.0]), times) == pytest.approx(-20 * np.log(2.0))


def test_explained_share_is_of_what_is_beyond_the_expected() -> None:
    entries = np.array([10, 30])
    before, after = np.array([5.0, 1.0]), np.array([1.4, 0.9])
    assert explained_share(before, after, entries) == pytest.approx(0.9)  # 4 of 40 are left
    assert explained_share(np.array([0.9, 1.0]), after, entries) == 0.0


def test_chance_is_that_of_student_on_both_sides() -> None:
    assert chance(3.0, 1.5, degrees=12.0) == pytest.approx(2.0 * student.sf(2.0, 12.0), rel=1e-10)
    assert chance(-3.0, 1.5, degrees=12.0) == chance(3.0, 1.5, degrees=12.0)
    assert chance(1.0, 0.0, degrees=9.0) == chance(1.0, np.inf, degrees=9.0) == 1.0


def test_probabilities_are_adjusted_as_holm_says() -> None:
    """The example of R's p.adjust(method = "holm"): 4 x 0.005, 3 x 0.01, 2 x 0.03, then no less."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []
