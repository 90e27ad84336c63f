"""Gauge stations: zero, correlated noise, drift, opposed gauges, and rejected inputs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from monte_carlo import red_noise

from kolsky.bars.audit import Switches
from kolsky.bars.budget import merge_quantities, propagate
from kolsky.bars.signals.baseline import estimate_noise, measure_signal_zero, quantisation_step
from kolsky.bars.signals.bridge import Bridge, Linear
from kolsky.bars.signals.stations import bar_signal
from kolsky.base.apparatus import Bar
from kolsky.base.records import Recording

BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=210e9, density=7800.0)
BRIDGE = Bridge("quarter", gauge_factor=2.1, excitation=5.0, gain=500.0)
BASELINE = (0.0, 100e-6)
OFFSET = 20e-6
INTERVAL = 0.1e-6
NOISE = 2e-3
DRIFT = tuple(f"drift {k}" for k in (1, 2, 3, 4))


def recorded(strain, *, seed=0, noise=NOISE, offset=0.01, channel="CH1"):
    """Volts of a quarter bridge under a strain (tension positive), clock 20 us behind the shot's."""
    v = BRIDGE.volts(strain) + offset + noise * np.random.default_rng(seed).standard_normal(strain.size)
    time = INTERVAL * np.arange(strain.size) - OFFSET
    return Recording(time=time, value=v, channel=channel, unit="V", path=Path("scope.csv"), sha256="0" * 64)


def pulse(height, n=4000):
    t = INTERVAL * np.arange(n)
    return height * np.interp(t, [120e-6, 140e-6, 260e-6, 280e-6], [0.0, 1.0, 1.0, 0.0])


def station(recordings=None, calibration=BRIDGE, **changes):
    options = {"baseline": BASELINE, "clock_offset": OFFSET, "compression": -1} | changes
    position, side = options.pop("position", 1.0), options.pop("side", "incident")
    return bar_signal(recordings or [recorded(pulse(-1e-3))], calibration, BAR, position, side, **options)


def test_compression_is_positive_on_the_shots_clock():
    found, corrections, quantities = station()
    signal = found.strain
    assert (signal.start, signal.unit, signal.name) == (pytest.approx(0.0, abs=1e-18), "1", "incident gauge")
    assert signal.interval == pytest.approx(INTERVAL, rel=1e-12)
    sigma = NOISE * BRIDGE.strain_per_volt
    assert signal.sigma == pytest.approx(sigma, rel=0.09)  # 1001 samples know it to 2.2 %, four of them
    error = signal.value - pulse(1e-3)
    # Zero to sigma / sqrt(1001), noise amplified by the bridge's slope at 1e-3, GF strain / 1000: nothing.
    assert np.abs(error).max() < 5.5 * sigma
    assert abs(error.mean()) < 4.0 * sigma * np.sqrt(1 / 1001 + 1 / 4000)
    names = [q.name for q in quantities]
    assert names == [
        f"incident gauge, {what}" for what in ("gauge factor", "excitation", "gain", "zero", *DRIFT)
    ]
    zero = quantities[3]
    assert (zero.kind, zero.value) == ("A", 0.0)
    # Of white noise alone, whose memory is estimated to 15 %, and with the weakest drift that may be there.
    assert 0.65 * sigma / np.sqrt(1001) < zero.sigma < 12.0 * sigma / np.sqrt(1001)
    by_key = {c.key: c for c in corrections}
    assert by_key["bridge nonlinearity"].applied
    # Quarter bridge: GF strain / 2 of the strain, 0.1 % here.
    assert by_key["bridge nonlinearity"].size == pytest.approx(0.5 * 2.1 * 1e-6, rel=0.03)
    assert not by_key["baseline drift"].applied
    assert "not significant" in by_key["baseline drift"].reason


def test_sign_is_declared_not_guessed():
    positive = recorded(pulse(-1e-3))
    positive = replace(positive, value=-positive.value)
    one, other = station()[0], station([positive], compression=1)[0]
    np.testing.assert_array_equal(one.strain.value, other.strain.value)
    pulled = station(compression=1)[0]
    assert pulled.strain.value[2000] == pytest.approx(-1e-3, rel=0.02)


def test_nonlinearity_can_be_switched_off():
    off = station(switches=Switches({"bridge nonlinearity": False}))
    assert [c.applied for c in off.corrections if c.key == "bridge nonlinearity"] == [False]
    on = station().signal.strain.value[1500:2500].mean()
    # In compression the output is larger than its slope at zero says, by GF strain / 2.
    assert off.signal.strain.value[1500:2500].mean() / on == pytest.approx(
        1 + 1.05e-3, abs=2e-5
    )  # (GF strain)^2 = 4e-6


def test_opposed_gauges_are_averaged_and_bending_is_reported():
    bent = 0.2 * pulse(1e-3)
    pair = [recorded(pulse(-1e-3) - bent, seed=1), recorded(pulse(-1e-3) + bent, seed=2, channel="CH2")]
    found, corrections, quantities = station(pair)
    single = station()[0].strain.sigma
    assert found.strain.sigma == pytest.approx(single / np.sqrt(2.0), rel=0.13)  # 3.2 % of the ratio, four
    np.testing.assert_allclose(found.strain.value, pulse(1e-3), atol=5.5 * single / np.sqrt(2.0))
    np.testing.assert_allclose(found.bending, bent, atol=5.5 * single / np.sqrt(2.0))
    (entry,) = [c for c in corrections if c.key == "bending"]
    assert entry.applied
    assert "bending is 20" in entry.reason or "bending is 19.9" in entry.reason
    assert entry.size == pytest.approx(0.2e-3, rel=0.02)
    assert len(quantities) == 4 + len(DRIFT)  # one calibration, one gauge factor: their errors are the same
    apart = station(pair, [BRIDGE, BRIDGE], uncertainty={"gauge_factor": 0.01})
    assert [q.name for q in apart.quantities if "factor" in q.name] == [
        "incident gauge 1, gauge factor",
        "incident gauge 2, gauge factor",
    ]
    first = station(pair, switches=Switches({"bending": False})).signal
    np.testing.assert_allclose(first.strain.value, pulse(1.2e-3), atol=5.5 * single)


def test_opposed_gauges_with_a_sign_each():
    turned = recorded(pulse(1e-3), seed=2, channel="CH2")
    pair = [recorded(pulse(-1e-3), seed=1), turned]
    with pytest.raises(ValueError, match=r"disagree in sign: half their difference is \d+"):
        station(pair)
    assert station(pair, compression=[-1, 1]).signal.strain.value[2000] == pytest.approx(1e-3, rel=0.02)


def test_drift_is_seen_reported_and_taken_out():
    t = INTERVAL * np.arange(4000)
    drift = 2.0 * t / BRIDGE.strain_per_volt  # 2 per second: 0.2e-3 over the baseline
    record = recorded(pulse(-1e-3))
    record = replace(record, value=record.value - drift)
    left, corrections, quantities = station([record])
    (entry,) = [c for c in corrections if c.key == "baseline drift"]
    assert not entry.applied
    assert "significant at 1 %" in entry.reason
    assert "not significant" not in entry.reason
    assert entry.size == pytest.approx(2.0 * (399.9e-6 - 50e-6), rel=0.05)
    # What is left in is an uncertainty: a steady drift over three baselines lies within two of it.
    walk = sum(q.sigma**2 for q in quantities if "drift" in q.name)
    assert 0.5 * 2.0 * 325e-6 < np.sqrt(walk) < 2.0 * 325e-6
    # A walk of variance D t, over 299.9 us here, moves the mean of the baseline's 100 us by D T / 3.
    zero = next(q.sigma for q in quantities if q.name.endswith("zero"))
    assert zero == pytest.approx(np.sqrt(walk / 299.9e-6 * 100e-6 / 3.0), rel=0.02)
    fixed = station([record], switches=Switches({"baseline drift": True}))
    assert fixed.quantities[-1].sigma < 0.1
    off = fixed.signal.strain.value[3500:].mean()
    assert abs(off) < 4.0 * fixed.quantities[-1].sigma * 325e-6 + 1e-6
    assert left.strain.value[3500:].mean() == pytest.approx(2.0 * 325e-6, rel=0.05)


def test_budget_of_a_station():
    record = recorded(pulse(-1e-3))
    uncertainty = {"gauge_factor": 0.01, "excitation": 0.01, "gain": 1.0}
    made = station([record], uncertainty=uncertainty)

    def model(values):
        return {"strain": station([record], uncertainty=uncertainty, values=values).signal.strain.value}

    budget = propagate(model, merge_quantities(made.quantities), noise={"strain": made.signal.strain.sigma})
    np.testing.assert_array_equal(budget.value["strain"], made.signal.strain.value)
    relative = np.sqrt((0.01 / 2.1) ** 2 + (0.01 / 5.0) ** 2 + (1.0 / 500.0) ** 2)
    zero, *modes = (q.sigma for q in made.quantities[-1 - len(DRIFT) :])
    t = np.clip(INTERVAL * (np.arange(4000) - 1000) / (INTERVAL * 2999), 0.0, 1.0)
    drift = sum((s * np.sin((k + 0.5) * np.pi * t)) ** 2 for k, s in enumerate(modes))
    noise = made.signal.strain.sigma
    expected = np.sqrt((relative * made.signal.strain.value) ** 2 + zero**2 + drift + noise**2)
    # The bridge's nonlinearity, 1e-3, is in the sensitivities.
    np.testing.assert_allclose(budget.sigma("strain"), expected, rtol=3e-3)


def change(row, value):
    made = recorded(pulse(-1e-3))
    made.value[row] = value
    return [made]


def flat(first, last):
    made = recorded(pulse(-1e-3))
    made.value[first:last] = made.value.min()
    return [made]


def shifted(by):
    made = recorded(pulse(-1e-3))
    return [made, replace(made, time=made.time + by)]


def rounded():
    made = recorded(pulse(-1e-3))
    return [replace(made, time=made.time.round(6))]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recordings": change(5, np.nan)}, r"sample 5 is .*must be finite"),
        ({"recordings": [replace(recorded(pulse(-1e-3)), unit="1")]}, r"for 'V', the recording is in '1'"),
        ({"recordings": [recorded(pulse(-1e-3), noise=0.0)]}, r"all 1001 baseline samples are 0.01"),
        ({"recordings": flat(1500, 1510)}, r"stays at its extreme .* 10 samples from sample 1500 .*clipped"),
        ({"full_scale": 1.2}, r"samples reach full scale, the first -1\.2\d+ at sample \d+"),
        ({"full_scale": 0.0}, r"full_scale must be > 0, got 0"),
        ({"recordings": shifted(1e-7)}, r"opposed gauges CH1 and CH1 must have the same times"),
        ({"recordings": rounded()}, r"intervals off an even division, allowed is 0.01; a rounded"),
        ({"recordings": [recorded(pulse(-1e-3))] * 3}, r"one channel or two of opposed gauges, got 3"),
        ({"baseline": (0.0, 1.85e-6)}, r"holds 19 samples, at least 20"),
        ({"baseline": (1e-4, 0.0)}, r"must start before it ends"),
        ({"baseline": (0.0, 1.0)}, r"the record ends at 0.0003999 s"),
        ({"compression": 0}, r"compression must be \+1 or -1, got 0"),
        ({"compression": [1, 1]}, r"one for each of 1 channels, got 2"),
        ({"position": 2.5}, r"position must be in \(0, 2\] m, got 2.5"),
        ({"side": "input"}, r"side must be 'incident' or 'transmission', got 'input'"),
        ({"uncertainty": {"gauge": 0.1}}, r"uncertainty of 'gauge' has no effect"),
    ],
)
def test_bad_input_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        station(**changes)


def test_a_coarse_recorder_is_not_taken_for_clipped():
    # Codes of 20 mV on 2 mV noise: still for long on top of the pulse, but longer at rest.
    record = recorded(pulse(-1e-3), noise=8e-3)
    record = replace(record, value=0.02 * np.round(record.value / 0.02))
    made = station([record])
    assert made.signal.strain.value[2000] == pytest.approx(1e-3, rel=0.02)
    assert quantisation_step(record.value) == pytest.approx(0.02, rel=1e-9)
    # Rounding adds step / sqrt(12) in quadrature.
    expected = np.hypot(8e-3, 0.02 / np.sqrt(12.0)) * BRIDGE.strain_per_volt
    assert made.signal.strain.sigma == pytest.approx(expected, rel=0.1)


def test_noise_is_not_smaller_than_rounding():
    value = np.zeros(1000)
    value[::100] = 1.0  # all but still
    rest = measure_signal_zero(np.arange(1000.0), value, (0.0, 999.0), name="x")
    assert rest.step == 1.0
    assert rest.noise.sigma == pytest.approx(np.sqrt(1 / 12))


def test_uncertainty_of_a_mean_of_red_noise():
    # The AR(1) process e_k = 0.9 e_(k-1) + white: 1 + 2 sum rho = 1.9 / 0.1 = 19.
    rho = 0.9 ** np.arange(200.0)
    rng = np.random.default_rng(3)
    means, claimed, slopes, claimed_slopes = [], [], [], []
    t = np.arange(4000.0)
    for _ in range(300):
        rest = measure_signal_zero(t, red_noise(1.0, rho, 4000, rng), (0.0, 4000.0), name="x")
        means.append(rest.mean)
        claimed.append(rest.mean_sigma)
        slopes.append(rest.slope / rest.slope_sigma)
        claimed_slopes.append(rest.drifts)
    assert np.mean(claimed) == pytest.approx(np.sqrt(19 / 4000), rel=0.08)  # taper and trend take 5 %
    assert np.std(means) == pytest.approx(np.sqrt(19 / 4000), rel=0.17)  # 300 draws: 4.1 %, four of them
    assert np.std(slopes) == pytest.approx(1.05, rel=0.17)
    assert np.mean(claimed_slopes) < 0.04  # 1 % at the level of 1 %; 300 draws scatter by 0.6 %


def test_noise_of_too_few_or_equal_samples_is_refused():
    with pytest.raises(ValueError, match="at least 8 samples, got 3"):
        estimate_noise(np.ones(3))
    with pytest.raises(ValueError, match="all 9 samples are the same"):
        estimate_noise(np.zeros(9))


def test_recordings_that_are_strain_already():
    record = recorded(pulse(-1e-3))
    strain = replace(record, value=BRIDGE.strain_per_volt * record.value, unit="1")
    made = station([strain], Linear(1.0, unit="1"))
    assert made.signal.strain.value[2000] == pytest.approx(1e-3, rel=0.02)
    assert [c.key for c in made.corrections] == ["baseline drift"]
