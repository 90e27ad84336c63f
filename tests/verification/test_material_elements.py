"""Closed-form laws and volumetric forms in the elements: forces of their energy, steps that are stable."""

import numpy as np
import pytest
from fbar_element import GRADIENT_TOLERANCE, bound_quality, gradient_errors

from explicit.elements import ELEMENTS
from explicit.materials import LAWS

DIFFERENCES = np.geomspace(1e-4, 1e-6, 3)
"""Steps over an element's size at which central differences are at their best [-]."""
CASES = [
    ("mooney_rivlin", "quadratic"),
    ("ogden3", "quadratic"),
    ("veronda_westmann", "quadratic"),
    ("gent", "logarithmic"),
    ("yeoh", "simo_taylor"),
]
"""Laws of each family, and every volumetric form."""


@pytest.mark.slow
@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize(("name", "form"), CASES)
def test_forces_are_the_gradient_of_the_energy(element: str, name: str, form: str) -> None:
    law = LAWS[name].example()
    errors = gradient_errors(element, law, volumetric=form, differences=DIFFERENCES)
    assert errors.min() < GRADIENT_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize(("name", "form"), CASES)
def test_the_bound_of_the_step_holds(element: str, name: str, form: str) -> None:
    bound = bound_quality(element, 0.495, by="eigenvalue", law=LAWS[name].example(), volumetric=form)
    assert bound.least > 1.0
    assert bound.median < 2.0  # not much shorter steps than the element itself would allow


@pytest.mark.slow
@pytest.mark.parametrize("element", list(ELEMENTS))
def test_the_default_bound_is_no_looser_than_for_marlows_law(element: str) -> None:
    marlow = bound_quality(element, 0.495)
    found = bound_quality(element, 0.495, law=LAWS["neo_hookean"].of([25e3]))
    assert found.least > 0.98  # as the trace of Marlow's, docs/theory/speed.md
    assert found.median < 1.02 * marlow.median
