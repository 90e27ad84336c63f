"""Marlow's law; figures as on the page (`marlow.py`)."""

import marlow
import numpy as np
import pytest
from order import assert_order

from explicit.materials import marlow_from_curve, neo_hookean


def test_neo_hookean_curve_gives_the_neo_hookean_law() -> None:
    assert marlow.case().neo_hookean_error < 1e-13  # a constant quotient: round-off


def test_yeoh_curve_converges_with_the_number_of_points() -> None:
    result = marlow.case()
    assert result.yeoh_error[2] < 1e-5  # 41 points; third order from 2e-4 at 11
    # A monotone cubic is of third order where its slopes are limited by one-sided data, else better.
    assert_order(1.0 / np.array(marlow.POINTS), result.yeoh_error, 3.0, 0.2, at_least=True)


def test_limit_at_rest_is_a_third_of_the_modulus() -> None:
    # The fit is a line in s^2 over s < 0.3; it leaves out 3 C3 s^4 / C1 <= 5e-4, a tenth reaches s = 0.
    assert marlow.case().origin_error[2] < 1e-4


def test_uniaxial_stress_of_the_law_is_the_curve() -> None:
    assert marlow.case().uniaxial_error < 1e-13  # knots on the data: round-off


def test_stress_is_the_derivative_of_the_energy() -> None:
    error = marlow.case().difference_error
    best = int(np.argmin(error))
    assert error[best] < 1e-8  # eps^(2/3) = 4e-11 times the third derivative over the first
    assert_order(marlow.DIFFERENCES[:4], error[:4], 2.0, 0.05)  # truncation
    assert 2 < best < len(error) - 2
    assert_order(marlow.DIFFERENCES[-4:], error[-4:], -1.0, 0.3)  # round-off / h; scatter of the rounding


def test_stress_and_slope_are_continuous_past_the_data() -> None:
    value, slope = marlow.case().jump
    assert value < 1e-6  # the slope times the probe of 1e-7
    assert slope < 1e-6  # round-off 1e-16 over the probe 1e-7, with a factor


@pytest.mark.parametrize(("precision", "tolerance"), [("fp64", 1e-14), ("fp32", 2e-6)])
def test_warp_twin_is_the_numpy_law(precision: str, tolerance: float) -> None:
    assert marlow.case().twin[precision] < tolerance  # round-off of some twenty operations


def test_tangent_bounds_the_curvature_of_the_energy() -> None:
    # The stable step relies on it; 1e-3 for the second difference's own error.
    assert marlow.case().tangent_ratio < 1.0 + 1e-3


def test_data_limit_is_the_largest_s_of_the_curve() -> None:
    stretch = np.linspace(0.5, 0.95, 10)
    law = marlow_from_curve(stretch, 1e4 * (stretch - stretch**-2))
    assert law.data_limit == pytest.approx(np.sqrt(0.25 + 4.0 - 3.0), rel=1e-14)


@pytest.mark.parametrize(
    ("stretch", "stress", "message"),
    [
        ([0.9, 0.8, 0.7, 0.6], [-1, -2, -3, -4], "at least 5 points"),
        ([0.9, 0.8, 1.1, 0.6, 0.5], [-1, -2, 1, -4, -5], "this one has both"),
        ([0.9, 0.8, 0.7, 0.6, 0.5], [-1, -2, 3, -4, -5], "sign of the other branch"),
        ([0.9, 0.8, 0.8, 0.6, 0.5], [-1, -2, -2, -4, -5], "repeated"),
        ([0.9, 0.8, 0.7, 0.6, -0.5], [-1, -2, -3, -4, -5], "stretch must be > 0, got -0.5"),
    ],
)
def test_impossible_curves_are_refused(stretch: list[float], stress: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        marlow_from_curve(np.array(stretch), 1e3 * np.array(stress))


@pytest.mark.parametrize("modulus", [0.0, -1.0, float("nan")])
def test_neo_hookean_needs_a_positive_modulus(modulus: float) -> None:
    with pytest.raises(ValueError, match="shear_modulus must be > 0 Pa"):
        neo_hookean(modulus)
