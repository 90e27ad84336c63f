"""Least squares on the refined mesh where the coarser mesh's slopes mislead: made-up responses that ring."""

from typing import Any

import numpy as np
import pytest
from test_several_parameters import FINE, TRUTH, MadeUp, ringing

from doe import Box
from kolsky.inverse.gauss_newton import MISLED, MOST_RUNS, _by_own_slopes, _on_refined
from kolsky.inverse.objective import Objective
from kolsky.inverse.refined_descent import differences, neighbours, search_on_refined
from kolsky.inverse.refined_search import CONFIRMED

STEP = 1e-6 * np.array([1.0, 0.01])


def slopes_at(x: np.ndarray) -> np.ndarray:
    """Jacobian of the made-up force, shape [k, d]."""
    return np.column_stack([(ringing(x + d) - ringing(x - d))[0] / (2.0 * d.sum()) for d in np.diag(STEP)])


def test_neighbours_keep_to_the_box_and_differences_are_exact_for_a_linear_response() -> None:
    box = Box.of({"a": (0.0, 1.0), "b": (10.0, 30.0)})
    up, down = neighbours(box, np.array([0.98, 12.0]), np.array([0.05, 7.0]))
    np.testing.assert_allclose(up, [[1.0, 12.0], [0.98, 14.0]])  # at the face; a tenth of the edge
    np.testing.assert_allclose(down, [[0.93, 12.0], [0.98, 10.0]])
    A = np.array([[1.0, -2.0], [3.0, 0.5], [0.0, 4.0]])
    np.testing.assert_allclose(differences(np.concatenate([up, down]) @ A.T, up, down), A, rtol=1e-12)


def test_it_ends_where_the_own_step_is_short() -> None:
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    sigma = np.sqrt(np.diag(one.covariance(slopes_at(TRUTH), ringing(TRUTH)[0])))
    own = search_on_refined(made, one, TRUTH + 4.0 * sigma * [1.0, -1.0])
    assert own is not None
    np.testing.assert_allclose(own.slope, slopes_at(own.x), rtol=0.02, atol=0.02 * abs(own.slope).max())
    full = np.linalg.lstsq(slopes_at(own.x), one.data - ringing(own.x)[0], rcond=None)[0]
    assert (np.abs(full) <= CONFIRMED * sigma).all()
    assert set(made.points) == {FINE}


def test_slopes_that_point_uphill_are_given_up_for_the_own_ones() -> None:
    """With the slope along Poisson's ratio of the wrong sign every step rises: twice, and then no more."""
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    sigma = np.sqrt(np.diag(one.covariance(slopes_at(TRUTH), ringing(TRUTH)[0])))
    start = TRUTH + np.array([0.0, 8.0]) * sigma
    wrong = slopes_at(TRUTH) * [1.0, -1.0]
    last, _ = _on_refined(made, one, wrong, start, None, shift=np.zeros(2))
    assert not last.confirmed
    assert made.points[FINE] < MOST_RUNS
    assert made.points[FINE] >= 1 + MISLED
    run, slope = _by_own_slopes(made, one, wrong, last)
    assert run.confirmed
    assert slope is not wrong
    assert (np.abs(run.x - TRUTH) < 4.0 * sigma).all()


def test_no_run_beside_the_end_keeps_what_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    made: Any = MadeUp()
    one = Objective(made.observations, np.empty(0, dtype=bool))
    wrong = slopes_at(TRUTH) * [1.0, -1.0]
    last, _ = _on_refined(made, one, wrong, TRUTH + 1e-5, None, shift=np.zeros(2))
    monkeypatch.setattr(made, "vectors", lambda stage, points, *rest: np.full((len(points), TIME), np.nan))
    assert search_on_refined(made, one, last.x) is None
    assert _by_own_slopes(made, one, wrong, last) == (last, wrong)


TIME = len(ringing(TRUTH)[0])
