"""Clocks of cameras and oscilloscope: known lags are estimated within their sigma."""

import numpy as np
import pytest
from softflyer import FRAME, MASS, NOISE, SPEED, Flight

from kolsky.bars.flyer.synchronisation import Agreement, synchronise
from kolsky.bars.records import Signal
from kolsky.base.records import FlyerMotion

END, REST, TRAVEL = 700e-6, 0.0, 0.6e-3
SPECIMEN = (0.6, 900.0)
"""rho c A of a soft specimen [N s/m] and its stiffness [N/m]."""
ZERO = NOISE / 20.0  # of 400 samples
FLIGHT = Flight()


def solved(seed, lag=0.0, **options):
    motion, force = FLIGHT.motion(seed, END, lag=lag), FLIGHT.force(seed, END, specimen=SPECIMEN)
    return synchronise(motion, force, mass=MASS, rest=REST, travel=TRAVEL, sigma_zero=ZERO, **options)


def test_planted_lags_come_back_within_their_sigma():
    lags = np.linspace(-90e-6, 90e-6, 24)
    found = [solved(seed, lag) for seed, lag in enumerate(lags)]
    score = np.array([(f.lag - lag) / f.sigma for f, lag in zip(found, lags, strict=True)])
    # 24 scores: their rms is 1 within 0.14 (one deviation); 0.6 to 1.45 are three.
    assert 0.6 < np.sqrt(np.mean(score**2)) < 1.45
    assert np.abs(score).max() < 3.7  # one in 200 batches of 24
    # 1 um of noise at 2.6 m/s is 0.4 us a frame; some 25 frames, and unknown gain, wave and stiffness.
    assert max(f.sigma for f in found) < 0.7e-6
    gain = np.array([(f.gain - 1.0) / f.sigma_gain for f in found])
    assert 0.6 < np.sqrt(np.mean(gain**2)) < 1.45
    assert np.mean([f.chi2_per_dof for f in found]) == pytest.approx(1.0, abs=0.12)  # 24 fits of 45: 3 %


def test_the_verdicts():
    assert solved(3).agreement is Agreement.AGREES
    late = solved(3, 20e-6)
    assert late.agreement is Agreement.DIFFERS
    assert "frames.clock_offset" in late.sentence
    far = solved(3, 150e-6, reach=100e-6)
    assert far.at_edge
    assert far.agreement in (Agreement.UNDECIDED, Agreement.UNLIKE)


def test_a_wrong_mass_shows_as_gain_and_another_channel_as_no_match():
    motion, force = FLIGHT.motion(5, END), FLIGHT.force(5, END, specimen=SPECIMEN)
    heavy = synchronise(motion, force, mass=1.2 * MASS, rest=REST, travel=TRAVEL, sigma_zero=ZERO)
    assert heavy.gain == pytest.approx(1.2, abs=4 * heavy.sigma_gain)
    other = Signal(force.start, force.interval, 50.0 * np.sin(force.time / 9e-6), NOISE, "N")
    found = synchronise(motion, other, mass=MASS, rest=REST, travel=TRAVEL, sigma_zero=ZERO)
    assert found.agreement is Agreement.UNLIKE
    assert "right channel" in found.sentence


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"travel": 5e-6}, "at least 8 are needed"),
        ({"rest": 1.0}, "outside the signal"),
        ({"reach": 600e-6}, "shorten reach"),
    ],
)
def test_impossible_requests(change, words):
    motion, force = FLIGHT.motion(1, END), FLIGHT.force(1, END)
    options = {"mass": MASS, "rest": REST, "travel": TRAVEL, **change}
    with pytest.raises(ValueError, match=words):
        synchronise(motion, force, **options)


def test_uneven_sigmas_weigh_the_frames():
    """A frame that is off by far more than the others' noise, and says so, does not move the lag."""
    motion, force = FLIGHT.motion(9, END), FLIGHT.force(9, END, specimen=SPECIMEN)
    x, sigma = motion.displacement.copy(), motion.sigma.copy()
    x[25] += 200e-6
    sigma[25] = 300e-6
    found = synchronise(
        FlyerMotion(motion.time, x, sigma), force, mass=MASS, rest=REST, travel=TRAVEL, sigma_zero=ZERO
    )
    assert abs(found.lag) < 3 * found.sigma < 0.25 * FRAME * SPEED
