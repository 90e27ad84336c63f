"""Steps on the refined mesh: a made problem whose optimum, slopes and distances are known in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.least_squares import Whitening
from kolsky.inverse.forward import Numerics
from kolsky.inverse.joint_search import (
    COARSE_SLOPE_RUNS,
    MOST_RUNS,
    WORSE_STEP,
    Optimum,
    refined_optimum,
    secant,
)

TRUE = np.array([0.3, -0.2])
SLOPES = np.array([[20.0, 0.0], [0.0, 50.0], [10.0, 10.0]])
"""Of the refined mesh, in standard deviations of the data."""


class Made:
    """Data that are linear in two unknowns; what is asked of it is counted."""

    def __init__(self, given: np.ndarray = SLOPES, lost: bool = False, rough: float = 0.0) -> None:
        self.given, self.lost, self.rough = given, lost, rough
        self.runs: list[np.ndarray] = []
        self.costs: list[float] = []
        self.rng = np.random.default_rng(3)
        self.batches = 0
        self.refined = Numerics(mesh=(64, 86))
        self.unknowns = SimpleNamespace(box=SimpleNamespace(lower=(-1.0, -1.0), upper=(1.0, 1.0)))
        self.stack = SimpleNamespace(data=SLOPES @ TRUE)

    def predict(self, stage: str, points: np.ndarray, numerics: Numerics) -> np.ndarray:
        assert numerics.mesh == (64, 86)
        self.runs += list(points)
        seen = points @ SLOPES.T + self.rough * self.rng.standard_normal((len(points), 3))
        self.costs += [self.deviance(row) for row in seen]
        return np.full_like(seen, np.nan) if self.lost else seen

    def deviance(self, vector: np.ndarray) -> float:
        return float(((vector - self.stack.data) ** 2).sum())

    def whitening(self, residual: np.ndarray) -> Whitening:
        return Whitening(np.ones(len(residual)), np.zeros((0, len(residual))))

    def slopes(self, x: np.ndarray, sigma: np.ndarray, numerics: Numerics) -> Any:
        self.batches += 1
        return x @ SLOPES.T, self.given


def refined(made: Made, x: np.ndarray, slopes: np.ndarray) -> Optimum:
    return refined_optimum(made, x, slopes)  # type: ignore[arg-type]


def test_right_slopes_take_two_runs_and_no_others() -> None:
    made = Made()
    start = np.array([0.5, 0.5])
    found = refined(made, start, SLOPES)
    np.testing.assert_allclose(found.x, TRUE, atol=1e-12)
    np.testing.assert_array_equal(found.start, start)
    np.testing.assert_allclose(found.vector, SLOPES @ TRUE)
    assert found.confirmed
    assert (len(made.runs), made.batches) == (2, 0)


def test_a_start_within_a_quarter_of_a_standard_deviation_is_confirmed_there() -> None:
    sigma = np.sqrt(np.diag(np.linalg.inv(SLOPES.T @ SLOPES)))
    for share, runs in ((0.9, 1), (1.1, 2)):
        made = Made()
        start = TRUE + share * 0.25 * sigma * np.array([1.0, 0.0])
        assert refined(made, start, SLOPES).confirmed
        assert len(made.runs) == runs


def test_slopes_that_lead_astray_are_taken_anew() -> None:
    made = Made()
    found = refined(made, np.array([0.4, 0.0]), -0.3 * SLOPES)  # away from the optimum
    np.testing.assert_allclose(found.x, TRUE, atol=1e-12)
    assert found.confirmed
    # The start, the step that led away, and the one from the start with the right slopes.
    assert (len(made.runs), made.batches) == (3, 1)
    np.testing.assert_allclose(found.slopes, SLOPES, atol=1e-9)


def test_slopes_that_grope_are_taken_anew() -> None:
    made = Made()
    steep = 4.0 * SLOPES @ np.array([[1.0, 0.6], [-0.6, 1.0]])  # short steps, turned
    found = refined(made, np.array([0.9, 0.9]), steep)
    assert found.confirmed
    assert made.batches == 1
    assert len(made.runs) == COARSE_SLOPE_RUNS + 1


def test_a_misfit_that_jumps_is_not_confirmed_and_ends() -> None:
    made = Made(rough=3.0)
    found = refined(made, np.array([0.5, 0.5]), SLOPES)
    assert not found.confirmed
    assert len(made.runs) == MOST_RUNS
    assert made.deviance(found.vector) <= min(made.costs) + WORSE_STEP


def test_a_lost_run_is_refused() -> None:
    with pytest.raises(ValueError, match="refined mesh of 64 x 86 elements did not complete"):
        refined(Made(lost=True), TRUE, SLOPES)


def test_the_secant_explains_the_last_change_and_nothing_else() -> None:
    wrong = SLOPES + np.array([[3.0, -1.0], [2.0, 5.0], [0.0, 1.0]])
    sigma, before, x = np.array([0.1, 0.5]), np.array([0.1, 0.1]), np.array([0.2, 0.4])
    found = secant(wrong, before, SLOPES @ before, sigma, x, SLOPES @ x)
    np.testing.assert_allclose(found @ (x - before), SLOPES @ (x - before))
    step = (x - before) / sigma
    across = sigma * np.array([-step[1], step[0]])  # at right angles, in standard deviations
    np.testing.assert_allclose(found @ across, wrong @ across)
    np.testing.assert_array_equal(secant(wrong, x, SLOPES @ x, sigma, x, SLOPES @ x), wrong)
