"""The flyer's direction, tilt and end of symmetry from a known motion of the body."""

import numpy as np
import pytest

from dic import FrameOutcome
from dic.bodies.body_motion import BodyMotion
from kolsky.bars.flyer.flight import _noise_of_one, fit_flight, symmetry_end

FRAMES, STATIC, RATE = 100, 10, 120e3
T = (np.arange(FRAMES) - STATIC + 1) / RATE
SPEED = 2.5
LENGTH, ANGLE = 0.5e-6, 0.2e-3


def smooth_start(t, rise):
    """Displacement and velocity of a start from rest to 1 m/s within `rise`, its jerk bounded."""
    s = np.clip(t / rise, 0.0, 1.0)
    v = s**2 * (3.0 - 2.0 * s)
    x = rise * (s**3 - 0.5 * s**4) + np.maximum(t - rise, 0.0)
    return x, v


def body(rng=None, drift=0.0, turn_rate=0.0):
    """A flyer that moves against y, drifts along x ever faster and turns about Z; velocities with it."""
    x, v = smooth_start(T, 60e-6)
    late = np.maximum(T - 150e-6, 0.0)
    span = T[-1] - 150e-6
    u = np.stack([drift * SPEED * late**2 / (2 * span), -SPEED * x, np.zeros(FRAMES)], axis=-1)
    velocity = np.stack([SPEED * v, drift * SPEED * late / span, np.zeros(FRAMES)], axis=-1)
    turn = np.stack([np.zeros(FRAMES), np.zeros(FRAMES), turn_rate * x / 1.0], axis=-1)
    C = np.zeros((FRAMES, 6, FRAMES, 6))
    for k in range(6):
        C[np.arange(FRAMES), k, np.arange(FRAMES), k] = (ANGLE if k < 3 else LENGTH) ** 2
    if rng is not None:
        u = u + LENGTH * rng.standard_normal(u.shape)
        turn = turn + ANGLE * rng.standard_normal(turn.shape)
    outcome = np.full(FRAMES, int(FrameOutcome.VALID))
    return BodyMotion(np.zeros(3), u, turn, C, np.full(FRAMES, 50), outcome, 1.0, 1.0), velocity, v


START = T[STATIC - 1]


def test_directions_and_rates_are_found_within_their_sigmas():
    ratio, rates = [], []
    moving = T[STATIC + 12 :]
    for seed in range(2):
        motion, velocity, v = body(np.random.default_rng(seed), drift=0.1, turn_rate=20.0)
        flight = fit_flight(motion, T, start=START)
        found, sigma = flight.velocity(moving)
        ratio.append((found - velocity[STATIC + 12 :])[:, :2] / sigma[:, :2])
        phi, phi_sigma = flight.orientation(moving)
        true = np.arctan2(velocity[STATIC + 12 :, 1], velocity[STATIC + 12 :, 0])
        drifting = true > 0.02
        assert np.abs((phi - true) / phi_sigma)[drifting].max() < 5.0
        rate, rate_sigma = flight.tilt_rate(moving)
        rates.append((rate[:, 1] - 20.0 * v[STATIC + 12 :]) / rate_sigma[:, 1])
        assert np.abs(rate[:, 0] / rate_sigma[:, 0]).max() < 5.0  # nothing turns about x
    # A smooth path's errors are slow: about ten independent ones a draw, and sigmas that follow the
    # scale of the prior; a factor 2 either way would be a wrong sigma.
    assert 0.4 < np.std(ratio) < 1.6
    assert 0.4 < np.std(rates) < 1.6


def test_a_flyer_along_the_axis_has_an_angle_of_noise_only_and_no_end_of_symmetry():
    flight = fit_flight(body(np.random.default_rng(7))[0], T, start=START)
    phi, sigma = flight.orientation(T[STATIC + 12 :])
    assert (phi < 5.0 * sigma + 1e-6).all()
    assert np.degrees(phi.max()) < 0.5
    found = symmetry_end(flight, T[STATIC:], separation=80e-6, over=50e-6, share=0.02)
    assert found.row is None
    assert found.reference == pytest.approx([1.0, 0.0, 0.0], abs=0.02)


def test_symmetry_ends_where_the_drift_exceeds_the_share():
    flight = fit_flight(body(np.random.default_rng(8), drift=0.2)[0], T, start=START)
    times = T[STATIC:]
    found = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.1)
    # The lateral velocity grows linearly to a fifth: a tenth (sin of atan, 0.5 %) half-way.
    true = 150e-6 + 0.5 * (T[-1] - 150e-6)
    assert times[found.row] == pytest.approx(true, abs=5.0 / RATE)  # noise of the share over its slope
    never = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.3)
    assert never.row is None
    patient = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.1, times_in_row=200)
    assert patient.row is None


def test_bad_options_and_times_are_refused():
    motion = body()[0]
    with pytest.raises(ValueError, match="one time a frame"):
        fit_flight(motion, T[1:], start=START)
    flight = fit_flight(motion, T, start=START)
    for options in ({"share": 0.0}, {"over": -1.0}, {"times_in_row": 0}):
        with pytest.raises(ValueError, match="share must be"):
            symmetry_end(flight, T[STATIC:], **({"separation": 0.0, "over": 1e-5, "share": 0.1} | options))


def test_a_frames_own_noise_is_what_no_smooth_error_explains():
    """Variance 1 + 4 + 1 of a second difference of independent errors; none of a line's offset and slope."""
    frames = np.arange(12.0)
    line = np.stack([np.ones(12), frames - 5.5])
    covariance = 0.3**2 * np.eye(12) + line.T @ np.diag([4.0, 0.25]) @ line
    np.testing.assert_allclose(_noise_of_one(covariance), 0.3, rtol=1e-12)
