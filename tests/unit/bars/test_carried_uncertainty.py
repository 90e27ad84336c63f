"""Propagation of uncertainties from one step to the next, compared with closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from elastic_layer import Layer
from monte_carlo import Spread, difference
from softflyer import Flight

from kolsky.bars.budget import propagate
from kolsky.bars.flyer.events import _full_speed
from kolsky.bars.flyer.flight import Flight as Paths
from kolsky.bars.flyer.flight import symmetry_end
from kolsky.bars.flyer.path import FlyerPath, fit_flyer
from kolsky.bars.guides.propagation import wave_speed
from kolsky.bars.records import BarSignal, FaceWaves, Quantity, Signal
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.reduction.windows import find_windows
from kolsky.base.apparatus import Bar, Specimen

BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0, poisson=0.0)
SPECIMEN = Specimen(diameter=10e-3, length=4e-3, density=1000.0)


def stations(slow=0.0, sigma=0.0, memory=1.0):
    """A pulse at both stations of two bars together, 0.5 m each; a slow error on the later one."""
    t = 0.5e-6 * np.arange(1200)

    def pulse(at):
        return 1e-3 * np.exp(-(((t - at) / 20e-6) ** 2))

    error = slow * np.sin(2 * np.pi * t / 60e-6)
    made = (pulse(150e-6), pulse(350e-6) + error)
    return [
        BarSignal(Signal(0.0, 0.5e-6, value, sigma, "1", side, memory), BAR, 0.5, side)
        for value, side in zip(made, ("incident", "transmission"), strict=True)
    ]


def gain_of(found, t):
    """Sigma of a gain per residual: 1 over the norm of the pulse, which its slope in time does not touch."""
    model = 1e-3 * np.exp(-(((t - 350e-6) / 20e-6) ** 2))
    return 1.0 / np.linalg.norm(model)


def test_correlated_residuals_widen_a_wave_speed():
    windows = {"incident_window": (50e-6, 250e-6), "transmitted_window": (250e-6, 450e-6)}
    found = wave_speed(*stations(slow=1e-5), **windows)
    n = found.residual.size
    assert found.alike > 10.0  # a sine of 120 samples is alike over a sixth of it and more
    expected = np.sqrt(found.alike * np.sum(found.residual**2) / (n - 2)) * gain_of(found, found.time)
    assert found.gain_sigma == pytest.approx(expected, rel=0.02)


def test_a_wave_speed_is_not_better_than_the_gauges_noise():
    """No residual: the noise of both gauges with its memory, sqrt(4 + 4) sigma for a gain of one."""
    windows = {"incident_window": (50e-6, 250e-6), "transmitted_window": (250e-6, 450e-6)}
    found = wave_speed(*stations(sigma=1e-6, memory=4.0), **windows)
    expected = np.sqrt(8.0) * 1e-6 * gain_of(found, found.time)
    assert found.gain_sigma == pytest.approx(expected, rel=0.02)


def straight(jerk, sigma):
    """A path over two spans of 1 s, the second jerk with a sigma."""
    return FlyerPath(
        np.array([0.0, 1.0, 2.0]), np.array(jerk), np.diag([0.0, sigma**2]), 0.0, 1.0, 1.0, 1.0, 1.0
    )


@pytest.mark.parametrize(("sigma", "row"), [(0.34, 2), (0.38, None)])
def test_symmetry_ends_beyond_two_sigmas(sigma, row):
    """At 2 s: 12 m/s along, 0.96 m/s across, 8.0 %; 5 % are passed if 2 sigma / 2 / 12.04 is below 3.0 %."""
    paths = Paths(
        straight([6.0, 6.0], 0.0),
        (straight([0.0, 1.92], sigma), straight([0.0, 0.0], 0.0)),
        (straight([0.0, 0.0], 0.0),) * 2,
    )
    found = symmetry_end(paths, [0.5, 1.0, 2.0], separation=0.2, over=0.3, share=0.05, times_in_row=1)
    assert found.share[2] == pytest.approx(0.96 / np.hypot(12.0, 0.96))
    assert found.row == row


def test_intervals_are_compared_in_standard_uncertainties():
    budget = propagate(lambda v: {"y": v["a"]}, [Quantity("a", 3.0, 0.5, "1", "B")])
    half = float(budget.coverage_factor("y", 0.95)) * 0.5
    drawn = Spread(np.array(3.0), np.array(0.5), np.array(3.0 - half - 0.1), np.array(3.0 + half), 1000, 0.95)
    assert difference(budget, "y", drawn) == pytest.approx(0.2)


def test_full_speed_is_known_to_a_frame_at_best():
    """Acceleration 6 t, then 6 - 12 (t - 1): zero at 1.5 s; its sigma over the jerk 12, and a frame's 1 s."""
    path = straight([6.0, -12.0], 0.0)
    found = _full_speed(path)
    assert found.time == pytest.approx(1.5)
    assert found.sigma == pytest.approx(1 / np.sqrt(12))
    loose = _full_speed(replace(path, covariance=np.diag([36.0, 0.0])))
    assert loose.sigma == pytest.approx(np.hypot(6.0 / 12.0, 1 / np.sqrt(12)))


def test_a_common_error_of_all_frames_is_in_the_paths_uncertainty():
    """A velocity of one sigma, 0.1 m/s, that all frames have in common from the start on."""
    motion = Flight().motion(0, 400e-6)
    start = 0.0
    drift = np.maximum(motion.time - start, 0.0)
    own = np.diag(motion.sigma**2)
    plain = fit_flyer(motion, start=start)
    common = fit_flyer(motion, start=start, covariance=own + 0.1**2 * np.outer(drift, drift))
    same = fit_flyer(motion, start=start, covariance=own)
    t = 300e-6
    np.testing.assert_array_equal(common.jerk, plain.jerk)
    np.testing.assert_allclose(same.covariance, plain.covariance, rtol=1e-12)
    assert common.sigma_velocity(t) == pytest.approx(np.hypot(0.1, plain.sigma_velocity(t)), rel=0.05)


def test_slow_noise_of_the_gauges_is_carried_to_the_faces():
    scene = Layer()
    signals = scene.signals()
    noisy = [
        replace(s, strain=replace(s.strain, sigma=sigma, memory=9.0))
        for s, sigma in zip(signals, (2e-6, 5e-6), strict=True)
    ]
    found = face_waves(*noisy, find_windows(*signals))
    assert found.sigma == {"incident": 2e-6, "reflected": 2e-6, "transmitted": 5e-6}
    assert found.white == pytest.approx({"incident": 6e-6, "reflected": 6e-6, "transmitted": 15e-6})


@pytest.mark.parametrize(
    ("level", "white", "judged"), [(10e-6, 10e-6, True), (2.5e-6, 1e-6, True), (4e-6, 10e-6, False)]
)
def test_equilibrium_is_judged_by_the_lesser_of_two_noises(level, white, judged):
    """Averaged over four samples: white noise of 1e-6 in each wave; what is slow is no less than that.

    Front sqrt(2), back 1: half of their root sum of squares, over sqrt(4), times 5: 2.17 times the noise,
    which is the lesser of `white` and sqrt(4) 1e-6.
    """
    n = 50
    half, names = np.full(n, 0.5 * level), ("incident", "reflected", "transmitted")
    faces = FaceWaves(
        1e-6 * np.arange(n), half, half, 2 * half, dict.fromkeys(names, 1e-6), BAR, BAR,
        white=dict.fromkeys(names, white),
    )  # fmt: skip
    found = reduce(faces, SPECIMEN)
    assert np.isfinite(found.imbalance[10:40]).all() == judged
    assert np.isinf(found.imbalance[10:40]).all() == (not judged)
