"""A held Poisson's ratio that does not fit: the search of its valleys as if it were free."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.diagnosis import causes
from kolsky.diagnosis.causes import Best, _freed_poisson
from kolsky.shot.inputs import POISSON

MESH = (20, 27)


def held(monkeypatch: pytest.MonkeyPatch, asked: dict[str, Any]) -> Any:
    """A search about m = 1.2 with nu held at 0.495, on a mesh whose optimum lies 0.05 above the answer's."""

    def freeing(prepared: Any, freed: Any) -> Any:
        asked["settings"] = freed.settings
        box = Box.of({"stiffness_factor": (0.5, 2.5), "poisson": (0.45, 0.4999)})
        declared = np.array([1.0, 0.495])
        return SimpleNamespace(box=box, declared=declared, numerics=SimpleNamespace(mesh=MESH))

    def search_meshes(runner: Any, start: np.ndarray) -> Any:
        asked["start"] = start
        return SimpleNamespace(optima={MESH: SimpleNamespace(x=np.array([1.15, 0.499]))})

    monkeypatch.setattr(causes, "InverseProblem", SimpleNamespace(freeing=freeing))
    monkeypatch.setattr(causes, "Runner", SimpleNamespace(of=lambda problem, work: None))
    monkeypatch.setattr(causes, "search_meshes", search_meshes)
    monkeypatch.setattr(causes, "replace", lambda one, **new: SimpleNamespace(**{**vars(one), **new}))
    monkeypatch.setattr(Best, "renewed", lambda self, judge: self)
    settings = SimpleNamespace(held={"poisson": 0.495, "friction": 0.1}, hold=("poisson", "damping"))
    freed = SimpleNamespace(free={"stiffness_factor": (0.5, 2.5)})
    problem = SimpleNamespace(prepared=None, freed=freed, settings=settings)
    runner = SimpleNamespace(work=None, offset=lambda mesh: np.array([0.05]) if mesh == MESH else None)
    return SimpleNamespace(
        problem=problem, runner=runner, x=np.array([1.2]), before=np.ones(2), left=np.zeros(3),
        clipped=lambda x: x, measured=list,
    )  # fmt: skip


def test_its_start_is_the_answer_and_its_end_is_that_of_the_refined_mesh(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The surrogate's mesh ends at m = 1.15, which lies 0.05 above the refined mesh's optimum."""
    asked: dict[str, Any] = {}
    search = held(monkeypatch, asked)
    (found,) = _freed_poisson(search, causes.causes())
    np.testing.assert_allclose(asked["start"], [1.2, 0.495])
    assert found.own.candidate.key == POISSON
    np.testing.assert_allclose(found.own.x, [1.1], rtol=1e-12)
    assert found.own.value == pytest.approx(0.499, rel=1e-12)
    settings = asked["settings"]
    assert settings.free == {"stiffness_factor": (0.5, 2.5), "poisson": None}
    assert settings.held == {"friction": 0.1}
    assert settings.hold == ("damping",)


def test_a_free_ratio_is_not_searched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    others = [c for c in causes.causes() if c.key != POISSON]
    assert _freed_poisson(held(monkeypatch, {}), others) == []


def test_a_scan_without_a_run_leaves_the_other_causes_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(search: Any, candidates: Any) -> Any:
        raise ValueError("no run of the design completed")

    model = SimpleNamespace(
        runner=SimpleNamespace(problem=SimpleNamespace(box=Box.of({"poisson": (0.4, 0.5)})))
    )
    search = SimpleNamespace(before=np.array([9.0, 1.0]), at=np.array([0.49]))
    monkeypatch.setattr(causes, "can_be_tried", lambda c, problem: False)
    monkeypatch.setattr(causes, "CauseModel", lambda *_: model)
    monkeypatch.setattr(causes, "_search_from", lambda *_: search)
    monkeypatch.setattr(causes, "best_trials", lambda *_, explained: [])
    monkeypatch.setattr(causes, "_findings", lambda *_: ("another cause",))
    monkeypatch.setattr(causes, "_freed_poisson", fails)
    runner: Any = model.runner
    found = causes._analysed(runner, np.array([0.49]), None, None, False)  # type: ignore[arg-type]
    assert found.findings == ("another cause",)
    assert found.lost == "the valleys of Poisson's ratio: no run of the design completed"
