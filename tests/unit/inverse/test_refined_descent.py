"""Steps with slopes of the refined mesh where those of the coarser mesh are wrong: synthetic oscillating
responses."""

from typing import Any

import numpy as np
import pytest
from test_objective import objective
from test_several_parameters import FINE, SHIFT, TRUTH, Bins, MadeUp, ringing

from doe import Box
from kolsky.inverse.coarse_search import jacobian
from kolsky.inverse.gauss_newton import (
    MISLED,
    MOST_RUNS,
    OWN_DIFFERENCE_STEP,
    _chord_steps,
    _with_surrogate,
    descend,
    difference_points,
    differences,
    judge_run,
    refined_slopes,
    run_deviance,
)
from kolsky.inverse.objective import Objective
from kolsky.inverse.refined_search import CONFIRMED
from kolsky.inverse.surrogate_mesh_search import MeshOptimum

STEP = 1e-6 * np.array([1.0, 0.01])


def slopes_at(x: np.ndarray) -> np.ndarray:
    """Jacobian of the made-up force, shape [k, d]."""
    return np.column_stack([(ringing(x + d) - ringing(x - d))[0] / (2.0 * d.sum()) for d in np.diag(STEP)])


def test_neighbours_keep_to_the_box_and_differences_are_exact_for_a_linear_response() -> None:
    box = Box.of({"a": (0.0, 1.0), "b": (10.0, 30.0)})
    up, down = difference_points(box, np.array([0.98, 12.0]), np.array([0.05, 7.0]))
    np.testing.assert_allclose(up, [[1.0, 12.0], [0.98, 14.0]])  # at the face; a tenth of the edge
    np.testing.assert_allclose(down, [[0.93, 12.0], [0.98, 10.0]])
    A = np.array([[1.0, -2.0], [3.0, 0.5], [0.0, 4.0]])
    np.testing.assert_allclose(differences(np.concatenate([up, down]) @ A.T, up, down), A, rtol=1e-12)


def test_slopes_are_taken_a_quarter_of_sigma_beside_a_run() -> None:
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    run = judge_run(made, one, slopes_at(TRUTH), TRUTH, made.problem.refined, None)
    asked: list[np.ndarray] = []
    vectors = made.vectors
    made.vectors = lambda stage, points, *rest: asked.append(points) or vectors(stage, points, *rest)
    found = refined_slopes(made, one, run)
    np.testing.assert_allclose(found, slopes_at(TRUTH), atol=0.01 * abs(slopes_at(TRUTH)).max(axis=0).max())
    away = np.diag((asked[0][:2] - asked[0][2:]) / 2.0)
    np.testing.assert_allclose(away, OWN_DIFFERENCE_STEP * run.step.sigma, rtol=1e-9)
    assert set(made.points) == {FINE}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slopes_that_point_uphill_are_given_up_for_the_own_ones(sign: float) -> None:
    """With the slope along Poisson's ratio of the wrong sign every step rises: twice, and then no more."""
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    sigma = np.sqrt(np.diag(one.covariance(slopes_at(TRUTH), ringing(TRUTH)[0])))
    start = TRUTH + np.array([0.0, 8.0 * sign]) * sigma
    wrong = slopes_at(TRUTH) * [1.0, -1.0]
    last = _chord_steps(made, one, wrong, start, made.problem.refined)
    assert not last.confirmed
    assert made.points[FINE] < MOST_RUNS
    assert made.points[FINE] >= 1 + MISLED
    run, slope = descend(made, one, wrong, last)
    assert run.confirmed
    assert run_deviance(run) < run_deviance(last)
    # It stops where a full Gauss-Newton step with the mesh's own slopes is short.
    full = np.linalg.lstsq(slopes_at(run.x), one.data - ringing(run.x)[0], rcond=None)[0]
    assert (np.abs(full) <= 1.5 * CONFIRMED * sigma).all()
    assert np.corrcoef(slope[:, 1], slopes_at(run.x)[:, 1])[0, 1] > 0.9


def test_routes_and_profiles_have_the_slopes_of_the_answer() -> None:
    """The coarse mesh is left out of step: its surrogate has other slopes than the answer rests on."""
    made: Any = MadeUp()
    made.rng = np.random.default_rng(5)
    one = Objective(made.observations, np.empty(0, dtype=bool))
    slope = slopes_at(TRUTH)
    run = judge_run(made, one, slope, TRUTH, made.problem.refined, None)
    coarse = MeshOptimum(TRUTH + SHIFT, run.step.sigma, run.step.sigma)
    _, fine = _with_surrogate(made, run, slope, ringing(TRUTH)[0], coarse)
    size = abs(slope).max(axis=0)
    assert (abs(jacobian(fine.surrogate, fine.box, TRUTH) - slope).max(axis=0) > 0.01 * size).all()
    # Exact up to the differences of 1e-3 of the box, 0.016 sigma, of what bends.
    np.testing.assert_allclose(jacobian(fine.model, fine.box, TRUTH) / size, slope / size, atol=1e-6)
    np.testing.assert_allclose(fine.model(TRUTH)[0], run.vector, rtol=1e-12)


def test_a_lost_run_beside_keeps_what_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    wrong = slopes_at(TRUTH) * [1.0, -1.0]
    last = _chord_steps(made, one, wrong, TRUTH + 1e-5, made.problem.refined)
    lost = np.full((4, len(ringing(TRUTH)[0])), np.nan)
    monkeypatch.setattr(made, "vectors", lambda stage, points, *rest: lost)
    assert descend(made, one, wrong, last) == (last, wrong)


def hump(x: np.ndarray) -> np.ndarray:
    """A force that is least at x = -0.25, and never zero."""
    return 0.6 + x + 2.0 * x**2


def test_a_step_that_rises_is_halved_until_it_does_not() -> None:
    """At 0 the force is 0.6 and its slope 1: a step of -0.6 to where it is 0.72, half of it to 0.48."""
    made: Any = Bins(hump)
    one = objective(np.zeros(10), np.empty(0))
    start = judge_run(made, one, np.ones((10, 1)), np.zeros(1), made.problem.refined, None)
    run, _ = descend(made, one, np.full((10, 1), 7.0), start)
    assert made.visited[:3] == pytest.approx([0.0, -0.6, -0.3], abs=1e-6)
    assert run_deviance(run) <= run_deviance(start) + 20.0 * np.log(0.48 / 0.6) + 1e-9


def test_a_trial_that_is_lost_is_no_better_point() -> None:
    """The step of -0.6, the second run, folds; half of it is tried next."""
    made: Any = Bins(hump)
    one = objective(np.zeros(10), np.empty(0))
    start = judge_run(made, one, np.ones((10, 1)), np.zeros(1), made.problem.refined, None)
    made.lost = {2}
    run, _ = descend(made, one, np.full((10, 1), 7.0), start)
    assert made.visited[1:3] == pytest.approx([-0.6, -0.3], abs=1e-6)
    assert run_deviance(run) < run_deviance(start)
    made.visited, made.lost = [], set(range(1, 99))
    assert descend(made, one, np.full((10, 1), 7.0), start)[0].x == start.x
