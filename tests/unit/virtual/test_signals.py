"""The chain from newtons to codes: each element is compared with its closed form."""

import numpy as np
import pytest

from kolsky.virtual import instruments

STEP = 2.5e-7


def test_low_pass_follows_a_step_and_a_ramp() -> None:
    """A unit step's answer is 1 - exp(-t / tau), a ramp's a (t - tau + tau exp(-t / tau))."""
    frequency = 100e3
    tau = 1.0 / (2.0 * np.pi * frequency)
    t = STEP * np.arange(400)
    ramp = instruments.low_pass(3.0 * t, STEP, frequency)
    assert ramp == pytest.approx(3.0 * (t - tau + tau * np.exp(-t / tau)), abs=1e-15)
    # A step between two samples is a line of one step: the same answer, averaged over that step.
    step = instruments.low_pass(np.minimum(t / STEP, 1.0), STEP, frequency)
    assert step[1:] == pytest.approx(
        1.0 - tau / STEP * (1.0 - np.exp(-STEP / tau)) * np.exp(-(t[1:] - STEP) / tau), abs=1e-12
    )


def test_low_pass_has_minus_3_db_at_its_frequency() -> None:
    """The amplitude of a sine at the corner is 1 / sqrt 2 of what went in, its phase 45 degrees late."""
    frequency = 20e3
    t = STEP * np.arange(8000)
    out = instruments.low_pass(np.sin(2.0 * np.pi * frequency * t), STEP, frequency)[4000:]
    basis = np.column_stack(
        [np.sin(2.0 * np.pi * frequency * t[4000:]), np.cos(2.0 * np.pi * frequency * t[4000:])]
    )
    a, b = np.linalg.lstsq(basis, out, rcond=None)[0]
    # Lines between samples cut a sine by (omega h)^2 / 12 = 8e-5.
    assert np.hypot(a, b) == pytest.approx(np.sqrt(0.5), rel=2e-4)
    assert np.degrees(np.arctan2(b, a)) == pytest.approx(-45.0, abs=0.02)


def test_droop_of_a_constant_force_is_exponential() -> None:
    """A force that stays is seen to fall to 1/e in a time constant; its integral compensates it."""
    tau, t = 1e-3, STEP * np.arange(8001)
    force = np.minimum(t / STEP, 1.0)
    seen = instruments.droop(force, STEP, tau)
    # After the one step of rise the output is exp(-(t - STEP / 2) / tau) to (STEP / tau)^2.
    assert seen[1:] == pytest.approx(np.exp(-(t[1:] - 0.5 * STEP) / tau), abs=1e-7)
    assert seen[4000] == pytest.approx(np.exp(-1.0), rel=2e-4)
    regained = seen + np.concatenate([[0.0], np.cumsum(0.5 * (seen[1:] + seen[:-1])) * STEP]) / tau
    assert regained == pytest.approx(force, abs=1e-6)  # the trapezoid's error


def test_quantisation_noise_is_a_step_over_root_twelve() -> None:
    """A 12-bit recorder of 1 V full scale has codes 2 / 4096 V apart and that noise."""
    step = 2.0 / 4096
    assert instruments.code_step(1.0, 12) == step
    volts = np.linspace(-0.5, 0.5, 400_001)
    error = instruments.quantised(volts, 1.0, 12) - volts
    assert np.abs(error).max() <= 0.5 * step * (1.0 + 1e-9)
    assert error.std() == pytest.approx(step / np.sqrt(12.0), rel=1e-3)


def test_recorder_clips_at_its_first_and_last_code() -> None:
    """Codes run from -2^(b-1) to 2^(b-1) - 1."""
    seen = instruments.quantised(np.array([-5.0, -1.0, 0.0, 0.9999, 5.0]), 1.0, 8)
    assert seen.tolist() == [-1.0, -1.0, 0.0, 127 / 128, 127 / 128]


def test_delay_and_jitter() -> None:
    """A ramp that arrives late is read lower by slope x delay; jitter makes noise of slope x its sigma."""
    signal, times = 50.0 * STEP * np.arange(4001), np.linspace(2e-4, 9e-4, 5000)
    rng = np.random.default_rng(3)
    late = instruments.sampled(signal, 0.0, STEP, times, delay=7e-6, rng=rng)
    assert late == pytest.approx(50.0 * (times - 7e-6), abs=1e-12)
    shaken = instruments.sampled(signal, 0.0, STEP, times, jitter=2e-7, rng=rng) - 50.0 * times
    # A standard deviation of 5000 values is known to 1 %.
    assert shaken.std() == pytest.approx(50.0 * 2e-7, rel=0.04)
    assert instruments.sampled(signal, 0.0, STEP, np.array([-1e-4]), rng=rng)[0] == 0.0
    with pytest.raises(ValueError, match="the signal ends at"):
        instruments.sampled(signal, 0.0, STEP, np.array([2e-3]), rng=rng)


def test_baseline_and_inertia() -> None:
    """A level at time 0 that drifts; a platen of 7 g at 1000 m/s^2 adds 7 N."""
    assert instruments.baseline(np.array([-1.0, 0.0, 2.0]), 0.003, 0.5).tolist() == [-0.497, 0.003, 1.003]
    assert instruments.with_inertia(np.array([1.0]), 7e-3, np.array([1000.0]))[0] == pytest.approx(8.0)
