"""One list of a shot's inputs: the use of an entry by all its readers, also of an added entry."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_input_directions import objective, response

from doe import Box
from kolsky.diagnosis.cause_inputs import can_be_tried, changed_vector
from kolsky.inverse.work import Work
from kolsky.schema.apparatus import IDENTIFY_KEYS
from kolsky.shot.input_records import UNCHANGED, Cause, Change, Input, Laboratory
from kolsky.shot.inputs import INPUTS, causes
from kolsky.studies.budget.realisation import factors_of, usual_sizes
from kolsky.uncertainty import input_changes
from kolsky.uncertainty.input_changes import ModelAtOptimum, RunLost, input_directions
from kolsky.virtual.shot_file import declared_sizes

MADE = Input(
    key="made_up",
    words="a made-up step of the force",
    unit="N",
    step=0.5,
    seen=lambda model, u: model.change(transmitted=u),
    cause=Cause(
        key="force.made_up", words="a made-up step", check="check it",
        changed=lambda u: Change(force_offset=u), step=0.1, typical=0.2,
    ),
    laboratory=Laboratory("imperfections.baseline", "2 mV"),
)  # fmt: skip


def runner() -> Any:
    shot = SimpleNamespace(interface=SimpleNamespace(faces="stick", side="none"), force=None, uncertainty={})
    problem = SimpleNamespace(
        shot=shot,
        observations=objective().observations,
        settings=SimpleNamespace(held={}),
        box=Box.of({"stiffness_factor": (0.5, 1.5)}),
    )
    return SimpleNamespace(problem=problem, work=Work())


def test_an_input_that_is_added_to_the_list_is_seen_by_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(INPUTS, "made_up", MADE)
    monkeypatch.delitem(INPUTS, "force_zero")  # whose key of the laboratory it takes
    one = objective()
    runs = SimpleNamespace(reference_and_jacobian=lambda: (response(), np.ones((12, 1))))
    monkeypatch.setattr(input_changes, "MovedRuns", lambda *_: runs)
    monkeypatch.setattr(input_changes, "INPUTS", {"made_up": MADE})  # the others need runs
    found = input_directions(runner(), np.ones(1), one, one.data)
    # Half of the largest force, which is 95 N.
    np.testing.assert_allclose(found["made_up"].change, [47.5] * 10 + [0.0] * 2, rtol=1e-12)
    tried = next(c for c in causes() if c.key == "force.made_up")
    assert (tried.unit, tried.declared, can_be_tried(tried, runner().problem)) == ("N", "made_up", True)
    assert usual_sizes()["imperfections.baseline"] == "2 mV"
    (_, factor) = factors_of({"imperfections.baseline": usual_sizes()["imperfections.baseline"]})
    assert (factor.words, factor.shared) == ("a made-up step of the force", False)
    assert declared_sizes({"made_up": 0.25}) == {"imperfections.baseline": "0.25 N"}


def test_a_lost_run_of_an_input_is_an_error_only_if_it_is_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(key: str, step: float) -> None:
        raise RunLost(f"the run with a changed {key} ended folded")

    runs = SimpleNamespace(reference_and_jacobian=lambda: (response(), np.ones((12, 1))), change=lost)
    monkeypatch.setattr(input_changes, "MovedRuns", lambda *_: runs)
    monkeypatch.setattr(input_changes, "INPUTS", {"made_up": replace(MADE, seen=None)})
    one, made = objective(), runner()
    found = input_directions(made, np.ones(1), one, one.data)
    assert found.absent == {"made_up": "the run with a changed made_up ended folded"}
    made.problem.shot.uncertainty["made_up"] = 0.25
    with pytest.raises(ValueError, match=r"ended folded; .* remove made_up from \[uncertainty\]"):
        input_directions(made, np.ones(1), one, one.data)


@pytest.mark.parametrize(
    ("key", "found"),
    [
        ("sensitivity", lambda u: 1.0 + u),
        ("force_zero", lambda u: -u),
        ("clock_offset", lambda u: u),
        ("outline_clock", lambda u: u),
        ("flyer_clock", lambda u: u),
        ("Z_offset", lambda u: -u),
        ("y_offset", lambda u: -u),
    ],
)
def test_the_cause_that_puts_an_input_right_undoes_its_direction(key: str, found: Any) -> None:
    """What is found where an input is declared too large by u, through the model, is minus its direction."""
    one, run, record, u = objective(), response(), INPUTS[key], 1e-7
    assert record.seen is not None
    change = record.cause.changed(record.cause.coordinate(found(u)))
    undone = changed_vector(change, run, one.observations) - changed_vector(UNCHANGED, run, one.observations)
    direction = record.seen(ModelAtOptimum(one, one.observations, run), u)
    inner = [*range(1, 9), 10, 11]  # the first bin begins where the force does, the last ends with it
    np.testing.assert_allclose(undone[inner], -direction[inner], rtol=1e-6, atol=1e-9 * np.ptp(direction))


def test_every_key_that_may_be_declared_is_an_input_and_keys_are_told_once() -> None:
    assert set(IDENTIFY_KEYS) <= set(INPUTS)
    assert all(INPUTS[key].step > 0.0 and INPUTS[key].place for key in IDENTIFY_KEYS)
    for keys in (
        [c.key for c in causes()],
        [one.laboratory.key for one in INPUTS.values() if one.laboratory is not None],
    ):
        assert len(keys) == len(set(keys))
