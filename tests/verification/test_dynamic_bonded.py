"""Dynamic bonded compression; figures and tolerances as on the page (`dynamic_bonded.py`)."""

import dynamic_bonded as topic
import numpy as np
import pytest
from order import assert_order

KHZ = 1e3
# Measured is 0.4 to 0.6 %; 10 and 20 kHz: the reference's own 1 and 2 % and as much again for 48 x 66.
FINE_10_KHZ, FINE_20_KHZ = 0.02, 0.04


def test_coarse_graded_mesh_follows_the_reference_force() -> None:
    found = topic.against_reference(topic.COARSE_GRADED, "stick", 5 * KHZ)
    assert found.of_peak < topic.COARSE_TOLERANCE


def test_coarse_meshes_lose_little_of_the_outline() -> None:
    # not asked of 16 x 22: an eighth of an element's size, and a guard against drifting away
    for grid in (topic.COARSE, topic.COARSE_GRADED):
        assert topic.outline_errors(topic.simulate(grid), "stick").max() < 40e-6


@pytest.mark.parametrize("grid", topic.FINE, ids=str)
def test_refined_meshes_follow_the_reference_force(grid: topic.Grid) -> None:
    assert topic.against_reference(grid, "stick", 5 * KHZ).of_peak < topic.FINE_TOLERANCE
    assert topic.against_reference(grid, "slip", 5 * KHZ).of_peak < topic.FINE_TOLERANCE


@pytest.mark.parametrize("side", ["stick", "slip"])
def test_higher_cutoffs_on_a_refined_mesh(side: str) -> None:
    grid = topic.Grid(48, 66)
    assert topic.against_reference(grid, side, 10 * KHZ).of_peak < FINE_10_KHZ
    assert topic.against_reference(grid, side, 20 * KHZ).of_peak < FINE_20_KHZ


@pytest.mark.parametrize(("side", "law"), [("stick", "bonded"), ("slip", "frictionless")])
def test_refined_outline_follows_the_reference(side: str, law: str) -> None:
    response = topic.simulate(topic.Grid(48, 66), law)
    assert topic.outline_errors(response, side).max() < topic.PROFILE_TOLERANCE


@pytest.mark.parametrize("grid", [topic.COARSE, topic.Grid(48, 66)], ids=str)
def test_energy_of_the_dynamic_case(grid: topic.Grid) -> None:
    response = topic.simulate(grid)
    assert response.completed.all()
    assert response.energy.imbalance()[0] < topic.ENERGY_TOLERANCE


def test_final_energies_are_those_of_the_reference() -> None:
    wanted = topic.reference("stick").energy
    assert wanted is not None
    found = topic.final_energies(topic.simulate(topic.Grid(48, 66)))
    # half a per cent of the work: so well does the reference know its force
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=5e-3 * wanted[2])


@pytest.mark.slow
def test_small_strain_waves_converge_with_second_order() -> None:
    result = topic.case()
    errors = [result.small[grid].of_rms for grid in topic.UNIFORM]
    # Second order, seen a little steeper: 16 x 22 cannot carry the waves at all, and the finest mesh of the
    # comparison has an error of its own, (48/96)^2 of the finest in the series.
    assert_order([1.0 / grid.across for grid in topic.UNIFORM], errors, 2.0, 0.4, at_least=True)


@pytest.mark.slow
def test_the_time_step_is_not_the_error_of_the_coarse_mesh() -> None:
    assert topic.case().half_step.of_peak < 2e-3  # a tenth of what separates 16 x 22 from the reference


@pytest.mark.slow
def test_damping_of_the_paper_brings_the_coarse_mesh_within_two_per_cent() -> None:
    result = topic.case()
    assert result.damped[topic.COARSE].of_peak < 0.01
    assert result.damped[topic.COARSE_GRADED].of_rms < 0.02
