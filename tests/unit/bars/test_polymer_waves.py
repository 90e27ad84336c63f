"""Propagation coefficient and modulus of a polymer bar: a Zener bar in closed form, tables, broken input."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bar_pulses import Pulse, carried

from kolsky.bars.guides.propagation import propagate
from kolsky.bars.guides.viscoelastic import Pass, fit_modulus, propagation_coefficient
from kolsky.bars.guides.waveguide import PronyModulus, TabulatedWaveguide, ViscoelasticWaveguide
from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar

BAR = Bar(0.02, 2.0, 5e9, 1190.0, 0.35)
ZENER = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
GUIDE = ViscoelasticWaveguide(BAR, ZENER)
STEP = 5e-7
TIME = STEP * np.arange(6000)
PULSE = Pulse(100e-6, duration=20e-6, rise=15e-6, ripple=0.0)
WAYS = (0.0, 2.0, 4.0)
PASSES = [Pass((50e-6 + way / 2160.0, 830e-6 + way / 2160.0), way, i) for i, way in enumerate(WAYS)]


@cache
def echoes(dispersive):
    omega = PULSE.frequencies(2.0 * TIME[-1])
    k = ViscoelasticWaveguide(BAR, ZENER, dispersive=dispersive).wavenumber(omega)
    return sum((-1) ** i * carried(PULSE, TIME, omega, np.exp(-1j * k * way)) for i, way in enumerate(WAYS))


def gauge(sigma=0.0, seed=0, dispersive=True):
    noise = sigma * np.random.default_rng(seed).standard_normal(TIME.size)
    return BarSignal(Signal(0.0, STEP, echoes(dispersive) + noise, sigma, "1"), BAR, 1.0, "incident")


@pytest.mark.parametrize("n", [2, 3])
def test_zener_bar_without_noise(n):
    found = propagation_coefficient(gauge(), PASSES[:n])
    omega = 2.0 * np.pi * found.frequency
    assert found.frequency[-1] > 15e3
    # Left is the tail cut off by the windows, below 1e-5 of a pass.
    np.testing.assert_allclose(found.wavenumber, GUIDE.wavenumber(omega), rtol=2e-4)
    np.testing.assert_allclose(found.modulus(), ZENER(omega), rtol=1e-4)
    assert found.tail < 1e-4


def test_a_thin_bar_against_the_closed_form():
    found = propagation_coefficient(gauge(dispersive=False), PASSES)
    omega = 2.0 * np.pi * found.frequency
    # Zener's modulus and k = omega (rho / E*)^(1/2), written out.
    modulus = 5.0e9 + 0.5e9 * 1j * omega * 12e-6 / (1.0 + 1j * omega * 12e-6)
    exact = omega * np.sqrt(1190.0 / modulus)
    np.testing.assert_allclose(found.wavenumber, exact, rtol=2e-4)
    np.testing.assert_allclose(found.modulus(geometric=False), modulus, rtol=1e-4)


def test_sigma_is_the_scatter():
    runs = [propagation_coefficient(gauge(1e-3, seed), PASSES[:2]) for seed in range(5)]
    n = min(run.frequency.size for run in runs)
    omega = 2.0 * np.pi * runs[0].frequency[:n]
    errors = np.array([(run.wavenumber[:n] - GUIDE.wavenumber(omega)) / run.sigma[:n] for run in runs])
    # Padded eightfold: some 25 independent components a run, 125 values: 6 %.
    assert np.sqrt(np.mean(errors.real**2)) == pytest.approx(1.0, abs=0.25)
    assert np.sqrt(np.mean(errors.imag**2)) == pytest.approx(1.0, abs=0.25)


def test_fitted_series_gives_the_zener_solid_back():
    fitted = fit_modulus(propagation_coefficient(gauge(1e-3), PASSES), [1.2e-6, 12e-6, 120e-6])
    assert fitted.rms < 1e-3
    omega = 2.0 * np.pi * np.array([1e3, 5e3, 15e3])
    np.testing.assert_allclose(fitted.modulus(omega), ZENER(omega), rtol=1e-3)  # noise of 1e-3 of the peak


def test_a_measured_bar_carries_a_pulse():
    found = propagation_coefficient(gauge(), PASSES[:2])
    slow = Pulse(300e-6, duration=300e-6, rise=150e-6, ripple=0.0)
    omega = slow.frequencies(2.0 * TIME[-1])
    here = Signal(0.0, STEP, carried(slow, TIME, omega), 0.0, "1")
    there = propagate(here, found.waveguide(), 0.8)
    exact = carried(slow, there.time, omega, np.exp(-0.8j * GUIDE.wavenumber(omega)))
    assert (
        np.abs(there.value - exact).max() < 2e-3
    )  # below 1 kHz the table knows no more than its first value


def test_prony_modulus_at_both_ends_and_its_dissipation():
    assert abs(ZENER(1e-3) - 5.0e9) < 1e3
    assert abs(ZENER(1e12) / ZENER.instantaneous - 1.0) < 1e-6
    # Largest loss of a Zener solid: tan delta = (E0 - E) / (2 (E0 E)^(1/2)).
    omega = np.geomspace(1e3, 1e7, 4001)
    loss = ZENER(omega)
    peak = (loss.imag / loss.real).max()
    assert peak == pytest.approx(0.5e9 / (2.0 * np.sqrt(5.5e9 * 5.0e9)), rel=1e-5)


def test_lossy_waves_fade_in_their_direction_and_mirror_in_frequency():
    omega = np.linspace(-5e5, 5e5, 101)
    k = GUIDE.wavenumber(omega)
    assert (k.imag <= 0.0).all()
    np.testing.assert_allclose(k, -np.conj(k[::-1]), rtol=1e-12, atol=1e-12)
    assert GUIDE.wavenumber(0.0) == 0.0
    assert GUIDE.stiffness(0.0).real == pytest.approx(5.0e9 * np.pi * 1e-4, rel=1e-12)


def test_refuses_broken_tables_and_series():
    f = np.array([1e3, 2e3])
    with pytest.raises(ValueError, match="ascend"):
        TabulatedWaveguide(BAR, f[::-1], np.full(2, 2000.0), np.zeros(2))
    with pytest.raises(ValueError, match="phase velocities"):
        TabulatedWaveguide(BAR, f, np.array([2000.0, -1.0]), np.zeros(2))
    with pytest.raises(ValueError, match="does not amplify"):
        TabulatedWaveguide(BAR, f, np.full(2, 2000.0), np.array([0.1, -0.1]))
    with pytest.raises(ValueError, match="known up to 2000 Hz"):
        TabulatedWaveguide(BAR, f, np.full(2, 2000.0), np.zeros(2)).wavenumber(1e6)
    with pytest.raises(ValueError, match="a modulus for each time"):
        PronyModulus(5e9, (1e9,), ())
    with pytest.raises(ValueError, match="> 0 and finite"):
        PronyModulus(5e9, (1e9,), (0.0,))


def test_refuses_passes_that_tell_nothing():
    with pytest.raises(ValueError, match="ascend from 0"):
        propagation_coefficient(gauge(), PASSES[:1])
    with pytest.raises(ValueError, match="Cure: shorter windows"):
        propagation_coefficient(gauge(), [replace(PASSES[0], window=(50e-6, 1.2e-3)), PASSES[1]])
    with pytest.raises(ValueError, match="no band above"):
        propagation_coefficient(gauge(sigma=1.0), PASSES)
    with pytest.raises(ValueError, match="above_noise"):
        propagation_coefficient(gauge(), PASSES, above_noise=0.0)
    with pytest.raises(ValueError, match="relaxation times"):
        fit_modulus(propagation_coefficient(gauge(), PASSES), [0.0])
