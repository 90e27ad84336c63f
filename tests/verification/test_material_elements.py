"""Closed-form laws and volumetric forms in the elements: forces of their energy, steps that are stable."""

import numpy as np
import pytest
from scipy.optimize import brentq
from test_fbar import GRADIENT_TOLERANCE, bound_quality, gradient_errors
from test_frictionless import FORCE_TOLERANCE, LOADING, RADIUS, RADIUS_TOLERANCE, slow_compression

from explicit.elements import ELEMENTS
from explicit.materials import LAWS, AnyLaw
from explicit.materials.law import kirchhoff
from explicit.materials.volumetric import VolumetricLaw, bulk_modulus

DIFFERENCES = np.geomspace(1e-4, 1e-6, 3)
"""Steps over an element's size at which central differences are at their best [-]."""
CASES = [
    ("mooney_rivlin", "quadratic"), ("ogden3", "quadratic"), ("veronda_westmann", "quadratic"),
    ("gent", "logarithmic"), ("yeoh", "simo_taylor"),
]  # fmt: skip
"""Laws of each family, and every volumetric form."""


@pytest.mark.slow
@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize(("name", "form"), CASES)
def test_forces_are_the_gradient_of_the_energy(element: str, name: str, form: str) -> None:
    law = LAWS[name].example()
    # With the bound of the next test: each bound is compiled with its element.
    errors = gradient_errors(element, law, volumetric=form, bound="eigenvalue", differences=DIFFERENCES)
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
    assert found.least > 0.98  # as the trace of Marlow's, tests/verification/test_step_bound.py
    assert found.median < 1.02 * marlow.median


def homogeneous(law: AnyLaw, poisson: float, compression: float) -> tuple[float, float]:
    """Force [N] and radius [m] of a cylinder squeezed without friction: its sides are free of stress."""
    volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, poisson)))
    along = 1.0 - compression

    def stresses(across: float) -> np.ndarray:
        stretch = np.array([across, across, along])
        J = float(stretch.prod())
        return kirchhoff(law, stretch) + J * volume.pressure(J)

    guess = along**-0.5
    across = brentq(lambda x: stresses(x)[0], 0.9 * guess, 1.1 * guess, xtol=1e-14)
    return float(-stresses(across)[2] / along * np.pi * RADIUS**2), across * RADIUS


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ogden2", "mooney_rivlin", "veronda_westmann"])
def test_slow_frictionless_compression_is_the_closed_form(name: str) -> None:
    law, squeezed = LAWS[name].example(), np.array([0.1, 0.2, 0.3, 0.4])
    force, radius, _ = slow_compression(LOADING, [law], [0.495], squeezed)
    expected = np.array([homogeneous(law, 0.495, e) for e in squeezed])
    # As with the neo-Hookean law on the same mesh: what is left is the inertia of loading in 40 ms.
    np.testing.assert_allclose(force[0], expected[:, 0], rtol=FORCE_TOLERANCE)
    np.testing.assert_allclose(radius[0], expected[:, 1], rtol=0, atol=RADIUS_TOLERANCE["stable"])
