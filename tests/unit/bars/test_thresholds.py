"""Verdicts on both sides of their thresholds, and sigmas by hand: arrivals, zeros, clocks, events."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from kolsky.bars.flyer.events import Event, end_of_dip, find_kink, find_push_back, first_jump, moving_average
from kolsky.bars.flyer.path import FlyerPath, path_strain
from kolsky.bars.flyer.synchronisation import Agreement, Synchronisation, _Fit
from kolsky.bars.records import BarSignal, History, Signal
from kolsky.bars.reduction.inertia import path_acceleration
from kolsky.bars.reduction.stress_strain import correct_punching, punching_compliance
from kolsky.bars.reduction.validity import Reason, imbalance, validity
from kolsky.bars.reduction.windows import check_windows, find_windows, incident_arrival, usable_limits
from kolsky.bars.signals import baseline
from kolsky.bars.signals.arrival import find_arrival
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.records import FlyerMotion

US = 1e-6
BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0)
"""Its wave speed [m/s]; 20 mm take 4 us, 0.5 m 100 us."""


def gauge(value, *, side="incident", position=0.5, sigma=1e-7, start=0.0, step=0.1 * US):
    return BarSignal(Signal(start, step, np.asarray(value), sigma, "1", f"{side} gauge"), BAR, position, side)


def trapezoid(t, begin, height, *, rise=10 * US, hold=60 * US):
    return height * np.interp(t, begin + np.cumsum([0.0, rise, hold, rise]), [0.0, 1.0, 1.0, 0.0])


def noise(n, sigma=1e-7, seed=0):
    return sigma * np.random.default_rng(seed).standard_normal(n)


T = 0.1 * US * np.arange(8000)


# Arrival and windows


@pytest.mark.parametrize(("level", "found"), [(5.9, False), (6.1, True)])
def test_a_pulse_is_six_sigmas_of_the_averaged_noise_high(level, found):
    """40 samples averaged: 6 sigma / sqrt(40). The pulse is a step of zero noise, its sigma declared."""
    value = np.where((T >= 200 * US) & (T < 500 * US), level / np.sqrt(40), 0.0)
    signal = Signal(0.0, 0.1 * US, value, 1.0, "1", "gauge")
    if found:
        assert find_arrival(signal, sign=1, average=4 * US).level == pytest.approx(level / np.sqrt(40))
    else:
        with pytest.raises(ValueError, match="no positive pulse"):
            find_arrival(signal, sign=1, average=4 * US)


def test_sigma_of_an_arrival_is_that_of_its_flanks_intersection():
    """A flank of 1 over 10 us, samples from one below 20 % to one above 60 %; its counts of 0.01."""
    rise = 10 * US
    value = np.clip((T - 200.03 * US) / rise, 0.0, 1.0)
    sigma = 0.01
    found = find_arrival(Signal(0.0, 0.1 * US, value, sigma, "1", "g"), sign=1, average=0.1 * US)
    used = T[(value >= 0.2) & (value < 0.6)]
    used = np.concatenate([[used[0] - 0.1 * US], used, [used[-1] + 0.1 * US]])
    spread = np.sum((used - used.mean()) ** 2)
    variance = sigma**2 * (1 / used.size + (used.mean() - 200.03 * US) ** 2 / spread)
    count = 0.01**2 / 12  # without noise the zero may lie anywhere within a count
    assert found.time == pytest.approx(200.03 * US, abs=1e-12)
    expected = np.sqrt((variance + count) * rise**2 + (0.1 * US) ** 2 / (12 * used.size))
    assert found.sigma == pytest.approx(expected, rel=0.03)  # a sample more or less at either end
    slow = replace(Signal(0.0, 0.1 * US, value, sigma, "1", "g"), memory=4.0)
    expected = np.sqrt((4 * variance + count) * rise**2 + (0.1 * US) ** 2 / (12 * used.size))
    assert find_arrival(slow, sign=1, average=0.1 * US).sigma == pytest.approx(expected, rel=0.03)


def test_a_pulse_ends_at_a_twentieth_of_its_level():
    value = np.interp(T, [200 * US, 210 * US, 300 * US, 400 * US], [0.0, 1.0, 1.0, 0.0])
    found = find_arrival(Signal(0.0, 0.1 * US, value, 1e-9, "1", "g"), sign=1, average=0.1 * US)
    assert found.end == pytest.approx(395 * US, abs=0.2 * US)
    assert found.rise_time == pytest.approx(10 * US, rel=1e-3)


@pytest.mark.parametrize(("share", "refused"), [(0.19, False), (0.21, True)])
def test_an_earlier_pulse_of_the_other_sign_is_a_fifth_of_the_level(share, refused):
    signal = gauge(trapezoid(T, 300 * US, 1e-3) - trapezoid(T, 100 * US, share * 1e-3) + noise(T.size))
    if refused:
        with pytest.raises(ValueError, match="a pulse of tension comes first"):
            incident_arrival(signal)
    else:
        assert incident_arrival(signal).time == pytest.approx(300 * US, abs=0.05 * US)


@pytest.mark.parametrize(("share", "observed"), [(0.045, False), (0.055, True)])
def test_a_reflected_pulse_is_a_twentieth_of_the_incident_one(share, observed):
    """At 0.5 m: predicted 200 us after the incident pulse."""
    signal = gauge(trapezoid(T, 100 * US, 1e-3) - trapezoid(T, 305 * US, share * 1e-3) + noise(T.size))
    reflected, transmitted = check_windows(signal, gauge(0.0 * T + noise(T.size), side="transmission"))
    assert reflected.predicted == pytest.approx(300 * US, abs=0.05 * US)
    assert (reflected.observed is not None) is observed
    assert transmitted.observed is None
    if observed:
        assert reflected.delay == pytest.approx(5 * US, abs=0.05 * US)
        assert "later than predicted" in reflected.reason


def test_limits_of_the_three_windows():
    """Two ways each, less one diameter's 4 us: 2 x 0.5 m, 2 (2 - 0.5) m, 2 (2 - 0.8) m."""
    found = usable_limits(gauge(0.0 * T), gauge(0.0 * T, side="transmission", position=0.8))
    assert [limit.time for limit in found] == pytest.approx([196 * US, 596 * US, 476 * US])
    assert [limit.reason.split(" ")[1] for limit in found] == ["reflected", "reflected", "transmitted"]


@pytest.mark.parametrize(("hold", "refused"), [(180 * US, False), (192 * US, True)])
def test_an_incident_pulse_is_shorter_than_the_way_to_the_specimen_and_back(hold, refused):
    """Limit 196 us; a pulse lasts hold + 19.5 us from its foot to a twentieth of its level, 4 us averaged."""
    hold -= 6 * US
    first = gauge(trapezoid(T, 100 * US, 1e-3, hold=hold) + noise(T.size))
    second = gauge(noise(T.size), side="transmission")
    if refused:
        with pytest.raises(ValueError, match="they overlap"):
            find_windows(first, second)
    else:
        longer = find_windows(first, second)
        assert longer.incident[1] - 100 * US == pytest.approx(
            196 * US, abs=0.1 * US
        )  # 1.25 times would overlap


# Zero, noise, clipping


def line_and_noise(slope=0.0):
    """100 samples whose residual about a line alternates in blocks of a known sum of squares."""
    t = np.arange(100.0)
    residual = np.tile([1.0, -1.0, -1.0, 1.0], 25)
    return t, 3.0 + slope * (t - 49.5) + residual


def test_a_zero_has_the_sigma_of_its_mean():
    t, v = line_and_noise()
    rest = baseline.measure_signal_zero(t, v, (0.0, 99.0), name="x")
    assert rest.mean == pytest.approx(3.0)
    assert rest.noise.sigma == pytest.approx(np.sqrt(100 / 98))
    memory = max(rest.noise.memory, 1.0)
    assert rest.mean_sigma == pytest.approx(rest.noise.sigma * np.sqrt(memory / 100))
    spread = np.sum((t - 49.5) ** 2)
    assert rest.slope_sigma == pytest.approx(rest.noise.sigma * np.sqrt(memory / spread))
    assert rest.freedom == pytest.approx(100 / memory - 2)
    np.testing.assert_allclose(replace(rest, slope=2.0).line(np.array([49.5, 50.5])), [0.0, 2.0])


@pytest.mark.parametrize(("share", "drifts"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True)])
def test_a_drift_is_significant_at_one_percent(share, drifts):
    """Ten independent samples: eight degrees of freedom, Student's t at 0.995."""
    limit = float(student.ppf(0.995, 8))
    assert limit == pytest.approx(3.355, abs=1e-3)
    rest = baseline.SignalZero(
        0.0, 9.0, 10, 0.0, 0.1, share * limit * 0.2, 0.2, baseline.Noise(1.0, 1.0), 0.0, 1
    )
    assert bool(rest.drifts) is drifts


def test_memory_lowers_the_degrees_of_freedom():
    rest = baseline.SignalZero(0.0, 99.0, 100, 0.0, 0.1, 0.0, 0.2, baseline.Noise(1.0, 2.0), 0.0, 1)
    assert rest.freedom == pytest.approx(48.0)
    assert replace(rest, count=3).freedom == 1.0


@pytest.mark.parametrize(("held", "refused"), [(8, False), (9, True)])
def test_clipping_is_three_times_the_longest_rest(held, refused):
    """At rest no value lasts more than three samples: nine in a row at the extreme are clipped."""
    rest = np.tile([0.0, 0.0, 0.0, 1.0], 20)
    value = np.concatenate([rest, np.linspace(2.0, 8.0, 30), np.full(held, 9.0), [1.0]])
    rest = baseline.measure_signal_zero(np.arange(80.0), value[:80], (0.0, 79.0), name="x")
    assert rest.longest_run == 3
    if refused:
        with pytest.raises(ValueError, match="9 samples from sample 110 on"):
            baseline.check_clipping(value, rest, name="x", full_scale=None)
    else:
        baseline.check_clipping(value, rest, name="x", full_scale=None)
    with pytest.raises(ValueError, match="samples reach full scale"):
        baseline.check_clipping(value, rest, name="x", full_scale=9.0)
    baseline.check_clipping(value, rest, name="x", full_scale=9.001)


@pytest.mark.parametrize(("held", "refused"), [(7, False), (8, True)])
def test_clipping_is_eight_samples_at_least(held, refused):
    value = np.concatenate([np.tile([0.0, 1.0], 40), np.full(held, -9.0), [1.0]])
    rest = baseline.measure_signal_zero(np.arange(80.0), value[:80], (0.0, 79.0), name="x")
    if refused:
        with pytest.raises(ValueError, match="it is clipped"):
            baseline.check_clipping(value, rest, name="x", full_scale=None)
    else:
        baseline.check_clipping(value, rest, name="x", full_scale=None)


@pytest.mark.parametrize(("distinct", "step"), [(50, 2.0), (51, 0.0)])
def test_codes_are_seen_where_half_the_samples_repeat(distinct, step):
    value = np.resize(2.0 * np.arange(distinct), 100)
    assert baseline.quantisation_step(value) == step


# Equilibrium, validity


@pytest.mark.parametrize(("force", "judged"), [(4.99, False), (5.01, True)])
def test_forces_are_judged_above_five_times_their_averaged_noise(force, judged):
    """Noise 3 and 4 N over 25 samples: 0.5 * 5 / 5 = 0.5 N of the mean; times 5 is 2.5 N."""
    mean = 0.5 * force
    found = imbalance(np.full(100, mean + 0.01), np.full(100, mean - 0.01), 3.0, 4.0, width=25)
    assert np.isfinite(found).all() == judged
    if judged:
        assert found == pytest.approx(np.full(100, 0.02 / mean))


def judged(front, back, added=0.0, noise=0.0):
    n = 100
    sigma = np.full(n, noise)
    strain = History(np.linspace(0.0, 0.5, n), np.zeros(n), "1")
    forces = [History(np.full(n, value), sigma, "N") for value in (front, back)]
    return validity(US * np.arange(n), *forces, strain, inertial_stress=np.full(n, added) / 1e-4, area=1e-4)


def test_the_classical_reduction_holds_within_a_twentieth_of_the_stress():
    assert judged(102.4, 97.6).start_reason is Reason.RECORD
    assert judged(102.6, 97.4).start_reason is Reason.BALANCE
    assert judged(100.0, 100.0, 4.9).start_reason is Reason.RECORD
    assert judged(100.0, 100.0, -5.1).start_reason is Reason.INERTIA
    # Two sigmas of both faces, sqrt(2) sigma each: 5 N at 1.7678 N.
    assert judged(100.0, 100.0, noise=1.76).start_reason is Reason.RECORD
    assert judged(100.0, 100.0, noise=1.78).start_reason is Reason.NOISE
    # A difference within its own noise is the noise's.
    assert judged(103.0, 97.0, noise=2.2).start_reason is Reason.NOISE
    assert judged(103.0, 97.0, noise=2.1).start_reason is Reason.BALANCE


@pytest.mark.parametrize(("kept", "empty"), [(19, True), (22, False)])
def test_a_nearly_empty_window_is_a_fifth_of_the_strain(kept, empty):
    n, sigma = 101, np.zeros(101)
    front = np.where(np.arange(n) <= kept, 100.0, 120.0)
    found = validity(
        US * np.arange(n),
        History(front, sigma, "N"),
        History(np.full(n, 100.0), sigma, "N"),
        History(0.01 * np.arange(n) / 2, sigma, "1"),
        inertial_stress=0.0 * sigma,
        area=1e-4,
    )
    assert found.covered == pytest.approx(kept / 100)
    assert found.nearly_empty is empty
    assert ("kolsky identify" in found.sentence) is empty


# Corrections


def flyer_path():
    """Jerk 6 m/s^3 from 1 s on, its covariance 1: x = t^3, v = 3 t^2, a = 6 t."""
    return FlyerPath(np.array([1.0, 3.0]), np.array([6.0]), np.array([[1.0]]), 0.0, 1.0, 1.0, 1.0)


def test_strain_and_acceleration_under_a_path():
    e, rate, second = path_strain(flyer_path(), [0.5, 2.0], length=0.5)
    assert [h.value.tolist() for h in (e, rate, second)] == [[0.0, 2.0], [0.0, 6.0], [0.0, 12.0]]
    np.testing.assert_allclose([h.sigma[1] for h in (e, rate, second)], [2 / 6, 2 / 2, 2.0])
    assert [h.unit for h in (e, rate, second)] == ["1", "1/s", "1/s^2"]
    a = path_acceleration(flyer_path(), [0.5, 2.0])
    assert (a.value.tolist(), a.sigma.tolist()) == ([0.0, 6.0], [0.0, 1.0])
    with pytest.raises(ValueError, match="must be > 0 m"):
        path_strain(flyer_path(), [2.0], length=0.0)


def test_punching_adds_the_noise_of_both_forces():
    from test_remarks_and_quoted_values import reduction

    n = 50
    r = reduction(np.zeros(n), np.zeros(n), np.zeros(n), balanced=None)
    ramp = History(np.arange(n) * 100.0, np.full(n, 3.0), "N")
    r = replace(r, front_force=ramp, back_force=replace(ramp, sigma=np.full(n, 4.0)))
    specimen = Specimen(diameter=10e-3, length=4e-3, density=1000.0)
    compliance = punching_compliance(BAR, 5e-3)
    found, _ = correct_punching(r, specimen, BAR, BAR)
    noise_of = {"one wave": 2 * 4.0, "two waves": 2 * 3.0, "three waves": 5.0}
    for key, newtons in noise_of.items():
        assert found.strain[key].sigma[25] == pytest.approx(compliance * newtons / 4e-3)
        # A slope between means over 4 us, one diameter's travel: the noise over these 4 us.
        assert found.rate[key].sigma[25] == pytest.approx(compliance * newtons / 4e-3 / (4 * US))
        assert found.strain[key].value[25] == pytest.approx(-2 * compliance * 2500.0 / 4e-3)
        assert found.rate[key].value[25] == pytest.approx(-2 * compliance * 100.0 / US / 4e-3)


# Clocks and events of a flyer


def clocks(**changes):
    options = {
        "lag": 0.0, "sigma": 1e-6, "gain": 1.0, "sigma_gain": 0.01, "chi2_per_dof": 1.0,
        "frames": 20, "frame_interval": 8e-6, "at_edge": False,
    }  # fmt: skip
    return Synchronisation(**{**options, **changes})


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({"lag": 1.99e-6}, Agreement.AGREES),
        ({"lag": -2.01e-6}, Agreement.DIFFERS),
        ({"sigma": 3.99e-6}, Agreement.AGREES),
        ({"sigma": 4.01e-6}, Agreement.UNDECIDED),
        ({"at_edge": True}, Agreement.UNDECIDED),
        ({"chi2_per_dof": 24.9}, Agreement.AGREES),
        ({"chi2_per_dof": 25.1}, Agreement.UNLIKE),
    ],
)
def test_the_verdict_on_two_clocks(changes, verdict):
    assert clocks(**changes).agreement is verdict


def test_sigma_of_a_lag_is_that_of_a_fit():
    """x = a t^2 / 2 with free gain and zero; residuals widen the sigma and never narrow it."""
    t = 0.25 * US * np.arange(2400)
    frames = 8 * US * np.arange(40.0)
    truth = 1e4 * frames**2
    sign = np.where(np.arange(40) % 2, 1.0, -1.0)

    def found(scatter):
        motion = FlyerMotion(frames, truth + scatter * sign, np.full(40, 1e-6))
        curves = np.stack([1e4 * t**2, t])
        return _Fit(motion, t, curves, np.array([np.inf, 0.0]), 2e-3, 50 * US).solve()

    quiet, loud = found(0.5e-6), found(3e-6)
    J = np.column_stack([np.ones(40), truth, 2e4 * frames]) / 1e-6
    expected = np.sqrt(np.linalg.inv(J.T @ J)[2, 2])
    assert quiet.sigma == pytest.approx(expected, rel=0.02)  # chi-square below one does not narrow it
    assert loud.chi2_per_dof == pytest.approx(9.0 * 40 / 37, rel=0.1)
    assert loud.sigma == pytest.approx(expected * np.sqrt(loud.chi2_per_dof), rel=0.02)


def test_a_moving_average_lowers_the_noise_by_its_samples_and_memory():
    signal = Signal(0.0, 1.0, np.arange(20.0), 3.0, "N", "x", memory=2.0)
    t, value, sigma = moving_average(signal, 8.0)  # 2 round(4) + 1 = 9 samples
    assert (t[0], value[0], t.size) == (4.0, pytest.approx(4.0), 12)
    assert sigma == pytest.approx(3.0 * np.sqrt(2.0 / 9.0))


@pytest.mark.parametrize(("height", "found"), [(2.9, False), (3.1, True)])
def test_an_impact_is_three_times_the_excursions_of_the_flight(height, found):
    """In flight the signal steps by 1 N about its past mean; later once by more."""
    n = 200
    value = np.zeros(n)
    value[70:100:10] = 1.0
    value[150:] = height
    event = first_jump(Signal(0.0, US, value, 1e-3, "N"), 100 * US, 0.0, 20 * US)
    assert (event is not None) is found
    if found:
        assert event.time == pytest.approx(149.5 * US)
        assert event.sigma == pytest.approx(US / np.sqrt(12))


@pytest.mark.parametrize(("height", "found"), [(7.9, False), (8.1, True)])
def test_an_impact_is_eight_sigmas_at_least(height, found):
    value = np.where(np.arange(200) >= 150, height, 0.0)
    assert (first_jump(Signal(0.0, US, value, 1.0, "N"), 100 * US, 0.0, 20 * US) is not None) is found


@pytest.mark.parametrize(
    ("depth", "sigma", "found"), [(5.5, 1e-3, True), (4.5, 1e-3, False), (5.5, 5.0, False)]
)
def test_a_dip_is_a_twentieth_of_the_drive_and_five_sigmas(depth, sigma, found):
    """Driven by 100 N until 100 us; the joint pulls until 130 us, less and less."""
    t = US * np.arange(300.0)
    value = np.interp(t, [0, 10 * US, 90 * US, 100 * US, 110 * US, 130 * US], [0, 100, 100, 0, -depth, 0])
    event = end_of_dip(Signal(0.0, US, value, sigma, "N"), 105 * US, 250 * US, 4 * US)
    assert (event is not None) is found
    if found:
        assert event.time == pytest.approx(130 * US, abs=1.5 * US)
        assert event.sigma == pytest.approx(4 * US / np.sqrt(12), rel=0.02)  # of the average's span, at least


def test_push_back_is_half_the_peak_with_the_scatter_over_the_slope():
    t = US * np.arange(400.0)
    value = np.interp(t, [0, 100 * US, 300 * US], [0, 100, 0])
    force = Signal(0.0, US, value, 0.5, "N")
    arrest, none = Event("arrest", 110 * US, US, "x"), Event("second impact", None, None, "x")
    found = find_push_back(arrest, none, force, 5 * US)
    # Five samples averaged: the peak is 99.2 N, the noise 0.5 / sqrt(5) N.
    assert found.time == pytest.approx((300 - 99.2) * US, abs=1e-9)
    assert found.sigma == pytest.approx(0.5 / np.sqrt(5) / 0.5e6)
    assert find_push_back(replace(arrest, time=None), none, force, 5 * US).time is None
    early = find_push_back(arrest, replace(none, time=150 * US), force, 5 * US)
    assert "does not fall to half" in early.how


def test_a_kink_is_weighed_against_what_is_left():
    """Exact data with alternating residuals of two sigmas: the gain and the sigma take them into account."""
    t = np.linspace(0.0, 1.0, 61)
    clean = 1.0 + 4.0 * np.maximum(t - 0.5, 0.0)
    ripple = 0.02 * np.where(np.arange(61) % 2, 1.0, -1.0)
    options = {"degree": 0, "power": 1, "begins": True}
    small = find_kink(t, clean + 1e-9 * ripple, np.full(61, 0.01), (0.2, 0.8), **options)
    large = find_kink(t, clean + ripple, np.full(61, 0.01), (0.2, 0.8), **options)
    # Straight line with free height: what a kink takes away, in sigmas squared; three unknowns.
    fall = np.sum((clean - clean.mean()) ** 2) / 0.01**2
    assert small.gain == pytest.approx(fall, rel=1e-3)
    growth = 61 * 4 / 58
    assert large.gain == pytest.approx(fall / growth, rel=0.02)
    assert large.sigma == pytest.approx(small.sigma * np.sqrt(growth), rel=0.05)
    J = np.column_stack([np.ones(61), np.maximum(t - 0.5, 0.0), -4.0 * (t > 0.5)]) / 0.01
    assert small.sigma == pytest.approx(np.sqrt(np.linalg.inv(J.T @ J)[2, 2]), rel=0.05)
    assert small.change == pytest.approx(4.0, rel=1e-3)
