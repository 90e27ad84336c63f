"""Coulomb friction; figures and tolerances as on the page (`friction.py`)."""

import friction as topic
import numpy as np
import pytest
from friction import DRAG
from static_bonded import reference as bonded

FOLDS_SLIPS_STICKS = (0.1, 0.3, 1000.0)
"""Coefficients of the slow tests on fine meshes: the edge folds, the face slips, nothing slips. The page
itself (`python tests/verification/pages.py`) takes all six, against the same tolerances."""


def test_the_reference_without_slip_is_the_bonded_one() -> None:
    # FElupe and DOLFINx; below 30 % they, too, are less exact. A third program agrees within 0.3 %.
    np.testing.assert_allclose(topic.known(1000.0).force[2:], bonded().force[2:], rtol=3e-3)


def test_coarse_force_with_friction_against_the_reference() -> None:
    found = topic.compress(topic.COARSE, element="one_point")
    assert all(one.completed for one in found)
    assert topic.force_excess(found, "16 × 22") < topic.FORCE_TOLERANCE["16 × 22"]


def test_the_static_force_grows_with_friction() -> None:
    forces = np.array([one.force[:3] for one in topic.compress(topic.COARSE, element="one_point")])
    assert (np.diff(forces, axis=0) > 0.0).all()


def test_energy_momentum_and_gap_through_stick_and_slip() -> None:
    ledger = topic.impact()
    assert ledger.energy.max() < topic.ENERGY_TOLERANCE
    assert ledger.momentum.max() < topic.MOMENTUM_TOLERANCE
    assert ledger.penetration < topic.GAP_TOLERANCE
    assert ledger.given_back < 1e-6  # of the work: the ledger knows the running step by half
    assert (ledger.dissipated[:-1] > 5e-3).all()  # it did slip
    slow = topic.compress(topic.COARSE, element="one_point")
    assert max(one.penetration for one in slow) < topic.GAP_TOLERANCE


def test_the_linearised_reference_flutters_with_friction_only() -> None:
    rates = topic.flutter()
    assert rates[0, 0] == 0.0
    assert (rates[0, 1:] == 0.0).all()
    assert (rates[1:, 1:] > 0.5 * DRAG).all()  # the drag of the slow loading does not stop it


@pytest.mark.slow
@pytest.mark.parametrize("name", ["32 × 44", pytest.param("32 × 44, F-bar", marks=pytest.mark.long)])
def test_fine_force_and_outline_with_friction_against_the_reference(name: str) -> None:
    mesh, element = topic.CASES[name]
    found = topic.compress(mesh, element=element, friction=FOLDS_SLIPS_STICKS)
    assert all(one.completed for one in found)
    assert topic.force_excess(found, name, FOLDS_SLIPS_STICKS) < topic.FORCE_TOLERANCE[name]
    middle, outline = topic.radius_excess(found, name, FOLDS_SLIPS_STICKS)
    assert middle < topic.RADIUS_TOLERANCE
    assert outline < topic.OUTLINE_TOLERANCE


@pytest.mark.slow
def test_without_damping_sliding_faces_flutter() -> None:
    damped, bare = (topic.compress(topic.EVEN, beta, friction=(0.5, 1000.0)) for beta in (topic.DAMPING, 0.0))
    half, stuck = (b.force[1] / d.force[1] - 1.0 for b, d in zip(bare, damped, strict=True))
    # 20 % compression: f = 0.5 loses several per cent, no slip nothing but the damping's own 0.1 %
    assert half < -0.02
    assert abs(stuck) < 0.005
