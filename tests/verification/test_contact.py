"""Contact laws; figures and tolerances as on the page (`contact.py`)."""

import contact
import numpy as np
import pytest


def test_coulomb_without_friction_is_frictionless_to_the_last_bit() -> None:
    assert contact.same_bits(contact.case().sweep, contact.case().smooth)


def test_coulomb_with_huge_friction_is_rough_to_the_last_bit() -> None:
    assert contact.same_bits(contact.case().sweep, contact.case().rough, -1)


def test_coulomb_approaches_rough_steadily() -> None:
    distance = contact.case().distance[1:]
    # 1.001: neighbouring coefficients may meet the same peak of the difference.
    assert (distance[1:] <= 1.001 * distance[:-1]).all()


def test_force_grows_with_friction() -> None:
    grown = np.diff(contact.case().sweep.impulse_transmission[:, -1])
    assert (grown[:-1] > 0.0).all()
    assert (
        grown[-1] >= 0.0
    )  # from the coefficient on at which every pressed node sticks, nothing is left to grow


def test_friction_never_gives_energy_back() -> None:
    assert np.diff(contact.case().sweep.energy.friction, axis=1).min() > -contact.DISSIPATION_TOLERANCE


@pytest.mark.parametrize("law", contact.LAWS)
def test_no_side_node_passes_through_a_platen(law: str) -> None:
    result = contact.case()
    assert (
        result.rolled[law] >= 2 or law == "frictionless"
    )  # the side has rolled on: there is something to test
    assert result.penetration[law] < contact.GAP_TOLERANCE


def test_bonded_faces_carry_tension() -> None:
    flyer, transmission, gap = contact.case().pull["bonded"]
    assert flyer < -1.0  # a modulus of 80 kPa, a strain of 5 % and inertia: some newtons
    assert transmission < -0.5
    assert abs(gap) < contact.GAP_TOLERANCE


@pytest.mark.parametrize("law", ["rough", "coulomb", "frictionless"])
def test_other_faces_lift_off(law: str) -> None:
    flyer, transmission, gap = contact.case().pull[law]
    assert flyer == 0.0
    assert transmission == 0.0
    assert gap == pytest.approx(0.05 * contact.LENGTH, rel=1e-12)  # the specimen stays where it is
