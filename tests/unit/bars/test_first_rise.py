"""First rises of pulses: on straight flanks, on feet with two slopes, and with wrong distances."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_layer import ALUMINIUM, Layer

from kolsky.bars.records import Signal
from kolsky.bars.reduction.windows import check_windows, incident_arrival
from kolsky.bars.signals.arrival import first_rise, low_level

STEP = 1e-7
T = STEP * np.arange(5000)
SCENE = replace(Layer(first=ALUMINIUM, gauges=(0.7, 0.5)), modulus=0.5e9)


def signal(value, sigma=0.0, memory=1.0):
    return Signal(0.0, STEP, value, sigma, "1", "gauge", memory)


def ramp(first, rise, last=400e-6):
    return np.interp(T, [first, first + rise, last, last + rise], [0.0, 1.0, 1.0, 0.0])


def test_a_straight_flank_passes_a_twentieth_of_its_level():
    """From 100 us on over 20 us: 5 % are passed at 101 us, whatever the sign."""
    for sign in (1, -1):
        found = first_rise(signal(sign * ramp(100e-6, 20e-6)), sign=sign, average=4e-7)
        assert found.time == pytest.approx(101e-6, abs=STEP)  # an average of four samples is not centred
        assert found.level == pytest.approx(0.05)
        assert found.sigma == pytest.approx(STEP / np.sqrt(12.0))


def test_noise_raises_the_level_and_is_in_the_sigma():
    """Sigma 0.02 over averages of 4, memory 2: 0.02 sqrt(2 / 4), six of which are 0.085; slope 1 / 20 us."""
    noisy = signal(ramp(100e-6, 20e-6), sigma=0.02, memory=2.0)
    noise = 0.02 * np.sqrt(0.5)
    assert low_level(noisy, 1.0, 4e-7) == pytest.approx(6.0 * noise)
    assert low_level(noisy, 10.0, 4e-7) == pytest.approx(0.5)
    found = first_rise(noisy, sign=1, average=4e-7)
    assert found.level == pytest.approx(6.0 * noise)
    assert found.sigma == pytest.approx(np.hypot(noise * 20e-6, STEP / np.sqrt(12.0)), rel=1e-6)


def test_a_plastic_flank_is_not_extrapolated():
    """A tenth of the level from 100 us on and the rest from 110 us: the tangent says 108 us, the rise 101."""
    value = 0.1 * ramp(100e-6, 2e-6) + 0.9 * ramp(110e-6, 20e-6)
    assert first_rise(signal(value), sign=1, average=4e-7).time == pytest.approx(101e-6, abs=2 * STEP)


def test_what_does_not_rise_is_not_found():
    pulse = signal(ramp(100e-6, 20e-6), sigma=1e-3)
    options = {"sign": 1, "average": 4e-7}
    assert first_rise(pulse, **options, after=0.0, before=90e-6) is None
    assert first_rise(pulse, **options, after=110e-6, before=300e-6) is None  # there from the beginning
    assert first_rise(pulse, **options, smallest=1.1) is None
    assert first_rise(pulse, **options, level=1.1) is None
    assert first_rise(pulse, sign=-1, average=4e-7, before=300e-6) is None
    assert first_rise(pulse, **options, after=0.0, before=5e-7) is None
    found = first_rise(pulse, **options, level=0.5)
    assert found.time == pytest.approx(110e-6, abs=STEP)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["compression", "tension"])
def test_pulses_that_come_when_they_must_have_small_offsets(sign):
    scene = SCENE if sign > 0 else SCENE.pulled()
    first, second = scene.signals(noise=1e-6)
    for check in check_windows(first, second, tension=sign < 0):
        assert check.offset > -check.offset_sigma
    reflected, _ = check_windows(first, second, tension=sign < 0)
    assert reflected.offset / reflected.offset_sigma < 1.0
    rise = incident_arrival(first, tension=sign < 0).rise_time
    across = ALUMINIUM.diameter / ALUMINIUM.wave_speed
    # Noise is next to nothing.
    assert reflected.offset_sigma == pytest.approx(np.hypot(0.4 * across, 0.05 * rise), rel=0.05)


@pytest.mark.parametrize("by", [-0.2, -0.06, 0.06, 0.2])
def test_a_wrong_distance_of_the_incident_gauge_is_seen_both_ways(by):
    """2 x 0.2 m / c0 are 79 us: far outside where the pulse is due, and it is found there."""
    first, second = SCENE.signals(noise=1e-6)
    right = check_windows(first, second)[0]
    wrong = check_windows(replace(first, position=first.position + by), second)[0]
    assert wrong.offset - right.offset == pytest.approx(-2.0 * by / ALUMINIUM.wave_speed, abs=0.3e-6)
    assert abs(wrong.offset) > 10.0 * wrong.offset_sigma


def test_a_transmission_gauge_declared_too_far_is_seen():
    first, second = SCENE.signals(noise=1e-6)
    right = check_windows(first, second)[1]
    wrong = check_windows(first, replace(second, position=second.position + 0.06))[1]
    assert wrong.offset - right.offset == pytest.approx(-0.06 / SCENE.second.wave_speed, abs=0.3e-6)
