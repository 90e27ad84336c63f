"""The search from the floor of a valley to the maximum of the likelihood, for a synthetic oscillating
test."""

from typing import Any

import numpy as np
import pytest
from test_likely_path import Onset, off_by
from test_several_parameters import TIME, TRUTH

from kolsky.inverse.objective import Objective
from kolsky.inverse.valleys import (
    AHEAD,
    FARTHEST,
    STRIDE,
    climb_summit,
    likeliest_summit,
    margin,
    strides_beside,
)


def turns(x: np.ndarray) -> float:
    """Oscillations over the test."""
    return float(0.5 * np.sqrt(x[0] / (1.0 - 2.0 * x[1])) * TIME[-1])


def climbed(made: Any, floor: np.ndarray) -> Any:
    numerics = made.settings.numerics
    (runs,) = made.under_other_motions(floor[None], made.front_jerks, numerics)
    return climb_summit(made, floor, runs, numerics, np.empty(0, dtype=bool))


@pytest.mark.parametrize("share", [1.0, -1.5, 2.5])
def test_the_summit_is_whole_strides_from_a_floor(share: float) -> None:
    made: Any = Onset(np.array([2.0, -1.5]))
    found = climbed(made, off_by(share).x)
    assert found.strides == pytest.approx(share / STRIDE)
    assert turns(found.x) == pytest.approx(turns(TRUTH), abs=0.02)
    assert found.x[0] == TRUTH[0]
    # The patterns are those of the summit: they ring at the frequency there.
    rings = made.rings(found.x)
    left = found.patterns - found.patterns @ np.linalg.pinv(rings) @ rings
    assert np.abs(left).max() < 1e-9 * np.abs(found.patterns).max()


def test_least_squares_that_do_not_know_the_onset_would_stay() -> None:
    """The deviance without patterns is lower half an oscillation off than at the true value."""
    made: Any = Onset(np.array([-2.5, 0.0]))  # 4 sin of the model and -7.5 sin of the onset: out of phase
    one = Objective(made.observations, np.empty(0, dtype=bool))
    at = np.array([off_by(share).x for share in (0.0, 0.5, -0.5)])
    plain = one.deviance(one.vectors(made.predicted(at, (16, 22))))
    assert plain[0] > plain[1:].min() + 10.0
    found = climbed(made, at[1 + int(np.argmin(plain[1:]))])
    assert turns(found.x) == pytest.approx(turns(TRUTH), abs=0.02)


def test_a_climb_ends_at_the_bounds() -> None:
    run: list[float] = []

    class Kept(Onset):
        def under_other_motions(self, points: np.ndarray, deviations: np.ndarray, numerics: Any) -> Any:
            run.extend(turns(x) for x in points)
            return super().under_other_motions(points, deviations, numerics)

    made: Any = Kept(np.array([2.0, -1.5]))
    low = turns(np.array([TRUTH[0], 0.49]))
    floor = low + 0.6  # one stride above the lower bound
    climbed(made, off_by(turns(TRUTH) - floor).x)
    assert sorted(run)[:3] == pytest.approx([floor - STRIDE, floor, floor + STRIDE], abs=1e-2)
    assert len(set(np.round(run, 3))) == len(run)


def test_places_to_run_next_by_hand() -> None:
    assert (AHEAD, FARTHEST) == (2, 8)
    assert strides_beside(0, {0}) == [-2, -1, 1, 2]
    assert strides_beside(1, {-2, -1, 0, 1, 2}) == []
    assert strides_beside(2, {-2, -1, 0, 1, 2}) == [3, 4]
    assert strides_beside(-2, {-2, -1, 0, 1, 2}) == [-4, -3]
    assert strides_beside(8, set(range(-2, 9))) == []


def test_the_margin_is_of_the_next_valley() -> None:
    """The summit, a floor on its slope, and two of other valleys: 2 oscillations are still its own."""
    assert margin(np.array([-100.0, -95.0, -60.0, -75.0]), np.array([0.0, 2.0, 5.0, 2.01])) == 25.0
    assert margin(np.array([-100.0, -95.0]), np.array([0.0, 1.0])) == np.inf


def test_the_likeliest_floor_is_climbed_and_its_margin_told() -> None:
    made: Any = Onset(np.array([2.0, -1.5]))
    floors = np.array([off_by(share).x for share in (-3.5, 1.0, 4.0)])
    found = likeliest_summit(made, floors, made.settings.numerics, np.empty(0, dtype=bool))
    assert turns(found.x) == pytest.approx(turns(TRUTH), abs=0.02)
    assert 100.0 < found.margin < np.inf
