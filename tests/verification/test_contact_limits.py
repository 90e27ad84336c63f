"""Limits and ledgers of contact; figures and tolerances as on the page (`contact_limits.py`)."""

import contact_limits as topic
import numpy as np
import pytest
from contact_limits import AREA, STEP, STIFFNESS, stuck, twice
from friction import COARSE, FORCE_TOLERANCE, compress, force_excess
from order import assert_order
from scene import YOUNG


@pytest.mark.parametrize("law", topic.LAWS)
def test_no_node_goes_beyond_a_platen_at_any_step(law: str) -> None:
    ledger = topic.ledger(law)
    assert ledger.rolled >= 2 or law == "frictionless"  # the side has rolled on: there is something to test
    assert ledger.penetration < (topic.PENALTY_GAP_TOLERANCE if law == "penalty" else topic.GAP_TOLERANCE)


@pytest.mark.parametrize("law", topic.LAWS)
def test_impulses_are_the_momentum_through_stick_and_slip(law: str) -> None:
    ledger = topic.ledger(law)
    assert ledger.step == STEP  # steps of one size: places within a step give its velocity
    assert ledger.momentum < topic.MOMENTUM_TOLERANCE


@pytest.mark.parametrize("law", topic.LAWS)
def test_energy_through_stick_and_slip(law: str) -> None:
    ledger = topic.ledger(law)
    assert ledger.energy < topic.ENERGY_TOLERANCE
    if law in ("coulomb", "penalty"):
        assert ledger.friction > 0.01  # it did slip
    assert ledger.friction > -topic.ENERGY_TOLERANCE


@pytest.mark.parametrize("measure", ["outline", "force", "impulse", "penetration"])
def test_the_penalty_converges_to_the_kinematic_law(measure: str) -> None:
    errors = {**vars(topic.case().penalty), "penetration": topic.case().depth}
    chosen = topic.FITTED
    assert_order(1.0 / topic.STIFFNESS[chosen], errors[measure][chosen], 1.0, topic.ORDER_TOLERANCE)


def test_the_penalty_penetrates_by_pressure_over_stiffness() -> None:
    np.testing.assert_allclose(topic.press(), 1.0, rtol=0.0, atol=topic.PRESS_TOLERANCE)


def test_a_sticking_face_moves_by_shear_over_stiffness_and_does_not_creep() -> None:
    shear = (
        stuck() * STIFFNESS
    )  # some of the modulus at 20 %; a face that creeps would move a hundred times more
    assert (shear > 0.05 * YOUNG).all()
    assert (shear < 0.5 * YOUNG).all()
    np.testing.assert_allclose(shear, shear[-1], rtol=0.02)  # 1.5 um of 4.75 mm at the softest: other terms


def test_coulomb_converges_to_rough() -> None:
    fit = topic.order_of_friction(topic.case())
    assert fit.order - fit.standard_error > topic.FRICTION_ORDER


def test_release_stress_leads_from_rough_to_bonded() -> None:
    result = topic.case()
    assert topic.same_bits(result.release, 0, result.rough)
    assert topic.same_bits(result.release, -1, result.bonded)
    # The more the faces hold, the harder they pull, up to the bonded ones; nothing is the same in between.
    tension = result.release.force_transmission.min(axis=1)
    assert (np.diff(tension) <= 0.0).all()
    assert tension[0] == 0.0
    assert not topic.same_bits(result.release, 5, result.rough)
    assert not topic.same_bits(result.release, 5, result.bonded)


def test_faces_let_go_at_the_release_stress() -> None:
    # Every node pulls with less than the release stress, so the force stays below stress times area.
    assert (topic.pull() < 1.0).all()
    assert (topic.pull() > 1.0 - topic.PULL_TOLERANCE).all()


def test_what_was_let_go_is_pressed_again_but_never_bonds() -> None:
    bonded, released = twice()
    assert (bonded[[0, 2], 0] < -0.1).all()  # 80 kPa, 5 % and 71 mm^2: 0.28 N
    assert -1e3 * AREA < released[0, 0] < 0.0
    assert released[1, 1] > 0.1
    assert released[2, 0] == 0.0


@pytest.mark.slow
def test_both_formulations_against_the_static_reference() -> None:
    hard, soft = compress(COARSE), compress(COARSE, contact="penalty")
    assert force_excess(soft, "16 × 22") < FORCE_TOLERANCE["16 × 22"]
    for a, b in zip(hard, soft, strict=True):
        assert b.completed
        np.testing.assert_allclose(b.force, a.force, rtol=topic.STATIC_TOLERANCE)
