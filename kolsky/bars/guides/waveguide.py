"""Bars as guides of one longitudinal wave: wavenumber, attenuation, stiffness, impedance.

Elastic bars follow Pochhammer and Chree. Polymer bars have a complex modulus or a measured propagation
coefficient.
"""

from dataclasses import dataclass
from math import inf, isfinite, pi
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kolsky.bars.guides import pochhammer
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import ComplexArray

_SURFACE_BAND = 2.0
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

    Raises ValueError if a property of the bar is outside its range.

    ``bar``: diameter, Young's modulus, density and Poisson's ratio. ``dispersive``: whether the bar's own
    Poisson's ratio makes it disperse; without, every wave travels at c0. ``surface``: whether a gauge on the
    surface shows another strain than the section's mean (M1 of Tyas and Watson). The band then ends at omega
    a / c0 = `SURFACE_BAND`.
    """

    bar: Bar
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
        return _SURFACE_BAND * self.wave_speed / (pi * self.bar.diameter) if self.surface else inf

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
        stiffness = self.impedance(w) * _speed_of(w, self.wavenumber(w), self.wave_speed)
        if self.surface:
            reduced = 0.5 * w * self.bar.diameter / self.wave_speed
            stiffness = stiffness * pochhammer.mean_over_surface(reduced, self.bar.poisson)
        return np.asarray(stiffness, dtype=complex)

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.5): rho A omega / k [N s/m]."""
        w = np.asarray(omega)
        return _impedance_of(self.bar, _speed_of(w, self.wavenumber(w), self.wave_speed))


def area(bar: Bar) -> float:
    """Cross-section of a bar [m^2]."""
    return pi * bar.diameter**2 / 4.0


def check_bar(bar: Bar) -> None:
    """Refuse a bar whose waves cannot be computed."""
    for name in ("diameter", "length", "youngs_modulus", "density"):
        value = getattr(bar, name)
        if not (isfinite(value) and value > 0.0):
            raise ValueError(f"{name} of a bar must be > 0 and finite, got {value}")
    if not 0.0 <= bar.poisson < 0.5:
        raise ValueError(f"poisson of a bar must be in [0, 0.5), got {bar.poisson}")


def _impedance_of(bar: Bar, speed: ComplexArray) -> ComplexArray:
    """Eq. (B.5): rho A omega / k [N s/m] of a bar whose waves have the speed omega / k [m/s]."""
    return bar.density * area(bar) * speed


def _speed_of(omega: NDArray[Any], wavenumber: ComplexArray, at_rest: float) -> ComplexArray:
    """omega / k [m/s], with its limit at omega = 0."""
    still = wavenumber == 0.0
    return np.asarray(np.where(still, at_rest, omega / np.where(still, 1.0, wavenumber)), dtype=complex)


@dataclass(frozen=True)
class PronyModulus:
    """Complex modulus of springs and dashpots, E + sum of E_j i omega tau_j / (1 + i omega tau_j).

    One pair is the standard linear solid (Zener).
    """

    long_term: float
    """Modulus at rest E [Pa], > 0."""
    moduli: tuple[float, ...]
    """Moduli E_j of the Maxwell elements [Pa], > 0."""
    times: tuple[float, ...]
    """Their relaxation times tau_j [s], > 0."""

    def __post_init__(self) -> None:
        if len(self.moduli) != len(self.times):
            raise ValueError(f"a modulus for each time, got {len(self.moduli)} and {len(self.times)}")
        for value in (self.long_term, *self.moduli, *self.times):
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f"moduli and times of a Prony series must be > 0 and finite, got {value}")

    def __call__(self, omega: ArrayLike) -> ComplexArray:
        """Complex modulus E* [Pa] at angular frequencies [rad/s]."""
        w = np.asarray(omega, dtype=complex)
        modulus = np.full(w.shape, self.long_term, dtype=complex)
        for part, time in zip(self.moduli, self.times, strict=True):
            modulus += part * 1j * w * time / (1.0 + 1j * w * time)
        return modulus

    def scaled(self, factor: float) -> "PronyModulus":
        """The same with all moduli times `factor`."""
        if factor == 1.0:
            return self
        return PronyModulus(self.long_term * factor, tuple(factor * part for part in self.moduli), self.times)

    @property
    def instantaneous(self) -> float:
        """Modulus at infinite frequency [Pa]: what the fastest wave feels."""
        return self.long_term + sum(self.moduli)


@dataclass(frozen=True)
class ViscoelasticWaveguide:
    """A polymer bar with a complex modulus and, by the correspondence principle, geometric dispersion.

    Poisson's ratio is real and constant. The bar's own Young's modulus is not used.
    """

    bar: Bar
    """The bar: diameter, density, Poisson's ratio."""
    modulus: PronyModulus
    dispersive: bool = True
    """True if waves also disperse by the bar's finite radius."""

    def __post_init__(self) -> None:
        check_bar(self.bar)

    @property
    def wave_speed(self) -> float:
        """Speed of the first arrival, with the instantaneous modulus [m/s]."""
        return float(np.sqrt(self.modulus.instantaneous / self.bar.density))

    @property
    def largest_frequency(self) -> float:
        """Everywhere [Hz]."""
        return inf

    def wavenumber(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.8): the first mode at the complex omega a (rho / E*)^(1/2) [rad/m]."""
        w = np.asarray(omega)
        plain = w * np.sqrt(self.bar.density / self.modulus(w))
        if not self.dispersive:
            return plain
        radius = 0.5 * self.bar.diameter
        return np.asarray(pochhammer.wavenumber(plain * radius, self.bar.poisson) / radius)

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.6): rho A (omega / k)^2, which is E* A in a thin bar [N]."""
        return self.bar.density * area(self.bar) * self._speed(np.asarray(omega)) ** 2

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.5): rho A omega / k [N s/m]."""
        return _impedance_of(self.bar, self._speed(np.asarray(omega)))

    def _speed(self, omega: NDArray[Any]) -> ComplexArray:
        return _speed_of(
            omega, self.wavenumber(omega), float(np.sqrt(self.modulus.long_term / self.bar.density))
        )
