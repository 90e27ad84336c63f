"""Intervals, ridges, posterior and verdicts for functions with known answers."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from doe import Box, ResponseSurrogate, full_factorial, latin_hypercube
from doe.arrays import FloatArray
from doe.information import SingularInformationError, inverse_information
from doe.least_squares import bounded_step, newton_step
from doe.refine import CONVERGED_MOVE, Refinement, refine
from doe.surrogates import ProcessSurrogate
from doe.uncertainty import Channel, Likelihood, VerdictKind, profile_likelihoods, sample_posterior, verdicts

LEVEL = 3.841458820694124  # 95 % point of chi-square with one degree of freedom, tables
BOX = Box(("x", "y"), (-2.0, -2.0), (3.0, 4.0))
A = np.array([[1.0, 0.3], [0.2, 1.5], [0.5, -0.4], [0.9, 0.1]])
SIGMA = 0.1
TRUTH = np.array([0.4, 1.2])


def of(model: Callable[[np.ndarray], np.ndarray], data: np.ndarray, box: Box = BOX) -> Likelihood:
    return Likelihood(box, model, data, [Channel("all", np.full(len(data), SIGMA))])


def linear(p: np.ndarray) -> np.ndarray:
    return p @ A.T


def test_quadratic_profile_is_gauss_newton() -> None:
    data = A @ TRUTH + SIGMA * np.array([0.5, -1.0, 0.3, 0.7])
    likelihood = of(linear, data)
    profiles = profile_likelihoods(likelihood, (0.0, 0.0))
    best, *_ = np.linalg.lstsq(A, data, rcond=None)
    # The search ends at 1e-10 of the box; differences of a linear model are exact to 1e-12.
    np.testing.assert_allclose(profiles.optimum.point, best, atol=1e-7)
    C = SIGMA**2 * np.linalg.inv(A.T @ A)
    alone = SIGMA / np.linalg.norm(A, axis=0)
    for j, profile in enumerate(profiles.profiles):
        half = np.sqrt(LEVEL * C[j, j])
        np.testing.assert_allclose(profile.interval, best[j] + half * np.array([-1, 1]), atol=1e-6)
        np.testing.assert_allclose(
            profile.conditional, best[j] + np.sqrt(LEVEL) * alone[j] * np.array([-1, 1]), atol=1e-6
        )
        exact = (profile.values - best[j]) ** 2 / C[j, j]
        np.testing.assert_allclose(profile.rise, exact, rtol=1e-6, atol=1e-6)
        assert profile.other_optima == ()
        assert profile.not_converged == 0
    assert [v.kind for v in verdicts(likelihood, profiles)] == [VerdictKind.IDENTIFIED] * 2
    unit = likelihood.jacobian(profiles.optimum.unit_point)
    edges = np.array([5.0, 6.0])
    cov = inverse_information(unit / edges)
    np.testing.assert_allclose(cov, C, rtol=1e-8)


def test_a_linear_ridge_that_runs_out_of_the_box() -> None:
    # Only x + y is seen: the profile of either never rises while the other can make up for it.
    likelihood = of(lambda p: np.outer(p.sum(axis=1), np.arange(1.0, 6.0)), np.arange(1.0, 6.0))
    profiles = profile_likelihoods(likelihood, (0.5, 0.5))
    x, y = verdicts(likelihood, profiles)
    assert x.kind is y.kind is VerdictKind.RIDGE
    assert [p.name for p in x.partners] == ["y"]
    # Along the ridge y falls by what x rises.
    assert x.partners[0].change == pytest.approx(-x.partners[0].per, abs=0.1)  # within 1.96 sigma of x + y
    assert "ridge with y" in x.text
    # Along x + y = 1 x may be anything in its box; y ends where x is -2, with 1.96 sigma of x + y more.
    assert x.interval == (None, None)
    assert y.interval[0] is None
    assert y.interval[1] == pytest.approx(3.0 + np.sqrt(LEVEL) * SIGMA / np.sqrt(55.0), abs=1e-6)
    assert "at most 3.0264" in y.text


def test_a_banana_is_followed_round_its_bend() -> None:
    # Deviance ((y - x^2) / 0.1)^2 + ((x - 1) / 0.5)^2: the profile of x is the second term alone.
    def banana(p: np.ndarray) -> np.ndarray:
        return np.stack([p[:, 1] - p[:, 0] ** 2, (p[:, 0] - 1.0) * SIGMA / 0.5], axis=1)

    box = Box(("x", "y"), (-2.0, -1.0), (3.0, 10.0))
    likelihood = of(banana, np.zeros(2), box)
    profiles = profile_likelihoods(likelihood, (-1.0, 5.0))
    x = profiles["x"]
    half = 0.5 * np.sqrt(LEVEL)
    np.testing.assert_allclose(x.interval, [1.0 - half, 1.0 + half], atol=1e-5)
    np.testing.assert_allclose(x.rise, ((x.values - 1.0) / 0.5) ** 2, atol=1e-4)  # floor of the search
    np.testing.assert_allclose(x.points[:, 1], x.values**2, atol=1e-4)
    verdict = verdicts(likelihood, profiles)[0]
    assert verdict.kind is VerdictKind.IDENTIFIED
    # With y known to be 1: 4 x^2 / 0.01 + 4 gives a sigma of 0.05; ten times less than 0.5.
    assert verdict.inflation == pytest.approx(10.0, rel=0.05)
    assert [p.name for p in verdict.partners] == ["y"]
    assert "times longer" in verdict.text


def test_a_bound_on_one_side() -> None:
    # tanh saturates: data at the plateau say "at least", nothing more.
    data = np.full(4, 1.0)
    box = Box(("x",), (0.0,), (10.0,))
    likelihood = of(lambda p: np.repeat(np.tanh(p), 4, axis=1), data, box)
    profiles = profile_likelihoods(likelihood, (3.0,))
    (verdict,) = verdicts(likelihood, profiles)
    assert verdict.kind is VerdictKind.ONE_SIDED
    # 4 ((1 - tanh x) / 0.1)^2 = 3.84; the best fit at the plateau has a deviance of 1e-9 or less.
    exact = np.arctanh(1.0 - SIGMA * np.sqrt(LEVEL) / 2.0)
    assert verdict.interval[0] == pytest.approx(exact, abs=1e-5)
    assert verdict.interval[1] is None
    assert f"at least {exact:.4f}" in verdict.text


def test_an_optimum_on_a_face_of_the_box() -> None:
    # The data ask for -0.05, the box begins at 0: the rise is that over the face, in closed form.
    likelihood = of(lambda p: p, np.array([-0.05]), Box(("x",), (0.0,), (1.0,)))
    profiles = profile_likelihoods(likelihood, (0.5,))
    assert profiles.optimum.point[0] == 0.0
    (verdict,) = verdicts(likelihood, profiles)
    assert verdict.kind is VerdictKind.ONE_SIDED
    assert verdict.interval[0] is None
    assert verdict.interval[1] == pytest.approx(-0.05 + np.sqrt(0.05**2 + LEVEL * SIGMA**2), abs=1e-6)


def test_a_parameter_that_the_data_do_not_see() -> None:
    likelihood = of(lambda p: np.outer(p[:, 0], np.ones(3)), np.full(3, 0.5))
    profiles = profile_likelihoods(likelihood, (1.0, 0.3))
    x, y = verdicts(likelihood, profiles)
    assert (x.kind, y.kind) == (VerdictKind.IDENTIFIED, VerdictKind.NOT_SEEN)
    assert x.partners == y.partners == ()
    jacobian = likelihood.jacobian(profiles.optimum.unit_point)
    with pytest.raises(SingularInformationError, match="do not move along"):
        inverse_information(jacobian)


def test_a_second_optimum_is_told_and_a_better_one_is_taken() -> None:
    # Two valleys, at -1 and +1, with a small preference for the second; started in the first.
    def model(p: np.ndarray) -> np.ndarray:
        return np.concatenate([p**2 - 1.0, 0.05 * (p - 1.0)], axis=1)

    likelihood = of(model, np.zeros(2), Box(("x",), (-2.0,), (2.0,)))
    profiles = profile_likelihoods(likelihood, (-1.0,))
    assert profiles.restarts == 1
    assert profiles.optimum.point[0] == pytest.approx(1.0, abs=1e-6)
    # At -1 the second entry alone costs (0.05 * 2 / 0.1)^2 = 1 < 3.84: it fits as well.
    assert min(abs(value + 1.0) for value in profiles["x"].other_optima) < 0.05
    (verdict,) = verdicts(likelihood, profiles)
    assert "fit as well" in verdict.text


def test_posterior_of_a_linear_model_is_the_profile() -> None:
    pytest.importorskip("emcee", reason="the extra [bayes] is not installed")
    data = A @ TRUTH
    likelihood = of(linear, data)
    posterior = sample_posterior(likelihood, (0.0, 0.0), rng=5, max_steps=2500)
    assert posterior.converged
    C = SIGMA**2 * np.linalg.inv(A.T @ A)
    sigma = np.sqrt(np.diag(C))
    # More than 50 autocorrelation times of 32 walkers, 1600 independent samples: means to 0.025 sigma,
    # deviations to 1.8 %; four of each.
    np.testing.assert_allclose((posterior.samples.mean(axis=0) - TRUTH) / sigma, 0.0, atol=0.1)
    np.testing.assert_allclose(posterior.samples.std(axis=0) / sigma, 1.0, atol=0.072)
    low, high = np.percentile(posterior.samples[:, 0], [2.5, 97.5])
    assert (high - low) / (2 * 1.96 * sigma[0]) == pytest.approx(1.0, abs=0.1)
    assert posterior.prior == "x: uniform in [-2, 3]; y: uniform in [-2, 4]"


@pytest.mark.slow
def test_posterior_of_a_discrepancy() -> None:
    pytest.importorskip("emcee", reason="the extra [bayes] is not installed")
    k = 400
    data = np.random.default_rng(9).normal(0.3, 0.5, k)
    channel = Channel("force", np.full(k, 0.1), discrepancy=0.4)
    likelihood = Likelihood(Box(("x",), (-2.0,), (3.0,)), lambda p: np.repeat(p, k, axis=1), data, [channel])
    posterior = sample_posterior(likelihood, (0.0,), rng=5, discrepancy_priors=[10.0], max_steps=1500)
    tau = np.sqrt(data.var() - 0.1**2)
    # Standard deviation of tau 0.5 / sqrt(800) = 0.018; the wide prior moves it by far less. Half of it.
    assert posterior.discrepancies.mean() == pytest.approx(tau, abs=0.009)
    assert posterior.samples.std() == pytest.approx(data.std() / np.sqrt(k), rel=0.1)
    assert posterior.discrepancy_names == ("force",)
    assert "half-normal, scale 10" in posterior.prior


def test_a_chain_that_is_too_short_says_so() -> None:
    pytest.importorskip("emcee", reason="the extra [bayes] is not installed")
    posterior = sample_posterior(of(linear, A @ TRUTH), (0.0, 0.0), rng=5, max_steps=100)
    assert not posterior.converged
    again = sample_posterior(of(linear, A @ TRUTH), (0.0, 0.0), rng=5, max_steps=100)
    np.testing.assert_array_equal(again.samples, posterior.samples)


def test_what_is_wrong_is_refused() -> None:
    with pytest.raises(ValueError, match="finite and > 0"):
        Channel("force", np.array([0.1, 0.0]))
    with pytest.raises(ValueError, match="hold 3 entries"):
        Likelihood(BOX, linear, np.zeros(4), [Channel("all", np.ones(3))])
    with pytest.raises(ValueError, match="must return shape"):
        profile_likelihoods(of(lambda p: np.zeros((len(p), 3)), np.zeros(4)), (0.0, 0.0))
    with pytest.raises(ValueError, match="not finite at"):
        profile_likelihoods(of(lambda p: np.full((len(p), 4), np.nan), np.zeros(4)), (0.0, 0.0))
    with pytest.raises(ValueError, match="outside"):
        profile_likelihoods(of(linear, np.zeros(4)), (9.0, 0.0))


def decay(p: np.ndarray) -> np.ndarray:
    """Amplitude x, rate y, 60 times."""
    return p[:, :1] * np.exp(-p[:, 1:] * np.linspace(0.0, 2.0, 60))


DECAY_BOX = Box(("x", "y"), (0.5, 0.2), (1.5, 2.0))


def test_a_surrogate_gives_the_interval_of_what_it_stands_for() -> None:
    points = full_factorial(DECAY_BOX, 7).points
    surrogate = ResponseSurrogate.fit(DECAY_BOX, points, decay(points))
    data = decay(np.array([[1.0, 0.9]]))[0] + 0.02 * np.random.default_rng(0).standard_normal(60)
    channel = Channel("all", np.full(60, 0.02))
    exact, replaced = (
        profile_likelihoods(Likelihood(DECAY_BOX, model, data, [channel]), (1.1, 1.0))
        for model in (decay, surrogate.predict)
    )
    for name, edge in (("x", 1.0), ("y", 1.8)):
        # Leave-one-out error over the noise of a single entry, as a share of the interval, times the box.
        allowed = surrogate.loo_rms * edge
        np.testing.assert_allclose(replaced[name].interval, exact[name].interval, atol=allowed)
        assert allowed < 0.1 * np.ptp(exact[name].interval)


REFINE_BOX = Box(("m", "f"), (0.5, 0.0), (2.0, 1.0))
TIME = np.linspace(0.0, 1.0, 50)
REFINE_SIGMA = 0.02
REFINE_TRUTH = np.array([1.1, 0.35])


def model(points: FloatArray) -> FloatArray:
    """A history with a narrow valley: the phase of a wave depends on both parameters."""
    m, f = points[:, :1], points[:, 1:]
    return 10.0 * m * TIME**2 + np.sin(9.0 * np.sqrt(m) * TIME + 2.0 * f) + f * TIME


DATA = model(REFINE_TRUTH[None])[0] + REFINE_SIGMA * np.random.default_rng(1).standard_normal(50)


def misfit(responses: FloatArray) -> FloatArray:
    return np.asarray((((responses - DATA) / REFINE_SIGMA) ** 2).sum(axis=1))


def locate(surrogate: ProcessSurrogate, region: Box, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    def cost(u: FloatArray) -> float:
        return float(misfit(surrogate.predict(region.scale(np.clip(u, 0.0, 1.0))[None], extrapolate=True))[0])

    found = minimize(
        cost, np.clip(region.unit(start), 0.0, 1.0), method="Nelder-Mead", bounds=[(0.0, 1.0)] * 2,
        options={"xatol": 1e-5, "fatol": 1e-6},
    )  # fmt: skip
    x, h = region.scale(np.clip(found.x, 0.0, 1.0)), 1e-4
    slope = [
        (surrogate.predict([x + e], extrapolate=True) - surrogate.predict([x - e], extrapolate=True))[0]
        / (2 * h)
        for e in h * np.eye(2)
    ]
    return x, np.sqrt(np.diag(np.linalg.inv(np.array(slope) @ np.array(slope).T / REFINE_SIGMA**2)))


def refined(run=model, box: Box = REFINE_BOX, **options: int) -> Refinement:
    points = latin_hypercube(box, 16, rng=3, optimise=True).points
    return refine(run, box, points, run(points), misfit=misfit, locate=locate, scale=REFINE_SIGMA, **options)


def optimum(
    lower: tuple[float, float] = REFINE_BOX.lower, upper: tuple[float, float] = REFINE_BOX.upper
) -> FloatArray:
    """On the model itself."""
    found = minimize(
        lambda x: misfit(model(x[None]))[0], np.clip(REFINE_TRUTH, lower, upper), method="Nelder-Mead",
        bounds=list(zip(lower, upper, strict=True)), options={"xatol": 1e-9, "fatol": 1e-9},
    )  # fmt: skip
    return np.asarray(found.x)


def test_the_models_optimum_is_found_in_few_runs() -> None:
    found = refined()
    assert found.converged
    # What it promises: the last runs moved it by no more than 0.2 sigma, and the surrogate is exact there.
    np.testing.assert_array_less(np.abs(found.x - optimum()), CONVERGED_MOVE * found.sigma)
    # A grid that resolves the valley (0.2 sigma) over the box would have 10^5 points.
    assert len(found.points) <= 16 + 6 * 6
    # Every run is there, and each is what the function gives.
    np.testing.assert_array_equal(found.responses, model(found.points))


def test_it_is_reproducible() -> None:
    first = refined(rng=5, max_rounds=2).points
    np.testing.assert_array_equal(first, refined(rng=5, max_rounds=2).points)
    assert not np.array_equal(first, refined(rng=6, max_rounds=2).points)


def test_new_runs_are_apart_and_in_the_region() -> None:
    points = refined().points[16:]
    assert REFINE_BOX.contains(points).all()
    for each in np.split(points, len(points) // 6):  # 2 d + 2 runs a round
        u = REFINE_BOX.unit(each)
        gaps = np.abs(u[:, None] - u).max(axis=2)[~np.eye(len(u), dtype=bool)]
        assert gaps.min() > 1e-4


def test_an_optimum_on_a_face_of_the_box_is_no_reason_to_go_on() -> None:
    box = Box(("m", "f"), (0.5, 0.0), (2.0, 0.3))
    found = refined(box=box)
    assert found.converged
    assert found.x[1] == pytest.approx(0.3, abs=1e-5)
    best = optimum(upper=(2.0, 0.3))
    assert abs(found.x[0] - best[0]) < CONVERGED_MOVE * found.sigma[0]


def test_failed_runs_are_left_out() -> None:
    lost = 0

    def fragile(points: FloatArray) -> FloatArray:
        nonlocal lost
        values = model(points)
        bad = (points[:, 1] > 0.5) & (np.arange(len(points)) % 2 == 1) & (len(points) < 16)
        values[bad] = np.nan
        lost += int(bad.sum())
        return values

    found = refined(run=fragile)
    assert lost > 0
    assert (len(found.points) + lost - 16) % 6 == 0
    np.testing.assert_array_less(np.abs(found.x - optimum()), CONVERGED_MOVE * found.sigma)


def test_a_rough_function_keeps_its_region_wide() -> None:
    def rough(points: FloatArray) -> FloatArray:
        """Chatter as large as the noise, another at every point."""
        phase = 1e6 * points.sum(axis=1, keepdims=True)
        return model(points) + REFINE_SIGMA * np.sin(phase + 40.0 * TIME)

    found = refined(run=rough)
    # Chatter is not followed: the region is kept wider than it would be for a smooth function ...
    wide, narrow = (REFINE_BOX.unit([r.lower, r.upper]) for r in (found.region, refined().region))
    assert np.ptp(wide, axis=0).max() >= np.ptp(narrow, axis=0).max()
    # ... and the optimum is that without chatter, to what its own size allows.
    np.testing.assert_array_less(np.abs(found.x - optimum()), 2.0 * found.sigma)


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="must be at least 1, got 0"):
        refined(max_rounds=0)
    assert not refined(max_rounds=1).converged


@pytest.mark.parametrize("hessian", [True, False])
def test_a_bounded_step_by_hand(hessian: bool) -> None:
    # |(2 + s + t, 1 + t)|^2 is least at s = t = -1.
    # At s = -1/2 it is |(1.5 + t, 1 + t)|^2, least at t = -1.25. At s >= 0 it is least at t = -1.5.
    residual, slope = np.array([2.0, 1.0]), np.array([[1.0, 1.0], [0.0, 1.0]])
    wide = np.full(2, 2.0)

    def step(low: FloatArray) -> FloatArray:
        if hessian:
            return newton_step(slope.T @ slope, slope.T @ residual, low, wide)
        return bounded_step(slope, residual, low, wide)

    np.testing.assert_allclose(step(-wide), [-1.0, -1.0])
    np.testing.assert_allclose(step(np.array([-0.5, -2.0])), [-0.5, -1.25])
    np.testing.assert_allclose(step(np.array([0.0, -2.0])), [0.0, -1.5], atol=1e-14)


def test_a_damped_step_by_hand() -> None:
    # Damping of 1 doubles the diagonal (1, 2) of the normal equations: (2, 1; 1, 4) (s, t) = -(2, 3).
    residual, slope = np.array([2.0, 1.0]), np.array([[1.0, 1.0], [0.0, 1.0]])
    wide = np.full(2, 2.0)
    np.testing.assert_allclose(
        bounded_step(slope, residual, -wide, wide, damping=1.0), [-5.0 / 7.0, -4.0 / 7.0]
    )
    # A coordinate that no entry depends on does not move.
    blind = bounded_step(np.array([[1.0, 0.0]]), np.array([-0.5]), -wide, wide)
    np.testing.assert_allclose(blind, [0.5, 0.0], atol=1e-12)
