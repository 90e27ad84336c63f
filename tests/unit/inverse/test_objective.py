"""The least-squares objective against closed forms of linear models; the coverage of its intervals."""

from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.objective import PATTERN_ERROR, WITH_DISCREPANCIES, FrontNoise, Objective
from kolsky.inverse.observations import Observations, Prediction

FloatArray = NDArray[np.float64]
NOISE_FORCE, NOISE_SHAPE = 0.3, 2e-6


def objective(force: FloatArray, shape: FloatArray, points_per_frame: int = 4) -> Objective:
    """Data of one bin of force a frame and a few outline points in each frame."""
    n, bin_width = len(force), 8e-6
    edges = bin_width * np.arange(n + 1)
    frame = np.arange(len(shape)) // points_per_frame
    return Objective(
        Observations(
            force=ForceHistory(time=edges, force=np.zeros(n + 1), sigma=np.ones(n + 1)),
            bins=ForceBins(
                edges=edges, mean=force, sigma=np.full(n, NOISE_FORCE), n=np.full(n, 17, dtype=np.int64)
            ),
            centre_line=CentreLine(
                time=bin_width * (frame + 0.5), frame=frame, y=np.zeros(len(shape)), Z=shape,
                sigma=np.full(len(shape), NOISE_SHAPE),
            ),
        ),
        counted=np.ones(len(shape), dtype=bool),
    )  # fmt: skip


def linear(n_force: int, n_shape: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Jacobian [k, 2] of smooth histories and the noise of each entry [k]."""
    t, u = np.linspace(0.0, 1.0, n_force), np.linspace(0.0, 1.0, n_shape)
    J = np.concatenate(
        [np.column_stack([30.0 * t**2, 4.0 * np.sin(9.0 * t)]), 1e-4 * np.column_stack([u, np.cos(7.0 * u)])]
    )
    return J, np.concatenate([np.full(n_force, NOISE_FORCE), np.full(n_shape, NOISE_SHAPE)])


def test_chi2_of_its_parts_by_hand() -> None:
    one = objective(np.array([1.0, 2.0]), np.array([1e-3]))
    vector = np.array([1.3, 1.4, 1e-3 + 4e-6])  # residuals of 1, -2 and 2 sigma
    assert one.chi2(vector, "force") == pytest.approx(5.0)
    assert one.chi2(vector, "shape") == pytest.approx(4.0)
    assert one.chi2(np.stack([vector, one.data])) == pytest.approx([9.0, 0.0])
    assert one.mask("shape").tolist() == [False, False, True]


def test_only_counted_points_are_in_the_vector() -> None:
    whole = objective(np.array([1.0]), np.array([1e-3, 2e-3, 3e-3]))
    some = Objective(whole.observations, counted=np.array([True, False, True]))
    Z = np.array([[4e-3, np.nan, 6e-3]])
    prediction = Prediction(force=np.zeros((1, 2)), force_bins=np.array([[2.0]]), Z=Z, inside=np.isfinite(Z))
    np.testing.assert_array_equal(some.data, [1.0, 1e-3, 3e-3])
    np.testing.assert_array_equal(some.vectors(prediction), [[2.0, 4e-3, 6e-3]])
    assert len(some.times) == len(some.noise) == len(some.sigma) == 3


def test_deviance_is_that_of_the_normal_density() -> None:
    one = objective(np.array([1.0, 2.0, 4.0]), np.array([1e-3, 2e-3]))
    vectors = one.data + np.array([[0.1, -0.2, 0.1, 1e-6, 2e-6], [3.0, -1.0, 2.0, 9e-6, -5e-6]])
    for vector, found in zip(vectors, one.deviance(vectors), strict=True):
        sigma = one.with_discrepancy(vector).sigma
        assert found == pytest.approx(
            -2.0 * norm.logpdf(vector, one.data, sigma).sum() - 5.0 * np.log(2.0 * np.pi), rel=1e-12
        )
    # Beyond the noise it is n ln of the mean square, whose slope is that of the weighted residuals.
    assert one.deviance(vectors[1:], "force")[0] == pytest.approx(3.0 * (1.0 + np.log(14.0 / 3.0)))


def test_discrepancy_is_what_the_noise_does_not_explain() -> None:
    # Force residuals of +-0.5 N at a noise of 0.3 N leave tau = 0.4 N; those of the outline are below it.
    one = objective(np.zeros(10), np.zeros(20))
    vector = np.concatenate([0.5 * (-1.0) ** np.arange(10), np.full(20, 1e-6)])
    found = one.with_discrepancy(vector)
    assert found.force_discrepancy == pytest.approx(0.4)
    assert found.shape_discrepancy == 0.0
    np.testing.assert_allclose(found.sigma[:10], 0.5)
    np.testing.assert_allclose(found.sigma[10:], NOISE_SHAPE)
    assert found.chi2(vector, "force") == pytest.approx(10.0)  # by its definition one a value
    # It is estimated afresh, not on top of the old one.
    assert found.with_discrepancy(vector).force_discrepancy == pytest.approx(0.4)


@pytest.mark.parametrize("points_per_frame", [1, 8])
def test_discrepancies_minimise_the_deviance_of_balanced_frames_with_common_patterns(
    points_per_frame: int,
) -> None:
    """Patterns and a slow error of the outline explain a part. Each discrepancy 2 % larger or smaller is
    worse."""
    rng = np.random.default_rng(8)
    n, q = 60, 240
    patterns = np.concatenate(
        [2.0 * np.sin(np.outer([3.0, 5.0, 8.0], np.linspace(0.0, 3.0, n))),
         2e-5 * np.cos(np.outer([2.0, 5.0, 9.0], np.linspace(0.0, 3.0, q)))], axis=1
    )  # fmt: skip
    one = objective(np.zeros(n), np.zeros(q), points_per_frame)
    one = replace(one, balanced=True, slowly=True, front=FrontNoise(patterns))
    scatter = np.concatenate([1.5 * rng.standard_normal(n), 9e-6 * rng.standard_normal(q)])
    vector = rng.standard_normal(3) @ patterns + scatter
    vector += 4e-5 * rng.standard_normal(len(one.slow_patterns)) @ one.slow_patterns
    found = one.with_discrepancy(vector)
    least = found.whitening().deviance(vector)
    for name in ("force_discrepancy", "shape_discrepancy", "slow_discrepancy"):
        assert getattr(found, name) > 0.0
        for factor in (0.98, 1.02):
            other = replace(found, **{name: factor * getattr(found, name)})
            assert other.whitening().deviance(vector) > least


@pytest.mark.parametrize("part", ["joint", "force", "shape"])
def test_gain_moves_the_optimum_as_a_new_fit_does(part) -> None:
    rng = np.random.default_rng(5)
    J, noise = linear(60, 240, rng)
    one = objective(np.zeros(60), np.zeros(240))
    use = one.mask(part)
    change = noise * rng.standard_normal(len(noise))
    # For a linear model the optimum of data d is the weighted least-squares solution of J x = d.
    expected, *_ = np.linalg.lstsq((J / noise[:, None])[use], (change / noise)[use], rcond=None)
    np.testing.assert_allclose(one.gain(J, part) @ change, expected, rtol=1e-9)  # round-off of the normal eq.


def test_a_frame_of_ten_points_weighs_as_one_where_balanced() -> None:
    """Four bins at 0 and forty points at 1, in units of their noise: the mean is 40/44, or 4/8."""
    slope = np.repeat([NOISE_FORCE, NOISE_SHAPE], [4, 40])[:, None]
    one = objective(np.zeros(4), np.full(40, NOISE_SHAPE), points_per_frame=10)
    for balanced, mean in ((False, 40.0 / 44.0), (True, 0.5)):
        weighed = replace(one, balanced=balanced)
        assert (weighed.gain(slope) @ weighed.data)[0] == pytest.approx(mean, rel=1e-12)
    # ln det C counts four values of each channel, with the sigma of which ten points have that of one.
    whole = 8.0 * np.log(NOISE_FORCE) + 8.0 * np.log(NOISE_SHAPE * np.sqrt(10.0))
    assert weighed.whitening().log_determinant == pytest.approx(whole, rel=1e-12)


def test_covariance_of_an_exact_fit_is_gauss_newton() -> None:
    J, noise = linear(60, 240, np.random.default_rng(0))
    one = objective(np.zeros(60), np.zeros(240))
    W = np.diag(noise**-2.0)
    for part, rows in (("joint", slice(None)), ("force", slice(0, 60)), ("shape", slice(60, None))):
        expected = np.linalg.inv(J[rows].T @ W[rows, rows] @ J[rows])
        # No residual, no sandwich; the noise alone counts. Round-off of two inversions.
        np.testing.assert_allclose(one.covariance(J, one.data, part), expected, rtol=1e-8)


@pytest.mark.parametrize("part", ["joint", "force", "shape"])
def test_a_common_error_weighs_as_the_dense_covariance(part) -> None:
    """Generalised least squares with the patterns of the front face."""
    rng = np.random.default_rng(7)
    J, noise = linear(20, 40, rng)
    plain = objective(np.zeros(20), np.zeros(40))
    patterns = rng.standard_normal((3, 60)) * noise * 4.0
    one = replace(plain, front=FrontNoise(patterns))
    use = one.mask(part)
    own = noise**2 + PATTERN_ERROR**2 * (patterns**2).sum(axis=0)
    C = (np.diag(own) + patterns.T @ patterns)[np.ix_(use, use)]
    W = np.linalg.inv(C)
    N = J[use].T @ W @ J[use]
    gain = np.linalg.solve(N, J[use].T @ W)
    np.testing.assert_allclose(one.gain(J, part)[:, use], gain, rtol=1e-8, atol=1e-12 * np.abs(gain).max())
    assert not one.gain(J, part)[:, ~use].any()
    np.testing.assert_allclose(one.information(J, part), N, rtol=1e-10)
    residual = noise * rng.standard_normal(60)
    assert one.chi2(residual, part) == pytest.approx(residual[use] @ W @ residual[use], rel=1e-10)
    spread = gain @ C
    found = one.spread(one.gain(J, part))[:, use]
    np.testing.assert_allclose(found, spread, rtol=1e-7, atol=1e-9 * np.abs(spread).max())
    # The variances of the optimum are those of the covariance that weighs, but no smaller than if every
    # entry's variance were its own; residuals that would say more there are none.
    by_itself = np.linalg.inv(J[use].T @ (J[use] / np.diag(C)[:, None]))
    expected = np.maximum(np.diag(np.linalg.inv(N)), np.diag(by_itself))
    np.testing.assert_allclose(np.diag(one.covariance(J, one.data, part)), expected, rtol=1e-7)
    assert (expected > 1.01 * np.diag(np.linalg.inv(N))).any()


def fits(
    correlated: float, n_sets: int, n_force: int, n_shape: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fits of noisy data of x = 0: estimates [n_sets, 2], their stated and their Gauss-Newton sigma."""
    rng = np.random.default_rng(2012)
    J, noise = linear(n_force, n_shape, rng)
    estimates, stated, simple = [], [], []
    for _ in range(n_sets):
        e = rng.standard_normal(len(noise))
        for i in range(1, n_force):  # AR(1) force noise of unit variance
            e[i] = correlated * e[i - 1] + np.sqrt(1.0 - correlated**2) * e[i]
        data = noise * e
        one = objective(data[:n_force], data[n_force:])
        x = one.gain(J) @ data
        estimates.append(x)
        stated.append(np.sqrt(np.diag(one.covariance(J, J @ x))))
        simple.append(np.sqrt(np.diag(one.covariance(J, one.data))))
    return np.array(estimates), np.array(stated), np.array(simple)


def test_intervals_of_white_noise_cover_the_truth_and_are_not_wide() -> None:
    estimates, stated, simple = fits(0.0, 400, 100, 200)
    covered = (np.abs(estimates) <= 2.0 * stated).mean()
    # 95.4 % would be exact; 800 intervals scatter by 0.7 %. The larger of two estimates is a little wide.
    assert 0.94 <= covered <= 0.99
    assert (stated >= simple * (1.0 - 1e-12)).any(axis=1).all()
    assert 1.0 <= (stated / simple).mean() < 1.25


def test_intervals_of_correlated_noise_cover_the_truth_where_simple_ones_do_not() -> None:
    estimates, stated, simple = fits(0.8, 400, 160, 0)
    # A slow component is worse known by sqrt((1 + 0.8) / (1 - 0.8)) = 3 than white noise says.
    assert (np.abs(estimates) <= 2.0 * simple)[:, 0].mean() < 0.65
    # Ten blocks of 16 bins see 2.5 of the factor 3 and know it to 22 %: 83 % instead of 95 % of the intervals
    # cover the truth (binomial scatter of 400: 2 %).
    assert (np.abs(estimates) <= 2.0 * stated)[:, 0].mean() > 0.77


def test_sandwich_of_correlated_residuals_has_the_known_factor() -> None:
    phi, n = 0.6, 3200
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(10):
        e = rng.standard_normal(n)
        for i in range(1, n):
            e[i] = phi * e[i - 1] + np.sqrt(1.0 - phi**2) * e[i]
        one = objective(NOISE_FORCE * e, np.zeros(0))
        variance = one.covariance(np.ones((n, 1)), np.zeros(n))[0, 0]
        ratios.append(variance / (NOISE_FORCE**2 / n))
    # The mean of AR(1) noise has the variance (sigma^2 / n) (1 + phi) / (1 - phi) = 4 sigma^2 / n; blocks of
    # L = 16 see of it 4 - 2 phi (1 - phi^L) / (L (1 - phi)^2) = 3.53. Ten sets of 200 blocks know it to
    # sqrt(2 / 2000) = 3 %, and the largest over the block lengths is a little above: 12 %.
    assert np.mean(ratios) == pytest.approx(3.53, rel=0.12)


def of_one_parameter(residual: FloatArray) -> tuple[Objective, FloatArray]:
    """The mean of n bins of force: gain 1 / n; edges that are exact in binary."""
    one = objective(residual, np.zeros(0))
    bins = replace(one.observations.bins, edges=2.0**-17 * np.arange(len(residual) + 1))
    whole = replace(one, observations=replace(one.observations, bins=bins))
    return whole, whole.covariance(np.ones((len(residual), 1)), np.zeros(len(residual)))


def test_sandwich_of_blocks_of_two_by_hand() -> None:
    # Pairs of bins at +3 and -3 N: 20 blocks of two with sums of 6 N / 40, longer blocks with none.
    _, found = of_one_parameter(3.0 * np.tile([1.0, 1.0, -1.0, -1.0], 10))
    assert found[0, 0] == pytest.approx(20 * (6.0 / 40.0) ** 2 * 20.0 / 19.0, rel=1e-12)  # round-off


def test_sandwich_needs_more_than_four_blocks_a_parameter() -> None:
    # Sixteen bins at +3 N, sixteen at -3 N: blocks of 16 would say most, but 64 bins hold only four of them.
    _, found = of_one_parameter(3.0 * np.repeat([1.0, -1.0, 1.0, -1.0], 16))
    assert found[0, 0] == pytest.approx(8 * (24.0 / 64.0) ** 2 * 8.0 / 7.0, rel=1e-12)
    _, more = of_one_parameter(3.0 * np.repeat([1.0, -1.0, 1.0, -1.0, 1.0], 16))
    assert more[0, 0] == pytest.approx(5 * (48.0 / 80.0) ** 2 * 5.0 / 4.0, rel=1e-12)


def test_a_scale_bends_the_forces_alone() -> None:
    one = objective(np.array([2.0, -4.0]), np.array([1e-3]))
    scaled = replace(one, observations=replace(one.observations, force_sigma_gain=0.05))
    np.testing.assert_allclose(scaled.scale_error, [0.1, -0.2, 0.0], rtol=1e-15)


def with_modes(one: Objective, modes: FloatArray) -> Objective:
    return replace(one, front=FrontNoise(modes))


def dense(one: Objective) -> FloatArray:
    """Covariance of the residuals, shape [k, k]."""
    return np.diag(one.own_sigma**2) + one.front_noise.T @ one.front_noise


def noisy(n_force: int, n_shape: int, rng: np.random.Generator) -> tuple[Objective, FloatArray]:
    """Data without a signal, and five modes of the front face's noise, some larger than the noise."""
    modes = rng.normal(size=(5, n_force + n_shape)) * np.array([3.0, 2.0, 1.0, 0.3, 0.1])[:, None]
    modes *= np.concatenate([np.full(n_force, NOISE_FORCE), np.full(n_shape, NOISE_SHAPE)])
    return with_modes(objective(np.zeros(n_force), np.zeros(n_shape)), modes), modes


def test_front_noise_is_taken_off_as_a_dense_inverse_would() -> None:
    rng = np.random.default_rng(5)
    one, modes = noisy(40, 60, rng)
    one = replace(one, force_discrepancy=0.2, shape_discrepancy=1e-6)
    r = one.noise * rng.normal(size=100)
    expected = one.own_sigma**2 * np.linalg.solve(dense(one), r)
    np.testing.assert_allclose(one.unexplained(r), expected, rtol=1e-9, atol=1e-12)
    # Weights: the variances of the residuals, entry by entry.
    np.testing.assert_allclose(one.sigma**2, np.diag(dense(one)), rtol=1e-12)
    np.testing.assert_array_equal(one.front_noise, modes)
    one = replace(one, counted=np.arange(60) != 7)
    assert one.front_noise.shape == (5, 99)
    np.testing.assert_array_equal(one.front_noise[:, 40 + 7], modes[:, 40 + 8])


def test_front_noise_is_no_discrepancy() -> None:
    # Residuals of noise, front face and a discrepancy of 1.5 times the force's noise; none of the outline.
    rng, taus, plain = np.random.default_rng(6), [], []
    one, modes = noisy(400, 600, rng)
    for _ in range(40):
        vector = one.data + one.noise * rng.normal(size=1000) + rng.normal(size=5) @ modes
        vector[:400] += 1.5 * NOISE_FORCE * rng.normal(size=400)
        found = one.with_discrepancy(vector)
        taus.append([found.force_discrepancy / NOISE_FORCE, found.shape_discrepancy / NOISE_SHAPE])
        plain.append(with_modes(one, modes[:0]).with_discrepancy(vector).force_discrepancy / NOISE_FORCE)
    mean = np.mean(taus, axis=0)
    # Of 400 residuals tau^2 = 2.25 is known to (1 + 2.25) sqrt(2 / 400) = 0.23, the mean of forty to 0.04.
    # The patterns' own error, a fifth of 14.1 = 9 + 4 + 1 + 0.09 + 0.01 squares, stands for 0.56 of it.
    assert mean[0] ** 2 == pytest.approx(2.25 - PATTERN_ERROR**2 * 14.1, abs=0.15)
    assert mean[1] < 0.35  # sqrt of what chance leaves of zero: (2 / 600)^(1/4) = 0.24, half the time
    assert np.mean(plain) > 3.0  # what the modes, 3.7 times the noise together, make it without them


def test_covariance_with_front_noise() -> None:
    rng = np.random.default_rng(8)
    J, _ = linear(160, 400, rng)
    one, modes = noisy(160, 400, rng)
    vector = one.data + rng.normal(size=5) @ modes + one.noise * rng.normal(size=560)
    one = one.with_discrepancy(vector)
    G = one.gain(J)
    # Ordinary weighted least squares under a covariance that is not the weights': G C G'.
    front = G @ modes.T @ modes @ G.T
    residual = one.residual_covariance(J, vector)
    np.testing.assert_allclose(one.covariance(J, vector), residual + front, rtol=1e-12)
    least = G @ np.diag(one.own_sigma**2) @ G.T
    # Residuals without the front face's part are white; the largest of four sandwiches of few blocks is not
    # beyond four times the least squares' variance (the fourth has ten blocks, chi-square up to 2.5 times).
    assert (np.diag(residual) >= 0.999 * np.diag(least)).all()
    by_itself = np.diag(np.linalg.inv(J.T @ (J / one.sigma[:, None] ** 2)))
    assert (np.diag(residual) < np.maximum(4.0 * np.diag(least), by_itself)).all()
    with_all = with_modes(one, modes[:0]).residual_covariance(J, vector)
    assert np.diag(with_all)[0] > 5.0 * np.diag(residual)[0]  # else they carry the front face's noise too


def test_the_most_likely_discrepancy_where_variances_differ() -> None:
    """The patterns' error makes some bins far less certain than others: they say little of tau."""
    rng = np.random.default_rng(12)
    patterns = np.zeros((1, 400))
    patterns[0, :200] = 40.0 * NOISE_FORCE
    found = []
    for _ in range(20):
        one = with_modes(objective(np.zeros(400), np.empty(0)), patterns)
        own = np.hypot(1.2 * NOISE_FORCE, np.hypot(NOISE_FORCE, PATTERN_ERROR * patterns[0]))
        vector = own * rng.standard_normal(400) + rng.standard_normal() * patterns[0]
        weighed = one.with_discrepancy(vector)
        found.append((weighed.force_discrepancy / NOISE_FORCE) ** 2)
        # Of all discrepancies it is, to the rounds' tenth, the one with the least deviance.
        trial = [replace(weighed, force_discrepancy=f * weighed.force_discrepancy) for f in (0.8, 1.0, 1.25)]
        cost = [float(t.chi2(vector)) + t.whitening().log_determinant for t in trial]
        assert cost[1] < min(cost[0], cost[2])
    # Two hundred certain bins know 1.44 to (1 + 1.44) sqrt(2 / 200) = 0.24, the mean of twenty to 0.055.
    assert np.mean(found) == pytest.approx(1.44, abs=0.2)


def test_other_discrepancies_change_nothing_that_an_objective_keeps() -> None:
    """What has been made without them goes over to the next objective; all else is made anew there."""
    one = noisy(40, 60, np.random.default_rng(13))[0]
    one = replace(one, slowly=True)
    parts = [name for name, part in vars(Objective).items() if isinstance(part, cached_property)]
    for name in parts:
        getattr(one, name)
    found = one.with_discrepancy(2.0 * one.noise * np.random.default_rng(14).normal(size=100))
    assert found.force_discrepancy > 0.0
    assert found.shape_discrepancy > 0.0
    kept = {name for name in parts if getattr(found, name) is getattr(one, name)}
    assert kept == {*parts} - {*WITH_DISCREPANCIES}
    fresh = replace(found)
    for name in kept:
        np.testing.assert_array_equal(getattr(found, name), getattr(fresh, name))


def test_errors_that_outline_points_have_in_common() -> None:
    """Two points that are off together by 3 sigma count as one: C = s² (1 + 9 · ones), by hand."""
    one = objective(np.array([1.0]), np.array([1e-3, 2e-3]))
    line = replace(one.observations.centre_line, modes=np.full((1, 2), 3.0 * NOISE_SHAPE))
    seen = replace(one, observations=replace(one.observations, centre_line=line))
    alike, unlike = np.array([1.0, 1.0]), np.array([1.0, -1.0])
    vectors = np.array([np.append([1.0], one.data[1:] + NOISE_SHAPE * r) for r in (alike, unlike)])
    # along (1, 1) / √2 the variance is 1 + 2 · 9, along (1, -1) / √2 it is 1
    np.testing.assert_allclose(seen.chi2(vectors, "shape"), [2.0 / 19.0, 2.0])
    np.testing.assert_allclose(seen.sigma[1:], np.sqrt(10.0) * NOISE_SHAPE)
    assert seen.pattern_variance.tolist() == [0.0, 0.0, 0.0]
    some = replace(seen, counted=np.array([False, True]))
    np.testing.assert_allclose(some.outline_errors, [[0.0, 3.0 * NOISE_SHAPE]])
