"""The path that the refined mesh's residual asks for, against the recursion of a linear response."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.inverse.gauss_newton import AMPLITUDES_STAY, MOST_MOVES, follow_on_refined, patterns_at_refined
from kolsky.inverse.objective import FrontNoise
from kolsky.inverse.path_noise import FrontPath, MovedFront, PathModes
from kolsky.inverse.settings import Numerics

PATTERN = np.array([[3.0, 0.0, -4.0]])  # of the surrogate's mesh, in units of the noise: 5 in all
STEPS = Numerics(mesh=(30, 40), grading=5.0)
POINT = SimpleNamespace(sigma=np.ones(1))


@dataclass(frozen=True)
class Path:
    jerk: np.ndarray


@dataclass(frozen=True)
class Seen:
    force_sigma: np.ndarray = field(default_factory=lambda: np.ones(2))
    centre_line: Any = field(default_factory=lambda: POINT)


PROBLEM = SimpleNamespace(observations=Seen())


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
    """A refined mesh whose patterns are `ratio` times those of the surrogate's, those of the graded mesh
    `graded` times; the path that made the data is `true` standard deviations off."""

    ratio: float
    true: float
    graded: float
    front: FrontPath
    lost: bool = False
    searches: list[float] = field(default_factory=list)
    problem: Any = field(default_factory=lambda: PROBLEM)

    @property
    def path(self) -> float:
        """How far the path is moved, in standard deviations."""
        return float(self.front.path.jerk[0])

    def under(self, front: FrontPath) -> Mesh:
        return replace(self, front=front)

    def under_other_motions(
        self, points: np.ndarray, deviations: np.ndarray, numerics: Numerics
    ) -> list[Any]:
        assert numerics is STEPS
        changes = self.graded * deviations[:, :1] * PATTERN
        rows = np.concatenate([np.zeros((1, 3)), changes])[: 1 if self.lost else None] + 7.0
        return [SimpleNamespace(force_bins=rows[:, :2], Z=rows[:, 2:])]

    def run(self, confirmed: bool = True) -> Any:
        """What the model gives under the moved path, less what the path's patterns say of it."""
        offset = self.front.noise.offset
        assert offset is not None
        moved = self.ratio * self.path
        weighed = Weighed(self.ratio * self.true * PATTERN[0], self.front.noise)
        return SimpleNamespace(
            step=SimpleNamespace(objective=weighed),
            vector=moved * PATTERN[0] - offset,
            x=np.zeros(1),
            numerics=STEPS,
            confirmed=confirmed,
        )

    def search(
        self, runner: Mesh, objective: Any, slope: np.ndarray, x: np.ndarray, numerics: Numerics
    ) -> Any:
        assert numerics is STEPS
        assert objective.front is runner.front.noise
        self.searches.append(runner.path)
        return runner.run(), slope + 1.0


def mesh(*, ratio: float, true: float, begun: float, graded: float = 1.0, lost: bool = False) -> Mesh:
    modes = PathModes(PATTERN, np.ones((1, 1)), np.ones((1, 2)))
    front = MovedFront(Path(np.zeros(2)), modes, np.array([begun]))  # type: ignore[arg-type]
    return Mesh(ratio, true, graded, FrontPath.following(front), lost)


def next_path(a: float, *, ratio: float, true: float, graded: float = 1.0) -> float:
    """Most likely path for the residual ratio (true - a) + graded a, in units of the surrogate's pattern:
    25 graded of a standard normal amplitude's 1 + 25 graded^2."""
    return 25.0 * graded / (1.0 + 25.0 * graded**2) * (ratio * (true - a) + graded * a)


def test_the_path_goes_to_what_the_refined_mesh_asks_for() -> None:
    runner = mesh(ratio=1.5, true=1.0, begun=2.4)  # patterns of the graded mesh that are too small
    last, slope, _ = follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    first = next_path(2.4, ratio=1.5, true=1.0)
    second = next_path(first, ratio=1.5, true=1.0)
    assert runner.searches == pytest.approx([first, second])
    assert abs(second - 1.0) < abs(first - 1.0) < abs(2.4 - 1.0)
    assert len(runner.searches) == MOST_MOVES
    assert slope[0, 0] == 2.0  # those of the last search
    assert last.vector == pytest.approx(0.5 * second * PATTERN[0])


def test_with_patterns_of_the_refined_mesh_one_move_is_all() -> None:
    runner = mesh(ratio=1.5, true=1.0, begun=2.4, graded=1.5)
    last, _, _ = follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    assert runner.searches == pytest.approx([56.25 / 57.25])  # of an estimate with a noise of 1 / 7.5
    assert last.vector == pytest.approx(np.zeros(3))  # the patterns say what the path does


def test_the_weights_have_the_new_patterns_though_the_path_stays() -> None:
    runner = mesh(ratio=1.2, true=1.0, begun=1.0, graded=1.2)
    assert abs(next_path(1.0, ratio=1.2, true=1.0, graded=1.2) - 1.0) < AMPLITUDES_STAY
    _, _, path = follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    assert len(runner.searches) == 1
    assert path.noise.patterns is not None
    assert np.abs(path.noise.patterns) == pytest.approx(1.2 * np.abs(PATTERN))


def test_where_a_pattern_is_lost_the_surrogates_serve() -> None:
    runner = mesh(ratio=1.5, true=1.0, begun=2.4, graded=9.0, lost=True)
    follow_on_refined(runner, Weighed(), np.zeros((3, 1)), runner.run(), runner.search)
    assert runner.searches[0] == pytest.approx(next_path(2.4, ratio=1.5, true=1.0))


@pytest.mark.parametrize("why", ["no moved path", "no rest", "no noise of a record"])
def test_it_is_left_alone(why: str) -> None:
    runner = mesh(ratio=1.5, true=9.0 if why == "no noise of a record" else 1.0, begun=2.4)
    first = runner.run(confirmed=why != "no rest")
    if why == "no moved path":
        runner.front = replace(runner.front, moved=None)
    assert follow_on_refined(runner, Weighed(), np.zeros((3, 1)), first, runner.search)[0] is first
    assert not runner.searches


def test_new_patterns_are_of_the_same_path() -> None:
    """Two modes of three replicates: on a mesh that answers twice as much the path is the same, its patterns
    are twice as large."""
    rng = np.random.default_rng(4)
    change, deviations = rng.normal(size=(3, 3)), rng.normal(size=(3, 5))
    change[2] = change[0] + change[1]
    modes = PathModes.of(change, np.ones(3), deviations)
    assert len(modes.patterns) == 2
    front = MovedFront(Path(np.arange(5.0)), modes, np.array([0.5, -1.0]))  # type: ignore[arg-type]
    response = np.linalg.pinv(modes.shares @ deviations) @ modes.patterns

    def under_other_motions(points: Any, jerks: np.ndarray, numerics: Any) -> list[Any]:
        rows = np.concatenate([np.zeros((1, 3)), 2.0 * jerks @ response])
        return [SimpleNamespace(force_bins=rows[:, :2], Z=rows[:, 2:])]

    runner = SimpleNamespace(problem=PROBLEM, under_other_motions=under_other_motions)
    last: Any = SimpleNamespace(x=np.zeros(1), numerics=STEPS)
    again = patterns_at_refined(runner, front, last)  # type: ignore[arg-type]
    assert again is not None
    assert again.path.jerk == pytest.approx(front.path.jerk)
    assert again.offset == pytest.approx(2.0 * front.offset)
    assert again.modes.patterns.T @ again.modes.patterns == pytest.approx(
        4.0 * modes.patterns.T @ modes.patterns
    )


def test_a_moved_path_and_what_is_taken_off_for_it() -> None:
    """Two modes of three replicates: jerk and patterns are the same combination."""
    rng = np.random.default_rng(4)
    change, deviations = rng.normal(size=(3, 8)), rng.normal(size=(3, 5))
    modes = PathModes.of(change, np.ones(8), deviations)
    front = MovedFront(Path(np.arange(5.0)), modes, np.array([0.5, -1.0, 2.0]))  # type: ignore[arg-type]
    shares = front.amplitudes @ modes.shares
    assert front.path.jerk == pytest.approx(np.arange(5.0) + shares @ deviations)
    assert front.offset == pytest.approx(shares @ change)  # modes are combinations of the replicates
    assert front.moved == pytest.approx(np.sqrt(5.25 / 3.0))
    assert modes.amplitudes(shares) == pytest.approx(front.amplitudes)
