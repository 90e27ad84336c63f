"""The numerics' part of an interval in closed form."""

import numpy as np
import pytest

from kolsky.uncertainty.numerical import element_uncertainty, mesh_uncertainty, numerical_uncertainty


def test_what_is_left_of_an_error_of_second_order() -> None:
    # m(h) = m0 + C h^2 with h = 1 / elements: 24 and 64 of them leave C / 64^2.
    C = np.array([30.0, -5.0])
    shift = C / 64.0**2 - C / 24.0**2
    remaining = np.abs(C) / 64.0**2
    # Roache's factor 1.25 over the ratio 1.15 of ASME V&V 20-2009, section 6.
    found = mesh_uncertainty(shift, coarse=24, fine=64)
    np.testing.assert_allclose(found, 1.25 / 1.15 * remaining, rtol=1e-12)  # round-off
    # In numbers: (64 / 24)^2 - 1 = 55 / 9.
    assert mesh_uncertainty(np.array([0.0055]), coarse=24, fine=64) == pytest.approx(0.0009 * 1.0869565217)


def test_the_other_element_is_a_rectangle_to_both_sides() -> None:
    # A rectangular distribution of half width a has the standard deviation a / sqrt(3) (GUM 4.3.7).
    np.testing.assert_allclose(element_uncertainty(np.array([-0.03, 0.006])), [0.0173205081, 0.0034641016])


def test_mesh_and_element_are_one_error_and_the_larger_counts() -> None:
    shift = np.array([0.0055, 0.0055, 0.0055])
    element = np.array([0.0, -0.01, np.nan])  # a lost run says nothing
    found = numerical_uncertainty(shift, coarse=24, fine=64, element_shift=element)
    mesh = 0.0009 * 1.25 / 1.15
    assert list(found) == ["mesh"]
    np.testing.assert_allclose(found["mesh"], [mesh, 0.01 / np.sqrt(3.0), mesh], rtol=1e-12)


def test_roughness_is_a_part_of_its_own() -> None:
    rough = np.array([0.2])
    found = numerical_uncertainty(np.array([0.0]), coarse=12, fine=24, roughness=rough)
    assert list(found) == ["mesh", "roughness"]
    assert found["roughness"] is rough
    assert found["mesh"] == 0.0
