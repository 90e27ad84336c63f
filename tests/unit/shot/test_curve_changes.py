"""Changes of the quasi-static curve, against closed forms."""

import numpy as np
import pytest

from explicit.materials import marlow_from_curve
from kolsky.base.records import MaterialCurve
from kolsky.shot.corrections import FORMS, PAST_END, SOFTEST, changed_curve

MU = 3e4
LAM = np.linspace(1.0, 0.4, 61)[1:]


def neo_hookean(stretch: np.ndarray) -> np.ndarray:
    return MU * (stretch - stretch**-2)


def curve(stretch: np.ndarray = LAM) -> MaterialCurve:
    stress = neo_hookean(stretch)
    return MaterialCurve(stretch=stretch, stress=stress, sigma=0.01 * np.abs(stress))


@pytest.mark.parametrize("form", [name for name in FORMS if name != "past end"])
def test_nothing_is_changed_by_an_amount_of_nothing(form: str) -> None:
    same = changed_curve(curve(), {form: 0.0})
    np.testing.assert_allclose(same.stretch, LAM, rtol=1e-15)
    np.testing.assert_allclose(same.stress, neo_hookean(LAM), rtol=1e-15)


def test_true_stress_is_over_the_area_there() -> None:
    """An incompressible column's area grows by 1 / λ: sigma = T λ."""
    declared = curve()
    wrong = MaterialCurve(stretch=LAM, stress=declared.stress * LAM, sigma=declared.sigma * LAM)
    right = changed_curve(wrong, {"true stress": 1.0})
    np.testing.assert_allclose(right.stress, declared.stress, rtol=1e-13)
    np.testing.assert_allclose(right.sigma, declared.sigma, rtol=1e-13)


def test_logarithmic_strain_is_that_of_the_stretch() -> None:
    wrong = MaterialCurve(stretch=1.0 + np.log(LAM), stress=neo_hookean(LAM), sigma=np.ones(60))
    np.testing.assert_allclose(changed_curve(wrong, {"true strain": 1.0}).stretch, LAM, rtol=1e-13)


def test_secants_grow_along_the_curve_and_a_scale_is_a_scale() -> None:
    tilted = changed_curve(curve(), {"tilt": 0.25}).stress / neo_hookean(LAM)
    assert tilted[-1] == pytest.approx(1.125, rel=1e-12)
    assert tilted[-1] - tilted[0] == pytest.approx(0.25 * (1.0 - 1.0 / 60.0), rel=1e-9)
    both = changed_curve(curve(), {"scale": 1.0, "tilt": 0.25}).stress
    np.testing.assert_allclose(both, 2.0 * tilted * neo_hookean(LAM), rtol=1e-13)


def test_the_other_branch_has_the_same_strains_with_the_other_sign() -> None:
    pulled = np.linspace(1.0, 1.6, 61)[1:]
    wrong = MaterialCurve(stretch=2.0 - pulled, stress=-neo_hookean(pulled), sigma=np.ones(60))
    right = changed_curve(wrong, {"branch": 1.0})
    np.testing.assert_allclose(right.stretch, pulled, rtol=1e-14)
    np.testing.assert_allclose(right.stress, neo_hookean(pulled), rtol=1e-14)


@pytest.mark.parametrize("stretch", [LAM, np.linspace(1.0, 2.0, 61)[1:]])
def test_a_curve_goes_on_past_its_end(stretch: np.ndarray) -> None:
    """A neo-Hookean quotient is mu everywhere; past the end mu (1 + u x²) with x = s / last - 1."""
    on = changed_curve(curve(stretch), {"past end": 3.0})
    law, last = (
        marlow_from_curve(on.stretch, on.stress, n_knots=513),
        marlow_from_curve(stretch, neo_hookean(stretch)).last,
    )
    assert law.last == pytest.approx(PAST_END * last, rel=1e-4)
    for x in (0.0, 0.5, 1.0):
        assert law.two_u_prime(np.array((1.0 + x) * last)) == pytest.approx(MU * (1.0 + 3.0 * x**2), rel=2e-3)
    soft = changed_curve(curve(stretch), {"past end": -3.0})
    quotient = soft.stress / (soft.stretch - soft.stretch**-2)
    assert quotient[-1] == pytest.approx(SOFTEST * MU, rel=1e-4)
    assert (np.diff(np.abs(soft.stretch - 1.0)) > 0.0).all()
