"""Simulations of the causes: one launch for each model, each run once, and recent runs are reused."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explicit import Outcome, Stepping
from kolsky.diagnosis import cause_model
from kolsky.diagnosis.cause_model import MOST_KEPT, CauseModel, Point
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.input_records import Change
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


class Counted(CauseModel):
    """Runs are their points; a launch is the list of its points."""

    def __init__(self) -> None:
        box = SimpleNamespace(names=("m",), dimension=1)
        problem = SimpleNamespace(settings=SimpleNamespace(held={}), box=box)
        self.runner: Any = SimpleNamespace(problem=problem)
        self.first = None
        self._recent: dict[object, Any] = {}

    def _launch(self, points: Any, numerics: Any = None) -> Any:
        return list(points)


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[list[list[float]]]:
    """By call, the free parameter of every run of every launch; a run at 9 is lost."""
    seen: list[list[list[float]]] = []

    def run(launches: Any) -> list[Any]:
        seen.append([[float(p.x[0]) for p in points] for points in launches])
        return [
            SimpleNamespace(
                outcomes=[SimpleNamespace(ok=p.x[0] != 9.0) for p in points],
                select=lambda rows, points=points: float(points[rows[0]].x[0]),
            )
            for points in launches
        ]

    monkeypatch.setattr(cause_model, "run_side_by_side", run)
    return seen


def at(x: float, **changed: Any) -> Point:
    return Point(np.array([x]), Change(**changed))


def test_a_launch_for_each_model_and_a_run_for_all_that_is_made_of_it(
    launched: list[list[list[float]]],
) -> None:
    model: Any = Counted()
    longer = {"specimen": {"length": 1.01}}
    asked = [
        at(1.0), at(2.0), at(1.0, force_factor=2.0), at(1.0, **longer), at(9.0), at(3.0, **longer), at(2.0),
    ]  # fmt: skip
    assert model.respond(asked) == [1.0, 2.0, 1.0, 1.0, None, 3.0, 2.0]
    assert launched == [[[1.0, 2.0, 9.0], [1.0, 3.0]]]


def test_what_was_run_lately_is_not_run_again(launched: list[list[list[float]]]) -> None:
    model: Any = Counted()
    model.respond([at(1.0), at(9.0)])
    assert model.respond([at(9.0), at(1.0), at(4.0)]) == [None, 1.0, 4.0]
    assert launched == [[[1.0, 9.0]], [[4.0]]]
    # Another value, motion or model is another run.
    model.respond([at(1.0, values={"friction": 0.1}), at(1.0, motion=1.1)])
    assert launched[-1] == [[1.0], [1.0]] or launched[-1] == [[1.0, 1.0]]
    # Of many the latest are kept.
    model.respond([at(10.0 + i) for i in range(MOST_KEPT)])
    assert len(model._recent) == MOST_KEPT
    model.respond([at(1.0)])
    assert launched[-1] == [[1.0]]


def test_a_changed_curve_has_a_launch_and_each_amount_a_run(launched: list[list[list[float]]]) -> None:
    model: Any = Counted()
    tilted, more = at(1.0, curve={"tilt": 0.1}), at(1.0, curve={"tilt": 0.2})
    assert model.respond([at(1.0), tilted, more, tilted, at(1.0, film=1.01)]) == [1.0] * 5
    assert launched == [[[1.0, 1.0], [1.0, 1.0]]]


def test_a_run_that_takes_many_more_steps_than_the_answer_is_lost_but_not_on_the_refined_mesh() -> None:
    class Known(CauseModel):
        def respond(self, points: Any) -> Any:
            return [SimpleNamespace(steps=np.array([100]))]

    prepared = prepare_shot(load_shot(OPEN_01))
    problem = SimpleNamespace(
        observations=prepared.observations,
        numerics=Numerics(mesh=(10, 14)),
        box=SimpleNamespace(lower=(0.5,), upper=(2.0,)),
        settings=SimpleNamespace(replicate_mesh=(16, 22)),
        point=lambda x: {"stiffness_factor": float(x[0])},
    )
    front = SimpleNamespace(path=prepared.forward.paths[0], noise=SimpleNamespace(offset=None))
    runner: Any = SimpleNamespace(
        problem=problem, front=front, forward=prepared.forward, solver_values=lambda x, mesh: x
    )
    model = Known(runner, np.ones(1), SimpleNamespace())  # type: ignore[arg-type]
    assert model.screen is model  # its mesh is not finer than the replicates'
    many, refined = model._launch([at(1.0)]), model._launch([at(1.0)], Numerics(mesh=(20, 27)))
    assert many.forward.most_steps == 1200
    assert refined.forward.most_steps == Stepping.max_steps
    few = replace(many.forward, most_steps=100).run(many.points, many.numerics)
    assert few.outcomes[0] is Outcome.STEP_LIMIT
