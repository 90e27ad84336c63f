"""Mesh errors of the data of several shots: lost runs are reported with the shots' names."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.inverse.settings import Numerics
from kolsky.uncertainty import mesh_error
from kolsky.uncertainty.mesh_error import joint_mesh_change

SETTINGS = SimpleNamespace(refined_mesh=(32, 43))


def problem(lost: dict[str, int], *, slides: bool = False) -> Any:
    """Two shots with two entries each; `lost` says of which shot a mesh's or an element's run is lost."""
    vectors = {"(16, 22)": 1.0, "fbar": 3.0, "(20, 27)": 6.0, "(32, 43)": 5.0}

    def predict(stage: str, points: np.ndarray, numerics: Numerics) -> np.ndarray:
        key = numerics.element if numerics.element == "fbar" else str(numerics.mesh)
        row = np.full(4, vectors[key])
        if key in lost:
            row[2 * lost[key] : 2 * lost[key] + 2] = np.nan
        return row[None]

    shots = [SimpleNamespace(name=n) for n in ("slow", "fast")]
    return SimpleNamespace(
        mesh=Numerics(mesh=(16, 22)),
        refined=Numerics(mesh=SETTINGS.refined_mesh),
        slides=slides,
        settings=SETTINGS,
        predict=predict,
        stack=SimpleNamespace(parts=lambda vector: np.split(vector, 2)),
        shots=shots,
    )


@pytest.fixture(autouse=True)
def one_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_error, "_joint_windows", lambda stack: np.zeros(4, int))


FOUND: Any = SimpleNamespace(x=np.ones(1), vector=np.full(4, 4.0))


def test_graded_runs_of_all_shots_tell_the_error() -> None:
    change = joint_mesh_change(problem({}), FOUND)
    assert change.lost == ()
    np.testing.assert_array_equal(change.graded.graded, np.ones(4))
    np.testing.assert_array_equal(change.graded.coarser, np.ones(4))
    assert change.graded.ratio == pytest.approx(1.6)


@pytest.mark.parametrize("mesh", [(20, 27), (32, 43)])
def test_a_graded_run_that_one_shot_has_lost_is_said(mesh: tuple[int, int]) -> None:
    change = joint_mesh_change(problem({str(mesh): 1}), FOUND)
    assert change.graded is None
    (lost,) = change.lost
    assert lost.is_graded
    assert lost.numerics.mesh == mesh
    assert lost.why == "of fast"


def test_the_other_element_that_is_lost_is_said_and_graded_runs_stay() -> None:
    change = joint_mesh_change(problem({"fbar": 0}), FOUND)
    assert change.element is None
    assert change.graded is not None
    assert [(run.is_graded, run.why) for run in change.lost] == [(False, "of slow")]


def test_sliding_shots_have_no_graded_runs_on_purpose() -> None:
    change = joint_mesh_change(problem({"(32, 43)": 1}, slides=True), FOUND)
    assert (change.graded, change.lost) == (None, ())


def test_a_run_of_the_search_that_is_lost_is_refused() -> None:
    with pytest.raises(ValueError, match="did not complete: refine --mesh"):
        joint_mesh_change(problem({"(16, 22)": 0}), FOUND)
