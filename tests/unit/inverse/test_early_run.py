"""A run that is begun before the answer is confirmed: when, of what, and that nobody waits for it."""

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.inverse import gauss_newton
from kolsky.inverse.forward import Numerics, graded
from kolsky.inverse.objective import Objective
from kolsky.inverse.work import PROBABLY_CONFIRMED, EarlyRun, start_in_thread
from tests.unit.inverse.test_several_parameters import MadeUp, ringing

REFINED = (64, 86)


def test_work_that_is_begun_goes_on_when_the_caller_has_returned() -> None:
    go, where = threading.Event(), list[bool]()

    def work() -> int:
        assert go.wait(10.0)
        where.append(threading.current_thread() is threading.main_thread())
        return 7

    found = start_in_thread(work)
    assert where == []
    go.set()
    assert found() == found() == 7
    assert where == [False]

    def fails() -> int:
        raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        start_in_thread(fails)()


def chosen(**numerics: Any) -> Any:
    return SimpleNamespace(
        numerics=Numerics(**{"threads": 2, **numerics}), refined_mesh=REFINED, held={"poisson": 0.499}
    )


def shot() -> Any:
    """A shot that answers with what it is asked."""
    return SimpleNamespace(run=lambda values, numerics: (values, numerics))


def test_it_is_the_finest_graded_run_of_the_point_on_one_thread() -> None:
    forward, x = shot(), np.array([1.2])
    early = EarlyRun.begun(forward, chosen(), ("stiffness_factor",), x)
    assert early is not None
    values, numerics = early.response()  # type: ignore[misc]
    assert values == {"poisson": 0.499, "stiffness_factor": 1.2}
    assert numerics == graded(Numerics(threads=1), REFINED)
    assert early.is_of(forward, np.array([1.2]))
    assert not early.is_of(forward, np.array([1.2 + 1e-15]))
    assert not early.is_of(shot(), x)  # the path has been moved


@pytest.mark.parametrize("numerics", [{"threads": 1}, {"compressible": 0.49}])
def test_none_is_begun_without_an_idle_core_or_a_graded_mesh(numerics: dict[str, Any]) -> None:
    assert EarlyRun.begun(shot(), chosen(**numerics), ("stiffness_factor",), np.array([1.2])) is None


def test_it_is_begun_beside_the_run_that_is_probably_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[np.ndarray] = []
    monkeypatch.setattr(gauss_newton.EarlyRun, "begun", lambda *args: begun.append(args[-1]))
    made: Any = MadeUp()
    made.prepared = SimpleNamespace(forward=None)
    one = Objective(made.observations, np.empty(0, dtype=bool))
    h = 1e-6 * np.array([1.0, 0.01])
    answer = np.array([1.05, 0.49885])
    slope = np.column_stack(
        [(ringing(answer + d) - ringing(answer - d))[0] / (2.0 * d.sum()) for d in np.diag(h)]
    )
    steps: list[float] = []
    judged = gauss_newton.judged

    def told(*args: Any) -> Any:
        run = judged(*args)
        steps.append(run.step.moved)
        return run

    monkeypatch.setattr(gauss_newton, "judged", told)
    start = answer + np.array([0.01, 2e-5])

    def found(*, final: bool) -> Any:
        begun.clear()
        steps.clear()
        shift = np.array([1e-3, 0.0])
        return gauss_newton._chord_steps(made, one, slope, start, None, shift=shift, final=final)[0]

    last = found(final=True)
    assert last.confirmed
    # Behind a long step nobody knows; behind a short one the run is that of the answer.
    assert len(begun) == sum(moved <= PROBABLY_CONFIRMED for moved in steps[:-1])
    assert len(begun) < len(steps)
    np.testing.assert_array_equal(begun[-1], last.x)
    # Where the path is moved behind it, it is not the answer's run.
    found(final=False)
    assert begun == []
