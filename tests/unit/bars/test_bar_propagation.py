"""Propagation along a bar, and its first longitudinal mode, compared with independent equations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bar_pulses import Pulse, carried, exact_wavenumber, printed_equation
from scipy.optimize import brentq
from scipy.special import jv

from kolsky.bars.guides import waveguide
from kolsky.bars.guides.propagation import propagation, windowed
from kolsky.bars.guides.waveguide import (
    TABLE_ERROR,
    ElasticWaveguide,
    PronyModulus,
    ViscoelasticWaveguide,
    dispersion_table,
    frequency_equation,
    onoe,
    rayleigh_speed,
)
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar

# Propagation of a signal along a bar: direct Fourier integrals, exact shifts, bands, noise, invalid

BAR = Bar(0.02, 2.0, 210e9, 7800.0, 0.29)
STEP = 2e-7
PULSE = Pulse(60e-6)
TARGET = 2e-3
"""What is asked of recovered pulses, over their peak."""


def exact(pulse, time, way, bar=BAR):
    omega = pulse.frequencies(2.0 * time[-1])
    k = exact_wavenumber(omega, radius=0.5 * bar.diameter, speed=bar.wave_speed, poisson=bar.poisson)
    return carried(pulse, time, omega, np.exp(-1j * k * way))


def strain(value, start=0.0, sigma=0.0, step=STEP):
    return Signal(start, step, value, sigma, "1", "incident gauge")


@pytest.mark.parametrize("way", [0.4, 1.0])
def test_forward_and_back_against_the_fourier_integral(way):
    n = 3500  # 0.7 ms: the tail of the slowest waves of a 5 us rise has passed
    here = exact(PULSE, STEP * np.arange(n), 0.0)
    there = exact(PULSE, way / BAR.wave_speed + STEP * np.arange(n), way)
    guide = ElasticWaveguide(BAR)
    forward = propagation(strain(here), guide, way)
    assert forward.signal.start == pytest.approx(way / BAR.wave_speed, rel=1e-14)
    # Table 1e-9 of k, some 40 rad of phase at the highest frequency with content; the target is 2e-3.
    assert np.abs(forward.signal.value - there).max() < 1e-6
    back = propagation(strain(there, way / BAR.wave_speed), guide, -way)
    # The last sample of a tail of 2e-5 is cut off.
    assert np.abs(back.signal.value - here).max() < 5e-5 < TARGET
    assert forward.energy == pytest.approx(1.0, abs=1e-6)
    assert forward.noise_gain == pytest.approx(1.0, abs=1e-12)
    assert forward.size > 0.2  # a plain shift misses the pulse by that
    assert forward.rms < forward.size


def test_a_bar_without_dispersion_shifts_the_clock_and_leaves_the_samples():
    value = np.random.default_rng(2).standard_normal(1000)  # content up to the last frequency
    for guide in (ElasticWaveguide(BAR, dispersive=False), ElasticWaveguide(replace(BAR, poisson=0.0))):
        if guide.dispersive:  # without Poisson's ratio only what is above J1' = 0 disperses
            value = np.exp(-0.5 * ((STEP * np.arange(1000) - 100e-6) / 13e-6) ** 2)
        moved = propagation(strain(value), guide, 1.2345)
        assert moved.signal.start == 1.2345 / BAR.wave_speed
        np.testing.assert_allclose(moved.signal.value, value, atol=1e-12)  # round-off of one transform
        assert moved.size < 1e-12


def test_start_and_length_of_choice():
    guide = ElasticWaveguide(BAR)
    value = exact(PULSE, STEP * np.arange(3000), 0.0)
    chosen = propagation(strain(value), guide, 0.5, start=1.23456e-4, samples=1111).signal
    assert (chosen.start, chosen.value.size) == (1.23456e-4, 1111)
    # Interpolated within the band: nothing but round-off and the table.
    np.testing.assert_allclose(chosen.value, exact(PULSE, chosen.time, 0.5), atol=1e-6)
    early = propagation(strain(value), guide, 0.5, start=-1e-4, samples=400).signal  # before the record
    np.testing.assert_allclose(early.value, 0.0, atol=1e-6)


def test_nothing_wraps_around_from_a_short_record_carried_far():
    pulse, way = Pulse(20e-6, duration=20e-6), 20.0
    time = STEP * np.arange(300)  # 60 us; the slowest waves come 6 ms late
    far = propagation(strain(exact(pulse, time, 0.0)), ElasticWaveguide(BAR), way).signal
    omega = pulse.frequencies(20e-3)
    k = exact_wavenumber(omega, radius=0.01, speed=BAR.wave_speed, poisson=BAR.poisson)
    there = carried(pulse, far.time, omega, np.exp(-1j * k * way))
    np.testing.assert_allclose(far.value, there, atol=1e-6)  # table, 1e-9 of 2000 rad


def test_window_keeps_other_waves_out():
    time = STEP * np.arange(3000)
    one, other = exact(PULSE, time, 0.0), exact(Pulse(350e-6), time, 0.0)
    alone = propagation(strain(one), ElasticWaveguide(BAR), 0.3).signal
    cut = propagation(strain(one - other), ElasticWaveguide(BAR), 0.3, window=(20e-6, 300e-6)).signal
    np.testing.assert_allclose(cut.value, alone.value, atol=1e-6)  # both pulses are below 1e-7 between


def test_window_is_the_signal_inside_and_fades_outside():
    signal = strain(np.ones(1000))
    part = windowed(signal, (50e-6, 150e-6))  # fades of 2 us
    inside = (signal.time >= 50e-6) & (signal.time <= 150e-6)
    assert (part.value[inside] == 1.0).all()
    assert part.value[np.argmin(np.abs(signal.time - 151e-6))] == pytest.approx(0.5, abs=1e-6)
    assert np.abs(part.value[(signal.time < 47.9e-6) | (signal.time > 152.1e-6)]).max() == 0.0


def test_noise_after_a_band_limit():
    rng = np.random.default_rng(7)
    noisy = strain(rng.standard_normal(40000), sigma=1.0)
    kept = propagation(noisy, ElasticWaveguide(BAR), 1.0, band=500e3)
    # Of the variance that share is left which the filter passes; 40000 samples tell it to 1 %.
    assert kept.signal.sigma == pytest.approx(kept.signal.value.std(), rel=0.02)
    assert kept.band == 500e3


def test_slow_noise_keeps_its_memory():
    # Noise that is even up to a tenth of the band: ten samples carry the information of one.
    rng = np.random.default_rng(11)
    spectrum = np.fft.rfft(rng.standard_normal(40000))
    spectrum[2001:] = 0.0
    value = np.fft.irfft(spectrum)
    noisy = replace(strain(value / value.std(), sigma=1.0), memory=10.0)
    through = propagation(noisy, ElasticWaveguide(BAR), 1.0).signal
    assert (through.sigma, through.memory) == (pytest.approx(1.0), pytest.approx(10.0))
    halved = propagation(noisy, ElasticWaveguide(BAR), 1.0, band=140e3).signal
    assert halved.sigma == pytest.approx(
        halved.value.std(), rel=0.03
    )  # 4000 independent values, half of them
    assert halved.memory == pytest.approx(10.0 / halved.sigma**2)


def test_back_along_a_lossy_bar_the_band_ends_where_noise_is_amplified_tenfold():
    bar = Bar(0.02, 2.0, 5e9, 1190.0, 0.35)
    guide = ViscoelasticWaveguide(bar, PronyModulus(5.0e9, (0.5e9,), (12e-6,)))
    rng = np.random.default_rng(3)
    noisy = Signal(0.0, 1e-6, rng.standard_normal(60000), 1.0, "1")
    back = propagation(noisy, guide, -2.0)
    gain = np.exp(-guide.wavenumber(2.0 * np.pi * back.band).imag * 2.0)
    assert float(gain) == pytest.approx(10.0, rel=0.01)  # one step of the transform's frequencies
    assert back.signal.sigma == pytest.approx(back.signal.value.std(), rel=0.06)  # some 2 % are independent
    pulse = Pulse(250e-6, duration=200e-6, rise=80e-6, ripple=0.0)
    time = 1e-6 * np.arange(4000)
    omega = pulse.frequencies(8e-3)
    start = 2.0 / guide.wave_speed
    there = carried(pulse, time + start, omega, np.exp(-2j * guide.wavenumber(omega)))
    recovered = propagation(Signal(start, 1e-6, there, 0.0, "1"), guide, -2.0).signal
    assert np.abs(recovered.value - carried(pulse, time, omega)).max() < TARGET


def test_refuses_arguments_outside_their_range():
    signal, guide = strain(np.zeros(100)), ElasticWaveguide(BAR)
    with pytest.raises(ValueError, match="wider band or a longer record"):
        propagation(signal, guide, 1.0, band=1.0)
    with pytest.raises(ValueError, match="within"):
        propagation(signal, guide, 1.0, window=(5e-6, 5e-3))


# The first longitudinal mode: roots of an independent equation, limits, mode shapes, invalid input.

REFERENCE = Path(__file__).resolve().parent.parent.parent / "reference" / "F_pochhammer_nu0.29.csv"


def test_reference_table():
    ratio, speed = np.loadtxt(REFERENCE, delimiter=",")[1:, :2].T  # in the first row, k is 0
    k = 2.0 * np.pi * ratio
    # c / c0 has eight decimals; the error of k is up to c over the group velocity times as large.
    np.testing.assert_allclose(waveguide.wavenumber(k * speed, 0.29), k, rtol=2e-8)


@pytest.mark.parametrize("poisson", [0.1, 0.29, 0.35, 0.45, 0.495])
def test_roots_of_the_printed_equation(poisson):
    for w in (0.05, 0.7, 1.9, 3.3, 7.7, 20.0):
        ours = float(waveguide.wavenumber(w, poisson))
        span = (1.0 - 1e-5) * ours, (1.0 + 1e-5) * ours
        exact = brentq(lambda k, w=w: printed_equation(k, w, poisson).real, *span, xtol=1e-14)
        assert abs(ours / exact - 1.0) < TABLE_ERROR


@pytest.mark.parametrize("poisson", [0.0, 1e-4, 0.05, 0.29, 0.4999])
def test_first_mode_from_the_bar_wave_to_the_rayleigh_wave(poisson):
    w = np.linspace(1e-3, 60.0, 5000)
    k = waveguide.wavenumber(w, poisson)
    assert (np.diff(k) > 0.0).all()
    # Rayleigh's correction of the lateral inertia: c / c0 = 1 - nu^2 W^2 / 4, next term of fourth order.
    low = w < 0.2
    np.testing.assert_allclose(k[low] / w[low], 1.0 + poisson**2 * w[low] ** 2 / 4.0, rtol=2e-4)
    # A surface of radius a bends the Rayleigh wave by some 0.1 / (k a) of its speed: 1e-3 at k a = 100.
    assert w[-1] / k[-1] == pytest.approx(rayleigh_speed(poisson), rel=4e-3)
    # No lower mode: between the mode and slower waves the printed equation keeps its sign.
    for i in (1000, 2500, 4900):
        slower = np.linspace(1.0005, 1.25, 400) * k[i]
        assert np.unique(np.sign(printed_equation(slower, w[i], poisson).real)).size == 1


def test_rayleigh_speed_of_a_published_value():
    # Graff 1975, Sec. 6.1: c_R / c_T = 0.9194 for nu = 1/4; c_T / c0 = (2 (1 + nu))^(-1/2).
    assert rayleigh_speed(0.25) * np.sqrt(2.5) == pytest.approx(0.9194, abs=5e-5)


def test_tables_hold_their_stated_error_between_knots_and_grow():
    table = dispersion_table(0.31, 50.0)
    assert table.x[-1] >= 50.0
    w = np.random.default_rng(5).uniform(0.01, 50.0, 4000)
    k = w * table(w)
    f, by_k, _ = frequency_equation(k, w, 0.31)
    assert np.abs(f / by_k / k).max() < TABLE_ERROR
    assert dispersion_table(0.31, 50.0) is table


def test_complex_frequencies_satisfy_the_equation_and_continue_the_real_ones():
    w = np.linspace(0.02, 6.0, 200) * np.exp(-0.1j)
    k = waveguide.wavenumber(w, 0.35)
    assert np.abs(printed_equation(k, w, 0.35)).max() < 1e-9  # residuals of order W^4 eps
    # Cauchy and Riemann: along the imaginary direction the wavenumber changes by i dk/dw.
    real, step = np.linspace(0.1, 5.0, 50), 1e-5
    change = (waveguide.wavenumber(real - 1j * step, 0.35) - waveguide.wavenumber(real, 0.35)) / (-1j * step)
    along = (waveguide.wavenumber(real + step, 0.35) - waveguide.wavenumber(real - step, 0.35)) / (2 * step)
    np.testing.assert_allclose(change.real, along, rtol=1e-6)  # O(step), table
    np.testing.assert_allclose(waveguide.wavenumber(-np.conj(w), 0.35), -np.conj(k), rtol=1e-12)


def test_onoe_function_on_both_sides_of_its_series():
    s = np.array([-2000.0, -30.0, -1.1e-3, -0.9e-3, 0.0, 0.9e-3, 1.1e-3, 5.0, 70.0])
    z = np.sqrt(s + 0j)
    scale = np.exp(-np.abs(z.imag))
    with np.errstate(invalid="ignore"):
        exact = np.where(s == 0.0, 2.0, z * (jv(0, z) * scale) / (jv(1, z) * scale)).real
    np.testing.assert_allclose(onoe(s), exact, rtol=1e-12)


@pytest.mark.parametrize("poisson", [-0.1, 0.5, float("nan")])
def test_refuses_other_poisson_ratios(poisson):
    with pytest.raises(ValueError, match=r"in \[0, 0\.5\)"):
        waveguide.wavenumber(1.0, poisson)


def test_refuses_what_is_not_a_frequency():
    with pytest.raises(ValueError, match="finite"):
        waveguide.wavenumber([1.0, np.nan], 0.3)


POCHHAMMER_BAR = Bar(0.02, 2.0, 5e9, 1190.0, 0.35)
ZENER = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
GUIDE = ViscoelasticWaveguide(POCHHAMMER_BAR, ZENER)


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
