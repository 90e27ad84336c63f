"""The path of a bar's face from its waves, compared with motions in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from barrecord import BAR, NOISE, SCALE, front, record, truth

from kolsky.bars.flyer.front_path import back_force, front_path, front_velocity
from kolsky.base.records import FrontVelocity

END, STEP, SIGMA = 300e-6, 0.5e-6, 0.02


def measured(seed, *, noise=SIGMA, declared=None, **more):
    t = STEP * np.arange(round(END / STEP) + 1)
    v = front(t) + noise * np.random.default_rng(seed).standard_normal(t.size)
    return FrontVelocity(t, v, declared or noise, **more)


def exact(t):
    """Position by a fine trapezoid rule."""
    fine = np.arange(0.0, END + 1e-8, 1e-8)
    v = front(fine)
    return np.interp(t, fine, np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1])) * 1e-8]))


@pytest.fixture(scope="module")
def paths():
    return [front_path(measured(seed)) for seed in range(8)]


def test_position_and_velocity_come_near_the_truth(paths):
    t = np.linspace(0.0, 299e-6, 600)
    dx = np.array([path.position(t) - exact(t) for path in paths])
    dv = np.array([path.velocity(t) - front(t) for path in paths])
    # 0.02 m/s a sample, integrated over 600 samples of 0.5 us: a random walk of 0.02 sqrt(600) 0.5 = 0.25 um.
    assert np.abs(dx[:, -1]).max() < 3.5 * 0.25e-6
    assert np.sqrt(np.mean(dv**2)) < 0.6 * SIGMA  # a sample alone knows it to sigma
    score = dx[:, -1] / [path.sigma_position(t[-1]) for path in paths]
    assert 0.4 < np.sqrt(np.mean(score**2)) < 1.8  # 8 scores: 1 within 0.25
    velocity = dv / np.array([path.sigma_velocity(t) for path in paths])
    assert 0.7 < np.sqrt(np.mean(velocity**2)) < 1.4


def test_it_starts_at_rest_a_little_before_the_arrival(paths):
    path = paths[0]
    assert path.start == pytest.approx(-4 * 3 * STEP)  # 601 samples in 300 means at most: three a mean
    assert path.position(path.start) == 0.0
    assert path.velocity(path.start) == 0.0
    assert path.end == pytest.approx(END)


def test_acceleration_and_its_sigma(paths):
    """What a mass between gauge and specimen feels."""
    t = np.linspace(5e-6, 290e-6, 300)
    h = 1e-8
    a = (front(t + h) - front(t - h)) / (2 * h)
    score = np.array([(path.acceleration(t) - a) / path.sigma_acceleration(t) for path in paths])
    # The prior is one for the whole record: generous on the plateau, narrow at the corners of the ramps.
    assert 0.5 < np.sqrt(np.mean(score**2)) < 1.5


def test_the_scale_is_common_to_all_samples():
    plain = front_path(measured(0))
    scaled = front_path(measured(0, sigma_gain=0.01))
    t = 250e-6
    own = 0.01 * plain.position(t)
    assert scaled.sigma_position(t) == pytest.approx(np.hypot(plain.sigma_position(t), own), rel=1e-6)
    assert np.array_equal(scaled.jerk, plain.jerk)


def test_too_small_a_declared_noise_is_found():
    path = front_path(measured(1, noise=0.1, declared=0.02))
    assert path.noise_scale == pytest.approx(5.0, rel=0.15)  # 300 means: 4 % each, two deviations and more
    assert front_path(measured(1)).noise_scale < 1.1


def test_a_fast_record_is_averaged():
    fine = 0.05e-6 * np.arange(6001)
    rng = np.random.default_rng(3)
    path = front_path(FrontVelocity(fine, front(fine) + 0.1 * rng.standard_normal(fine.size), 0.1))
    assert path.knots.size < 310
    assert abs(path.position(299e-6) - exact(299e-6)) < 4 * path.sigma_position(299e-6)


def test_a_short_record_is_refused():
    with pytest.raises(ValueError, match="20 samples or more, got 3"):
        front_path(replace(measured(0), time=STEP * np.arange(3), velocity=np.zeros(3)))


def test_noise_and_scale_are_told_apart():
    reduction, waves = record(0)
    motion = front_velocity(reduction, waves)
    assert motion.noise == pytest.approx(BAR.wave_speed * NOISE * np.sqrt(2))
    assert motion.sigma_gain == pytest.approx(SCALE, rel=1e-6)
    force, scale = back_force(reduction, waves)
    assert scale == pytest.approx(SCALE, rel=1e-6)
    assert force.sigma[0] == pytest.approx(NOISE * BAR.youngs_modulus * np.pi * BAR.diameter**2 / 4)
    slow = replace(waves, white={name: 3.0 * sigma for name, sigma in waves.sigma.items()}, origin=2e-3)
    late = front_velocity(reduction, slow)
    assert late.noise == pytest.approx(3.0 * motion.noise)
    assert late.sigma_gain == motion.sigma_gain
    assert late.time[0] == pytest.approx(2e-3)
    assert back_force(reduction, slow)[0].sigma[0] == pytest.approx(3.0 * force.sigma[0])
    bare = replace(
        reduction,
        front_velocity=replace(reduction.front_velocity, sigma=np.full(truth().time.size, motion.noise)),
    )
    assert front_velocity(bare, waves).sigma_gain < 1e-6
