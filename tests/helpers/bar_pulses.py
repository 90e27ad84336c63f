"""Pulses in bars by direct integration of their Fourier integrals: no FFT, no table, no code of the package.

A pulse is a box of length T with a ripple on top. A Gaussian of standard deviation s smooths its edges. Its
transform has a closed form. The wavenumber is a root of the printed frequency equation (Graff 1975, Eq.
8.2.34), found by bracketing with Bessel functions of complex arguments.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.signal import czt
from scipy.special import jv

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FASTEST_RISE = 5e-6  # rise from 10 to 90 % of the pulse [s]: 2.56 s


@dataclass(frozen=True)
class Pulse:
    """A smoothed box with a ripple."""

    arrival: float  # middle of the rise [s]
    duration: float = 100e-6  # time from the middle of the rise to the middle of the fall [s]
    rise: float = FASTEST_RISE  # rise time from 10 to 90 % [s]
    ripple: float = 0.08  # amplitude of the ripple over that of the pulse
    ripple_frequency: float = 60e3  # frequency of the ripple [Hz]

    @property
    def smoothing(self) -> float:
        """Standard deviation s of the Gaussian [s]."""
        return self.rise / 2.5631031310892007

    def spectrum(self, omega: ComplexArray) -> ComplexArray:
        """Fourier transform, integral of x(t) exp(-i omega t) dt [s]."""
        r = 2.0 * np.pi * self.ripple_frequency

        def smooth_box(w: ComplexArray) -> ComplexArray:
            half = 0.5 * w * self.duration
            small = np.abs(half) < 1e-12
            sinc = np.where(small, 1.0, np.sin(half) / np.where(small, 1.0, half))
            middle = self.arrival + 0.5 * self.duration
            return self.duration * sinc * np.exp(-0.5 * (w * self.smoothing) ** 2 - 1j * w * middle)

        turn = np.exp(1j * r * self.arrival)
        sides = smooth_box(omega - r) / turn + smooth_box(omega + r) * turn
        return smooth_box(omega) + 0.5 * self.ripple * sides

    def frequencies(self, longest: float) -> FloatArray:
        """Angular frequencies from zero up to a limit with less than 1e-8 of the spectrum above it [rad/s].

        Their step is fine enough for an integral over times up to `longest` [s]: about 16 points per period.
        """
        highest = 6.2 / self.smoothing + 2.0 * np.pi * self.ripple_frequency
        return np.linspace(0.0, highest, 2 * int(4.0 * highest * longest / np.pi) + 1)


def printed_equation(k: ComplexArray, w: ComplexArray, poisson: float) -> ComplexArray:
    """Left side of the frequency equation as printed, with a = c0 = 1, over J1(p) J1(q) / p."""
    longitudinal = (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson)
    p = np.sqrt(w**2 * longitudinal - k**2 + 0j)
    q = np.sqrt(w**2 * 2.0 * (1.0 + poisson) - k**2 + 0j)
    left = 2.0 * p * (q**2 + k**2) * jv(1, p) * jv(1, q)
    left -= (q**2 - k**2) ** 2 * jv(0, p) * jv(1, q) + 4.0 * k**2 * p * q * jv(1, p) * jv(0, q)
    return left * p / (jv(1, p) * jv(1, q))


@cache
def _roots(poisson: float, highest: float, n: int = 401) -> CubicSpline:
    """Wavenumber k a against frequency omega a / c0, by continuation from zero."""
    w = np.linspace(0.0, highest, n)
    k = np.zeros(n)
    for i in range(1, n):
        low = w[i] * (k[i - 1] / w[i - 1] if i > 1 else 1.0) * (1.0 - 1e-9)
        high = low + 0.5 * (w[i] - w[i - 1])
        sign = np.sign(printed_equation(low, w[i], poisson).real)
        while np.sign(printed_equation(high, w[i], poisson).real) == sign:
            high += 0.5 * (w[i] - w[i - 1])
        k[i] = brentq(lambda x: printed_equation(x, w[i], poisson).real, low, high, xtol=1e-13)  # noqa: B023
    return CubicSpline(w, k)


def exact_wavenumber(omega: FloatArray, *, radius: float, speed: float, poisson: float) -> FloatArray:
    """Wavenumber [rad/m] of the first mode at ascending frequencies from zero [rad/s].

    A cubic spline through 401 roots: 1e-9 of the wavenumber.
    """
    return _roots(poisson, float(omega[-1]) * radius / speed)(omega * radius / speed) / radius


def carried(
    pulse: Pulse, time: FloatArray, omega: FloatArray, turn: ComplexArray | float = 1.0
) -> FloatArray:
    """The pulse with its spectrum multiplied by `turn`, exp(-i k x). Simpson's rule starts from zero
    frequency.

    x(t) = 1 / pi * integral from 0 of Re[X(omega) exp(i omega t)] d(omega), summed at equally spaced times
    and frequencies by the chirp transform, which is exact for any spacing of either.
    """
    if omega.size % 2 == 0:
        raise ValueError("Simpson's rule needs an odd number of frequencies")
    weight = np.where(np.arange(omega.size) % 2 == 1, 4.0, 2.0)
    weight[0] = weight[-1] = 1.0
    d_omega, d_time = omega[1] - omega[0], time[1] - time[0]
    terms = weight * pulse.spectrum(omega.astype(complex)) * turn * np.exp(1j * omega * time[0])
    waves = czt(terms, time.size, np.exp(1j * d_omega * d_time))
    return waves.real * d_omega / 3.0 / np.pi
