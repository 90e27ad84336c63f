"""Derivatives by differences; figures and tolerances as on the page (`derivatives.py`)."""

import derivatives
import numpy as np
import pytest


@pytest.mark.slow
def test_the_v_falls_with_the_square_of_the_step_and_rises_with_its_inverse() -> None:
    result = derivatives.case()
    assert result.common.steps_shared
    assert result.common.study.smooth.all()
    for name, order in result.order.items():
        assert abs(order.order - 2.0) < 0.02, name  # the next term at 3 %
    change = result.common.study.change
    assert (change.min(axis=1) < derivatives.BOTTOM).all()
    # Round-off over a step that falls tenfold: tenfold, within the scatter of the digits.
    rise = np.log10(change[:, -1] / change[:, -5])
    assert ((rise > 1.5) & (rise < 2.5)).all()


@pytest.mark.slow
def test_steps_that_follow_the_deformation_scatter_and_the_study_says_so() -> None:
    result = derivatives.case()
    assert not result.following.steps_shared
    stiffness, damping = 0, 2  # the drag of alpha hardly moves the steps
    for p in (stiffness, damping):
        assert result.following.study.change[p, 4] > 100.0 * result.common.study.change[p, 4]
        assert not result.following.study.smooth[p]


@pytest.mark.slow
def test_landing_and_sliding_leave_a_response_that_is_smooth_only_piecewise() -> None:
    result = derivatives.case()
    for found in result.rolling.values():
        assert found.steps_shared
        assert not found.study.smooth.any()
        assert found.study.change.min() < derivatives.BOTTOM  # between two decisions it is smooth
    by_mesh = {(s.faces, s.mesh): s.radius for s in result.secants}
    for law in result.rolling:  # what a landing does goes with the element
        assert by_mesh[law, "32 × 44"] < by_mesh[law, "8 × 11"]


@pytest.mark.slow
def test_adjoint_and_differences_agree_within_the_error_estimate() -> None:
    result = derivatives.case()
    assert (result.adjoint_error < derivatives.ADJOINT).all()
    assert (np.abs(result.differences - result.adjoint) <= result.bound).all()


def test_derivative_of_a_plane_wave_against_its_closed_form() -> None:
    for platen, (_, found, exact) in derivatives.wave().items():
        assert derivatives.rms(found - exact) < derivatives.WAVE * derivatives.rms(exact), platen
