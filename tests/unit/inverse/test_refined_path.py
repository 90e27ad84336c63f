"""The path from the residual of the refined mesh, compared with the recursion of a linear response."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.inverse.gauss_newton import AMPLITUDES_STAY, MOST_MOVES, follow_on_refined
from kolsky.inverse.objective import FrontNoise
from kolsky.inverse.path_noise import FrontPath, MovedFront, PathModes
from kolsky.inverse.settings import Numerics

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
