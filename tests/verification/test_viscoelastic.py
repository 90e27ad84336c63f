"""Relaxation, oscillation, creep and a planted pair; figures and tolerances as on the page."""

import numpy as np
import pytest
import viscoelastic as v


@pytest.mark.parametrize("element", ["one_point", pytest.param("fbar", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", v.BRANCHES)
def test_a_held_specimen_relaxes_as_its_twin(name: str, element: str) -> None:
    part = v.held(name, element)
    assert part.error < v.FORCE_TOLERANCE
    assert part.imbalance < v.ENERGY_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("element", v.ELEMENTS)
@pytest.mark.parametrize("x", v.X)
def test_storage_and_loss_modulus(x: float, element: str) -> None:
    one = v.shaken(x, element)
    assert abs(one.storage - 1.0) < v.MODULUS_TOLERANCE
    assert abs(one.loss - 1.0) < v.MODULUS_TOLERANCE
    assert abs(one.work - 1.0) < v.WORK_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("element", v.ELEMENTS)
@pytest.mark.parametrize("name", v.BRANCHES)
def test_an_impact_keeps_its_energy(name: str, element: str) -> None:
    assert v.impact(name, element) < v.ENERGY_TOLERANCE


@pytest.mark.slow
def test_a_planted_pair_is_found_with_its_interval() -> None:
    found = v.recovery()
    assert found.asked == (1, 0)
    assert np.abs(found.normalised).max() < 3.5  # 36 normal numbers: beyond that once in 60
    assert 0.6 < found.rms < 1.4  # independent ones would scatter by 1 / sqrt(72) = 0.12
    assert (found.sigmas < 0.15).all()  # an interval that says something
    assert (np.ptp(found.sigmas, axis=0) < 0.2 * found.sigmas.mean(axis=0)).all()  # and is the tests' own
