"""Gradients by the adjoint; figures and tolerances as on the page (`adjoint.py`)."""

import adjoint
import pytest


def test_gradient_before_landing_against_differences() -> None:
    found = adjoint.scene("bonded", "one_point", "deviatoric", end=3e-4)
    assert found.forward < adjoint.FORWARD  # round-off
    assert max(check.best for check in found.checks) < adjoint.ALLOWED
    # Both sides of the V: at the widest step the differences are wrong by the truncation alone.
    assert found.checks[0].error[0] > 10.0 * found.checks[0].best


@pytest.mark.slow
def test_gradients_with_side_contact_and_friction_against_differences() -> None:
    for scene in adjoint.case().scenes:
        assert scene.forward < adjoint.FORWARD, scene.name
        for check in scene.checks:
            assert check.allowed < 1e-5  # a check that could not fail would be none
            assert check.best < check.allowed, (scene.name, check.name)


@pytest.mark.slow
def test_gradient_of_a_measured_shot_by_its_curve() -> None:
    shot = adjoint.case().shot
    for check in shot.checks.values():
        assert check.best < adjoint.ALLOWED, check.name
    # Scaling every stress is scaling m; the differences of the table leave 1e-9.
    assert abs(shot.by_stress.sum() / shot.by_factor - 1.0) < 1e-8
