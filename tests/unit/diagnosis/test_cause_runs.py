"""Simulations of the causes: one launch for each model, each run once, and recent runs are reused."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explicit import Outcome, Stepping
from kolsky.diagnosis import cause_model
from kolsky.diagnosis.cause_inputs import changed_vector, stretched
from kolsky.diagnosis.cause_model import MOST_KEPT, CauseModel, Point
from kolsky.diagnosis.causes import _stretched_runs
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.input_records import Change
from kolsky.shot.inputs import causes
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


class Counted(CauseModel):
    """Runs are their points; a launch is the list of its points."""

    def __init__(self) -> None:
        box = SimpleNamespace(names=("m",), dimension=1)
        problem = SimpleNamespace(settings=SimpleNamespace(held={}), box=box)
        self.runner: Any = SimpleNamespace(problem=problem)
        self.first, self.runs = None, 0
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
    assert model.runs == 5


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


SLOWER = 1.03  # factor on the times of all frames


def at_rate(m: float, damping: float, s: float) -> Any:
    """A coarse run of a shipped shot with the frames' times multiplied by s, and its shot."""
    prepared = prepare_shot(load_shot(OPEN_01))
    forward = replace(prepared.forward, paths=(prepared.path.faster(1.0 / s),))
    values = {"stiffness_factor": m, "poisson": 0.49, "damping": damping}
    return forward.run(values, Numerics(mesh=(10, 14))), prepared.observations


def test_a_stretched_run_is_the_run_with_slower_frames_and_a_softer_specimen() -> None:
    """Density times length^2 / time^2 is a stress. So m / s^2 and s beta move alike, s times as slowly."""
    run, seen = at_rate(1.2, 20e-6, 1.0)
    softer, _ = at_rate(1.2 / SLOWER**2, 20e-6 * SLOWER, SLOWER)
    rate = Change(film=SLOWER)
    made, right = changed_vector(rate, stretched(run, SLOWER), seen), changed_vector(rate, softer, seen)
    n = seen.n_force
    # Rounding of the steps, 1e-3 of the force; without the factor on the force 6 %.
    assert made[:n] == pytest.approx(right[:n], abs=1e-3 * np.abs(right[:n]).max())
    assert made[n:] == pytest.approx(
        right[n:], abs=2e-5
    )  # straight lines between frames and nodes: up to 18 um
    # The outline of the run itself, to 1 % of its noise: the first frame lies a little after the start.
    assert made[n:] == pytest.approx(changed_vector(Change(), run, seen)[n:], abs=1e-7)


def test_the_rate_of_the_frames_is_found_by_stretching_the_answer_s_run() -> None:
    """The answer of a film that is 3 % too fast is 6 % too stiff, with the right outline."""
    run, seen = at_rate(1.2, 20e-6, 1.0)
    softer, _ = at_rate(1.2 / SLOWER**2, 20e-6 * SLOWER, SLOWER)
    data = changed_vector(Change(film=SLOWER), softer, seen)
    lower, upper = np.array([0.5, 0.0]), np.array([2.5, 1e-4])
    names = ("stiffness_factor", "damping")
    search: Any = SimpleNamespace(
        x=np.array([1.2, 20e-6]),
        problem=SimpleNamespace(box=SimpleNamespace(names=names)),
        model=SimpleNamespace(
            refined=run, first=None, observations=seen, offset=None, lower=lower, upper=upper
        ),
        residual=lambda vector: vector - data,
        relieved=lambda residual, c: residual,
        loss=lambda misfits: float(misfits.sum()),
        expected=SimpleNamespace(misfits=lambda residual: np.array([(residual[: seen.n_force] ** 2).sum()])),
    )
    found = _stretched_runs(search, causes())
    best = min(found, key=lambda t: search.loss(t.misfits))
    assert best.value == pytest.approx(SLOWER, abs=1e-3)  # the step of the factors tried
    assert best.x == pytest.approx([1.2 / SLOWER**2, 20e-6 * SLOWER], rel=3e-3)  # twice the step
    search.model.upper = np.array([1.13, 1e-4])  # the right point lies outside
    assert min(t.u for t in _stretched_runs(search, causes())) > 0.9 * (np.sqrt(1.2 / 1.13) - 1.0)
    search.model.first = causes()[0]
    assert _stretched_runs(search, causes()) == []
