"""The flyer's path compared with motions in closed form, and on the two known-answer shots."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from kolsky.bars.flyer import jerks
from kolsky.bars.flyer.jerks import (
    CHANGE_PER_OCTAVE,
    ZERO_PRIOR,
    evidence,
    hat_functions,
    noise_parts,
    posterior,
)
from kolsky.bars.flyer.path import FlyerPath, fit_flyer, responses, whitening
from kolsky.base.records import FlyerMotion

ROOT = Path(__file__).parents[3]
FRAME = 1.0 / 120e3
FRAMES = -62.5e-6 + FRAME * np.arange(186)
START = FRAMES[11]
SIGMA = 1e-6
SPEED, RISE, ONSET = 2.6, 50e-6, 37.5e-6


def position(t):
    """At rest, then v = V u^3 (10 - 15 u + 6 u^2) - 25 tau - 6e4 tau^2, u = tau / rise, u <= 1."""
    tau = np.maximum(t - ONSET, 0.0)
    u = np.minimum(tau / RISE, 1.0)
    ramp = RISE * (2.5 * u**4 - 3.0 * u**5 + u**6) + np.maximum(tau - RISE, 0.0)
    return SPEED * ramp - 12.5 * tau**2 - 2e4 * tau**3


def velocity(t):
    tau = np.maximum(t - ONSET, 0.0)
    u = np.minimum(tau / RISE, 1.0)
    return SPEED * u**3 * (10.0 - 15.0 * u + 6.0 * u**2) - 25.0 * tau - 6e4 * tau**2


def measured(seed=0, *, noise=SIGMA, declared=SIGMA, frames=FRAMES, zero=0.0):
    e = noise * np.random.default_rng(seed).standard_normal(frames.size)
    return FlyerMotion(
        time=frames, displacement=position(frames) + zero + e, sigma=np.full(frames.size, declared)
    )


@pytest.fixture(scope="module")
def paths():
    return [fit_flyer(measured(seed), start=START) for seed in range(6)]


def rms(a):
    return float(np.sqrt(np.mean(np.square(a))))


def test_position_and_velocity_come_near_the_truth(paths):
    t = np.linspace(START, FRAMES[-1], 3000)
    ramp = t < ONSET + 70e-6
    dx = np.array([p.position(t) - position(t) for p in paths])
    dv = np.array([p.velocity(t) - velocity(t) for p in paths])
    # The zero comes from 12 static frames: 1 um / sqrt(12) = 0.29 um is common to the whole path.
    assert rms(dx) < 0.35e-6
    # One frame alone knows the velocity to sqrt(2) um / 8.33 us = 0.17 m/s; a third of it in the ramp.
    assert rms(dv[:, ramp]) < 0.06
    assert np.abs(dv).max() < 0.2
    # Averaging over tens of frames: 0.3 % of the speed after the ramp.
    assert rms(dv[:, ~ramp]) < 0.003 * SPEED


def test_neither_lag_nor_ringing(paths):
    # A lag of dt shows as -v dt on average: 0.15 um / 2.6 m/s = 0.06 us of an 8.33 us frame.
    t = np.linspace(ONSET, ONSET + 70e-6, 500)
    assert abs(np.mean([p.position(t) - position(t) for p in paths])) < 0.15e-6
    before = np.linspace(START, ONSET, 50)
    assert max(np.abs(p.position(before)).max() for p in paths) < 0.2e-6  # a fifth of the noise
    # Overshoot past the ramp, on average over the draws: below 1 % of the speed.
    after = np.linspace(ONSET + RISE, ONSET + 2 * RISE, 50)
    assert np.abs(np.mean([p.velocity(after) - velocity(after) for p in paths], axis=0)).max() < 0.01 * SPEED


def test_the_uncertainty_is_that_of_the_errors(paths):
    t = FRAMES[14:]
    x = rms([(p.position(t) - position(t)) / p.sigma_position(t) for p in paths])
    v = rms([(p.velocity(t) - velocity(t)) / p.sigma_velocity(t) for p in paths])
    # 6 draws of strongly correlated errors: about 20 % of scatter; the prior errs to the safe side.
    assert 0.5 < x < 1.3
    assert 0.5 < v < 1.3


def test_it_starts_at_rest_and_is_one_smooth_motion(paths):
    path = paths[0]
    assert path.start == START
    assert path.end == FRAMES[-1]
    assert path.position(START) == path.velocity(START) == path.acceleration(START) == 0.0
    t, h = np.linspace(START + 1e-6, FRAMES[-1] - 1e-6, 400), 1e-8
    # Central differences: h^2 jerk / 6 = 1e-6 m/s; round-off 1e-19 m / h.
    slope = (path.position(t + h) - path.position(t - h)) / (2 * h)
    np.testing.assert_allclose(path.velocity(t), slope, atol=1e-5)
    slope = (path.velocity(t + h) - path.velocity(t - h)) / (2 * h)
    # Half a jump of the jerk times h where a knot lies between; jerk < 1e10 m/s^3.
    np.testing.assert_allclose(path.acceleration(t), slope, atol=100.0)
    knots = path.knots[1:-1]
    for f, jump in ((path.position, 1e-11), (path.velocity, 1e-6), (path.acceleration, 0.1)):
        # Across 2e-12 s a value may change by 2e-12 times the next derivative (5, 2e5, 1e10).
        assert np.abs(f(knots + 1e-12) - f(knots - 1e-12)).max() < jump


def test_a_wrong_sigma_is_seen_and_does_not_make_it_ring():
    right = fit_flyer(measured(5), start=START)
    low = fit_flyer(measured(5, declared=0.3e-6), start=START)
    high = fit_flyer(measured(5, declared=4e-6), start=START)
    # 180 degrees of freedom know chi2/dof to sqrt(2 / 180) = 10 %, sigma to 5 %; three of them.
    assert right.chi2_per_dof == pytest.approx(1.0, abs=0.32)
    assert right.static_scatter == pytest.approx(1.0, abs=0.65)  # 11 degrees of freedom: 21 %
    assert low.chi2_per_dof == pytest.approx(1 / 0.09, rel=0.32)
    assert low.noise_scale == pytest.approx(1 / 0.3, rel=0.16)
    assert high.chi2_per_dof == pytest.approx(1 / 16, rel=0.32)
    assert high.noise_scale == 1.0  # the larger of declared and seen
    t = np.linspace(START, FRAMES[-1], 500)
    # The same data and noise: the optimiser's tolerance and the prior's bounds apart.
    np.testing.assert_allclose(low.position(t), right.position(t), atol=0.1e-6)
    assert high.sigma_position(t[-1]) > 2 * right.sigma_position(t[-1])


def test_the_zero_of_the_record_does_not_matter():
    at_zero, shifted = (fit_flyer(measured(1, zero=z), start=START) for z in (0.0, 0.4e-3))
    t = np.linspace(START, FRAMES[-1], 200)
    np.testing.assert_allclose(shifted.position(t), at_zero.position(t), atol=1e-9)  # optimiser's tolerance
    assert shifted.zero - at_zero.zero == pytest.approx(0.4e-3, abs=1e-9)


def test_missing_frames_and_a_start_between_frames():
    keep = np.ones(FRAMES.size, dtype=bool)
    keep[[14, 16, 40, 41, 42, 120]] = False
    path = fit_flyer(measured(2, frames=FRAMES[keep]), start=FRAMES[8] + 0.9 * FRAME)
    t = np.linspace(path.start, path.end, 2000)
    # Two of the ramp's six frames are lost: v FRAME = 22 um without them, known to 1 um at the others.
    assert np.abs(path.position(t) - position(t)).max() < 5e-6


def test_replicates_scatter_as_the_covariance_says(paths):
    path = paths[0]
    t = FRAMES[[13, 15, 20, 60, 185]]
    draws = path.replicates(800, np.random.default_rng(4))
    x = np.array([p.position(t) for p in draws])
    # A standard deviation from 800 draws is known to 1 / sqrt(1600) = 2.5 %; four of them.
    np.testing.assert_allclose(x.std(axis=0), path.sigma_position(t), rtol=0.1)
    v = np.array([p.velocity(t) for p in draws])
    np.testing.assert_allclose(v.std(axis=0), path.sigma_velocity(t), rtol=0.1)
    assert all(p.position(START) == 0.0 for p in draws)
    again = path.replicates(2, np.random.default_rng(4))
    np.testing.assert_array_equal(again[1].jerk, draws[1].jerk)


def test_table(paths):
    t, x, v = paths[0].table(257)
    assert (t[0], t[-1]) == (START, FRAMES[-1])
    np.testing.assert_array_equal(x, paths[0].position(t))
    np.testing.assert_array_equal(v, paths[0].velocity(t))
    with pytest.raises(ValueError, match="at least 2 times, got 1"):
        paths[0].table(1)


@pytest.mark.parametrize("time", [START - 1e-9, FRAMES[-1] + 1e-9, np.nan])
def test_no_extrapolation(paths, time):
    for f in (paths[0].position, paths[0].velocity, paths[0].acceleration, paths[0].sigma_position):
        with pytest.raises(ValueError, match="is known from"):
            f(np.array([START, time]))


def spoiled(field, row, value):
    motion = measured()
    array = getattr(motion, field).copy()
    array[row] = value
    return replace(motion, **{field: array})


@pytest.mark.parametrize(
    ("change", "start", "message"),
    [
        (("time", 0, FRAMES[0]), FRAMES[1], "2 flyer frames are at or before the start"),
        (("time", 0, FRAMES[0]), FRAMES[-5], "4 flyer frames are after the start"),
        (("time", 7, FRAMES[6]), START, "row 7"),
        (("displacement", 50, np.nan), START, "displacement must be finite, got nan at 50"),
        (("sigma", 50, 0.0), START, r"sigma of the flyer must be in \(0, inf\) m, got 0 at 50"),
    ],
)
def test_bad_input_is_refused(change, start, message):
    with pytest.raises(ValueError, match=message):
        fit_flyer(spoiled(*change), start=start)


def small_problem():
    """36 unevenly spaced frames with unequal weights, 7 of them static; 29 spans."""
    rng = np.random.default_rng(2)
    t = np.concatenate([np.arange(-6.0, 1.0), np.cumsum(rng.uniform(0.5, 1.5, 29))])
    weight = rng.uniform(0.5, 1.5, t.size)
    knots = np.concatenate([[0.0], t[7:]])
    G = np.column_stack([np.ones(t.size), responses(t, knots, 0)]) * weight[:, None]
    hats = hat_functions(0.5 * (knots[1:] + knots[:-1]))
    y = weight * np.maximum(t - 3.0, 0.0) ** 2 + rng.standard_normal(t.size)
    theta = np.concatenate([[0.2], np.linspace(0.5, -3.0, hats.shape[1])])
    return theta, y, weight, np.diff(knots), hats, G


def test_posterior_and_marginal_likelihood_against_the_dense_gaussian():
    theta, y, weight, spans, hats, G = small_problem()
    np.testing.assert_allclose(hats.sum(axis=1), 1.0, rtol=1e-14)
    s, prior = np.exp(theta[0]), np.concatenate([[ZERO_PRIOR], np.exp(hats @ theta[1:])])
    C = s**2 * np.eye(y.size) + (G * prior**2) @ G.T  # covariance of y itself
    dense = y @ np.linalg.solve(C, y) + np.linalg.slogdet(C)[1]
    smooth = np.sum((np.diff(theta[1:]) / CHANGE_PER_OCTAVE) ** 2)
    # Round-off of the dense solution: condition 1e9.
    assert evidence(theta, y, weight, spans, hats)[0] == pytest.approx(dense + smooth, rel=1e-6)
    z, V, rest = posterior(y / s, G * prior / s)
    np.testing.assert_allclose(prior * z, prior**2 * (G.T @ np.linalg.solve(C, y)), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(V, np.eye(z.size) - (G * prior).T @ np.linalg.solve(C, G * prior), atol=1e-6)
    np.testing.assert_allclose(rest, (y - G @ (prior * z)) / s, atol=1e-9)


def test_noise_of_all_frames_beside_the_declared_one():
    """The marginal likelihood of two parts of the noise against the dense Gaussian, and its gradient."""
    theta, y, weight, spans, hats, G = small_problem()
    parts = noise_parts(weight)
    np.testing.assert_allclose(parts, np.column_stack([np.ones(y.size), weight**2]))
    both = np.concatenate([[theta[0], -0.4], theta[1:]])
    prior = np.concatenate([[ZERO_PRIOR], np.exp(hats @ theta[1:])])
    C = np.diag(np.exp(0.4) + np.exp(-0.8) * weight**2) + (G * prior**2) @ G.T
    dense = y @ np.linalg.solve(C, y) + np.linalg.slogdet(C)[1]
    smooth = np.sum((np.diff(theta[1:]) / CHANGE_PER_OCTAVE) ** 2)
    # Round-off of the dense solution: condition 1e9.
    assert evidence(both, y, weight, spans, hats, parts)[0] == pytest.approx(dense + smooth, rel=1e-6)
    numeric = approx_fprime(both, lambda q: evidence(q, y, weight, spans, hats, parts)[0], 1e-6)
    slope = evidence(both, y, weight, spans, hats, parts)[1]
    np.testing.assert_allclose(slope, numeric, atol=1e-3, rtol=1e-4)


def test_sigmas_that_are_alike_have_one_part():
    assert noise_parts(np.array([0.0, 1.0, 1.04, 1.0])).shape == (4, 1)
    assert noise_parts(np.array([0.0, 1.0, 1.06, 1.0])).shape == (4, 2)


def test_warm_air_in_well_seen_frames_is_no_fault_of_the_others():
    """Sigmas of 2 um as the flyer comes into view and of 0.1 um later, and 0.3 um that all frames have:
    the early noise stays what it is, the late one is found."""
    late = FRAMES > FRAMES[60]  # noqa: SIM300
    sigma = np.where(late, 0.1e-6, 2e-6)
    noise = np.hypot(sigma, 0.3e-6) * np.random.default_rng(4).standard_normal(FRAMES.size)
    path = fit_flyer(FlyerMotion(FRAMES, position(FRAMES) + noise, sigma), start=START)
    # sqrt(1 + 9) in the late frames, which are two thirds; 125 of them know it to 6 %, three of that
    assert path.noise_scale == pytest.approx(np.sqrt(10.0), rel=0.19)
    t = np.linspace(START, FRAMES[58], 300)
    spread = path.sigma_position(t)
    # twelve static frames of 2 um know the zero to 0.6 um, the path is smooth: a scale of 3 on all frames
    # would make that 1.8 um and more
    assert np.median(spread) < 1.2e-6
    assert np.abs((path.position(t) - position(t)) / np.maximum(spread, 1e-9)).max() < 4.0


def test_added_noise_that_a_search_loses_is_found_again(monkeypatch):
    # The likelihood is flat in the logarithm of a part that has vanished: a search that begins there stays.
    sigma = np.where(np.arange(FRAMES.size) % 3 == 0, 4.0, 1.0) * SIGMA
    rng = np.random.default_rng(4)
    error = rng.standard_normal(FRAMES.size) * np.hypot(sigma, 3.0 * SIGMA)
    motion = FlyerMotion(time=FRAMES, displacement=position(FRAMES) + error, sigma=sigma)
    found = fit_flyer(motion, start=START)
    monkeypatch.setattr(jerks, "ADDED", 2e-3)
    again = fit_flyer(motion, start=START)
    assert again.noise_scale == pytest.approx(found.noise_scale, rel=1e-3)
    assert again.noise_scale == pytest.approx(np.hypot(1.0, 3.0), rel=0.15)
    assert rms(again.position(FRAMES[20:]) - found.position(FRAMES[20:])) < 1e-3 * SIGMA


def test_gradient_of_the_marginal_likelihood():
    theta, *rest, _ = small_problem()
    numeric = approx_fprime(theta, lambda q: evidence(q, *rest)[0], 1e-6)
    # One-sided difference: step times curvature, 1e-6 x 100.
    np.testing.assert_allclose(evidence(theta, *rest)[1], numeric, atol=1e-3, rtol=1e-4)


@pytest.mark.parametrize("folder", ["runs/open-01", "tests/data/open-02"])
def test_known_answer_shots(folder):
    truth = json.loads((ROOT / folder / "truth.json").read_text())
    frame, t, x = np.loadtxt(ROOT / folder / "flyer.csv", delimiter=",", skiprows=1).T
    assert frame[11] == 11
    path = fit_flyer(FlyerMotion(t, x * 1e-3, np.full(t.size, 1e-6)), start=t[11])
    assert path.chi2_per_dof == pytest.approx(1.0, abs=0.32)  # three of its standard deviations
    onset, speed = truth["motion_start_s"], truth["flyer_speed_m_s"]
    # Full speed is reached within 60 us; from there the specimen brakes it by 0.3 % in the next 80 us.
    after = np.linspace(onset + 65e-6, onset + 145e-6, 50)
    assert path.velocity(after).mean() == pytest.approx(speed, rel=0.003)
    assert np.abs(path.position(np.linspace(t[11], onset, 20))).max() < 0.2e-6


def test_an_error_that_frames_have_in_common():
    """The marginal likelihood with an autoregressive error against the dense Gaussian, and its gradient."""
    theta, y, weight, spans, hats, G = small_problem()
    size, keep = 0.7 * weight, np.full(y.size, np.exp(-0.4))
    at = np.arange(y.size)
    together = np.outer(size, size) * np.exp(-0.4 * np.abs(at[:, None] - at))
    prior = np.concatenate([[ZERO_PRIOR], np.exp(hats @ theta[1:])])
    C = np.exp(2.0 * theta[0]) * np.eye(y.size) + together + (G * prior**2) @ G.T
    dense = y @ np.linalg.solve(C, y) + np.linalg.slogdet(C)[1]
    smooth = np.sum((np.diff(theta[1:]) / CHANGE_PER_OCTAVE) ** 2)
    value, slope = evidence(theta, y, weight, spans, hats, None, (size, keep))
    assert value == pytest.approx(dense + smooth, rel=1e-6)  # round-off of the dense solution
    numeric = approx_fprime(theta, lambda q: evidence(q, y, weight, spans, hats, None, (size, keep))[0], 1e-6)
    np.testing.assert_allclose(slope, numeric, atol=1e-3, rtol=1e-4)


def test_errors_are_made_independent():
    """L^-1 of the covariance s² + q q' k, and its transpose."""
    t, s = np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 1.0])
    q = np.array([0.5, 0.5, 2.0])
    covariance = np.diag(s**2) + np.outer(q, q) * np.exp(-np.abs(t[:, None] - t) / 2.0)
    whitened = whitening(t, s, 2.0, (q, np.zeros(3)))
    L_inverse = whitened(np.eye(3))
    np.testing.assert_allclose(L_inverse @ covariance @ L_inverse.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(whitened(np.eye(3), back=True), L_inverse.T, atol=1e-12)
    np.testing.assert_allclose(whitening(t, s, 1.0, None)(np.ones((3, 2))), np.outer(1.0 / s, np.ones(2)))


def test_warm_air_is_no_motion():
    """Air of 0.4 um that lasts 12 frames before a flyer that is seen to 0.02 um: taken for noise of single
    frames the path follows it; told of it, the path's velocity is right within its sigma."""
    rng = np.random.default_rng(7)
    air, keep = np.empty(FRAMES.size), np.exp(-1.0 / 12.0)
    air[0] = rng.standard_normal()
    for k in range(1, air.size):
        air[k] = keep * air[k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal()
    sigma = np.full(FRAMES.size, 0.02e-6)
    seen = position(FRAMES) + 0.4e-6 * air + sigma * rng.standard_normal(FRAMES.size)
    plain = FlyerMotion(FRAMES, seen, sigma)
    told = replace(plain, shared_sigma=np.full(FRAMES.size, 0.4e-6), shared_memory=12.0 * FRAME)
    late = np.linspace(ONSET + 100e-6, FRAMES[-6], 300)
    errors, spreads = [], []
    for motion in (plain, told):
        path = fit_flyer(motion, start=START)
        errors.append(path.velocity(late) - velocity(late))
        spreads.append(path.sigma_velocity(late))
    rms = [np.sqrt(np.mean(one**2)) for one in errors]
    assert rms[1] < 0.6 * rms[0]
    assert np.sqrt(np.mean((errors[1] / spreads[1]) ** 2)) < 2.0
    assert np.sqrt(np.mean((errors[0] / spreads[0]) ** 2)) > 2.0


def test_all_patterns_of_a_path_make_its_covariance() -> None:
    rng = np.random.default_rng(7)
    root = rng.standard_normal((6, 6)) * 10.0 ** rng.uniform(-2.0, 2.0, 6)[:, None]
    spans = rng.uniform(1.0, 2.0, 6)
    path = FlyerPath(np.append(0.0, np.cumsum(spans)), np.zeros(6), root @ root.T, 0.0, 1.0, 1.0, 1.0)
    jerks = path.noise_patterns(6)
    np.testing.assert_allclose(jerks.T @ jerks, path.covariance, rtol=1e-7)
    # Fewer are those that move the velocity most, each by less than the one before.
    moved = np.linalg.norm(np.cumsum(np.cumsum(jerks * spans, 1) * spans, 1), axis=1)
    assert (np.diff(moved) <= 1e-9 * moved[0]).all()
    np.testing.assert_allclose(path.noise_patterns(2), jerks[:2])
