"""Failure is a result; figures and tolerances as on the page (`failure.py`)."""

import failure
import numpy as np
import pytest
from failure import EXPECTED, SHORT, STEPPING, TIMES
from scene import LENGTH, RADIUS

from explicit import Outcome
from explicit.time_loop.element_sweeps import MOTION_LIMIT

EVERY = pytest.mark.parametrize("row", failure.FAILED, ids=lambda i: EXPECTED[i].name)


def test_every_kind_of_failure_is_there() -> None:
    batch = failure.case().batch
    assert batch.outcomes == EXPECTED
    assert set(EXPECTED) == set(Outcome)


@pytest.mark.parametrize("kind", ["alone", "without"])
def test_nobody_notices_a_neighbours_failure(kind: str) -> None:
    assert failure.case().bits[kind]


@EVERY
def test_the_history_up_to_the_end_is_that_of_a_run_asked_to_end_there(row: int) -> None:
    assert failure.case().witnesses[row].same_history


@EVERY
def test_every_history_is_kept_to_the_end(row: int) -> None:
    batch = failure.case().batch
    end = batch.end_times[row]
    assert 0.0 < end < failure.END
    for history in (batch.surface_r, batch.surface_y, batch.energy.external, batch.energy.hourglass):
        known = np.isfinite(history[row]).reshape(len(TIMES), -1).all(axis=1)
        np.testing.assert_array_equal(known, end >= TIMES)
    for history in (batch.force_flyer, batch.impulse_transmission):
        known = np.isfinite(history[row])
        assert not known[end < TIMES].any()
        # A force is known when its step is made: the last one belongs to the step before, < 6.1 us long.
        assert known[end - 6.1e-6 > TIMES].all()


@EVERY
def test_the_element_named_is_the_one(row: int) -> None:
    seen, batch = failure.case().witnesses[row], failure.case().batch
    assert seen.named == seen.found
    i, j = divmod(seen.named, 8)  # eight elements across
    np.testing.assert_allclose(
        batch.failed_places[row],
        [(j + 0.5) * RADIUS / 8, (i + 0.5) * LENGTH / 11],
        rtol=1e-12,  # round-off
    )


def test_a_completed_run_names_no_element() -> None:
    batch = failure.case().batch
    sound = batch.completed
    assert (batch.failed_elements[sound] == -1).all()
    assert np.isnan(batch.failed_places[sound]).all()
    assert batch.describe(0) == f"COMPLETED at {1e6 * batch.end_times[0]:.1f} us"


def test_a_failure_is_noticed_when_it_happens() -> None:
    seen = {EXPECTED[i]: w for i, w in failure.case().witnesses.items()}
    assert seen[Outcome.INVERTED].before > 0.0 >= seen[Outcome.INVERTED].value
    collapsed = seen[Outcome.STEP_COLLAPSED]
    assert collapsed.before >= STEPPING.floor > collapsed.value
    table = seen[Outcome.TABLE_EXCEEDED]
    assert table.before <= SHORT < table.value
    motion = seen[Outcome.DIVERGED]
    assert motion.before <= MOTION_LIMIT < motion.value


@EVERY
def test_the_sentence_names_moment_element_and_cure(row: int) -> None:
    batch = failure.case().batch
    said, outcome = batch.describe(row), batch.outcomes[row]
    r, y = 1e3 * batch.failed_places[row]
    moment = f"{outcome.name} at {1e6 * batch.end_times[row]:.1f} us"
    assert said.startswith(
        f"{moment} in element {batch.failed_elements[row]} (R = {r:.2f} mm, Y = {y:.2f} mm): "
    )
    assert outcome.cause in said
    assert said.endswith(f"Cure: {outcome.cure}")


def test_an_unstable_step_is_stopped_before_its_forces_are_wrong() -> None:
    result = failure.case()
    assert result.unstable.outcomes == (Outcome.DIVERGED,)
    assert result.astray < failure.ONSET
    # It was not ended for nothing: its specimen moves with more energy than it was given.
    assert result.motion["step never measured again"][-1] > MOTION_LIMIT


def test_sound_motion_stays_far_below_the_limit() -> None:
    # One at first touch, when all work is motion yet; the step's own error is 2 % of it there.
    assert failure.case().motion["sound"].max() < 1.05
