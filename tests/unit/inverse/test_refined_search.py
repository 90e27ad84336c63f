"""The search by single runs, on a response that is known: an optimum beyond the second design is followed."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.inverse import refined_search
from kolsky.inverse.refined_search import _wider_box, search_by_single_runs

WHOLE = Box.of({"stiffness_factor": (0.5, 2.5)})


@pytest.mark.parametrize(
    ("bounds", "wider"),
    [
        ((1.0, 1.2), (0.9, 1.3)),
        ((0.55, 0.95), (0.5, 1.15)),
        ((2.0, 2.4), (1.8, 2.5)),
        ((0.5, 2.5), (0.5, 2.5)),
    ],
)
def test_half_the_edges_more_inside_the_whole_box(
    bounds: tuple[float, float], wider: tuple[float, float]
) -> None:
    found = _wider_box(Box.of({"stiffness_factor": bounds}), WHOLE)
    assert (found.lower[0], found.upper[0]) == pytest.approx(wider, rel=1e-12)
    assert found.names == WHOLE.names


@dataclass(frozen=True)
class Coarse:
    """What the search reads of the optimum on the coarse meshes."""

    box: Box
    x: Any
    surrogate: Any
    objective: Any


@dataclass(frozen=True)
class Least:
    """The misfit (p - data)^2 of one datum, with a standard deviation of 0.001."""

    data: float
    slowly: bool = False

    def vectors(self, prediction: Any) -> Any:
        return prediction

    def covariance(self, slope: Any, vector: Any) -> Any:
        return np.array([[1e-6]]) / slope[0, 0] ** 2


class Shifted:
    """A surrogate p = x that the refined mesh's p = x + shift corrects."""

    def __init__(self, shift: float = 0.0) -> None:
        self.shift = shift

    def predict(self, x: Any) -> Any:
        return np.atleast_2d(np.asarray(x) + self.shift)

    def through(self, point: Any, vector: Any) -> "Shifted":
        return Shifted(float(vector[0] - point[0]))


def searched(monkeypatch: pytest.MonkeyPatch, shift: float) -> tuple[Any, list[float]]:
    """The optimum, and where it was run; the data are 1.1, the second design goes from 1.05 to 1.15."""
    runs: list[float] = []

    def run(stages: Any, points: Any) -> Any:
        runs.extend(points[:, 0].tolist())
        return SimpleNamespace(points=points, prediction=points + shift)

    def least(box: Box, objective: Any, predict: Any) -> Any:
        x = np.clip(objective.data - predict(np.zeros(1))[0], box.lower, box.upper)
        return SimpleNamespace(x=x, objective=objective)

    monkeypatch.setattr(refined_search, "run_refined", run)
    monkeypatch.setattr(refined_search, "search", least)
    monkeypatch.setattr(refined_search, "jacobian", lambda predict, box, x: np.ones((1, 1)))
    monkeypatch.setattr(refined_search, "CorrectedSurrogate", lambda surrogate: surrogate)
    box = Box.of({"stiffness_factor": (1.05, 1.15)})
    coarse: Any = Coarse(box, np.array([1.1]), Shifted(), Least(1.1))
    stages: Any = SimpleNamespace(box=WHOLE)
    return search_by_single_runs(stages, coarse), runs


def test_an_optimum_inside_the_design_takes_two_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    found, runs = searched(monkeypatch, 0.02)
    assert found.confirmed
    assert found.x[0] == pytest.approx(1.08, abs=1e-12)
    assert runs == pytest.approx([1.1, 1.095, 1.08])


def test_an_optimum_beyond_the_design_is_followed_and_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The refined mesh's optimum 1.02 lies below the design's 1.05 and inside half its edge more."""
    found, runs = searched(monkeypatch, 0.08)
    assert found.confirmed
    assert found.x[0] == pytest.approx(1.02, abs=1e-12)
    assert runs == pytest.approx([1.1, 1.095, 1.02])


def test_an_optimum_that_is_never_reached_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every run is further off the search ends after its rounds, unconfirmed."""
    monkeypatch.setattr(refined_search, "MOST_CHECKS", 1)
    found, _ = searched(monkeypatch, 0.4)
    assert not found.confirmed
