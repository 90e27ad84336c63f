"""A polymer bar: its modulus in closed form, lossy waves, broken input."""

import numpy as np
import pytest
from bar_pulses import Pulse

from kolsky.bars.guides.waveguide import PronyModulus, ViscoelasticWaveguide
from kolsky.base.apparatus import Bar

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
