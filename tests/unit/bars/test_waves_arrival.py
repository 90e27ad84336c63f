"""Arrivals of pulses: bias and scatter, first rises, fine alignment, and the windows of the three pulses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from barshots import STRESS, bar_shot
from elastic_layer import ALUMINIUM, Layer

from kolsky.bars.audit import Switches
from kolsky.bars.records import BarSignal, Signal, Windows
from kolsky.bars.reduction.windows import (
    Alignment,
    alignments,
    check_windows,
    delays,
    find_windows,
    incident_arrival,
    usable_limits,
)
from kolsky.bars.signals.arrival import find_arrival, first_rise, low_level, moving_mean
from kolsky.base.apparatus import Bar
from kolsky.shot.waves import waves

# Arrival of a pulse: bias and scatter over noise and counts, and records without an arrival.

STEP = 80e-9
AVERAGE = 3.9e-6  # a bar of 20 mm


def pulse(time, start, rise, *, rounded=False, hold=250e-6):
    """A pulse of height 1 with straight flanks, or those of a raised cosine."""
    up = np.clip((time - start) / rise, 0.0, 1.0)
    down = np.clip((time - start - hold) / rise, 0.0, 1.0)
    if rounded:
        up, down = (0.5 * (1.0 - np.cos(np.pi * x)) for x in (up, down))
    return up - down


def signal(value, sigma, name="incident gauge"):
    return Signal(0.0, STEP, value, sigma, "1", name)


def arrivals(noise, count, *, rise=15e-6, rounded=False, sign=1, repeats=60):
    """Errors of time and onset [s], and the sigmas said, over random noise and fractions of a sample."""
    rng = np.random.default_rng(11)
    time = STEP * np.arange(7000)
    errors, onsets, sigmas = [], [], []
    for start in 150e-6 + 1e-6 * rng.uniform(size=repeats):
        value = sign * pulse(time, start, rise, rounded=rounded) + noise * rng.normal(size=time.size)
        if count:
            value = count * np.round(value / count + rng.uniform())
            value -= value[:1500].mean()
        sigma = float(np.hypot(noise, count / np.sqrt(12)))
        found = find_arrival(signal(value, sigma), sign=sign, average=AVERAGE)
        errors.append(found.time - start)
        onsets.append(found.onset - start)
        sigmas.append(found.sigma)
    return np.array(errors), np.array(onsets), np.array(sigmas)


# Counts of the epoxy shots, 12.5 and 24.8 microstrain, on pulses of 465 and 930 microstrain: 0.027. Their
# noise is 0.010 and 0.017 of the pulse.
@pytest.mark.parametrize("noise", [0.002, 0.01, 0.03, 0.1])
@pytest.mark.parametrize("count", [0.0, 0.027])
def test_a_straight_flank_has_no_bias_and_the_scatter_said(noise, count):
    errors, _, sigmas = arrivals(noise, count)
    said = np.sqrt((sigmas**2).mean())
    # Mean of 60 with 3.5 standard errors; a standard deviation of 60 has 9 % scatter. Below a quarter of a
    # count the count decides, and the sigma is that of a baseline anywhere in it: an upper bound.
    assert abs(errors.mean()) < 3.5 * errors.std() / np.sqrt(60) + 0.02e-6
    assert errors.std() < 1.35 * said
    if noise > 0.25 * count:
        assert errors.std() > 0.65 * said


@pytest.mark.parametrize("rise", [10e-6, 30e-6])
def test_a_rounded_foot_is_late_by_its_share_of_the_rise(rise):
    """The line through 20 % to 60 % of a raised cosine meets 0 at 0.168 of the rise, at every noise."""
    late = [arrivals(noise, 0.0, rise=rise, rounded=True)[0].mean() for noise in (0.0, 0.01, 0.03)]
    u = np.linspace(np.arccos(1 - 0.4), np.arccos(1 - 1.2), 2001) / np.pi  # where the cosine is 0.2 and 0.6
    slope, offset = np.polyfit(u, 0.5 * (1 - np.cos(np.pi * u)), 1)
    # Averaging over 3.9 us moves where the fit begins and ends, by 2 % of a rise of 10 us.
    np.testing.assert_allclose(late, -offset / slope * rise, atol=0.02 * 10e-6)


def test_the_onset_is_before_the_tangent_on_a_rounded_foot_and_late_with_noise():
    clean = arrivals(0.0, 0.0, rise=20e-6, rounded=True)
    noisy = arrivals(0.03, 0.0, rise=20e-6, rounded=True)
    assert 0.0 <= clean[1].mean() < 0.1 * clean[0].mean()
    assert clean[1].mean() < noisy[1].mean() < 0.25 * 20e-6


def test_a_negative_pulse_mirrors_a_positive_one():
    time = STEP * np.arange(7000)
    rng = np.random.default_rng(3)
    value = pulse(time, 151e-6, 15e-6) + 0.01 * rng.normal(size=time.size)
    a = find_arrival(signal(value, 0.01), sign=1, average=AVERAGE)
    b = find_arrival(signal(-value, 0.01), sign=-1, average=AVERAGE)
    assert (b.time, b.sigma, b.onset, b.end, b.level) == (a.time, a.sigma, a.onset, a.end, -a.level)
    assert a.level == pytest.approx(1.0, abs=0.01)  # of averages of 49 samples the largest of 5000 / 49
    assert a.rise_time == pytest.approx(15e-6, rel=0.03)
    # 95 % down the straight fall, widened by half the average.
    assert a.end == pytest.approx(151e-6 + 250e-6 + 0.95 * 15e-6, abs=AVERAGE)


def test_spikes_are_no_pulse():
    """Single counts eight sigmas high, as recorders make them, before the pulse."""
    time = STEP * np.arange(7000)
    rng = np.random.default_rng(3)
    value = pulse(time, 151e-6, 15e-6) + 0.01 * rng.normal(size=time.size)
    spiky = value.copy()
    spiky[300:1500:200] += 0.08
    a, b = (find_arrival(signal(v, 0.01), sign=1, average=AVERAGE) for v in (value, spiky))
    assert b.time == pytest.approx(a.time, abs=1e-12)
    assert b.onset == pytest.approx(a.onset, abs=2e-6)


def test_there_is_none_in_noise():
    """50 records of 560 us of noise alone: none has a pulse, and the message says what was there."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        with pytest.raises(
            ValueError, match=r"incident gauge: no positive pulse: the largest average .* \(6 st"
        ):
            find_arrival(signal(0.01 * rng.normal(size=7000), 0.01), sign=1, average=AVERAGE)


@pytest.mark.parametrize(
    ("value", "sign", "message"),
    [
        (np.zeros(7000), 1, "no positive pulse: the largest average over 3.9e-06 s is 0"),
        (-pulse(STEP * np.arange(7000), 150e-6, 15e-6), 1, "no positive pulse.* its declared sign"),
        (np.ones(7000), 1, "the pulse is there at the first sample.* a longer pre-trigger"),
        (np.zeros(100), 1, "100 samples between 0 s and .* are too few .* at least 196 are needed"),
        (np.zeros(7000), 2, r"the sign of a pulse = 2 must be \+1 or -1"),
    ],
)
def test_refusals(value, sign, message):
    with pytest.raises(ValueError, match=message):
        find_arrival(signal(value, 0.001), sign=sign, average=AVERAGE)


def test_moving_mean_by_hand():
    value = np.array([1.0, 2.0, 6.0, 3.0, 5.0])
    np.testing.assert_allclose(moving_mean(value, 3), [1.5, 3.0, 11 / 3, 14 / 3, 4.0])
    np.testing.assert_allclose(moving_mean(value, 2), [1.5, 4.0, 4.5, 4.0, 5.0])
    np.testing.assert_allclose(moving_mean(value, 1), value)


# First rises of pulses: on straight flanks, on feet with two slopes, and with wrong distances.

FIRST_RISE_STEP = 1e-7
T = FIRST_RISE_STEP * np.arange(5000)
SCENE = replace(Layer(first=ALUMINIUM, gauges=(0.7, 0.5)), modulus=0.5e9)


def first_rise_signal(value, sigma=0.0, memory=1.0):
    return Signal(0.0, FIRST_RISE_STEP, value, sigma, "1", "gauge", memory)


def ramp(first, rise, last=400e-6):
    return np.interp(T, [first, first + rise, last, last + rise], [0.0, 1.0, 1.0, 0.0])


def test_a_straight_flank_passes_a_twentieth_of_its_level():
    """From 100 us on over 20 us: 5 % are passed at 101 us, whatever the sign."""
    for sign in (1, -1):
        found = first_rise(first_rise_signal(sign * ramp(100e-6, 20e-6)), sign=sign, average=4e-7)
        assert found.time == pytest.approx(
            101e-6, abs=FIRST_RISE_STEP
        )  # an average of four samples is not centred
        assert found.level == pytest.approx(0.05)
        assert found.sigma == pytest.approx(FIRST_RISE_STEP / np.sqrt(12.0))


def test_noise_raises_the_level_and_is_in_the_sigma():
    """Sigma 0.02 over averages of 4, memory 2: 0.02 sqrt(2 / 4), six of which are 0.085; slope 1 / 20 us."""
    noisy = first_rise_signal(ramp(100e-6, 20e-6), sigma=0.02, memory=2.0)
    noise = 0.02 * np.sqrt(0.5)
    assert low_level(noisy, 1.0, 4e-7) == pytest.approx(6.0 * noise)
    assert low_level(noisy, 10.0, 4e-7) == pytest.approx(0.5)
    found = first_rise(noisy, sign=1, average=4e-7)
    assert found.level == pytest.approx(6.0 * noise)
    assert found.sigma == pytest.approx(np.hypot(noise * 20e-6, FIRST_RISE_STEP / np.sqrt(12.0)), rel=1e-6)


def test_a_plastic_flank_is_not_extrapolated():
    """A tenth of the level from 100 us on and the rest from 110 us: the tangent says 108 us, the rise 101."""
    value = 0.1 * ramp(100e-6, 2e-6) + 0.9 * ramp(110e-6, 20e-6)
    assert first_rise(first_rise_signal(value), sign=1, average=4e-7).time == pytest.approx(
        101e-6, abs=2 * FIRST_RISE_STEP
    )


def test_what_does_not_rise_is_not_found():
    pulse = first_rise_signal(ramp(100e-6, 20e-6), sigma=1e-3)
    options = {"sign": 1, "average": 4e-7}
    assert first_rise(pulse, **options, after=0.0, before=90e-6) is None
    assert first_rise(pulse, **options, after=110e-6, before=300e-6) is None  # there from the beginning
    assert first_rise(pulse, **options, smallest=1.1) is None
    assert first_rise(pulse, **options, level=1.1) is None
    assert first_rise(pulse, sign=-1, average=4e-7, before=300e-6) is None
    assert first_rise(pulse, **options, after=0.0, before=5e-7) is None
    found = first_rise(pulse, **options, level=0.5)
    assert found.time == pytest.approx(110e-6, abs=FIRST_RISE_STEP)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["compression", "tension"])
def test_pulses_that_come_when_they_must_have_small_offsets(sign):
    scene = SCENE if sign > 0 else SCENE.pulled()
    first, second = scene.signals(noise=1e-6)
    for check in check_windows(first, second, tension=sign < 0):
        assert check.offset > -check.offset_sigma
    reflected, _ = check_windows(first, second, tension=sign < 0)
    assert reflected.offset / reflected.offset_sigma < 1.0
    rise = incident_arrival(first, tension=sign < 0).rise_time
    across = ALUMINIUM.diameter / ALUMINIUM.wave_speed
    # Noise is next to nothing.
    assert reflected.offset_sigma == pytest.approx(np.hypot(0.4 * across, 0.05 * rise), rel=0.05)


@pytest.mark.parametrize("by", [-0.2, -0.06, 0.06, 0.2])
def test_a_wrong_distance_of_the_incident_gauge_is_seen_both_ways(by):
    """2 x 0.2 m / c0 are 79 us: far outside where the pulse is due, and it is found there."""
    first, second = SCENE.signals(noise=1e-6)
    right = check_windows(first, second)[0]
    wrong = check_windows(replace(first, position=first.position + by), second)[0]
    assert wrong.offset - right.offset == pytest.approx(-2.0 * by / ALUMINIUM.wave_speed, abs=0.3e-6)
    assert abs(wrong.offset) > 10.0 * wrong.offset_sigma


def test_a_transmission_gauge_declared_too_far_is_seen():
    first, second = SCENE.signals(noise=1e-6)
    right = check_windows(first, second)[1]
    wrong = check_windows(first, replace(second, position=second.position + 0.06))[1]
    assert wrong.offset - right.offset == pytest.approx(-0.06 / SCENE.second.wave_speed, abs=0.3e-6)


# Fine alignment for records whose pulses arrive later than distance and wave speed predict.

BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=200e9, density=8000.0)


def station(side: str, position: float) -> BarSignal:
    return BarSignal(Signal(0.0, 1e-7, np.zeros(4), 0.0, "1"), BAR, position, side)


def test_an_aligned_wave_stays_where_it_was_seen():
    """A gauge 5 mm farther than declared predicts 2 us more; the aligned wave does not follow."""
    aligned = {
        "reflected": Alignment("reflected", 3e-6, 400e-6, 0.2e-6),
        "transmitted": Alignment("transmitted", -1e-6, 300e-6, 0.3e-6),
    }
    assert delays({}, station("incident", 1.0), station("transmission", 0.5), {}) == (0.0, 0.0)
    as_declared = delays(aligned, station("incident", 1.0), station("transmission", 0.5), {})
    assert as_declared == pytest.approx((3e-6, -1e-6), abs=1e-15)
    farther = delays(aligned, station("incident", 1.005), station("transmission", 0.5), {})
    assert farther == pytest.approx((1e-6, -2e-6), abs=1e-15)
    moved = delays(
        aligned, station("incident", 1.0), station("transmission", 0.5), {"alignment, reflected wave": 0.2e-6}
    )
    assert moved == pytest.approx((3.2e-6, -1e-6), abs=1e-15)


def check(delay: float | None, sigma: float = 0.4e-6):
    seen = None if delay is None else SimpleNamespace(sigma=sigma, time=500e-6 + delay)
    return SimpleNamespace(predicted=500e-6, observed=seen, delay=delay, reason="nothing there")


def test_the_uncertainty_is_that_of_both_arrivals():
    arrival = SimpleNamespace(time=100e-6, sigma=0.3e-6)
    found, missing = alignments(arrival, (check(2e-6), check(None)), Switches())
    assert found["reflected"].sigma == pytest.approx(0.5e-6)
    assert (found["reflected"].late, found["reflected"].way) == (2e-6, pytest.approx(400e-6))
    assert missing == {"transmitted": "no transmitted pulse is found: nothing there"}
    with pytest.raises(ValueError, match="transmitted wave cannot be aligned"):
        alignments(arrival, (check(2e-6), check(None)), Switches({"transmitted alignment": True}))


def test_a_wrong_distance_is_aligned_away(tmp_path):
    """The incident gauge is declared 10 mm too near: its reflection comes 4 us late."""

    def run(name: str, corrections: str):
        folder = bar_shot(tmp_path / name, corrections=f"punching = false{corrections}")
        text = (folder / "shot.toml").read_text()
        (folder / "shot.toml").write_text(text.replace('"1000 mm"', '"990 mm"'))
        return waves(folder)

    off = run("off", "")
    on = run("on", ', "reflected alignment" = true, "transmitted alignment" = true')
    log = {c.name: c for c in off.corrections}
    entry = log["alignment, reflected wave"]
    assert not entry.applied
    assert "observed +4" in entry.reason
    # 4 us of a flank of 1500 (1 - 0.208) um/m in 20 us.
    assert entry.size == pytest.approx(4.0 / 20.0 * 1.5e-3 * (1.0 - 0.2083), rel=0.1)
    assert {c.name: c for c in on.corrections}["alignment, reflected wave"].applied
    first, second = ((r.front_force, r.back_force) for r in (off.reduction, on.reduction))
    # Bars of 62.8 MN: on the flanks the forces differ by what is misaligned, and no longer.
    apart = [np.abs(a.value - b.value)[: int(140e-6 / 1e-7)].max() for a, b in (first, second)]
    assert apart[1] < 0.35 * apart[0]
    assert on.budget.results["peak stress"][0] == pytest.approx(STRESS, rel=0.03)
    names = {row.quantity.name for row in on.budget.contributions}
    assert {"alignment, reflected wave", "alignment, transmitted wave"} < names


# Windows of the three pulses for exact waves with known times.

WINDOWS_SCENE = Layer(first=ALUMINIUM, gauges=(0.7, 0.5))


def travel(scene):
    return tuple(x / bar.wave_speed for bar, x in scene.stations)


@pytest.mark.parametrize("scene", [WINDOWS_SCENE, WINDOWS_SCENE.pulled()], ids=["compression", "tension"])
def test_windows_lie_where_the_waves_are(scene):
    first, second = scene.signals(noise=2e-6)
    windows = find_windows(first, second, tension=scene.sign < 0)
    x1, x2 = travel(scene)
    lead = 2 * ALUMINIUM.diameter / ALUMINIUM.wave_speed
    # Time 0 is the arrival at the specimen. The onset may be earlier than the tangent by some samples.
    for (begin, _), wave in zip(
        (windows.incident, windows.reflected, windows.transmitted), (-x1, x1, x2), strict=True
    ):
        assert wave - lead - 3e-6 < begin < wave - lead + 0.5e-6
    lengths = [b - a for a, b in (windows.incident, windows.reflected, windows.transmitted)]
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-12)
    pulse = 2 * scene.rise + scene.hold
    assert lengths[0] == pytest.approx(1.25 * pulse + lead, abs=5e-6)
    assert windows.source == "travel times"


def test_the_next_wave_ends_the_windows():
    """A transmission gauge near the free end: its own reflection is back after 2 (L - x) / c0."""
    scene = replace(WINDOWS_SCENE, second=replace(WINDOWS_SCENE.second, length=0.85))
    first, second = WINDOWS_SCENE.signals()
    second = replace(second, bar=scene.second)
    windows = find_windows(first, second)
    back = 2 * (0.85 - 0.5) / scene.second.wave_speed
    x2 = travel(scene)[1]
    assert windows.transmitted[1] < x2 + back
    assert windows.transmitted[1] > x2 + back - 6e-6  # one diameter's travel of the aluminium bar, 3.5 us
    limits = usable_limits(first, second)
    assert min(limits, key=lambda limit: limit.time).reason.endswith("far end of the transmission bar")


def test_a_long_pulse_overlaps_with_its_reflection():
    scene = replace(WINDOWS_SCENE, hold=300e-6)
    first, second = scene.signals()
    with pytest.raises(ValueError, match=r"they overlap\. It must be shorter than 2 x / c0\. Cure: a second"):
        find_windows(first, second)


def test_a_pulse_of_the_other_sign_is_not_taken():
    """A compressive shot declared one of tension: its reflected pulse is not taken for the incident one."""
    first, second = WINDOWS_SCENE.signals(noise=1e-6)
    with pytest.raises(
        ValueError, match=r"a pulse of compression comes first.* declared one of tension\. Cure"
    ):
        find_windows(first, second, tension=True)
    first, second = WINDOWS_SCENE.pulled().signals(noise=1e-6)
    with pytest.raises(ValueError, match=r"a pulse of tension comes first.* declared one of compression"):
        find_windows(first, second)


def test_distances_are_checked_against_what_is_seen():
    """A gauge that sits 20 mm from where it is declared: the reflected pulse is seen 2 x 20 mm / c0 off."""
    first, second = replace(WINDOWS_SCENE, modulus=0.5e9).signals(noise=1e-6)
    right = check_windows(first, second)
    # The specimen's own reflection begins with the incident pulse's slope; its foot is as straight.
    assert abs(right[0].delay) < 0.3e-6
    wrong = check_windows(replace(first, position=0.72), second)
    expected = -2 * 0.02 / ALUMINIUM.wave_speed
    assert wrong[0].delay - right[0].delay == pytest.approx(expected, abs=0.02e-6)  # of the noise in the tail
    assert "earlier than predicted" in wrong[0].reason
    # The transmitted wave comes a transit of the specimen later, 7.7 us, and rises in steps of two transits,
    # between which its tangent may meet the baseline half a transit early.
    transit = replace(WINDOWS_SCENE, modulus=0.5e9).transit
    assert 0.5 * transit < right[1].delay < 2 * transit


def test_nothing_transmitted_is_said():
    first, second = WINDOWS_SCENE.signals()
    silent = replace(second, strain=replace(second.strain, value=0.0 * second.strain.value, sigma=1e-6))
    _, transmitted = check_windows(first, silent)
    assert transmitted.observed is None
    assert np.isnan(transmitted.delay)
    assert "no positive pulse" in transmitted.reason


def test_windows_by_hand_are_kept():
    first, second = WINDOWS_SCENE.signals()
    hand = Windows((-150e-6, 0.0), (130e-6, 280e-6), (90e-6, 240e-6), source="shot file")
    assert find_windows(first, second, manual=hand) is hand


@pytest.mark.parametrize(
    ("hand", "message"),
    [
        (((0.0, -1e-6), (0.0, 1e-4), (0.0, 1e-4)), r"the incident window \[0\.0, -1e-06\] s must end after"),
        (
            ((-1e-4, 0.0), (0.0, 1.0), (0.0, 1e-4)),
            r"the reflected window .* leaves the record of incident ga",
        ),
        (((-1e-4, 0.0), (0.0, 1e-4), (-1.0, 1e-4)), r"the transmitted window .* leaves the record of transm"),
        (((0.0, 1e-4), (-1e-4, 0.0), (0.0, 1e-4)), r"begins at -0\.0001 s, before the incident one"),
        (((float("nan"), 0.0), (0.0, 1e-4), (0.0, 1e-4)), r"the incident window .* must end after it begins"),
    ],
)
def test_windows_by_hand_are_checked(hand, message):
    first, second = WINDOWS_SCENE.signals()
    with pytest.raises(ValueError, match=message):
        find_windows(first, second, manual=Windows(*hand, source="shot file"))


def test_stations_are_checked():
    first, second = WINDOWS_SCENE.signals()
    with pytest.raises(ValueError, match="is of the transmission bar, it must be of the incident bar"):
        find_windows(second, first)
    with pytest.raises(ValueError, match=r"= 1\.4 m must lie between 0 and the bar's length, 1\.4 m"):
        find_windows(replace(first, position=1.4), second)
    short = replace(second, strain=replace(second.strain, value=second.strain.value[:1500]))
    with pytest.raises(ValueError, match=r"transmission gauge: the record ends .* Cure: a longer record"):
        find_windows(first, short)
