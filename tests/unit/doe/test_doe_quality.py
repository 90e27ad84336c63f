"""Errors of surrogates on curves, and the number of runs that would do, against what is known of them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from doe import Box, ResponseSurrogate, full_factorial, sobol
from doe.surrogates import Kernel, SurrogateError
from doe.surrogates.quality import Fitness, fitness, nested

FloatArray = NDArray[np.float64]
BOX = Box(("x", "y"), (0.0, 1.0), (2.0, 3.0))
TIME = np.linspace(0.0, 1.0, 25)
SIGMA = np.linspace(0.01, 0.05, 25)
CUBIC = (Kernel("cubic", 1),)


def response(points: FloatArray) -> FloatArray:
    return np.sin(points[:, :1] * (1.0 + TIME) + points[:, 1:]) * TIME


def fit(x: FloatArray, y: FloatArray) -> ResponseSurrogate:
    return ResponseSurrogate.fit(BOX, x, y, scale=SIGMA, kernels=CUBIC, variance=1.0)


def test_beginnings_of_the_order_are_spread() -> None:
    u = full_factorial(Box(("a", "b"), (0.0, 0.0), (1.0, 1.0)), 5).points
    order = nested(u)
    assert sorted(order) == list(range(25))
    assert u[order[0]].tolist() == [0.5, 0.5]
    # The corners are farthest from the middle, then the middles of the edges.
    assert {tuple(x) for x in u[order[1:5]]} == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
    assert {tuple(x) for x in u[order[5:9]]} == {(0.0, 0.5), (0.5, 0.0), (0.5, 1.0), (1.0, 0.5)}


def test_the_runs_it_asks_for_do() -> None:
    small = sobol(BOX, 32, rng=1).points
    found = fitness(fit, BOX, small, response(small), sigma=SIGMA, allowed=0.05)
    assert not found.good
    # A cubic interpolates a smooth response to h^2 or better at the edges: n^-1 or faster for two parameters.
    assert 1.0 < found.order < 4.0
    needed = found.runs_needed
    assert needed is not None
    assert 32 < needed < 1000
    with pytest.raises(SurrogateError, match=f"about {needed} runs would do"):
        found.require()
    n = 2 ** int(np.ceil(np.log2(needed)))
    large = sobol(BOX, n, rng=1).points
    # Up to twice as many, for the balance of the sequence; an extrapolation is good to a factor.
    assert fitness(fit, BOX, large, response(large), sigma=SIGMA, allowed=0.05).error < 1.5 * 0.05


def test_a_gain_says_what_the_error_is_for() -> None:
    points = sobol(BOX, 32, rng=1).points
    gain = np.zeros((2, 25))
    gain[0, 0] = 1e9  # what only the first entry moves, which is zero for every run
    gain[1, 10] = 2.0
    found = fitness(fit, BOX, points, response(points), sigma=SIGMA, allowed=1.0, gain=gain)
    residual = fit(points, response(points)).loo_residuals
    assert found.error == pytest.approx(2.0 * np.sqrt(np.mean(residual[:, 10] ** 2)), rel=1e-6)
    assert found.good
    assert found.runs_needed == 32
    found.require()


def test_a_rough_response_is_not_cured_by_runs() -> None:
    points = sobol(BOX, 64, rng=1).points
    rough = response(points) + 0.1 * np.random.default_rng(0).standard_normal((64, 25))
    found = fitness(fit, BOX, points, rough, sigma=SIGMA, allowed=0.05)
    assert found.runs_needed is None
    with pytest.raises(SurrogateError, match="hardly falls with the number of runs"):
        found.require()


def test_what_cannot_be_judged() -> None:
    points = sobol(BOX, 4, rng=1).points
    with pytest.raises(ValueError, match="allowed must be finite and > 0"):
        fitness(fit, BOX, points, response(points), sigma=SIGMA, allowed=0.0)
    # Four runs carry a surrogate, two do not: one design is no convergence.
    found = fitness(fit, BOX, points, response(points), sigma=SIGMA, allowed=1e-6)
    assert found.runs == (4,)
    assert np.isnan(found.order)
    assert found.runs_needed is None
    with pytest.raises(SurrogateError, match="no kernel can be used with 3 runs"):
        fitness(fit, BOX, points[:3], response(points[:3]), sigma=SIGMA, allowed=1.0)
    # An extrapolation over a hundredfold is none.
    assert Fitness(1.0, 1e-9, (10, 20), (1.2, 1.0), 0.26).runs_needed is None
