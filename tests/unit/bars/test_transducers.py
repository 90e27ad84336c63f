"""Volts to newtons, the noise of a baseline, and bin means, compared with values calculated by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.bars.signals.transducers import bin_force, force_history, noise_correlation
from kolsky.base.apparatus import Transducer
from kolsky.base.records import ForceHistory, Recording

GAUGE = Transducer(sensitivity=0.01, compression_sign=1, full_scale=1.0)
OFFSET = 0.25


def recording(**changes):
    """40 samples of rest at 0.02 V +- 0.001 V, alternating, then 0.12 V; clock 0.25 s behind the shot's."""
    value = np.concatenate([0.02 + 0.001 * (-1.0) ** np.arange(40), np.full(20, 0.12)])
    time = 0.02 * np.arange(60) - OFFSET
    made = Recording(time=time, value=value, channel="CH2", unit="V", path=Path("scope.csv"), sha256="0" * 64)
    return replace(made, **changes)


def history(record=None, gauge=GAUGE, baseline=(0.0, 0.79)):
    return force_history(record or recording(), gauge, baseline=baseline, clock_offset=OFFSET)


def test_volts_become_newtons_on_the_shots_clock():
    force = history()
    np.testing.assert_allclose(force.time, 0.02 * np.arange(60), atol=1e-15)  # round-off
    np.testing.assert_allclose(force.force[40:], 10.0, rtol=1e-13)  # 0.1 V above rest / 0.01 V/N
    np.testing.assert_allclose(force.force[:2], [0.1, -0.1], rtol=1e-12)
    # Scatter +-0.001 V: sum of squares 40e-6, over 39, square root, over the sensitivity.
    np.testing.assert_allclose(force.sigma, np.sqrt(40e-6 / 39) / 0.01, rtol=1e-12)
    assert force.sigma.shape == force.force.shape


def test_compression_sign_turns_the_force_not_the_noise():
    negative = history(replace(recording(), value=-recording().value), replace(GAUGE, compression_sign=-1))
    np.testing.assert_allclose(negative.force, history().force, atol=1e-12)
    np.testing.assert_allclose(negative.sigma, history().sigma)


def values(row, value):
    changed = recording().value.copy()
    changed[row] = value
    return recording(value=changed)


def times(row, value):
    changed = recording().time.copy()
    changed[row] = value
    return recording(time=changed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"record": values(55, 1.0)}, r"1 samples reach full scale, the first 1 V.*< 1 V.*wider range"),
        ({"record": values(45, -1.2)}, r"the first -1.2 V"),
        ({"record": values(3, np.nan)}, r"must be finite, got nan at 3"),
        ({"record": times(7, recording().time[6])}, r"step of the time of .* must be in \(0, inf\) s"),
        ({"record": recording(unit="mV")}, r"unit must be 'V', got 'mV'"),
        ({"record": recording(time=np.arange(59.0))}, r"must have the shape \(59,\), got \(60,\)"),
        ({"record": recording(value=np.full(60, 0.02))}, r"all 40 baseline samples are 0.02 V"),
        ({"baseline": (0.0, 0.375)}, r"holds 19 samples, at least 20"),
        ({"baseline": (0.5, 0.1)}, r"must start before it ends"),
    ],
)
def test_bad_input_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        history(**change)


def test_twenty_baseline_samples_are_enough():
    # Samples 0 ... 19; their time 0.38 s is the 20th.
    assert history(baseline=(0.0, 0.385)).force.size == 60


def test_noise_correlation():
    # 40 alternating values e, -e: 39 products -e^2 over 40 squares.
    assert noise_correlation(history(), (0.0, 0.79)) == pytest.approx(-39 / 40)
    rng = np.random.default_rng(3)
    n = 20_000
    white = rng.standard_normal(n)
    # e_k = 0.6 e_(k-1) + white has the lag-1 autocorrelation 0.6; its estimate scatters by 0.006.
    red = np.zeros(n)
    for k in range(1, n):
        red[k] = 0.6 * red[k - 1] + white[k]
    t = np.arange(n, dtype=float)
    for e, expected in ((white, 0.0), (red, 0.6)):
        force = ForceHistory(time=t, force=e, sigma=np.ones(n))
        assert noise_correlation(force, (0.0, n)) == pytest.approx(expected, abs=0.03)
    with pytest.raises(ValueError, match="holds 5 samples"):
        noise_correlation(ForceHistory(t, white, np.ones(n)), (0.0, 4.0))


def sampled(time, force=None, sigma=None):
    time = np.asarray(time, dtype=float)
    return ForceHistory(
        time=time,
        force=np.zeros(time.size) if force is None else np.asarray(force, dtype=float),
        sigma=np.ones(time.size) if sigma is None else np.asarray(sigma, dtype=float),
    )


def test_bins_by_hand():
    # Times 0 1 3 4 6, window 0 ... 6, width 3: edges at samples 0, 3, 6.
    bins = bin_force(sampled([0, 1, 3, 4, 6], [2, 4, 0, 6, 3], [1, 2, 3, 4, 5]), window=(0.0, 6.0), width=3.0)
    np.testing.assert_array_equal(bins.edges, [0.0, 3.0, 6.0])
    np.testing.assert_array_equal(bins.centres, [1.5, 4.5])
    # Trapezoids: (3 + 4) / 3 and (3 + 9) / 3.
    np.testing.assert_allclose(bins.mean, [7 / 3, 4.0])
    # Weights of the samples times 6: 1 3 2 and 1 3 2.
    np.testing.assert_allclose(bins.sigma, [np.sqrt(1 + 36 + 36) / 6, np.sqrt(9 + 144 + 100) / 6])
    np.testing.assert_array_equal(bins.n, [3, 3])


def test_bins_cover_the_window_on_recorded_times():
    time = 0.5e-6 * np.arange(-400, 2941)
    force = sampled(time, 3.0 + 2e4 * time)
    window = (29.2e-6, 1.4792e-3)
    bins = bin_force(force, window=window)
    assert np.isin(bins.edges, time).all()
    inside = time[(time >= window[0]) & (time <= min(window[1], time[-1]))]
    assert (bins.edges[0], bins.edges[-1]) == (inside[0], inside[-1])
    assert set(np.diff(bins.edges).round(9)) <= {8.0e-6, 8.5e-6}  # 16 or 17 sample intervals of 0.5 us
    # The trapezoid rule is exact for a straight line; sigma of n intervals: sqrt(n - 1/2) / n.
    np.testing.assert_allclose(bins.mean, 3.0 + 2e4 * bins.centres, rtol=1e-12)
    np.testing.assert_allclose(bins.sigma, np.sqrt(bins.n - 1.5) / (bins.n - 1), rtol=1e-12)


def test_bin_sigma_is_the_scatter_of_bin_means():
    rng = np.random.default_rng(6)
    time = np.arange(161.0)
    sigma = 0.5 + 0.01 * time
    draws = np.array(
        [
            bin_force(
                sampled(time, sigma * rng.standard_normal(161), sigma), window=(0, 160), width=16.0
            ).mean
            for _ in range(1000)
        ]
    )
    expected = bin_force(sampled(time, sigma=sigma), window=(0.0, 160.0), width=16.0).sigma
    # 1000 draws know a standard deviation to 2.2 %; four of them. Neighbours correlate by 1/62.
    np.testing.assert_allclose(draws.std(axis=0), expected, rtol=0.09)


@pytest.mark.parametrize(
    ("window", "width", "message"),
    [
        ((0.0, 5.0), 0.5, r"bin width 0.5 s must be between the largest sample interval 1 s"),
        ((0.0, 5.0), 6.0, r"the samples' span 5 s"),
        ((20.0, 25.0), 2.0, r"holds 0 force samples"),
        ((5.0, 0.0), 2.0, r"must start before it ends"),
    ],
)
def test_impossible_bins_are_refused(window, width, message):
    with pytest.raises(ValueError, match=message):
        bin_force(sampled(np.arange(11.0)), window=window, width=width)
