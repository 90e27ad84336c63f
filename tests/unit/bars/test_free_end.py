"""Echoes from free far ends: one station a bar, records of closed form without dispersion."""

from dataclasses import replace

import numpy as np
import pytest
from barshots import INCIDENT, INTERVAL, RATE, SHARE, STRESS, bar_shot, ramp, write_scope

from kolsky.bars.guides.waveguide import ElasticWaveguide
from kolsky.bars.records import BarSignal, Signal, Windows
from kolsky.bars.reduction.separation import check_length, free_end_limits, without_echo
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.shot.waves import waves

SHORT = Bar(diameter=0.02, length=0.8, youngs_modulus=200e9, density=8000.0, poisson=0.0)
T = INTERVAL * np.arange(8000)


def station(value: np.ndarray, sigma: float = 0.0) -> BarSignal:
    return BarSignal(Signal(0.0, INTERVAL, value, sigma, "1"), SHORT, 0.5, "transmission")


def test_the_wave_comes_back_from_its_echoes():
    """300 mm to the end: an echo of the other sign 120 us later, and each of them has one."""
    wave = 1e-3 * ramp(T - 100e-6)
    echo = -1e-3 * ramp(T - 220e-6)
    guide = ElasticWaveguide(SHORT, dispersive=False)
    found = without_echo(station(wave + echo), guide, 100e3).strain.value
    # What is beyond 100 kHz at the trapezoid's corners is cut off in the echo: 3 % of its height.
    np.testing.assert_allclose(found, wave, atol=3e-5)
    assert np.abs(wave + echo - wave).max() == pytest.approx(1e-3)


def test_its_noise_is_that_of_every_pass():
    guide = ElasticWaveguide(SHORT, dispersive=False)
    strain = without_echo(station(np.zeros(8000), 1e-6), guide, 100e3).strain
    # The record lasts 2.5 round trips of 320 us: three passes, with the wave itself four parts.
    assert strain.sigma == pytest.approx(1e-6 * 2.0, rel=1e-12)


def test_windows_end_when_the_echo_is_back_at_the_specimen():
    long = replace(station(T), bar=replace(SHORT, length=2.0), side="incident")
    limits = free_end_limits(long, station(T))
    assert [limit.time for limit in limits] == pytest.approx([796e-6, 316e-6])  # round trips less 4 us
    fits = Windows((0.0, 310e-6), (0.0, 310e-6), (0.0, 310e-6), "shot file")
    check_length(fits, limits)
    with pytest.raises(ValueError, match=r"transmission bar is back at the specimen 0.000316 s"):
        check_length(replace(fits, transmitted=(0.0, 320e-6)), limits)


def record(folder, corrections: str):
    """A transmission bar of 800 mm: its echo overlaps the transmitted pulse after 120 of 150 us."""
    shot = bar_shot(folder, corrections=f"punching = false{corrections}")
    rng = np.random.default_rng(7)
    arrival = 200e-6
    first = INCIDENT * (ramp(T - arrival) - (1.0 - SHARE) * ramp(T - arrival - 400e-6))
    second = INCIDENT * SHARE * (ramp(T - arrival - 300e-6) - ramp(T - arrival - 420e-6))
    first, second = (1e3 * (x + 1e-6 * rng.standard_normal(T.size)) for x in (first, second))
    write_scope(shot / "scope.csv", ["t (s)", "inc (V)", "tra (V)"], [T, first, second])
    path = shot / "shot.toml"
    head, bar, rest = path.read_text().partition("[bars.transmission]")
    path.write_text(head + bar + rest.replace("2000 mm", "800 mm", 1))
    return shot


def test_a_short_bar_gives_the_whole_pulse(tmp_path):
    shortened = waves(record(tmp_path / "off", ""))
    whole = waves(record(tmp_path / "on", ', "free end" = true'))
    assert shortened.reduction.time[-1] < 118e-6  # ended by the echo
    assert whole.reduction.time[-1] > 150e-6
    late = (whole.reduction.time > 118e-6) & (whole.reduction.time < 128e-6)
    assert np.mean(whole.reduction.stress["one wave"].value[late]) == pytest.approx(STRESS, rel=0.02)
    assert np.mean(whole.reduction.rate["three waves"].value[late]) == pytest.approx(RATE, rel=0.02)
    log = {c.name: c for c in whole.corrections}
    assert log["free end, transmitted wave"].applied
    # Without it the echo takes all of the transmitted strain away.
    assert log["free end, transmitted wave"].size == pytest.approx(INCIDENT * SHARE, rel=0.1)
    assert not {c.key: c for c in shortened.corrections}["free end"].applied


def test_windows_by_hand_that_hold_the_echo_are_refused(tmp_path):
    shot = record(tmp_path / "shot", ', "free end" = true')
    text = (shot / "shot.toml").read_text()
    spans = [f'{name} = ["{at} us", "{at + 330} us"]' for name, at in WINDOWS.items()]
    (shot / "shot.toml").write_text(text.replace("[uncertainty]", "\n".join(spans) + "\n[uncertainty]"))
    with pytest.raises(InputError, match="back at the specimen"):
        waves(shot)


WINDOWS = {"incident": 150, "reflected": 460, "transmitted": 460}
