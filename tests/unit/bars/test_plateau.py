"""Plateau of a test: span, weights, flatness and verdict on both sides of each limit, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.bars.reduction.summary import summarise
from kolsky.bars.reduction.validity import (
    Flatness,
    Span,
    averaging_width,
    find_span,
    flatness,
    judge_plateau,
    pulse_length,
    weighted_mean,
)
from kolsky.base.apparatus import Bar, Specimen

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
