"""The path that the refined mesh's residual asks for, against the recursion of a linear response."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from kolsky.inverse.path_modes import MovedFront, PathModes
from kolsky.inverse.refined_path import MOST_MOVES, SAME, follow_on_refined

PATTERN = np.array([[3.0, 0.0, -4.0]])  # of the surrogate's mesh, in units of the noise: 5 in all
SHARE = 25.0 / 26.0  # what a standard normal amplitude keeps of an estimate with a noise of 1/5


@dataclass
class Mesh:
    """A refined mesh whose patterns are `ratio` times those of the surrogate's."""

    ratio: float
    true: float
    front: MovedFront
    searches: list[float] = field(default_factory=list)
    observations: object = None

    def follow(self, front: MovedFront) -> None:
        self.front = front

    def run(self, confirmed: bool = True) -> SimpleNamespace:
        """What the model gives under the moved path, the surrogate's patterns taken off."""
        (a,) = self.front.amplitudes
        vector = (self.ratio - 1.0) * a * PATTERN[0]
        data = self.ratio * self.true * PATTERN[0]
        covariance = np.eye(3) + PATTERN.T @ PATTERN
        weighing = SimpleNamespace(precision=lambda residual: np.linalg.solve(covariance, residual))
        objective = SimpleNamespace(front_noise=PATTERN, data=data, whitening=lambda: weighing)
        return SimpleNamespace(
            step=SimpleNamespace(objective=objective), vector=vector, x=np.zeros(1), confirmed=confirmed
        )

    def search(self, stages: "Mesh", objective: object, slope: np.ndarray, x: np.ndarray):
        self.searches.append(float(self.front.amplitudes[0]))
        return self.run(), slope + 1.0


@dataclass(frozen=True)
class Seen:
    observations: object = None


def mesh(*, ratio: float, true: float, begun: float) -> Mesh:
    modes = PathModes(PATTERN, np.ones((1, 1)), np.ones((1, 2)))
    return Mesh(ratio, true, MovedFront(SimpleNamespace(), modes, np.array([begun])))


def next_amplitude(a: float, *, ratio: float, true: float) -> float:
    """Most likely amplitude for the residual ratio * true - (ratio - 1) * a, in units of the pattern."""
    return SHARE * (ratio * true - (ratio - 1.0) * a)


def test_the_path_goes_to_what_the_refined_mesh_asks_for() -> None:
    stages = mesh(ratio=1.5, true=1.0, begun=2.4)  # where the surrogate's mesh rings too little
    last, slope = follow_on_refined(stages, Seen(), np.zeros((3, 1)), stages.run(), stages.search)
    first = next_amplitude(2.4, ratio=1.5, true=1.0)
    second = next_amplitude(first, ratio=1.5, true=1.0)
    assert stages.searches == pytest.approx([first, second])
    assert abs(second - 1.0) < abs(first - 1.0) < abs(2.4 - 1.0)
    assert len(stages.searches) == MOST_MOVES
    assert slope[0, 0] == 2.0  # those of the last search
    assert last.vector == pytest.approx(0.5 * second * PATTERN[0])


def test_a_path_that_stays_is_not_moved() -> None:
    stages = mesh(ratio=1.2, true=1.0, begun=1.0)
    assert abs(next_amplitude(1.0, ratio=1.2, true=1.0) - 1.0) < SAME
    first = stages.run()
    assert follow_on_refined(stages, Seen(), np.zeros((3, 1)), first, stages.search)[0] is first
    assert not stages.searches


@pytest.mark.parametrize("why", ["no moved path", "no rest", "no noise of a record"])
def test_it_is_left_alone(why: str) -> None:
    stages = mesh(ratio=1.5, true=6.0 if why == "no noise of a record" else 1.0, begun=2.4)
    first = stages.run(confirmed=why != "no rest")
    if why == "no moved path":
        stages.front = None
    assert follow_on_refined(stages, Seen(), np.zeros((3, 1)), first, stages.search)[0] is first
    assert not stages.searches


def test_a_moved_path_and_what_is_taken_off_for_it() -> None:
    """Two modes of three replicates: jerk and patterns are the same combination."""
    rng = np.random.default_rng(4)
    change, deviations = rng.normal(size=(3, 8)), rng.normal(size=(3, 5))
    modes = PathModes.of(change, np.ones(8), deviations)
    fitted = replace(stub(), jerk=np.arange(5.0))
    front = MovedFront(fitted, modes, np.array([0.5, -1.0, 2.0]))
    shares = front.amplitudes @ modes.shares
    assert front.path.jerk == pytest.approx(np.arange(5.0) + shares @ deviations)
    assert front.offset == pytest.approx(shares @ change)  # modes are combinations of the replicates
    assert front.moved == pytest.approx(np.sqrt(5.25 / 3.0))


@dataclass(frozen=True)
class stub:
    jerk: np.ndarray | None = None
