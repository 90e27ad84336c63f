"""Runs of the noise stage with another motion, another curve, or another scale."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.inverse import run_table
from kolsky.inverse import runner as runner_module
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.problem import Freed, InverseProblem
from kolsky.inverse.run_table import Replicates, RunTable
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Work

PATH: Any = "a path"


class Shot:
    """A prepared shot whose motion has a scale of its own; its runs only say what they were asked for."""

    observations = None

    def __init__(self, lost: tuple[int, ...] = ()) -> None:
        self.lost, self.motion, self.material = lost, np.empty(0), np.empty(0)

    def with_replicates(self, n: int, rng: Any, *, curves: int, path: Any) -> Any:
        assert (curves, path) == (3, PATH)
        return SimpleNamespace(paths=list(range(n + 2)), run=self.run)

    def run(
        self, values: Any, numerics: Any, *, motion: Any, material: Any, progress: Any, all_nodes: bool
    ) -> Any:
        self.motion, self.material = motion, material
        completed = ~np.isin(np.arange(len(motion)), self.lost)
        return SimpleNamespace(completed=completed, n_samples=len(motion), select=lambda rows: rows)


def runner(shot: Any, monkeypatch: pytest.MonkeyPatch) -> Runner:
    for module in (run_table, runner_module):
        monkeypatch.setattr(module, "predict", lambda rows, observations: rows)
    settings, box = Settings(replicates=3), Box.of({"stiffness_factor": (0.5, 2.0)})
    problem = InverseProblem(shot, Freed(settings, by_default=False, reasons={}), box, None)
    return Runner(problem, FrontPath(PATH), RunTable(box.names), Work(), np.random.default_rng(1))


def replicated(shot: Any, monkeypatch: pytest.MonkeyPatch, *, lesson: bool) -> Replicates:
    return runner(shot, monkeypatch).replicate(np.array([1.1]), lesson=lesson)()


def test_motions_then_curves_then_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    found = replicated(shot, monkeypatch, lesson=False)
    assert shot.motion.tolist() == [0, 1, 2, 3, 0, 0, 0, 4]
    assert shot.material.tolist() == [0, 0, 0, 0, 1, 2, 3, 0]
    assert np.flatnonzero(found.flyer).tolist() == [1, 2, 3]
    assert np.flatnonzero(found.curve).tolist() == [4, 5, 6]
    assert np.flatnonzero(found.scale).tolist() == [7]
    assert not found.lesson.any()


def test_where_the_patterns_are_known_no_motion_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    one = runner(shot, monkeypatch)
    found = one.under(one.front.with_noise(np.ones((1, 4)))).replicate(np.array([1.1]), lesson=False)()
    assert shot.motion.tolist() == [0, 0, 0, 0, 1]
    assert not found.flyer.any()
    assert np.flatnonzero(found.curve).tolist() == [1, 2, 3]


def test_what_teaches_the_weights_does_not_judge_them(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    found = replicated(shot, monkeypatch, lesson=True)
    assert shot.motion.tolist() == [0, 1, 2, 3, 4, 5, 6, 0, 0, 0, 7]
    assert shot.material.tolist() == [0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 0]
    assert np.flatnonzero(found.flyer).tolist() == [1, 2, 3]
    assert np.flatnonzero(found.lesson).tolist() == [4, 5, 6]
    assert np.flatnonzero(found.curve).tolist() == [7, 8, 9]
    assert np.flatnonzero(found.scale).tolist() == [10]


def test_a_lost_run_keeps_the_others_in_their_place(monkeypatch: pytest.MonkeyPatch) -> None:
    found = replicated(Shot(lost=(2, 5)), monkeypatch, lesson=False)
    assert found.lost == 2
    assert np.flatnonzero(found.flyer).tolist() == [1, 2]
    assert np.flatnonzero(found.curve).tolist() == [3, 4]
    assert np.flatnonzero(found.scale).tolist() == [5]


def test_they_are_run_when_they_are_asked_for_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    asked = runner(shot, monkeypatch).replicate(np.array([1.1]))
    assert shot.motion.size == 0
    assert asked() is asked()
    assert shot.motion.size == 11
