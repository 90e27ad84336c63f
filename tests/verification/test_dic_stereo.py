"""Stereo match of a cylinder; figures and tolerances as on the page (`dic_stereo.py`)."""

import dic_stereo
import pytest

from dic.correlation import Shape

pytestmark = pytest.mark.slow


def test_quadratic_shape_functions_find_the_cylinder() -> None:
    for (_, shape, subset), error in dic_stereo.case().errors.items():
        if shape is Shape.QUADRATIC and subset >= 21:
            assert abs(error.bias) < dic_stereo.BIAS


def test_affine_ones_lie_lower_by_the_mean_sagitta() -> None:
    for (_, shape, subset), error in dic_stereo.case().errors.items():
        if shape is Shape.AFFINE and subset >= 15:
            expected = -dic_stereo.sagitta(error.width)
            assert error.bias == pytest.approx(expected, rel=dic_stereo.SAGITTA)


def test_errors_are_what_their_sigma_says() -> None:
    for (angle, shape, _), error in dic_stereo.case().errors.items():
        if shape is Shape.QUADRATIC and angle == dic_stereo.ANGLES[0]:
            assert dic_stereo.SCALED[0] < error.scaled < dic_stereo.SCALED[1]


def test_points_that_both_cameras_see_are_accepted() -> None:
    for (_, shape, _), error in dic_stereo.case().errors.items():
        if shape is Shape.QUADRATIC:
            assert error.accepted > 0.95  # at 11 px some rim points are no better than their rivals


@pytest.mark.parametrize("angle", dic_stereo.ANGLES)
def test_no_false_match_passes_not_even_without_any_one_gate(angle: float) -> None:
    false = dic_stereo.case().false[angle]
    # Searches from a wrong place mostly end before the gates see them; those that converge are judged.
    assert false.number > 15
    assert false.passed == 0
    assert not any(false.without.values())
    assert false.true_rejected <= 0.02 * false.true


def test_another_surface_has_no_match() -> None:
    assert dic_stereo.case().other_surface[0] == 0
