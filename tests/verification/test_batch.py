"""Batches and precision; figures and tolerances as on the page (`batch.py`)."""

import batch
import numpy as np
import pytest

from explicit import Outcome


@pytest.mark.parametrize("precision", batch.PRECISIONS)
@pytest.mark.parametrize("threads", ["1 thread", "2 threads"])
def test_batch_of_one_is_a_row_of_a_batch_of_seven_to_the_last_bit(precision: str, threads: str) -> None:
    assert batch.case().same[f"{precision}, {threads}"]


def test_failing_neighbours_leave_the_bits_of_the_others() -> None:
    assert batch.case().neighbours


def test_a_failing_simulation_says_why_and_where() -> None:
    failed = batch.case().failed
    assert failed.outcomes == (
        Outcome.COMPLETED,
        Outcome.INVERTED,
        Outcome.COMPLETED,
        Outcome.STEP_LIMIT,
        Outcome.COMPLETED,
    )
    assert failed.steps[3] == 1000
    assert list(failed.completed) == [True, False, True, False, True]


@pytest.mark.parametrize("row", [1, 3])
def test_histories_are_nan_after_the_end_and_numbers_before(row: int) -> None:
    failed = batch.case().failed
    ended = failed.end_times[row]
    assert 0.0 < ended < batch.END
    for history in (
        failed.force_flyer,
        failed.impulse_transmission,
        failed.energy.external,
        failed.surface_r,
    ):
        values = history[row].reshape(len(batch.TIMES), -1)
        assert np.isnan(values[ended < batch.TIMES]).all()
        # One spacing of the samples: what belongs to the step that failed is not there.
        assert np.isfinite(values[ended - 5e-6 > batch.TIMES]).all()


def test_single_precision_is_enough() -> None:
    result = batch.case()
    assert result.force_difference < batch.FORCE_TOLERANCE
    assert result.place_difference < batch.PLACE_TOLERANCE
    assert result.force_difference > 0.0  # the two are different arithmetic, not one kernel used twice


def test_step_with_full_damping_is_the_closed_form() -> None:
    result = batch.case()
    np.testing.assert_allclose(result.steps["full"], result.predicted, rtol=batch.STEP_TOLERANCE)


def test_deviatoric_damping_hardly_touches_the_step_and_full_divides_it() -> None:
    steps = batch.case().steps
    # beta mu << beta K at nu = 0.495: xi is a hundredth of full damping's for the volumetric mode, and the
    # shear modes, ten times slower, set it: between half of the undamped step and all of it.
    assert (steps["deviatoric"] > 0.4 * steps["undamped"]).all()
    assert (steps["deviatoric"] < steps["undamped"]).all()
    assert (steps["deviatoric"] / steps["full"] > 10.0).all()
