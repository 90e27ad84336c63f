"""Which runs of the noise stage have another motion, another curve, another scale."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.inverse import staged_runs
from kolsky.inverse.problem import Settings
from kolsky.inverse.run_table import Replicates
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.work import Work


class Shot:
    """A prepared shot whose motion has a scale of its own; its runs only say what they were asked for."""

    observations = None

    def __init__(self, lost: tuple[int, ...] = ()) -> None:
        self.lost, self.motion, self.material = lost, np.empty(0), np.empty(0)

    def with_replicates(self, n: int, rng: Any, *, curves: int) -> Any:
        assert curves == 3
        return SimpleNamespace(paths=list(range(n + 2)), run=self.run)

    def run(self, values: Any, numerics: Any, *, motion: Any, material: Any, progress: Any) -> Any:
        self.motion, self.material = motion, material
        completed = ~np.isin(np.arange(len(motion)), self.lost)
        return SimpleNamespace(completed=completed, n_samples=len(motion), select=lambda rows: rows)


def replicated(shot: Any, monkeypatch: pytest.MonkeyPatch, *, lesson: bool) -> Replicates:
    monkeypatch.setattr(staged_runs, "predict", lambda rows, observations: rows)
    box = Box.of({"stiffness_factor": (0.5, 2.0)})
    stages = StagedRuns(shot, Settings(replicates=3), box, Work())
    asked = stages.replicate(np.array([1.1]), lesson=lesson)
    found = asked()
    assert stages.replicates is found
    return found


def test_motions_then_curves_then_the_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    shot = Shot()
    found = replicated(shot, monkeypatch, lesson=False)
    assert shot.motion.tolist() == [0, 1, 2, 3, 0, 0, 0, 4]
    assert shot.material.tolist() == [0, 0, 0, 0, 1, 2, 3, 0]
    assert np.flatnonzero(found.flyer).tolist() == [1, 2, 3]
    assert np.flatnonzero(found.curve).tolist() == [4, 5, 6]
    assert np.flatnonzero(found.scale).tolist() == [7]
    assert not found.lesson.any()


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


def test_they_depend_on_what_was_when_they_were_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    first, later = Shot(), Shot()
    monkeypatch.setattr(staged_runs, "predict", lambda rows, observations: rows)
    box = Box.of({"stiffness_factor": (0.5, 2.0)})
    stages = StagedRuns(first, Settings(replicates=3), box, Work())  # type: ignore[arg-type]
    assert stages.replicates is None
    asked = stages.replicate(np.array([1.1]))
    assert first.motion.size == 0  # put off
    stages.prepared = later  # type: ignore[assignment]
    assert asked() is asked()
    assert first.motion.size == 11
    assert later.motion.size == 0
