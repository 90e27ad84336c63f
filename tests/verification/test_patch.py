"""Patch test to round-off; figures and tolerances as on the page (`patch.py`)."""

import patch
import pytest

LINEAR = 1e-13  # sums of a few products of order one: 2e-16 times the number of terms


def test_element_gradient_is_exact_for_linear_fields() -> None:
    assert patch.case().gradient_error < LINEAR


def test_homogeneous_stress_leaves_interior_nodes_in_equilibrium() -> None:
    assert patch.case().weak_error < LINEAR


def test_hourglass_vectors_do_not_see_linear_fields() -> None:
    assert patch.case().hourglass_error < LINEAR


@pytest.mark.parametrize("precision", ["fp64", "fp32"])
@pytest.mark.parametrize("state", list(patch.STRETCH))
def test_patch_through_the_kernel(precision: str, state: str) -> None:
    result = patch.case()
    assert result.interior[precision][state] < patch.TOLERANCE[precision]
    assert result.face_force[precision][state] < patch.TOLERANCE[precision]


@pytest.mark.parametrize("precision", ["fp64", "fp32"])
def test_rigid_shift_and_rigid_velocity_give_no_force(precision: str) -> None:
    assert patch.case().rigid[precision] < patch.TOLERANCE[precision]


def test_damping_power_of_uniform_stretching() -> None:
    assert abs(patch.case().rate_power) < LINEAR
