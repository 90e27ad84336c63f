"""Other laboratories' bar signals, automatically reduced: what docs/validation/bars.md says."""

import numpy as np
import pytest
from real_bars import (
    BARS,
    by_hand,
    compared,
    copper,
    copper_facts,
    epoxy,
    flow_stress,
    imbalance_left,
    johnson_cook,
    preston_tonks_wallace,
)

from kolsky.bars.records import History
from kolsky.bars.reduction.stress_strain import integrated

pytestmark = pytest.mark.skipif(
    not BARS.is_dir(), reason="no folder 'shared' beside the repository: its data are not shipped"
)


@pytest.mark.parametrize("dispersion", [False, True], ids=["shifted", "dispersed"])
@pytest.mark.parametrize("sample", [1, 2])
def test_epoxy_meets_the_hand_processing(sample, dispersion):
    """Largest strain within 0.5 %, mean stress within 1 %, by both analyses; no window is the sheet's."""
    for (_, quantity), pair in compared(sample, dispersion=dispersion).items():
        # Issue's targets; the baseline alone makes 0.2 % and 0.7 % (sample 1, see the page).
        assert abs(pair.off) < (0.005 if quantity == "largest strain" else 0.01), (quantity, pair)


@pytest.mark.parametrize("sample", [1, 2])
def test_the_sheets_columns_are_what_the_page_says(sample):
    """Their "2w" is one wave, their "3w" three, of their aligned waves; their strain a rectangular sum."""
    sheet, step = by_hand(sample), 8.000643e-8
    i, r, t = (sheet[f"eps_{name}"] for name in "irt")
    stiffness, area, c0, length = 210e9 * np.pi * 0.01**2, np.pi * 0.005**2, 5188.0, 0.004
    rates = {"2w": -2 * c0 / length * r, "3w": c0 / length * (i - r - t)}
    stresses = {"2w": stiffness * t / area, "3w": stiffness * (i + r + t) / (2 * area)}
    for name in rates:  # eight digits are written
        np.testing.assert_allclose(sheet[f"rate_{name}"], rates[name], rtol=1e-6, atol=1e-3)
        np.testing.assert_allclose(sheet[f"stress_{name}_MPa"], 1e-6 * stresses[name], rtol=1e-6, atol=1e-5)
        np.testing.assert_allclose(sheet[f"strain_{name}"], np.cumsum(rates[name]) * step, atol=1e-7)


@pytest.mark.parametrize("sample", [1, 2])
def test_epoxy_is_in_equilibrium_and_conserves_energy(sample):
    test = epoxy(sample, dispersion=False)
    first, last = test.balanced
    assert 40e-6 < first < 80e-6  # after the transmitted pulse's rise, which ends at 60 to 90 us
    assert last - first > 75e-6
    energy = test.summary.energy
    # What the faces do and what deforms differ by the work of the imbalance, a few per cent of it.
    assert energy.deformation == pytest.approx(energy.absorbed, rel=0.02)
    assert test.summary.modulus is None


@pytest.mark.parametrize("sample", [1, 2])
def test_reflected_pulses_arrive_when_predicted(sample):
    reflected, transmitted = epoxy(sample, dispersion=False).seen
    assert abs(reflected.delay) < 1.5e-6  # 392 us of way at a wave speed of 0.3 %
    assert 5e-6 < transmitted.delay < 30e-6  # soft specimens are slow to load


@pytest.mark.parametrize("sample", [1, 2])
def test_sigma_of_a_strain_is_that_of_real_noise(sample):
    """Integrals over 20 stretches of rest against the sigma, with the noise's memory in it."""
    for signal in epoxy(sample, dispersion=False).signals:
        strain = signal.strain
        rest = strain.value[:2000].reshape(20, 100)
        white = strain.sigma * np.sqrt(strain.memory)
        history = [History(part, np.full(100, strain.sigma), "1") for part in rest - rest.mean()]
        ends = [integrated(part, 1.0, sigma=white) for part in history]
        # A standard deviation of 20 has 16 % scatter, a memory from 2000 samples about as much, and the drift
        # of the baseline comes on top: a correction of its own.
        said = float(ends[0].sigma[-1])
        assert 0.6 * said < np.std([part.value[-1] for part in ends]) < 1.7 * said


def test_the_copper_file_says_all_that_is_needed():
    said = copper_facts()
    assert said["speed"] == pytest.approx(np.sqrt(said["modulus"] / said["density"]), rel=1e-5)
    assert (said["gain"], said["excitation"], said["gauge"]) == (200.0, 8.0, 0.381)


def test_the_copper_record_confirms_the_calibrated_reflected_time():
    """Seen in the record within 0.1 us of the laboratory's 156.6 us, which the distance misses by 3.4 us."""
    said = copper_facts()
    as_said = copper(dispersion=False, calibrated=False).seen[0]
    way = 2 * said["gauge"] / said["speed"]
    # A pulse that starts as steep as the reference; 0.1 us is one sample.
    assert way + as_said.delay == pytest.approx(said["reflected time"], abs=0.1e-6)
    assert abs(copper(dispersion=False).seen[0].delay) < 0.1e-6


def test_dispersion_and_place_bring_the_copper_into_balance():
    left = {
        (dispersion, calibrated): imbalance_left(copper(dispersion=dispersion, calibrated=calibrated))
        for dispersion in (False, True)
        for calibrated in (False, True)
    }
    both = left.pop((True, True))
    assert both < 0.8 * min(left.values())
    span = copper(dispersion=True).balanced
    assert span[1] - span[0] > 20e-6  # of a pulse of 60 us


def test_copper_flows_as_copper():
    """Within 15 % of Preston, Tonks and Wallace at strains 0.05 to 0.15; Johnson and Cook lie above."""
    test = copper(dispersion=True)
    for strain in (0.05, 0.10, 0.15):
        stress, rate = flow_stress(test, strain)
        assert 2000.0 < rate < 5000.0
        assert stress == pytest.approx(preston_tonks_wallace(strain, rate), rel=0.15)
        assert stress < johnson_cook(strain, rate)
