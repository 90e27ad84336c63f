"""c0 and gain from a pulse that passes two stations: known answers, correct sigma, invalid input."""

from dataclasses import replace

import numpy as np
import pytest
from bar_pulses import Pulse, carried, exact_wavenumber

from kolsky.bars.guides.propagation import wave_speed
from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar

TRUE = Bar(0.02, 1.5, 200e9 * 1.04, 7850.0, 0.29)
STATED = replace(TRUE, youngs_modulus=200e9)
"""2 % off in speed: what a handbook may do."""
STEP = 2e-7
TIME = STEP * np.arange(3500)
PULSE = Pulse(60e-6, duration=80e-6, rise=8e-6)
OMEGA = PULSE.frequencies(1e-3)
K = exact_wavenumber(OMEGA, radius=0.01, speed=TRUE.wave_speed, poisson=TRUE.poisson)


def strain(way, share, sigma, seed):
    noise = sigma * np.random.default_rng(seed).standard_normal(TIME.size)
    return Signal(0.0, STEP, share * carried(PULSE, TIME, OMEGA, np.exp(-1j * K * way)) + noise, sigma, "1")


def together(sigma=0.0, seed=0, gain=0.97):
    return (
        BarSignal(strain(0.4, 1.0, sigma, 2 * seed), STATED, 0.6, "incident"),
        BarSignal(strain(0.4 + 1.2, gain, sigma, 2 * seed + 1), STATED, 0.6, "transmission"),
    )


WINDOWS = {"incident_window": (80e-6, 330e-6), "transmitted_window": (300e-6, 600e-6)}


def test_known_speed_and_gain_through_dispersion():
    found = wave_speed(*together(), **WINDOWS)
    assert found.wave_speed == pytest.approx(TRUE.wave_speed, rel=1e-6)  # tail of 1e-5 outside the windows
    assert found.gain == pytest.approx(0.97, abs=2e-5)
    assert found.rms < 2e-4
    assert found.plain_rms > 50.0 * found.rms
    assert found.bar.youngs_modulus == pytest.approx(TRUE.youngs_modulus, rel=2e-6)
    assert found.plain_wave_speed < found.wave_speed  # the bulk of a dispersed pulse is late


@pytest.mark.slow
def test_sigma_is_the_scatter_of_repeats():
    runs = [wave_speed(*together(5e-3, seed), **WINDOWS) for seed in range(6)]
    errors = np.array([(run.wave_speed - TRUE.wave_speed, run.gain - 0.97) for run in runs])
    stated = np.array([(run.wave_speed_sigma, run.gain_sigma) for run in runs]).mean(axis=0)
    # Six runs tell a scatter to 30 %.
    np.testing.assert_allclose(np.sqrt(np.mean(errors**2, axis=0)) / stated, 1.0, atol=0.5)


def test_poisson_ratio_that_is_off_shows_in_speed_and_residual():
    found = wave_speed(*together(), **WINDOWS)
    off = wave_speed(*(replace(s, bar=replace(STATED, poisson=0.32)) for s in together()), **WINDOWS)
    assert off.rms > 3.0 * found.rms
    assert found.rms < min(found.rms_by_poisson)
    change = 0.03 * found.by_poisson
    assert off.wave_speed - found.wave_speed == pytest.approx(change, rel=0.3)  # quadratic terms


def test_refuses_what_does_not_fit():
    incident, transmission = together()
    with pytest.raises(ValueError, match="must be alike, diameter"):
        wave_speed(incident, replace(transmission, bar=replace(STATED, diameter=0.03)), **WINDOWS)
    with pytest.raises(ValueError, match="no wave speed within 10 %"):
        wave_speed(replace(incident, position=0.9), transmission, **WINDOWS)
    with pytest.raises(ValueError, match="later window"):
        wave_speed(incident, transmission, incident_window=(80e-6, 330e-6), transmitted_window=(0.3, 0.6))
    with pytest.raises(ValueError, match="20 or more"):
        wave_speed(
            incident, transmission, incident_window=(80e-6, 330e-6), transmitted_window=(300e-6, 302e-6)
        )
    slower = replace(transmission, strain=replace(transmission.strain, interval=1e-7))
    with pytest.raises(ValueError, match="intervals must be equal"):
        wave_speed(incident, slower, **WINDOWS)
