"""Relaxation, oscillation, creep and a planted pair; figures and tolerances as on the page."""

import numpy as np
import pytest
import viscoelastic


@pytest.mark.parametrize("element", ["one_point", pytest.param("fbar", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", viscoelastic.BRANCHES)
def test_a_held_specimen_relaxes_as_its_twin(name: str, element: str) -> None:
    part = viscoelastic.held(name, element)
    assert part.error < viscoelastic.FORCE_TOLERANCE
    assert part.imbalance < viscoelastic.ENERGY_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("element", viscoelastic.ELEMENTS)
@pytest.mark.parametrize("x", viscoelastic.X)
def test_storage_and_loss_modulus(x: float, element: str) -> None:
    one = viscoelastic.shaken(x, element)
    assert abs(one.storage - 1.0) < viscoelastic.MODULUS_TOLERANCE
    assert abs(one.loss - 1.0) < viscoelastic.MODULUS_TOLERANCE
    assert abs(one.work - 1.0) < viscoelastic.WORK_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("element", viscoelastic.ELEMENTS)
@pytest.mark.parametrize("name", viscoelastic.BRANCHES)
def test_an_impact_keeps_its_energy(name: str, element: str) -> None:
    assert viscoelastic.impact(name, element) < viscoelastic.ENERGY_TOLERANCE


@pytest.mark.slow
def test_a_planted_pair_is_found_with_its_interval() -> None:
    found = viscoelastic.recovery()
    assert found.asked == (1, 0)
    assert np.abs(found.normalised).max() < 3.5  # 36 normal numbers: beyond that once in 60
    assert 0.6 < found.rms < 1.4  # independent ones would scatter by 1 / sqrt(72) = 0.12
    assert (found.sigmas < 0.15).all()  # an interval that says something
    assert (np.ptp(found.sigmas, axis=0) < 0.2 * found.sigmas.mean(axis=0)).all()  # and is the tests' own
