"""Estimates and verdicts, common errors of points, and priors, in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from test_objective import NOISE_FORCE, NOISE_SHAPE, linear, objective

from doe import Box
from doe.least_squares import Whitening
from doe.surrogates import SurrogateError
from kolsky.inverse.coarse_search import CorrectedSurrogate, at_inner_face, on_edge, search
from kolsky.inverse.estimates import estimates, held_values
from kolsky.inverse.gauss_newton import gauss_newton_step, linear_step
from kolsky.inverse.objective import (
    Objective,
    Prior,
    correlated_in_blocks,
    most_likely_amplitude,
    residual_without_common,
    slow_patterns,
)
from kolsky.inverse.result import Estimate, Method, Verdict, disagreements
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.search import Search
from kolsky.uncertainty.profiles import full_likelihood

# Estimates and their verdicts: sums of squares, the k = 2 interval, and each threshold from both sides.

BOX = Box.of({"stiffness_factor": (1.0, 2.0), "friction": (0.0, 4.0)})


def made(x: list[float], sigma: float = 0.01, **options: Any) -> dict[str, Estimate]:
    given: dict[str, Any] = {
        "noise": {"force and shape": np.array([sigma, 4.0 * sigma])},
        "numerical": {"mesh": np.array([0.001, 0.002])},
        "mesh_shift": np.array([-0.01, 0.02]),
        "confirmed": True,
        **options,
    }
    return estimates(BOX, np.array(x), **given)


def test_parts_add_in_quadrature() -> None:
    noise = {
        "force and shape": np.array([0.03, 0.0]),
        "flyer motion": np.array([0.04, 0.0]),
        "curve": np.array([0.12, 0.1]),
    }
    numerical = {"mesh": np.array([0.02, 0.0]), "roughness": np.array([0.015, 0.3])}
    found = made([1.5, 1.0], noise=noise, numerical=numerical)
    m, f = found["stiffness_factor"], found["friction"]
    assert (m.sigma_noise, m.sigma_numerical) == pytest.approx((0.13, 0.025))  # 3-4-12-13, 3-4-5
    assert (f.sigma_noise, f.sigma_numerical) == pytest.approx((0.1, 0.3))
    assert m.noise_parts == {"force and shape": 0.03, "flyer motion": 0.04, "curve": 0.12}
    assert m.numerical_parts == {"mesh": 0.02, "roughness": 0.015}
    assert (m.unit, m.value, m.mesh_shift) == ("1", 1.5, -0.01)


def test_the_interval_is_twice_the_combined_uncertainty_to_both_sides() -> None:
    e = replace(
        made([1.5, 1.0])["stiffness_factor"], sigma_noise=0.03, sigma_numerical=0.04, sigma_systematic=0.12
    )
    assert e.sigma == pytest.approx(0.13)
    assert e.interval == pytest.approx((1.24, 1.76))


def test_not_seen_where_four_sigma_are_the_whole_design() -> None:
    just = made([1.5, 2.0], sigma=0.2499)
    assert [e.outcome for e in just.values()] == [Verdict.IDENTIFIED] * 2
    more = made([1.5, 2.0], sigma=0.2501)
    assert [e.outcome for e in more.values()] == [Verdict.NOT_SEEN] * 2


def test_a_value_on_a_plateau_is_not_identified() -> None:
    noise = {"force and shape": np.array([0.03, 0.03]), "curve": np.array([0.04, 0.04])}
    rough = {"mesh": np.array([0.1, 0.1]), "roughness": np.array([0.0499, 0.0501])}
    found = made([1.5, 2.0], noise=noise, numerical=rough)  # all noise is 0.05: 3-4-5
    assert [e.outcome for e in found.values()] == [Verdict.IDENTIFIED, Verdict.PLATEAU]
    assert not Verdict.PLATEAU.identified


@pytest.mark.parametrize(
    ("x", "options", "expected"),
    [
        ([1.5, 2.0], {}, [Verdict.IDENTIFIED, Verdict.IDENTIFIED]),
        ([1.5, 2.0], {"outline": False}, [Verdict.FORCE_ALONE, Verdict.FORCE_ALONE]),
        ([1.5, 2.0], {"confirmed": False}, [Verdict.DISAGREEING, Verdict.DISAGREEING]),
        ([1.5, 4.0], {}, [Verdict.CONDITIONAL, Verdict.AT_BOUND]),
        ([1.0, 2.0], {}, [Verdict.AT_BOUND, Verdict.CONDITIONAL]),
        ([1.5, 4.0], {"confirmed": False}, [Verdict.DISAGREEING, Verdict.AT_BOUND]),
        ([1.5, 4.0], {"sigma": 0.3}, [Verdict.NOT_SEEN, Verdict.AT_BOUND]),
        ([1.5, 2.0], {"sigma": 0.3, "confirmed": False}, [Verdict.NOT_SEEN, Verdict.NOT_SEEN]),
    ],
)
def test_verdicts_in_their_order(x: list[float], options: dict[str, Any], expected: list[Verdict]) -> None:
    assert [e.outcome for e in made(x, **options).values()] == expected


def test_a_mesh_moves_what_is_seen_and_inside_and_nothing_past_a_bound() -> None:
    correction = np.array([0.02, -0.3])

    def found(x: list[float], sigma: float = 0.01) -> list[tuple[float, float, Verdict]]:
        each = made(x, sigma=sigma, mesh_correction=correction).values()
        assert [e.searched for e in each] == [(1.0, 2.0), (0.0, 4.0)]
        assert all(e.on_mesh == pytest.approx(at) for e, at in zip(each, x, strict=True))
        return [(e.value, e.mesh_correction, e.outcome) for e in each]

    good, bound, other = Verdict.IDENTIFIED, Verdict.AT_BOUND, Verdict.CONDITIONAL
    assert found([1.5, 2.0]) == [(1.52, pytest.approx(0.02), good), (1.7, pytest.approx(-0.3), good)]
    # The correction would take the second below nothing: it lies at nothing.
    assert found([1.5, 0.25]) == [(1.52, pytest.approx(0.02), other), (0.0, -0.25, bound)]
    assert found([1.99, 2.0]) == [(2.0, pytest.approx(0.01), bound), (1.7, pytest.approx(-0.3), other)]
    # At a bound it stays, also where the correction leads inside; what is not seen has no correction.
    assert found([1.5, 4.0]) == [(1.52, pytest.approx(0.02), other), (4.0, 0.0, bound)]
    assert found([1.5, 0.25], sigma=0.3) == [(x, 0.0, Verdict.NOT_SEEN) for x in (1.5, 0.25)]


def test_an_interval_ends_where_the_search_does() -> None:
    e = replace(made([1.1, 2.0])["stiffness_factor"], sigma_noise=0.3, sigma_numerical=0.4)
    assert e.interval == pytest.approx((1.0, 2.0))
    assert e.within(0.05) == pytest.approx((1.05, 1.15))
    assert replace(e, searched=Estimate.searched).interval == pytest.approx((0.1, 2.1))


def test_a_coordinate_lies_on_a_bound_within_a_hundred_thousandth_of_the_edge() -> None:
    assert on_edge(np.array([1.0 + 0.9e-5, 4.0 - 3.9e-5]), BOX).tolist() == [True, True]
    assert on_edge(np.array([1.0 + 1.1e-5, 4.0 - 4.1e-5]), BOX).tolist() == [False, False]
    local = Box.of({"stiffness_factor": (1.4, 1.6), "friction": (2.0, 4.0)})
    assert at_inner_face(np.array([1.4, 3.0]), local, BOX)
    assert not at_inner_face(np.array([1.5, 4.0]), local, BOX)  # it would leave the design


def test_a_held_value_stands_for_the_shots_own(monkeypatch: pytest.MonkeyPatch) -> None:
    from kolsky.inverse.parameters import PARAMETERS

    for name in PARAMETERS:
        monkeypatch.setitem(PARAMETERS, name, replace(PARAMETERS[name], held=lambda shot: 7.0))
    shot = SimpleNamespace(relaxation=None)
    found = held_values(shot, BOX.names, {"poisson": 0.45})  # type: ignore[arg-type]
    assert found == {"poisson": 0.45, "damping": 7.0, "mass_damping": 7.0, "release_stress": 7.0}


def test_methods_agree_within_a_quarter_of_the_half_width() -> None:
    def method(m: float) -> Method:
        return Method.compared("x", {"m": m}, answer={"m": 1.0}, half_width={"m": 0.02}, runs=1)

    assert method(1.01).distances == {"m": pytest.approx(0.5)}
    assert list(disagreements([method(1.0049), method(0.9951)])) == []
    (far,) = disagreements([method(0.9949)])
    assert far[2] == pytest.approx(-0.255)
    (unknown,) = disagreements([method(float("nan"))])
    assert np.isnan(unknown[2])


def test_a_cost_without_a_surrogate_leaves_the_papers_route_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object) -> None:
        raise SurrogateError("ill-conditioned")

    monkeypatch.setattr("kolsky.inverse.search.paper_route", refuse)
    problem = SimpleNamespace(box=Box.of({"stiffness_factor": (0.5, 2.0)}))
    runner: Any = SimpleNamespace(problem=problem, table=RunTable(("stiffness_factor",)))
    assert Search(runner, Mock(), Mock()).paper_route() is None


# Common errors of outline points, compared with closed forms and dense covariances.


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


# Priors of the free parameters against the posterior of a linear model with Gaussian noise.

MEAN, SIGMA = np.array([0.3, 5.0]), np.array([0.02, np.inf])
TRUTH = np.array([0.32, 1.1])
WIDE = Box.of({"a": (-10.0, 10.0), "b": (-10.0, 10.0)})


def problem():
    """An objective of a linear model with a prior on the first of two parameters, its Jacobian and sigma."""
    rng = np.random.default_rng(2)
    J, sigma = linear(120, 80, rng)
    data = J @ TRUTH + sigma * rng.standard_normal(len(sigma))
    one = objective(data[:120], data[120:])
    return replace(one, prior=Prior(MEAN, SIGMA)), J, sigma


def posterior(data, J, sigma):
    """Mean and covariance by Bayes' rule: precisions add, and so do precision times mean."""
    precision = np.diag([1.0 / 0.02**2, 0.0])
    covariance = np.linalg.inv((J / sigma[:, None] ** 2).T @ J + precision)
    return covariance @ ((J / sigma[:, None] ** 2).T @ data + precision @ [0.3, 0.0]), covariance


def test_one_datum_and_one_prior_by_hand() -> None:
    # A datum of 2.0 +- 0.3 and a prior of 1.0 +- 0.4: (2 / 0.09 + 1 / 0.16) / (1 / 0.09 + 1 / 0.16) = 1.64,
    # variance 1 / (1 / 0.09 + 1 / 0.16) = 0.0576.
    one = replace(objective(np.array([2.0]), np.empty(0)), prior=Prior(np.array([1.0]), np.array([0.4])))
    J, x = np.ones((1, 1)), np.array([7.0])
    assert x + linear_step(one, J, J @ x, x) == pytest.approx([1.64])
    assert one.covariance(J, np.array([2.0]))[0, 0] == pytest.approx(0.0576)
    assert one.prior_chi2(np.array([1.8])) == pytest.approx(4.0)
    assert one.prior_chi2(np.array([1.8]), "force") == 0.0
    # The force alone knows nothing of it.
    assert one.covariance(J, np.array([2.0]), "force")[0, 0] == pytest.approx(NOISE_FORCE**2)


def test_steps_end_at_the_posterior_of_a_linear_model() -> None:
    one, J, sigma = problem()
    best, covariance = posterior(one.data, J, sigma)
    fixed = replace(one, force_discrepancy=0.0, shape_discrepancy=0.0)
    x = np.array([-3.0, 4.0])
    np.testing.assert_allclose(x + linear_step(fixed, J, J @ x, x), best, rtol=1e-10)
    gain = fixed.gain(J)
    spread = (gain * sigma**2) @ gain.T + fixed.spread_of_prior(J)
    np.testing.assert_allclose(spread, covariance, rtol=1e-10)
    # The datum moves the optimum less than it would without the prior.
    assert abs(gain @ J)[0, 0] < 1.0 - 1e-3


def test_a_bounded_step_meets_the_posterior_and_a_face() -> None:
    one, J, _ = problem()
    near = TRUTH + np.array([1e-3, -2e-3])
    free = gauss_newton_step(one, J, J @ near, near, WIDE)
    again = one.with_discrepancy(J @ near)
    best, _ = posterior(one.data, J, again.sigma)
    np.testing.assert_allclose(near + free.change, best, rtol=1e-9)
    assert free.moved == pytest.approx(np.max(np.abs(free.change) / free.sigma))
    tight = Box.of({"a": (-10.0, 10.0), "b": (-10.0, float(best[1]) - 0.1)})
    start = np.minimum(near, [9.0, best[1] - 0.2])
    held = gauss_newton_step(one, J, J @ start, start, tight)
    assert start[1] + held.change[1] == pytest.approx(best[1] - 0.1)
    # The other parameter makes up for what that one may not do: its own least squares with b at the face.
    weights = one.with_discrepancy(J @ start).sigma ** -2.0
    left = one.data - J[:, 1] * (best[1] - 0.1)
    alone = (J[:, 0] @ (weights * left) + 0.3 / 0.02**2) / (J[:, 0] @ (weights * J[:, 0]) + 1.0 / 0.02**2)
    assert start[0] + held.change[0] == pytest.approx(alone, rel=1e-8)


class Straight:
    """A surrogate that is linear."""

    def __init__(self, J: np.ndarray) -> None:
        self.J = J

    def predict(self, points: np.ndarray, *, extrapolate: bool = False) -> np.ndarray:
        return np.atleast_2d(points) @ self.J.T


def test_search_and_likelihood_know_the_prior() -> None:
    one, J, _ = problem()
    model = CorrectedSurrogate(Straight(J))  # type: ignore[arg-type]
    found = search(WIDE, one, model.predict)
    best, _ = posterior(one.data, J, found.objective.sigma)
    np.testing.assert_allclose(found.x, best, rtol=1e-6)
    alone = search(WIDE, one, model.predict, "force")
    weights = alone.objective.sigma[:120] ** -2.0
    force = np.linalg.solve((J[:120].T * weights) @ J[:120], (J[:120].T * weights) @ one.data[:120])
    np.testing.assert_allclose(alone.x, force, rtol=1e-6)
    likelihood = full_likelihood(model, found.objective, WIDE)
    fit = likelihood.maximise([0.5, 0.5])
    np.testing.assert_allclose(fit.point, best, rtol=1e-6)
    there = likelihood.residuals(WIDE.unit(best[None]))[0]
    assert there[-1] == pytest.approx((best[0] - 0.3) / 0.02)


def test_a_prior_says_what_it_needs() -> None:
    assert Prior.of(("m", "nu"), {"beta": (1.0, 0.1)}) is None
    made = Prior.of(("m", "nu"), {"nu": (0.499, 1e-4)})
    assert made is not None
    np.testing.assert_array_equal(made.sigma, [np.inf, 1e-4])
    np.testing.assert_allclose(np.diag(made.precision), [0.0, 1e8])
    np.testing.assert_allclose(made.residuals(np.array([[9.0, 0.4993]])), [[3.0]])
    np.testing.assert_allclose(made.rows(), [[0.0, 1e4]])
    with pytest.raises(ValueError, match="sigmas > 0"):
        Prior(np.zeros(1), np.zeros(1))
    with pytest.raises(ValueError, match="one shape"):
        Prior(np.zeros(2), np.ones(1))


def test_prior_has_no_part_in_a_clocks_lag() -> None:
    prior: Any = SimpleNamespace(precision=np.array([[4.0, 1.0], [1.0, 2.0]]))
    objective: Any = SimpleNamespace(prior=prior)
    wide = Objective.prior_precision(objective, 3)
    assert wide.tolist() == [[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.0]]
    assert Objective.prior_precision(objective, 2).tolist() == prior.precision.tolist()
    assert not Objective.prior_precision(objective, 2, "force").any()


def test_the_search_of_a_surrogate_begins_at_the_best_of_several_points() -> None:
    """p^2 = 1 at two points, of which a second datum prefers 1; from the middle, -0.4, a search finds -1."""
    box = Box(("p", "q"), (-2.0, -1.0), (1.2, 1.0))

    def model(points: np.ndarray) -> np.ndarray:
        p, q = np.atleast_2d(points).T
        return 50.0 * NOISE_FORCE * np.stack([p**2 - 1.0, 0.1 * (p - 1.0), q], axis=1)

    one = objective(np.zeros(3), np.empty(0))
    # A thousandth of the standard deviation of p, noise over slope: 1 / 100.
    np.testing.assert_allclose(search(box, one, model).x, [1.0, 0.0], atol=1e-5)
    from_the_middle = search(box, one, model, start=np.array([-0.4, 0.0]))
    assert from_the_middle.x[0] == pytest.approx(-1.0, abs=0.1)
