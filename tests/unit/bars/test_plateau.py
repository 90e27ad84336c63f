"""Plateau, validity window and repeats of a test, by hand and on both sides of each limit."""

from dataclasses import replace

import numpy as np
import pytest

from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.bars.reduction.repeated_tests import average, repeated_tests, rising
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.reduction.summary import summarise
from kolsky.bars.reduction.validity import (
    Flatness,
    Reason,
    Span,
    averaging_width,
    find_span,
    flatness,
    judge_plateau,
    pulse_length,
    validity,
    weighted_mean,
)
from kolsky.base.apparatus import Bar, Specimen

# Plateau of a test: span, weights, flatness and verdict on both sides of each limit, by hand.

STEP = 1e-6
N = 201
T = STEP * np.arange(N)
THIN = Bar(diameter=5e-3, length=2.0, youngs_modulus=200e9, density=8000.0)
"""A wave crosses it in one step: nothing is averaged."""
SPECIMEN = Specimen(diameter=4e-3, length=4e-3, density=1000.0)


def trapezoid(rise=20e-6, first=20e-6, last=180e-6):
    return np.interp(T, [first, first + rise, last - rise, last], [0.0, 1.0, 1.0, 0.0])


def reduction(stress, *, rate=1000.0, ratio=0.0, sigma=0.0):
    """A reduction alike in every analysis: stress, a rate, R."""
    rates = np.broadcast_to(np.asarray(rate, dtype=float), (N,))
    strain = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (rates[1:] + rates[:-1]))])
    three = [
        History(np.asarray(v, dtype=float), np.full(N, s), u)
        for v, s, u in ((strain, 0.0, "1"), (rates, sigma, "1/s"), (stress, sigma, "Pa"))
    ]
    keys = ("one wave", "two waves", "three waves")
    zero = History(np.zeros(N), np.zeros(N), "N")
    return Reduction(
        T, *(dict.fromkeys(keys, one) for one in three), zero, zero, zero, zero,
        np.broadcast_to(np.asarray(ratio, dtype=float), (N,)), (0.0, T[-1]),
    )  # fmt: skip


def faces(pulse=None):
    zero, names = np.zeros(N), ("incident", "reflected", "transmitted")
    shape = trapezoid() if pulse is None else pulse
    return FaceWaves(T, 1e-3 * shape, zero, zero, dict.fromkeys(names, 1e-6), THIN, THIN)


def judged(stress, **options):
    share = {key: options.pop(key) for key in ("share", "allowance") if key in options}
    return judge_plateau(reduction(stress, **options), faces(), **share)


def test_the_span_lies_where_the_stress_stands():
    """Flanks of 20 us cross 80 % at 36 and 164 us; a tenth of 128 us is left out at either end."""
    for sign in (1.0, -1.0):
        span = find_span(reduction(sign * 3e8 * trapezoid()))
        assert (span.first, span.last) == (pytest.approx(48.8e-6), pytest.approx(151.2e-6))
        # From 48.8 to 151.2 us: samples 50 to 150 stand for themselves, 49 and 151 for 0.7 us each.
        expected = np.zeros(N)
        expected[50:151] = 1.0
        expected[[49, 151]] = 0.7
        np.testing.assert_allclose(span.weight, expected, atol=1e-9)


def test_the_span_ends_with_the_largest_strain_and_its_ends_can_be_moved():
    rate = np.where(T < 100.5e-6, 1000.0, -1000.0)
    span = find_span(reduction(3e8 * trapezoid(), rate=rate))
    assert span.last == pytest.approx(100e-6 - 0.1 * 64e-6)  # from 36 to 100 us
    moved = find_span(reduction(3e8 * trapezoid()), shift=(3e-6, -2e-6))
    assert (moved.first, moved.last) == (pytest.approx(51.8e-6), pytest.approx(149.2e-6))


def test_a_yield_peak_does_not_set_the_level():
    """Twice the flow stress over 6 us: the median of what exceeds half of it is the flow stress."""
    stress = 3e8 * trapezoid() * np.where((T > 40e-6) & (T < 46e-6), 1.9, 1.0)
    assert find_span(reduction(stress)).last == pytest.approx(151.2e-6)


@pytest.mark.parametrize(
    ("ratio", "weight"), [(0.04, 1.0), (-0.05, 1.0), (0.06, 0.8), (-0.09, 0.2), (0.1, 0.0), (np.inf, 0.0)]
)
def test_a_sample_counts_by_its_balance(ratio, weight):
    ratios = np.where(np.arange(N) == 100, ratio, 0.0)
    assert find_span(reduction(3e8 * trapezoid(), ratio=ratios)).weight[100] == pytest.approx(weight)


def test_without_balance_or_stress_there_is_no_span():
    assert find_span(reduction(3e8 * trapezoid(), ratio=0.2)) is None
    assert find_span(reduction(np.zeros(N))) is None
    assert find_span(reduction(3e8 * trapezoid(), ratio=0.2), allowance=0.2) is not None


def test_weighted_means_and_their_noise():
    span = Span(0.0, 1.0, np.array([0.0, 1.0, 0.5]))
    mean, sigma = weighted_mean(
        History(np.array([9.0, 2.0, 4.0]), np.array([9.0, 3.0, 8.0]), "Pa"), span, alike=4.0
    )
    assert mean == pytest.approx(4.0 / 1.5)
    assert sigma == pytest.approx(2.0 * 5.0 / 1.5)  # sqrt(4 (3^2 + (0.5 8)^2)) / 1.5


def test_flatness_is_the_change_of_the_best_line_and_what_it_leaves():
    """100 + 20 x over the span with an alternation of 3: 20 / 110 and 3 / 110, its slope nearly nothing."""
    weight = np.zeros(N)
    weight[50:150] = 1.0
    span = Span(T[50] - 0.5 * STEP, T[149] + 0.5 * STEP, weight)
    x = (T - span.first) / (span.last - span.first)
    alternate = 3.0 * np.where((np.arange(N) // 1) % 2, 1.0, -1.0)
    found = flatness(100.0 + 20.0 * x + alternate, T, span)
    assert found.change == pytest.approx(20.0 / 110.0, rel=0.02)  # an alternation has a slope of 2 / n^2
    assert found.scatter == pytest.approx(3.0 / 110.0, rel=0.01)
    assert flatness(-(100.0 + 20.0 * x), T, span).change == pytest.approx(20.0 / 110.0)


@pytest.mark.parametrize(
    ("change", "scatter", "words"),
    [
        (0.2, 0.1, None),
        (-0.201, 0.0, "changes by -20 %"),
        (0.0, 0.101, "scatters by 10 %"),
        (float("nan"), 0.0, "changes"),
        (0.0, float("inf"), "scatters"),
    ],
)
def test_limits_of_flatness(change, scatter, words):
    fault = Flatness(change, scatter).fault
    assert fault is None if words is None else words in fault


def test_the_pulse_is_as_long_as_half_its_height():
    """Flanks of 20 us from 20 us and to 180 us: above half from 31 to 169 us, 30 and 170 being just half."""
    assert pulse_length(faces(), 1) == pytest.approx(138e-6)
    assert pulse_length(replace(faces(), incident=-faces().incident), 1) == pytest.approx(138e-6)
    assert averaging_width(faces()) == 1
    assert averaging_width(replace(faces(), transmission_bar=replace(THIN, diameter=20e-3))) == 4


@pytest.mark.parametrize(("balanced", "quoted"), [(40, False), (43, True)])
def test_a_plateau_is_as_long_as_the_declared_share_of_the_pulse(balanced, quoted):
    """30 % of 138 us are 41.4 us."""
    sample = np.arange(N)
    ratio = np.where((sample >= 80) & (sample < 80 + balanced), 0.0, 1.0)
    found = judged(3e8 * trapezoid(), ratio=ratio)
    assert (found.span is not None) is quoted
    assert found.balanced == pytest.approx(balanced * 1e-6)
    if not quoted:
        assert "balanced for 40 us, 29 % of the pulse of 138 us; the least is 30 %" in found.reason
    assert judged(3e8 * trapezoid(), ratio=ratio, share=0.2).span is not None


def test_stress_and_rate_are_judged_apart():
    falls = 1000.0 * (1.3 - 0.005 * np.arange(N))
    found = judged(3e8 * trapezoid(), rate=falls)
    assert found.span is not None
    assert found.stress_fault is None
    assert "the rate changes by" in found.rate_fault
    both = judged(3e8 * trapezoid() * (1.0 + 0.006 * np.arange(N)), rate=falls)
    assert both.span is None
    assert "the stress changes by" in both.reason
    summary = summarise(reduction(3e8 * trapezoid(), rate=falls, sigma=2.0), faces(), SPECIMEN)
    assert summary.mean_rate is None
    assert summary.mean_stress.value == pytest.approx(3e8)
    assert summary.mean_stress.sigma == pytest.approx(2.0 / np.sqrt(102.4), rel=0.01)  # 101 and two parts


def test_a_small_change_of_an_input_moves_the_mean_a_little():
    """R grows through its allowance along the plateau of a stress that rises by 20 %: no jump anywhere."""
    stress = 3e8 * trapezoid() * (1.0 + 0.001 * np.arange(N))
    means = []
    for scale in np.linspace(0.97, 1.03, 61):
        r = reduction(stress, ratio=scale * 0.15 * (np.arange(N) / 200.0) - 0.05)
        means.append(weighted_mean(r.stress["three waves"], find_span(r))[0])
    steps = np.diff(means)
    assert np.abs(steps).max() < 3.0 * np.abs(steps).mean()


# The validity window of synthetic tests with known reasons.

AREA = 7e-5
VALIDITY_STEP = np.arange(400)
VALIDITY_T = 1e-6 * VALIDITY_STEP


def case(front, back, added=0.0, noise=0.01):
    sigma = np.full(VALIDITY_T.size, noise)
    strain = History(VALIDITY_T / VALIDITY_T[-1] * 0.5, np.full(VALIDITY_T.size, 1e-4), "1")
    return {
        "front_force": History(front + 0.0 * VALIDITY_T, sigma, "N"),
        "back_force": History(back + 0.0 * VALIDITY_T, sigma, "N"),
        "strain": strain,
        "inertial_stress": (added + 0.0 * VALIDITY_T) / AREA,
        "area": AREA,
    }


def test_the_window_ends_where_the_faces_differ_and_begins_where_inertia_fades():
    front = np.where(VALIDITY_STEP < 300, 100.0, 110.0)
    added = np.where(VALIDITY_STEP < 80, 20.0, 1.0)
    found = validity(VALIDITY_T, **case(front, np.full(VALIDITY_T.size, 100.0), added))
    assert found.window == pytest.approx((80e-6, 299e-6))
    assert (found.start_reason, found.end_reason) == (Reason.INERTIA, Reason.BALANCE)
    assert found.covered == pytest.approx(219 / 399)
    assert not found.nearly_empty
    assert "inverse method" not in found.sentence
    assert "80.0 us to 299.0 us" in found.sentence
    assert found.counts[Reason.INERTIA] == pytest.approx(80 / 400)


def test_the_share_is_the_users():
    """Forces 8 % apart are out at 5 % and in at 10 %."""
    assert validity(VALIDITY_T, **case(104.0, 96.0)).window is None
    found = validity(VALIDITY_T, **case(104.0, 96.0), share=0.1)
    assert found.window == pytest.approx((0.0, VALIDITY_T[-1]))
    assert found.start_reason is Reason.RECORD
    assert found.end_reason is Reason.RECORD


def test_no_time_counts_and_the_message_says_what_to_do():
    found = validity(VALIDITY_T, **case(130.0, 70.0))
    assert found.window is None
    assert found.start_reason is Reason.BALANCE
    assert found.nearly_empty
    assert "kolsky identify" in found.sentence


def test_noise_is_told_from_imbalance_and_averaged_away():
    """2 N of noise on 50 N hide 5 %; over 20 samples they do not."""
    rng = np.random.default_rng(0)
    front, back = (50.0 + 2.0 * rng.standard_normal(VALIDITY_T.size) for _ in range(2))
    single = validity(VALIDITY_T, **case(front, back, noise=2.0))
    # Two sigmas are left out by 4.6 % of pairs of samples; the rest is the noise's.
    assert single.counts[Reason.BALANCE] < 0.09
    assert single.counts[Reason.NOISE] > 0.9
    averaged = validity(VALIDITY_T, **case(front, back, noise=2.0), average=20e-6)
    # 2 N sqrt(2) / sqrt(20) = 0.63 N, 1.3 % of the stress: three intervals in a thousand miss 5 %.
    assert averaged.covered > 0.9


def test_pulling_faces_are_not_valid():
    found = validity(VALIDITY_T, **case(-10.0, -10.0))
    assert found.window is None
    assert found.counts[Reason.VALID] == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"share": 1.0}, r"share must be in \(0, 1\), got 1"),
        ({"area": 0.0}, r"area must be in \(0, inf\) m\^2, got 0"),
        ({"average": 1.0}, "at least 3 are needed"),
        ({"inertial_stress": np.zeros(3)}, r"inertial_stress must have the shape \(400,\), got \(3,\)"),
    ],
)
def test_impossible_options(change, words):
    with pytest.raises(ValueError, match=words):
        validity(VALIDITY_T, **{**case(1.0, 1.0), **change})


# Repeated tests: mean, scatter and band by hand; coverage of the band.

X = np.linspace(0.0, 0.4, 81)


def averaged(*values, axis=X, shared=0.0):
    """Tests t0, t1, ... of these values, each over one axis or (axis, value)."""
    pairs = [value if isinstance(value, tuple) else (axis, value) for value in values]
    return average({f"t{k}": (x, y, shared + 0.0 * x) for k, (x, y) in enumerate(pairs)})


def test_three_straight_lines_by_hand():
    made = average({f"t{k}": (X, (10.0 + k) * X, np.full(X.size, 0.1 * abs(k))) for k in (-1, 0, 1)})
    np.testing.assert_allclose(made.axis, X, atol=1e-16)
    np.testing.assert_allclose(made.mean, 10.0 * X, rtol=1e-13)
    np.testing.assert_allclose(made.scatter, X, rtol=1e-12)  # of 9, 10, 11: 1
    np.testing.assert_allclose(made.sigma, X / np.sqrt(3.0), rtol=1e-12)
    np.testing.assert_allclose(made.shared, 0.1 * np.sqrt(2.0 / 3.0), rtol=1e-12)
    low, high = replace(made, shared=0.0 * X).band()
    np.testing.assert_allclose(high - made.mean, 4.3027 * X / np.sqrt(3.0), rtol=2e-5)  # t_95(2), printed
    np.testing.assert_allclose(made.mean - low, high - made.mean, rtol=1e-12)
    assert (made.count, made.remarks) == (3, ())


def test_what_all_tests_share_is_not_averaged_away():
    made = averaged(4.0 + 0.0 * X, 6.0 + 0.0 * X, shared=2.0)
    # Scatter sqrt(2), of the mean 1, and 2 that is shared.
    u, nu = made.combined()
    np.testing.assert_allclose(u, np.sqrt(5.0))
    np.testing.assert_allclose(nu, 25.0)  # Welch and Satterthwaite: 1 * (sqrt 5 / 1)^4
    np.testing.assert_allclose(made.band()[1] - 5.0, 2.0595 * np.sqrt(5.0), rtol=1e-4)  # t_95(25)
    same = averaged(X, X, shared=1.0)
    np.testing.assert_allclose(same.band()[1] - X, 1.95996, rtol=1e-5)  # no scatter: normal


def test_unequal_ranges_are_cut_and_said():
    made = averaged(2.0 * X, (X[10:51], 2.0 * X[10:51]))
    assert (made.axis[0], made.axis[-1]) == (X[10], X[50])
    assert made.axis.size == 41
    assert made.remarks == ("t0: 0 to 0.4 cut to the common range 0.05 to 0.25",)
    np.testing.assert_allclose(made.mean, 2.0 * made.axis, rtol=1e-13)


def test_interpolation_is_linear():
    made = averaged((X[::8], X[::8] ** 2), (X[::10], X[::10] ** 2))  # steps of 0.04 and of 0.05
    off = made.values[0] - made.axis**2
    # h^2 / 8 times the second derivative, 2, at most: in the middle of a step, at 0.1.
    assert off.min() > -1e-15
    assert off.max() == pytest.approx(0.04**2 / 4.0, rel=1e-9)


@pytest.mark.parametrize("tests", [2, 5])
def test_the_band_holds_the_truth_as_often_as_it_says(tests):
    rng = np.random.default_rng(tests)
    x = np.linspace(0.0, 1.0, 3)
    held = 0
    for _ in range(2000):
        low, high = averaged(*(x + rng.standard_normal() for _ in range(tests)), axis=x).band()
        held += bool(low[1] <= 0.5 <= high[1])
    assert held / 2000 == pytest.approx(0.95, abs=0.02)  # 0.5 %, four of them


def test_tests_without_a_common_range_are_refused():
    with pytest.raises(ValueError, match=r"no range in common: t1 starts at 1, t0 ends at 0\.4"):
        averaged(X, (X + 1.0, X))


@pytest.mark.parametrize(
    ("value", "first", "last"),
    [([0, 1, 2, 3], 0, 3), ([3, 1, 0, 1, 2, 2], 2, 4), ([0, 1, 0, 1, 2, 1], 2, 4), ([0, 1, 0, 1], 0, 1)],
)
def test_the_longest_rise(value, first, last):
    found = rising(np.array(value, dtype=float))
    assert (found.start, found.stop - 1) == (first, last)


def test_a_strain_without_rise_is_refused():
    with pytest.raises(ValueError, match="does not increase anywhere"):
        rising(np.array([2.0, 1.0, 1.0]))


BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=210e9, density=7800.0)
REPEATS_SPECIMEN = Specimen(diameter=10e-3, length=4e-3, density=1180.0)
TIME = 1e-6 * np.arange(200)


def repeats_reduction(strength, rate):
    """Balanced test at one rate after a ramp, unloaded at the end."""
    shape = np.interp(TIME, [10e-6, 30e-6, 150e-6, 170e-6, 199e-6], [0.0, 1.0, 1.0, -0.1, -0.1])
    reflected = -rate * shape * REPEATS_SPECIMEN.length / (2.0 * BAR.wave_speed)
    area = np.pi / 4.0 * BAR.diameter**2
    transmitted = strength * shape * REPEATS_SPECIMEN.area / (BAR.youngs_modulus * area)
    return reduce(
        FaceWaves(
            TIME,
            incident=transmitted - reflected,
            reflected=reflected,
            transmitted=transmitted,
            sigma={"incident": 1e-7, "reflected": 1e-7, "transmitted": 1e-7},
            incident_bar=BAR,
            transmission_bar=BAR,
        ),
        REPEATS_SPECIMEN,
    )


def test_reductions_of_repeated_tests():
    made = repeated_tests({"a": repeats_reduction(100e6, 1000.0), "b": repeats_reduction(120e6, 1200.0)})
    flat = (made.axis > 0.05) & (made.axis < 0.11)
    np.testing.assert_allclose(made.mean[flat], 110e6, rtol=1e-9)
    np.testing.assert_allclose(made.scatter[flat], 20e6 / np.sqrt(2.0), rtol=1e-9)
    single = repeats_reduction(100e6, 1000.0).stress["three waves"].sigma[0]
    np.testing.assert_allclose(made.shared, single, rtol=1e-12)
    np.testing.assert_allclose(made.combined()[0][flat], np.hypot(10e6, single), rtol=1e-9)
    # t_95 = 12.706 with one degree of freedom; what is shared raises the degrees by 1e-6 here.
    np.testing.assert_allclose(made.band()[1][flat] - 110e6, 12.706 * 10e6, rtol=1e-3)
    # Constant rate from 30 to 150 us, ramps half of 20 us: 0.130 and 0.156; the strain falls behind 168 us.
    assert made.axis[-1] == pytest.approx(0.5 * 1000 * 20e-6 + 1000 * 120e-6 + 0.5 * 1000 * 18.2e-6, rel=2e-3)
    assert [remark[:20] for remark in made.remarks] == [
        "a: loading from stra",
        "b: loading from stra",
        "b: 0 to 0.1669 cut t",
    ]


def test_one_test_has_no_mean():
    with pytest.raises(ValueError, match="at least 2 tests, got 1"):
        repeated_tests({"a": repeats_reduction(100e6, 1000.0)})
