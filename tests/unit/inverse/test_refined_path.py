"""The search on the refined mesh: slopes and path, compared with linear models."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_objective import objective
from test_several_parameters import FINE, TRUTH, Bins, MadeUp, ringing

from doe import Box
from kolsky.inverse.coarse_search import CorrectedSurrogate, jacobian
from kolsky.inverse.gauss_newton import (
    AMPLITUDES_STAY,
    CONFIRMED,
    MISLED,
    MOST_MOVES,
    MOST_RUNS,
    OWN_DIFFERENCE_STEP,
    _chord_steps,
    _with_surrogate,
    descend,
    difference_points,
    differences,
    follow_on_refined,
    judge_run,
    refined_slopes,
    run_deviance,
)
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.path_noise import FrontPath, MovedFront, PathModes
from kolsky.inverse.settings import Numerics

# The path from the residual of the refined mesh, compared with the recursion of a linear response.

PATTERN = np.array([[3.0, 0.0, -4.0]])  # of the surrogate's mesh, in units of the noise: 5 in all
STEPS = Numerics(mesh=(30, 40), grading=5.0)


@dataclass(frozen=True)
class Path:
    jerk: np.ndarray


@dataclass(frozen=True)
class Weighed:
    """An objective without discrepancies, its noise 1."""

    data: np.ndarray = field(default_factory=lambda: np.zeros(3))
    front: FrontNoise = field(default_factory=lambda: FrontNoise(PATTERN))
    kept = np.array([True, True, True])

    @property
    def front_noise(self) -> np.ndarray:
        assert self.front.patterns is not None
        return self.front.patterns

    def with_discrepancy(self, vector: np.ndarray) -> Weighed:
        return self

    def whitening(self) -> Any:
        covariance = np.eye(3) + self.front_noise.T @ self.front_noise
        return SimpleNamespace(precision=lambda residual: np.linalg.solve(covariance, residual))


@dataclass
class Mesh:
    """A refined mesh whose patterns are `ratio` times those of the surrogate's; the path that made the data
    is `true` standard deviations off."""

    ratio: float
    true: float
    front: FrontPath
    searches: list[float] = field(default_factory=list)

    @property
    def path(self) -> float:
        """How far the path is moved, in standard deviations."""
        return float(self.front.path.jerk[0])

    def under(self, front: FrontPath) -> Mesh:
        return replace(self, front=front)

    def run(self, confirmed: bool = True) -> Any:
        """What the model gives under the moved path, less what the path's patterns say of it."""
        offset = self.front.noise.offset
        assert offset is not None
        moved = self.ratio * self.path
        weighed = Weighed(self.ratio * self.true * PATTERN[0], self.front.noise)
        return SimpleNamespace(
            step=SimpleNamespace(objective=weighed), vector=moved * PATTERN[0] - offset, x=np.zeros(1),
            numerics=STEPS, confirmed=confirmed, pace=self.path,
        )  # fmt: skip

    def search(
        self, runner: Mesh, objective: Any, slope: np.ndarray, x: np.ndarray, numerics: Numerics, pace: Any
    ) -> Any:
        assert numerics is STEPS
        assert pace == (self.searches[-1] if self.searches else self.path)  # that of the search before
        assert objective.front is runner.front.noise
        self.searches.append(runner.path)
        return runner.run(), slope + 1.0


def mesh(*, ratio: float, true: float, begun: float) -> Mesh:
    modes = PathModes(PATTERN, np.ones((1, 1)), np.ones((1, 2)))
    front = MovedFront(Path(np.zeros(2)), modes, np.array([begun]))  # type: ignore[arg-type]
    return Mesh(ratio, true, FrontPath.following(front))


def next_path(a: float, *, ratio: float, true: float) -> float:
    """Most likely path for the residual ratio (true - a) + a, in units of the surrogate's pattern: 25 of a
    standard normal amplitude's 26."""
    return 25.0 / 26.0 * (ratio * (true - a) + a)


def test_the_path_goes_to_what_the_refined_mesh_asks_for() -> None:
    runner = mesh(ratio=1.5, true=1.0, begun=2.4)  # patterns that are too small
    last, slope, _ = follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    first = next_path(2.4, ratio=1.5, true=1.0)
    second = next_path(first, ratio=1.5, true=1.0)
    assert runner.searches == pytest.approx([first, second])
    assert abs(second - 1.0) < abs(first - 1.0) < abs(2.4 - 1.0)
    assert len(runner.searches) == MOST_MOVES
    assert slope[0, 0] == 2.0  # those of the last search
    assert last.vector == pytest.approx(0.5 * second * PATTERN[0])


def test_a_path_that_the_residual_leaves_is_not_run_again() -> None:
    runner = mesh(ratio=1.2, true=1.0, begun=1.0)
    assert abs(next_path(1.0, ratio=1.2, true=1.0) - 1.0) < AMPLITUDES_STAY
    follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    assert not runner.searches


@pytest.mark.parametrize("why", ["no moved path", "no rest", "no noise of a record"])
def test_it_is_left_alone(why: str) -> None:
    runner = mesh(ratio=1.5, true=9.0 if why == "no noise of a record" else 1.0, begun=2.4)
    first = runner.run(confirmed=why != "no rest")
    if why == "no moved path":
        runner.front = replace(runner.front, moved=None)
    assert follow_on_refined(runner, Weighed(), np.zeros((3, 1)), first, runner.search)[0] is first
    assert not runner.searches


def test_a_moved_path_and_what_is_taken_off_for_it() -> None:
    """Two modes of three replicates: jerk and patterns are the same combination."""
    rng = np.random.default_rng(4)
    change, deviations = rng.normal(size=(3, 8)), rng.normal(size=(3, 5))
    modes = PathModes.of(change, np.ones(8), deviations)
    front = MovedFront(Path(np.arange(5.0)), modes, np.array([0.5, -1.0, 2.0]))  # type: ignore[arg-type]
    shares = front.amplitudes @ modes.shares
    assert front.path.jerk == pytest.approx(np.arange(5.0) + shares @ deviations)
    assert front.offset == pytest.approx(shares @ change)  # modes are combinations of the replicates
    assert modes.amplitudes(shares) == pytest.approx(front.amplitudes)


# Steps with slopes of the refined mesh where those of the coarser mesh are wrong: synthetic oscillating

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
    coarse, fine = _with_surrogate(made, run, slope)
    size, plain = abs(slope).max(axis=0), CorrectedSurrogate(coarse.surrogate).predict
    assert (abs(jacobian(plain, fine.box, TRUTH) - slope).max(axis=0) > 0.01 * size).all()
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
