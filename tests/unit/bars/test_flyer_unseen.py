"""A flyer that becomes visible some time after its start: the gap of its path, and the sigma of its zero."""

import numpy as np
import pytest

from kolsky.bars.flyer.jerks import evidence, hat_functions
from kolsky.bars.flyer.path import FlyerPath, _without_gaps, fit_flyer
from kolsky.base.records import FlyerMotion
from kolsky.shot.records import fit_front_path

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
        dof=1.0,
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
