"""A pattern flattened to a quarter, followed; figures and tolerances as on the page (`dic_tracking.py`)."""

import dic_tracking as topic
import pytest

pytestmark = pytest.mark.slow  # 40 s


def test_no_point_is_lost_down_to_a_quarter() -> None:
    result = topic.case()
    courses = [*result.series.values(), result.always, result.fine]
    assert min(course.alive for course in courses) >= 0.99


def test_the_errors_of_a_chain_do_not_add_up() -> None:
    result = topic.case()
    assert result.always.references > 30
    assert result.series["every frame"].references < 8
    assert topic.ratio(result.always, result.series["every frame"]) < topic.DRIFT
    assert topic.ratio(result.always, result.series["every frame"]) < topic.sum_ratio(result) / 1.5


def test_frames_may_be_left_out() -> None:
    result = topic.case()
    for name in ("every second", "every fourth"):
        assert topic.ratio(result.series[name], result.series["every frame"]) < topic.SPARSE


def test_sigma_is_that_of_the_errors() -> None:
    result = topic.case()
    for course in (*result.series.values(), result.always):
        assert course.normalised.min() > topic.CALIBRATED[0]
        assert course.normalised.max() < topic.CALIBRATED[1]
    assert result.fine.normalised.min() > topic.CALIBRATED[0]
    assert result.fine.normalised.max() < topic.UNDERSAMPLED
