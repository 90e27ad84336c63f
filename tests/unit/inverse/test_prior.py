"""Priors of the free parameters against the posterior of a linear model with Gaussian noise."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_objective import NOISE_FORCE, linear, objective

from doe import Box
from kolsky.inverse.coarse_search import CorrectedSurrogate, search
from kolsky.inverse.gauss_newton import gauss_newton_step, linear_step
from kolsky.inverse.objective import Objective, Prior
from kolsky.uncertainty.profiles import full_likelihood

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
