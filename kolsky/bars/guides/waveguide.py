"""Bars as guides of one longitudinal wave: wavenumber, attenuation, stiffness, impedance.

A wave that travels toward +x varies as exp(i (omega t - k x)): the real part of k turns its phase, and a
negative imaginary part makes it fade. Numbers of equations are those of docs/theory/bar_waves.md.
"""

from dataclasses import dataclass
from math import inf, isfinite, pi
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kolsky.bars.guides import pochhammer
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import ComplexArray

SURFACE_BAND = 2.0
"""omega a / c0 up to which a gauge on the surface can stand for the section."""


class Waveguide(Protocol):
    """A bar as propagation, separation and forces need it."""

    @property
    def wave_speed(self) -> float:
        """Speed by which arrivals are told [m/s]: dispersion is what differs from a shift at this speed."""

    @property
    def largest_frequency(self) -> float:
        """Frequency up to which the guide is known [Hz]; inf if everywhere."""

    def wavenumber(self, omega: ArrayLike) -> ComplexArray:
        """Wavenumber k [rad/m] at angular frequencies omega [rad/s], real or with a small imaginary part."""

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """Force through the section per strain that a gauge shows [N]."""

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Force through the section per mean particle velocity of one wave [N s/m]."""


@dataclass(frozen=True)
class ElasticWaveguide:
    """A linear elastic bar in its first longitudinal mode.

    Parameters
    ----------
    bar : Bar
        Diameter, Young's modulus, density and Poisson's ratio.
    dispersive : bool, keyword-only
        Whether the bar's own Poisson's ratio makes it disperse; without, every wave travels at c0.
    surface : bool, keyword-only
        Whether a gauge on the surface shows another strain than the section's mean (M1 of Tyas and Watson).
        The band then ends at omega a / c0 = `SURFACE_BAND`.

    Raises
    ------
    ValueError
        If a property of the bar is outside its range.
    """

    bar: Bar
    """The bar."""
    dispersive: bool = True
    """True if waves of different length travel at different speeds."""
    surface: bool = False
    """True if strains are those of the surface."""

    def __post_init__(self) -> None:
        check_bar(self.bar)
        if self.surface and not (self.dispersive and self.bar.poisson > 0.0):
            raise ValueError(
                "a surface strain differs from the mean in a dispersive bar with poisson > 0 only"
            )

    @property
    def wave_speed(self) -> float:
        """Bar wave speed c0 [m/s]."""
        return self.bar.wave_speed

    @property
    def largest_frequency(self) -> float:
        """Everywhere, unless a surface gauge ends the band [Hz]."""
        return SURFACE_BAND * self.wave_speed / (pi * self.bar.diameter) if self.surface else inf

    def wavenumber(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.3): k a is the first mode's at omega a / c0 [rad/m]."""
        w = np.asarray(omega)
        if not self.dispersive:
            return np.asarray(w / self.wave_speed, dtype=complex)
        radius = 0.5 * self.bar.diameter
        turned = pochhammer.wavenumber(w * radius / self.wave_speed, self.bar.poisson)
        return np.asarray(turned / radius, dtype=complex)

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.6): rho A (omega / k)^2, times M1 if strains are those of the surface [N]."""
        w = np.asarray(omega)
        stiffness = self.impedance(w) * speed_of(w, self.wavenumber(w), self.wave_speed)
        if self.surface:
            reduced = 0.5 * w * self.bar.diameter / self.wave_speed
            stiffness = stiffness * pochhammer.mean_over_surface(reduced, self.bar.poisson)
        return np.asarray(stiffness, dtype=complex)

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.5): rho A omega / k [N s/m]."""
        w = np.asarray(omega)
        return impedance_of(self.bar, speed_of(w, self.wavenumber(w), self.wave_speed))


def area(bar: Bar) -> float:
    """Cross-section of a bar [m^2]."""
    return pi * bar.diameter**2 / 4.0


def check_bar(bar: Bar) -> None:
    """Refuse a bar whose waves cannot be computed.

    Raises
    ------
    ValueError
        With the name, the value and the allowed range.
    """
    for name in ("diameter", "length", "youngs_modulus", "density"):
        value = getattr(bar, name)
        if not (isfinite(value) and value > 0.0):
            raise ValueError(f"{name} of a bar must be > 0 and finite, got {value}")
    if not 0.0 <= bar.poisson < 0.5:
        raise ValueError(f"poisson of a bar must be in [0, 0.5), got {bar.poisson}")


def stiffness_of(bar: Bar, speed: ComplexArray) -> ComplexArray:
    """Eq. (B.6): rho A (omega / k)^2 [N] of a bar whose waves have the speed omega / k [m/s]."""
    return bar.density * area(bar) * speed**2


def impedance_of(bar: Bar, speed: ComplexArray) -> ComplexArray:
    """Eq. (B.5): rho A omega / k [N s/m] of such a bar."""
    return bar.density * area(bar) * speed


def speed_of(omega: NDArray[Any], wavenumber: ComplexArray, at_rest: float) -> ComplexArray:
    """omega / k [m/s], with its limit at omega = 0."""
    still = wavenumber == 0.0
    return np.asarray(np.where(still, at_rest, omega / np.where(still, 1.0, wavenumber)), dtype=complex)
