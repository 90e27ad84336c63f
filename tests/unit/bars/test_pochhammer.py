"""The first longitudinal mode: roots of an independent equation, limits, mode shapes, invalid input."""

from pathlib import Path

import numpy as np
import pytest
from bar_pulses import Pulse, printed_equation
from scipy.optimize import brentq
from scipy.special import jv

from kolsky.bars.guides import waveguide
from kolsky.bars.guides.waveguide import (
    TABLE_ERROR,
    PronyModulus,
    ViscoelasticWaveguide,
    dispersion_table,
    frequency_equation,
    onoe,
    rayleigh_speed,
)
from kolsky.base.apparatus import Bar

REFERENCE = Path(__file__).resolve().parent.parent.parent / "reference" / "F_pochhammer_nu0.29.csv"


def test_reference_table():
    data = np.loadtxt(REFERENCE, delimiter=",")
    found = waveguide.phase_velocity(data[:, 0], 0.29)
    np.testing.assert_allclose(found, data[:, 1], rtol=0.0, atol=1e-8)  # it has eight decimals


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


def test_frequency_is_the_inverse():
    k = np.array([0.0, 1e-5, 0.1, 2.0, -3.0, 30.0])
    np.testing.assert_allclose(
        waveguide.wavenumber(waveguide.frequency(k, 0.3), 0.3), k, rtol=2 * TABLE_ERROR
    )
    lossy = np.array([0.1, 1.0, 4.0]) * np.exp(-0.1j)
    np.testing.assert_allclose(waveguide.wavenumber(waveguide.frequency(lossy, 0.3), 0.3), lossy, rtol=1e-12)


def test_mean_over_surface_by_integrating_the_mode_shape():
    # Displacements from the potentials (Graff 1975, Eqs. 8.2.20 to 8.2.24), the mean by Gauss quadrature.
    nu = 0.33
    for w in (0.1, 0.8, 1.5, 2.5):
        k = float(waveguide.wavenumber(w, nu))
        p = np.sqrt(w**2 * (1 + nu) * (1 - 2 * nu) / (1 - nu) - k**2 + 0j)
        q = np.sqrt(w**2 * 2 * (1 + nu) - k**2 + 0j)
        shear = 2.0 * k * p * jv(1, p) / ((q**2 - k**2) * jv(1, q))  # no shear stress on the surface

        def strain(r, k=k, p=p, q=q, shear=shear):
            return (k * jv(0, p * r) - q * shear * jv(0, q * r)).real

        r, weight = np.polynomial.legendre.leggauss(30)
        r, weight = 0.5 * (r + 1.0), 0.5 * weight
        mean = 2.0 * (weight * r * strain(r)).sum()
        assert float(waveguide.mean_over_surface(w, nu)) == pytest.approx(mean / strain(1.0), rel=1e-7)


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
    with pytest.raises(ValueError, match=">= 0"):
        waveguide.phase_velocity([-0.1], 0.3)
    with pytest.raises(ValueError, match="mean strain"):
        waveguide.mean_over_surface(1.0, 0.0)


BAR = Bar(0.02, 2.0, 5e9, 1190.0, 0.35)
ZENER = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
GUIDE = ViscoelasticWaveguide(BAR, ZENER)
STEP = 5e-7
TIME = STEP * np.arange(6000)
PULSE = Pulse(100e-6, duration=20e-6, rise=15e-6, ripple=0.0)


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


def test_refuses_broken_series():
    with pytest.raises(ValueError, match="a modulus for each time"):
        PronyModulus(5e9, (1e9,), ())
    with pytest.raises(ValueError, match="> 0 and finite"):
        PronyModulus(5e9, (1e9,), (0.0,))
