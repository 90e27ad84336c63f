"""A flyer's flight: events, the unknown smoothness, a path that is seen late, direction and tilt."""

from types import SimpleNamespace

import numpy as np
import pytest
from softflyer import Flight

from dic import FrameOutcome
from dic.bodies.body_motion import BodyMotion
from kolsky.bars.flyer.events import find_kink, flyer_events
from kolsky.bars.flyer.flight import _noise_of_one, fit_flight, symmetry_end
from kolsky.bars.flyer.jerks import evidence, evidences, hat_functions, noise_parts
from kolsky.bars.flyer.path import (
    DRAWS,
    FlyerPath,
    _without_gaps,
    controls_in_gaps,
    fit_flyer,
    importance_draws,
    mixed_covariance,
)
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar
from kolsky.base.records import FlyerMotion
from kolsky.shot.records import fit_front_path

# Events of synthetic flights, compared with their times in closed form.

REST = 20e-6
ARREST, IMPACT, END = 900e-6, 1500e-6, 1700e-6
FLIGHT = Flight(pull=60e-6, loss=0.5, arrest=ARREST, impact=IMPACT)


def transmitted(seed=0):
    """A bell around the arrest, 100 N high."""
    t = -200e-6 + 0.5e-6 * np.arange(3900)
    clean = 100.0 / np.cosh((t - ARREST) / 200e-6)
    return Signal(
        -200e-6, 0.5e-6, clean + 0.2 * np.random.default_rng(seed).standard_normal(t.size), 0.2, "N"
    )


BAR = Bar(diameter=15e-3, length=3.0, youngs_modulus=190e9, density=8048.0)


@pytest.fixture(scope="module")
def everything():
    return flyer_events(
        FLIGHT.motion(0, END),
        rest=REST,
        incident=FLIGHT.force(0, END),
        transmitted=transmitted(),
        bar=BAR,
        ringing=10e-6,
    )


def near(event, time, sigmas=3.0):
    assert event.time == pytest.approx(time, abs=sigmas * event.sigma), event


def test_every_event_with_all_instruments(everything):
    near(everything["full speed"], FLIGHT.full)
    near(everything["separation"], FLIGHT.full + FLIGHT.pull)
    # Relative to a back face that moves with F / Z (the first echo is 1.2 ms away) it stands still earlier.
    deceleration = 2.1 / 300e-6
    near(everything["arrest"], ARREST - 100.0 / BAR.impedance / deceleration)
    near(everything["push-back"], ARREST + 200e-6 * np.arccosh(2.0))
    near(everything["second impact"], IMPACT)
    # Sigmas are worth something: frames are 8.3 us apart.
    assert everything["arrest"].sigma < 2e-6
    assert everything["second impact"].sigma < 2e-6
    assert everything["separation"].sigma < 5e-6
    order = ("full speed", "separation", "arrest", "push-back", "second impact")
    assert sorted(order, key=lambda name: everything[name].time) == list(order)
    assert everything.usable == (everything["second impact"].time, "second impact")
    assert everything.path.end < IMPACT
    with pytest.raises(KeyError, match="is not one of"):
        everything["landing"]


def test_a_displacement_alone(everything):
    events = flyer_events(FLIGHT.motion(1, END), rest=REST)
    near(events["separation"], FLIGHT.full + FLIGHT.pull)
    assert "displacement" in events["separation"].how
    near(events["arrest"], ARREST)
    near(events["second impact"], IMPACT)
    assert events["push-back"].time is None
    assert "transmitted force" in events["push-back"].how
    assert events["end of symmetry"].time is None
    assert "pictures" in events["end of symmetry"].how


def test_what_did_not_happen_is_not_found():
    still = Flight()
    events = flyer_events(still.motion(2, 450e-6), rest=REST, incident=still.force(2, 450e-6))
    near(events["full speed"], still.full)
    for name in ("separation", "arrest", "push-back", "second impact"):
        assert events[name].time is None
        assert events[name].how
    assert "2.6 m/s" in events["arrest"].how
    assert events.usable[1] == "the record"


def test_a_bar_needs_the_transmitted_force():
    motion = Flight().motion(3, 300e-6)
    with pytest.raises(ValueError, match="give both or neither"):
        flyer_events(motion, rest=REST, bar=BAR)


def test_a_kinks_time_has_the_scatter_it_says():
    t = np.linspace(0.0, 1.0, 60)
    rng = np.random.default_rng(4)
    score, gains = [], []
    for _ in range(30):
        clean = 1.0 + t + 3.0 * np.maximum(t - 0.43, 0.0)
        kink = find_kink(
            t,
            clean + 0.05 * rng.standard_normal(60),
            np.full(60, 0.05),
            (0.1, 0.9),
            degree=1,
            power=1,
            begins=True,
        )
        score.append((kink.time - 0.43) / kink.sigma)
        straight = find_kink(
            t,
            1.0 + t + 0.05 * rng.standard_normal(60),
            np.full(60, 0.05),
            (0.1, 0.9),
            degree=1,
            power=1,
            begins=True,
        )
        gains.append(straight.gain)
        assert kink.change == pytest.approx(3.0, abs=0.4)
        assert kink.gain > 100.0
    assert 0.7 < np.sqrt(np.mean(np.square(score))) < 1.35  # 30 scores: 1 within 0.13
    assert max(gains) < 25.0  # chi-square of two: 1 in 10^5 reaches 25
    with pytest.raises(ValueError, match="needs at least"):
        find_kink(t[:5], t[:5], t[:5], (0.0, 1.0), degree=1, power=1, begins=True)
    with pytest.raises(ValueError, match="span"):
        find_kink(t, t, t + 1, (1.0, 1.0), degree=1, power=1, begins=True)


# The unknown smoothness of a flyer that no frame shows: closed forms, and known motions.

A = np.array([[2.0, 0.6], [0.6, 0.5]])
MODE = np.array([7.0, 1.0, -3.0])
FREE = np.array([False, True, True])


def quadratic(thetas):
    """-2 ln L of a normal likelihood of the second and third unknown, with precision A."""
    off = thetas[:, 1:] - MODE[1:]
    slopes = np.hstack([np.zeros((len(off), 1)), 2.0 * off @ A])
    return SimpleNamespace(values=np.sum(off @ A * off, axis=1), gradients=slopes)


@pytest.mark.parametrize("shares", [False, True])
@pytest.mark.parametrize("two_parts", [False, True])
def test_many_smoothnesses_at_once_have_the_likelihood_of_each(two_parts, shares):
    """Uneven spans, seven frames at rest, and three that show nothing."""
    rng = np.random.default_rng(4)
    spans, n = rng.uniform(0.5, 1.5, 29), 36
    hats = hat_functions(np.cumsum(spans) - 0.5 * spans)
    weight = rng.uniform(0.3, 1.5, n)
    weight[9:12] = 0.0
    y = weight * (np.maximum(np.arange(n) - 9.0, 0.0) ** 2 + rng.standard_normal(n))
    parts = noise_parts(weight) if two_parts else None
    shared = (0.7 * weight, rng.uniform(0.2, 0.9, n)) if shares else None
    scales = rng.uniform(0.0, 1.0, (5, 2 if two_parts else 1))
    thetas = np.hstack([scales, rng.uniform(-4.0, 2.0, (5, hats.shape[1]))])
    data = (y, weight, spans, hats, parts, shared)
    values, slopes = zip(*(evidence(theta, *data) for theta in thetas), strict=True)
    together = evidences(thetas, *data)
    # the same products, in an order that a BLAS may choose anew for several matrices
    np.testing.assert_allclose(together.values, values, rtol=1e-12)
    np.testing.assert_allclose(together.gradients, slopes, rtol=1e-9, atol=1e-9 * np.abs(slopes).max())


def test_draws_have_the_likelihood_s_mean_and_covariance():
    """Sixty draws that count tell a variance to a fifth; opposite pairs tell the mean exactly."""
    drawn, weights = importance_draws(MODE, FREE, quadratic)
    assert drawn.shape == (DRAWS, 3)
    assert weights.sum() == pytest.approx(1.0)
    assert (drawn[:, 0] == MODE[0]).all()
    np.testing.assert_allclose(weights @ drawn, MODE, atol=1e-12)
    off = drawn[:, 1:] - MODE[1:]
    found = (off.T * weights) @ off
    np.testing.assert_allclose(found, np.linalg.inv(A), atol=0.35 * np.sqrt(np.linalg.inv(A)[1, 1] * 0.78))
    assert 0.3 * DRAWS < 1.0 / np.sum(weights**2) < 0.8 * DRAWS  # those that count


def test_the_same_call_draws_the_same():
    first, second = (importance_draws(MODE, FREE, quadratic) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])


def test_a_mixture_has_the_covariances_and_the_spread_of_the_means():
    """Weights 1/4 and 3/4 of two priors, each with the dense normal equations of all five unknowns."""
    rng = np.random.default_rng(3)
    y, H, prior = rng.standard_normal(8), rng.standard_normal((8, 5)), np.array([9.0, 0.5, 2.0, 1.0, 0.3])
    drawn = np.array([False, True, False, True, False])
    tau, weights = np.array([[0.2, 3.0], [1.5, 0.1]]), np.array([0.25, 0.75])

    def dense(prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        covariance = np.linalg.inv(H.T @ H + np.diag(prior**-2.0))
        return covariance @ H.T @ y, covariance

    expected, about = np.zeros((5, 5)), dense(prior)[0]
    for one, weight in zip(tau, weights, strict=True):
        other = prior.copy()
        other[drawn] = one
        mean, covariance = dense(other)
        expected += weight * (covariance + np.outer(mean - about, mean - about))
    found = mixed_covariance(y, H, prior, drawn, tau, weights)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)  # round-off


def test_the_smoothness_of_spans_beside_unseen_frames_is_free():
    """Control points at 0, 3, 6, 12 frames: spans 4 to 6 lie between those at 3, 6 and 12."""
    t = np.arange(10.0)
    hats = hat_functions(np.arange(9) + 0.5)
    assert hats.shape[1] == 4
    seen = np.ones(10, dtype=bool)
    assert controls_in_gaps(hats, t, seen, t).tolist() == [False] * 4
    seen[6] = False
    assert controls_in_gaps(hats, t, seen, t).tolist() == [False, True, True, True]
    seen[:] = True
    seen[1] = False
    assert controls_in_gaps(hats, t, seen, t).tolist() == [True, True, False, False]


def shown_late(start: float, rise: float, unseen: int, seed: int) -> tuple[float, float]:
    """Errors of a path over their sigma where nothing is seen: root mean square, and where it is largest."""

    def position(t):
        since = np.maximum(t - start, 0.0)
        u = np.minimum(since / rise, 1.0)
        return SPEED * (0.5 * (u - np.sin(np.pi * u) / np.pi) * rise + np.maximum(since - rise, 0.0))

    t = np.delete(FRAME * np.arange(-9, 80), slice(10, 10 + unseen))
    noise = SIGMA * np.random.default_rng(seed).standard_normal(t.size)
    path = fit_flyer(FlyerMotion(t, position(t) + noise, np.full(t.size, SIGMA)), start=0.0)
    at = FRAME * np.arange(1, unseen + 1)
    sigma = path.sigma_position(at)
    z = (path.position(at) - position(at)) / sigma
    return float(np.sqrt(np.mean(z**2))), float(z[np.argmax(sigma)])


def test_an_onset_that_no_frame_shows_is_off_by_what_is_stated():
    """Eight flyers at 2.5 m/s after 40 to 90 us, unseen for 120 to 190 us.

    Without what the unknown smoothness adds the root mean square is 2.3, and 3.8 where the path is known
    least; with it they are 1.0 and 1.4. Eight errors tell theirs to a quarter.
    """
    rng = np.random.default_rng(3)
    found = []
    for k in range(8):
        start, rise = rng.uniform([0.0, 4.0], [4.0, 9.0]) * FRAME
        found.append(shown_late(start, rise, int(rng.integers(12, 20)), k))
    everywhere, worst = np.sqrt(np.mean(np.square(found), axis=0))
    assert 0.5 < everywhere < 1.5
    assert 0.5 < worst < 2.0


# A flyer that becomes visible some time after its start: the gap of its path, and the sigma of its zero.

FRAME, SIGMA, SPEED, START = 1e-5, 1e-7, 2.5, 0.0
RISE = 5.0 * FRAME


def position(t):
    """At rest until `START`, then 2.5 m/s after a rise of half a cosine."""
    since = np.maximum(t - START, 0.0)
    u = np.minimum(since / RISE, 1.0)
    return SPEED * (0.5 * (u - np.sin(np.pi * u) / np.pi) * RISE + np.maximum(since - RISE, 0.0))


def motion(unseen: slice, *, zero_sigma: float = 0.0) -> FlyerMotion:
    t = FRAME * np.arange(-9, 80)
    t = np.delete(t, unseen)
    noise = SIGMA * np.random.default_rng(1).standard_normal(t.size)
    return FlyerMotion(t, position(t) + noise, np.full(t.size, SIGMA), zero_sigma)


def test_only_gaps_of_more_than_a_frame_are_filled():
    t = np.array([0.0, 1.0, 3.0, 4.0, 8.0])
    times, seen = _without_gaps(t, 1.0)
    np.testing.assert_allclose(times, [0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0])
    assert seen.tolist() == [True] * 4 + [False] * 3 + [True]


def test_a_path_crosses_a_gap_without_overshoot():
    """Eight frames after the start are unseen: the speed there is between none and a tenth above the last."""
    path = fit_flyer(motion(slice(10, 18)), start=START)
    t = np.linspace(START, 70 * FRAME, 400)
    v = path.velocity(t)
    assert v.min() > -0.1 * SPEED
    assert v.max() < 1.1 * SPEED
    later = t > 10 * FRAME
    np.testing.assert_allclose(path.position(t[later]), position(t[later]), atol=6 * SIGMA)
    # in the gap nothing but smoothness is known, and the sigma says so
    assert path.sigma_position(4 * FRAME) > 5.0 * path.sigma_position(20 * FRAME)


def test_frames_without_a_displacement_say_nothing():
    """The likelihood of data with frames between of no weight is that of one long span of the same motion."""
    spans = np.ones(6)
    hats = hat_functions(np.arange(6) + 0.5)
    y, weight = np.array([0.3, -0.2, 0.1, 2.0, 5.0, 9.0, 14.0, 20.0, 27.0]), np.ones(9)
    value, slope = evidence(np.array([0.2, 0.5, 0.1, -0.3]), y, weight, spans, hats)
    y[5], weight[5] = 0.0, 0.0
    without, _ = evidence(np.array([0.2, 0.5, 0.1, -0.3]), y, weight, spans, hats)
    # dense: the variance of what is seen, y = zero + sum of the kicks of the jerks before
    G = np.zeros((9, 7))
    G[:, 0] = 100.0
    tau = np.exp(hats @ np.array([0.5, 0.1, -0.3]))
    for k in range(6):
        after = np.arange(6) - k
        reach = (after + 1.0) ** 3 / 6.0 - np.maximum(after, 0.0) ** 3 / 6.0
        G[3:, k + 1] = np.where(after >= 0, reach, 0.0) * tau[k]

    def dense(rows):
        V = G[rows] @ G[rows].T + np.exp(0.4) * np.eye(len(rows))
        data = np.array([0.3, -0.2, 0.1, 2.0, 5.0, 9.0, 14.0, 20.0, 27.0])[rows]
        return np.linalg.slogdet(V)[1] + data @ np.linalg.solve(V, data)

    prior = float(np.sum((np.diff([0.5, 0.1, -0.3]) / 2.0) ** 2))
    assert value - prior == pytest.approx(dense(list(range(9))))
    assert without - prior == pytest.approx(dense([0, 1, 2, 3, 4, 6, 7, 8]))
    step = 1e-6
    ahead, _ = evidence(np.array([0.2 + step, 0.5, 0.1, -0.3]), y, weight, spans, hats)
    _, gradient = evidence(np.array([0.2 + 0.5 * step, 0.5, 0.1, -0.3]), y, weight, spans, hats)
    assert (ahead - without) / step == pytest.approx(gradient[0], rel=1e-4)
    assert slope.shape == (4,)


def test_the_zeros_sigma_is_in_every_place_after_the_rest():
    """5 µm that all displacements after the rest have in common, beside noise that is averaged over."""
    plain = fit_front_path(motion(slice(10, 18)), start=START)
    common = fit_front_path(motion(slice(10, 18), zero_sigma=5e-6), start=START)
    np.testing.assert_array_equal(common.jerk, plain.jerk)
    t = np.array([20.0, 40.0, 70.0]) * FRAME
    expected = np.hypot(5e-6, plain.sigma_position(t))
    np.testing.assert_allclose(common.sigma_position(t), expected, rtol=0.02)
    # a common shift changes no speed once the path has caught up with it
    np.testing.assert_allclose(common.sigma_velocity(t), plain.sigma_velocity(t), rtol=0.05)


def test_the_likelihood_stays_accurate_where_a_gap_leaves_much_unknown():
    """Its slope is that of its values, to which the round-off of a long gap must add nothing."""
    y, weight = position(FRAME * np.arange(-9, 80)) / SIGMA, np.linspace(0.3, 1.0, 89)
    y, weight[10:29] = y * weight, 0.0
    y[10:29] = 0.0
    hats = hat_functions(np.arange(79) + 0.5)
    shared = (np.where(weight > 0.0, 0.3, 0.0), np.full(89, 0.1))
    theta = np.array([0.0, 5.0, 4.4, 2.9, 0.7, -0.6, -3.5, -3.3])[: 1 + hats.shape[1]]
    slope = evidence(theta, y, weight, np.ones(79), hats, None, shared)[1]
    step = 1e-5
    for k, one in enumerate(np.eye(theta.size)):
        ahead, behind = (
            evidence(theta + sign * step * one, y, weight, np.ones(79), hats, None, shared)[0]
            for sign in (1.0, -1.0)
        )
        assert (ahead - behind) / (2.0 * step) == pytest.approx(slope[k], abs=5e-3, rel=1e-4), k


def risen(pattern: list[float]) -> FlyerPath:
    """Velocities 0.5, 1.5, 2, 2, 2 after 1 to 5 s; one pattern of jerk is unknown."""
    return FlyerPath(
        knots=np.arange(6.0),
        jerk=np.array([1.0, 0.0, -1.0, 0.0, 0.0]),
        covariance=np.outer(pattern, pattern),
        zero=0.0,
        noise_scale=1.0,
        chi2_per_dof=1.0,
        static_scatter=1.0,
    )


def test_the_onset_is_known_as_the_position_over_the_velocity():
    """From 2 s, beyond half of the largest velocity, to 3 s, where it is reached.

    A jerk in the first second displaces by 7/6 after 2 s and by 19/6 after 3; one in the second by 1/6 and
    7/6. Later times, when a displacement of 61/6 is left open, are none of the onset.
    """
    assert risen([1.0, 0.0, 0.0, 0.0, 0.0]).sigma_onset == pytest.approx(19.0 / 6.0 / 2.0)
    assert risen([1.0, -19.0 / 7.0, 0.0, 0.0, 0.0]).sigma_onset == pytest.approx(30.0 / 42.0 / 1.5)
    assert risen([0.0, 0.0, 0.0, 0.0, 1.0]).sigma_onset == 0.0


def test_the_onset_that_no_frame_shows_is_known_less_well():
    """Eight unseen frames, and a zero known to 2 um: at 2.5 m/s that alone is 0.8 us."""
    seen, unseen = (
        fit_front_path(motion(gap), start=START).sigma_onset for gap in (slice(0, 0), slice(10, 18))
    )
    assert seen < 0.2e-6 < 5.0 * seen < unseen
    off = fit_front_path(motion(slice(10, 18), zero_sigma=2e-6), start=START).sigma_onset
    assert off == pytest.approx(np.hypot(unseen, 0.8e-6), rel=0.25)


# The flyer's direction, tilt and end of symmetry from a known motion of the body.

FRAMES, STATIC, RATE = 100, 10, 120e3
T = (np.arange(FRAMES) - STATIC + 1) / RATE
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


FLIGHT_START = T[STATIC - 1]


def test_directions_and_rates_are_found_within_their_sigmas():
    ratio, rates = [], []
    moving = T[STATIC + 12 :]
    for seed in range(2):
        motion, velocity, v = body(np.random.default_rng(seed), drift=0.1, turn_rate=20.0)
        flight = fit_flight(motion, T, start=FLIGHT_START)
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
    flight = fit_flight(body(np.random.default_rng(7))[0], T, start=FLIGHT_START)
    phi, sigma = flight.orientation(T[STATIC + 12 :])
    assert (phi < 5.0 * sigma + 1e-6).all()
    assert np.degrees(phi.max()) < 0.5
    found = symmetry_end(flight, T[STATIC:], separation=80e-6, over=50e-6, share=0.02)
    assert found.row is None
    assert found.reference == pytest.approx([1.0, 0.0, 0.0], abs=0.02)


def test_symmetry_ends_where_the_drift_exceeds_the_share():
    flight = fit_flight(body(np.random.default_rng(8), drift=0.2)[0], T, start=FLIGHT_START)
    times = T[STATIC:]
    found = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.1)
    # The lateral velocity grows linearly to a fifth: a tenth (sin of atan, 0.5 %) half-way.
    true = 150e-6 + 0.5 * (T[-1] - 150e-6)
    assert times[found.row] == pytest.approx(true, abs=5.0 / RATE)  # noise of the share over its slope
    never = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.3)
    assert never.row is None
    patient = symmetry_end(flight, times, separation=80e-6, over=50e-6, share=0.1, times_in_row=200)
    assert patient.row is None


def test_a_frames_own_noise_is_what_no_smooth_error_explains():
    """Variance 1 + 4 + 1 of a second difference of independent errors; none of a line's offset and slope."""
    frames = np.arange(12.0)
    line = np.stack([np.ones(12), frames - 5.5])
    covariance = 0.3**2 * np.eye(12) + line.T @ np.diag([4.0, 0.25]) @ line
    np.testing.assert_allclose(_noise_of_one(covariance), 0.3, rtol=1e-12)
