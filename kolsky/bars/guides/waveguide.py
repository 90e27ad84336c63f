"""Bars as guides of one longitudinal wave: wavenumber, attenuation, stiffness, impedance.

Elastic bars follow the first mode of a solid round bar with a free surface, after Pochhammer (1876) and Chree
(1889). The frequency equation is solved once for each Poisson's ratio and tabulated; Newton steps refine the
solution. Polymer bars have a complex modulus.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.special import i0e, i1e, j0, j1, jve

from dic.basics import check_interval
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import ComplexArray, FloatArray

Array = NDArray[Any]

_SERIES = 1e-3
"""Below this |s| the Onoe function is replaced by its series. The next term is s^4 / 23040, below
round-off."""


def frequency_equation(k: Array, w: Array, poisson: float) -> tuple[Array, Array, Array]:
    """Residual of the frequency equation and its derivatives by K and W.

    With p = alpha^2 a^2 = W^2 (c0/c_L)^2 - K^2 and q = beta^2 a^2 = W^2 (c0/c_T)^2 - K^2. The Onoe function
    O(s) = z J0(z) / J1(z), z^2 = s, is real for real s of either sign. The equation is Graff 1975, Eq.
    8.2.34, times p / (J1 J1):

    f = 2 p (q + K^2) - (q - K^2)^2 O(p) - 4 K^2 p O(q).
    """
    shear, longitudinal = _slownesses(poisson)
    square = k**2
    p, q = w**2 * longitudinal - square, w**2 * shear - square
    op, oq = onoe(p), onoe(q)
    dop, doq = _onoe_slope(p, op), _onoe_slope(q, oq)
    d = q - square
    f = 2.0 * p * (q + square) - d**2 * op - 4.0 * square * p * oq
    by_p = 2.0 * (q + square) - d**2 * dop - 4.0 * square * oq
    by_q = 2.0 * p - 2.0 * d * op - 4.0 * square * p * doq
    by_square = 2.0 * p + 2.0 * d * op - 4.0 * p * oq
    return f, 2.0 * k * (by_square - by_p - by_q), 2.0 * w * (longitudinal * by_p + shear * by_q)


def rayleigh_speed(poisson: float) -> float:
    """Speed of surface waves divided by c0 [-]. It is the limit of the first mode at high frequency.

    With x = (c / c_T)^2: x^3 - 8 x^2 + (24 - 16 g) x - 16 (1 - g) = 0, g = (c_T / c_L)^2 (Graff 1975,
    Eq. 6.1.86).
    """
    shear, longitudinal = _slownesses(poisson)
    g = longitudinal / shear
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * g, -16.0 * (1.0 - g)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(real[(real > 0.0) & (real < 1.0)][0] / shear))


def _slownesses(poisson: float) -> tuple[float, float]:
    """(c0 / c_T)^2 and (c0 / c_L)^2 [-]."""
    return 2.0 * (1.0 + poisson), (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson)


def onoe(s: Array) -> Array:
    """z J0(z) / J1(z) with z^2 = s (Onoe, McNiven and Mindlin 1962). For s < 0, scaled functions are used."""
    s = np.asarray(s)
    small = np.abs(s) < _SERIES
    if np.iscomplexobj(s):
        z = np.sqrt(np.where(small, 1.0, s))
        value = z * jve(0, z) / jve(1, z)
    else:
        z = np.sqrt(np.where(small, 1.0, np.abs(s)))
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.where(s < 0.0, z * i0e(z) / i1e(z), z * j0(z) / j1(z))
    return np.asarray(np.where(small, 2.0 - s / 4.0 - s**2 / 96.0 - s**3 / 1536.0, value))


def _onoe_slope(s: Array, value: Array) -> Array:
    """dO/ds from the Riccati equation of O, 2 s O' = 2 O - O^2 - s."""
    small = np.abs(s) < _SERIES
    slope = (2.0 * value - value**2 - s) / (2.0 * np.where(small, 1.0, s))
    return np.asarray(np.where(small, -0.25 - s / 48.0 - s**2 / 512.0, slope))


TABLE_ERROR = 1e-9
"""Largest relative error of a table's wavenumber [-], measured between its knots."""
FIRST_TABLE = 8.0
"""omega a / c0 at which a table ends at first. It is doubled until it covers the required frequencies."""
_SCAN = 400
"""Number of phase velocities in the search for a bracket of the slowest root."""


def dispersion_table(poisson: float, largest: float = FIRST_TABLE) -> CubicHermiteSpline:
    """Slowness c0 / c of the first mode against omega a / c0, cached by Poisson's ratio.

    Knots satisfy the frequency equation and have exact slopes. Intervals are halved until the cubic between
    the knots is within `TABLE_ERROR` of the root in their middle.
    """
    if not 0.0 <= poisson < 0.5:
        raise ValueError(f"Poisson's ratio of a bar must be in [0, 0.5), got {poisson}")
    doublings = max(0, int(np.ceil(np.log2(max(largest, FIRST_TABLE) / FIRST_TABLE))))
    return _table(float(poisson), FIRST_TABLE * 2.0**doublings)


@lru_cache(maxsize=32)
def _table(poisson: float, end: float) -> CubicHermiteSpline:
    if poisson == 0.0:
        return _table_without_poisson(end)

    def solve(w: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = _slowest_root(w, poisson)
        _, by_k, by_w = frequency_equation(k, w, poisson)
        return k / w, (-by_w / by_k - k / w) / w

    return _refined(solve, np.array([0.0]), np.ones(1), np.zeros(1), end)


def _table_without_poisson(end: float) -> CubicHermiteSpline:
    """Without Poisson's ratio the bar does not disperse up to J1'(W) = 0, where two branches cross."""
    crossing = 1.8411837813406593

    def solve(w: FloatArray) -> tuple[FloatArray, FloatArray]:
        low, high = w.copy(), w / (0.8 * rayleigh_speed(0.0))
        for _ in range(80):  # W^2 - p O(p) - K^2 O(q) = 0: f over 2 p
            k = 0.5 * (low + high)
            p, q = w**2 - k**2, 2.0 * w**2 - k**2
            beyond = w**2 - p * onoe(p) - k**2 * onoe(q) < 0.0
            low, high = np.where(beyond, low, k), np.where(beyond, k, high)
        p, q = w**2 - k**2, 2.0 * w**2 - k**2
        op, oq = onoe(p), onoe(q)
        kept, turned = op + p * _onoe_slope(p, op), k**2 * _onoe_slope(q, oq)
        by_k = 2.0 * k * (kept - oq + turned)
        by_w = 2.0 * w * (1.0 - kept - 2.0 * turned)
        return k / w, (-by_w / by_k - k / w) / w

    above = _refined(solve, np.array([]), np.array([]), np.array([]), end, start=crossing * (1.0 + 1e-9))
    knots = np.concatenate([[0.0, crossing], above.x])
    values = np.concatenate([[1.0, 1.0], above(above.x)])
    return CubicHermiteSpline(knots, values, np.concatenate([[0.0, 0.0], above(above.x, 1)]))


def _refined(
    solve: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    knots: FloatArray,
    values: FloatArray,
    slopes: FloatArray,
    end: float,
    *,
    start: float = 0.0,
) -> CubicHermiteSpline:
    """Slowness table with intervals halved until the cubics are accurate at the midpoints."""
    first = np.linspace(start, end, 33)[1 if start == 0.0 else 0 :]
    new_values, new_slopes = solve(first)
    knots, values, slopes = (
        np.concatenate(pair) for pair in ((knots, first), (values, new_values), (slopes, new_slopes))
    )
    open_ = np.ones(knots.size - 1, dtype=bool)
    while open_.any():
        middles = 0.5 * (knots[1:] + knots[:-1])[open_]
        found, slope = solve(middles)
        error = np.abs(CubicHermiteSpline(knots, values, slopes)(middles) / found - 1.0)
        places = np.flatnonzero(open_) + 1
        # The error decreases with the fourth power. Halves of accurate intervals need no check.
        again = (error > TABLE_ERROR) & (middles - knots[places - 1] > 1e-7)
        knots, values = np.insert(knots, places, middles), np.insert(values, places, found)
        slopes = np.insert(slopes, places, slope)
        open_ = np.zeros(knots.size - 1, dtype=bool)
        left = places + np.arange(places.size) - 1
        open_[left[again]] = open_[left[again] + 1] = True
    return CubicHermiteSpline(knots, values, slopes)


def _slowest_root(w: FloatArray, poisson: float) -> FloatArray:
    """Largest wavenumber at each frequency (the first mode), bracketed by a scan and then refined."""
    slowest = 0.9 * rayleigh_speed(poisson)
    k = np.empty_like(w)
    pending = np.arange(w.size)
    n = _SCAN
    while pending.size:
        speeds = np.linspace(slowest, 1.0 + 1e-12, n)
        ascending = w[pending, None] / speeds
        sign = np.sign(frequency_equation(ascending, w[pending, None], poisson)[0])
        changes = sign[:, 1:] * sign[:, :-1] <= 0.0
        found = changes.any(axis=1)
        cell = changes.argmax(axis=1)[found]
        rows = pending[found]
        k[rows] = _closed_in(ascending[found, cell + 1], ascending[found, cell], w[rows], poisson)
        pending = pending[~found]
        n *= (
            10  # next to the crossing of two branches, at a very small Poisson's ratio, both hide in one cell
        )
        if n > 1_000_000:
            raise RuntimeError(f"no root of the frequency equation at omega a / c0 = {w[pending[0]]:g}")
    return k


def _closed_in(low: FloatArray, high: FloatArray, w: FloatArray, poisson: float) -> FloatArray:
    """Newton's method inside a bracket, with bisection if a step leaves it."""
    sign = np.sign(frequency_equation(low, w, poisson)[0])
    k = 0.5 * (low + high)
    for _ in range(80):
        f, slope, _ = frequency_equation(k, w, poisson)
        same = np.sign(f) == sign
        low, high = np.where(same, k, low), np.where(same, high, k)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = k - f / slope
        inside = np.isfinite(step) & (step > low) & (step < high)
        following = np.where(inside, step, 0.5 * (low + high))
        done = np.abs(following - k) <= 4e-16 * k
        k = following
        if done.all():
            break
    return k


def wavenumber(frequency: ArrayLike, poisson: float) -> Array:
    """Wavenumber of the first mode.

    Complex frequencies belong to waves under an exponential window or, by the correspondence principle, to a
    viscoelastic bar. The table then gives only the start of a Newton iteration on the frequency equation.

    ``frequency``: omega a / c0 [-], real or complex, any sign. The real part of a complex frequency must
    exceed the imaginary part. ``poisson``: Poisson's ratio, in [0, 0.5). Returns: k a [-], same shape; odd in
    the frequency. The relative error is below `dispersion_table.TABLE_ERROR`. Raises ValueError if Poisson's
    ratio is outside its range, or if a frequency is not finite.
    """
    w = np.asarray(frequency)
    if not np.isfinite(w).all():
        raise ValueError("frequencies must be finite; cure: remove what is not a number from the signal")
    size = np.abs(w.real)
    slowness = dispersion_table(poisson, float(size.max(initial=0.0)))
    real = size * slowness(size)
    if not np.iscomplexobj(w):
        return np.copysign(real, w)
    turned = np.where(w.real < 0.0, -w, w)  # K(-W) = -K(W): only the right half-plane has to be known
    offset = 1j * turned.imag
    group = slowness(size) + size * slowness(size, 1)
    bend = 2.0 * slowness(size, 1) + size * slowness(size, 2)
    found = np.asarray(real + offset * group + 0.5 * offset**2 * bend)
    return np.where(w.real < 0.0, -1.0, 1.0) * _polished(found, turned, poisson)


def _polished(k: Array, w: Array, poisson: float) -> Array:
    """A few Newton steps in the complex plane, from a nearby start."""
    result = np.array(k)
    moving = np.flatnonzero(np.abs(np.ravel(w)) > 1e-4)  # below, the residual is round-off
    if poisson == 0.0:
        return result
    result, at = result.ravel(), np.ravel(w)
    for _ in range(8):
        if moving.size == 0:
            return result.reshape(w.shape)
        f, slope, _ = frequency_equation(result[moving], at[moving], poisson)
        change = f / slope
        result[moving] -= change
        # Newton's method doubles the digits. The next step would change only round-off.
        moving = moving[np.abs(change) > 1e-8 * np.abs(result[moving])]
    raise ValueError(
        f"no wavenumber found at omega a / c0 = {at[moving[0]]:.6g}; the damping must be small, the "
        "imaginary part below a third of the real one. Cure: limit the band"
    )


@dataclass(frozen=True)
class ElasticWaveguide:
    """A linear elastic bar in its first longitudinal mode.

    ``bar``: diameter, Young's modulus, density and Poisson's ratio.
    """

    bar: Bar
    dispersive: bool = True
    """True if Poisson's ratio causes dispersion. If False, every wave travels at c0."""

    @property
    def wave_speed(self) -> float:
        """Bar wave speed c0 [m/s]."""
        return self.bar.wave_speed

    def wavenumber(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.3): k a of the first mode at omega a / c0 [rad/m]."""
        w = np.asarray(omega)
        if not self.dispersive:
            return np.asarray(w / self.wave_speed, dtype=complex)
        radius = 0.5 * self.bar.diameter
        turned = wavenumber(w * radius / self.wave_speed, self.bar.poisson)
        return np.asarray(turned / radius, dtype=complex)

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.6): rho A (omega / k)^2 [N]."""
        w = np.asarray(omega)
        return self.impedance(w) * _speed_of(w, self.wavenumber(w), self.wave_speed)

    def impedance(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.5): rho A omega / k [N s/m]."""
        w = np.asarray(omega)
        return _impedance_of(self.bar, _speed_of(w, self.wavenumber(w), self.wave_speed))


def area(bar: Bar) -> float:
    """Cross-section of a bar [m^2]."""
    return pi * bar.diameter**2 / 4.0


def _impedance_of(bar: Bar, speed: ComplexArray) -> ComplexArray:
    """Eq. (B.5): rho A omega / k [N s/m] of a bar with the wave speed omega / k [m/s]."""
    return bar.density * area(bar) * speed


def _speed_of(omega: NDArray[Any], wavenumber: ComplexArray, at_rest: float) -> ComplexArray:
    """omega / k [m/s], with its limit at omega = 0."""
    still = wavenumber == 0.0
    return np.asarray(np.where(still, at_rest, omega / np.where(still, 1.0, wavenumber)), dtype=complex)


@dataclass(frozen=True)
class PronyModulus:
    """Complex modulus of springs and dashpots, E + sum of E_j i omega tau_j / (1 + i omega tau_j).

    One pair is the standard linear solid (Zener). Raises ValueError if a value is not positive, or if there
    is not one time for each modulus.
    """

    long_term: float
    """Modulus at rest E [Pa], > 0."""
    moduli: tuple[float, ...]
    """Moduli E_j of the Maxwell elements [Pa], > 0."""
    times: tuple[float, ...]
    """Their relaxation times tau_j [s], > 0."""

    def __post_init__(self) -> None:
        check_interval("(0, inf) Pa", long_term=self.long_term, moduli=self.moduli)
        check_interval("(0, inf) s", times=self.times)
        if len(self.moduli) != len(self.times):
            raise ValueError(f"a modulus for each time, got {len(self.moduli)} and {len(self.times)}")

    def __call__(self, omega: ArrayLike) -> ComplexArray:
        """Complex modulus E* [Pa] at angular frequencies [rad/s]."""
        w = np.asarray(omega, dtype=complex)
        modulus = np.full(w.shape, self.long_term, dtype=complex)
        for part, time in zip(self.moduli, self.times, strict=True):
            modulus += part * 1j * w * time / (1.0 + 1j * w * time)
        return modulus

    def scaled(self, factor: float) -> "PronyModulus":
        """The modulus with all moduli times `factor`."""
        if factor == 1.0:
            return self
        return PronyModulus(self.long_term * factor, tuple(factor * part for part in self.moduli), self.times)

    @property
    def instantaneous(self) -> float:
        """Modulus at infinite frequency [Pa], which determines the fastest wave."""
        return self.long_term + sum(self.moduli)


@dataclass(frozen=True)
class ViscoelasticWaveguide:
    """A polymer bar with a complex modulus. Geometric dispersion follows by the correspondence principle.

    Poisson's ratio is real and constant. Young's modulus of the bar is not used.
    """

    bar: Bar
    modulus: PronyModulus
    dispersive: bool = True
    """True if the finite radius of the bar also causes dispersion."""

    @property
    def wave_speed(self) -> float:
        """Speed of the first arrival [m/s], with the instantaneous modulus."""
        return float(np.sqrt(self.modulus.instantaneous / self.bar.density))

    def wavenumber(self, omega: ArrayLike) -> ComplexArray:
        """Eq. (B.8): the first mode at the complex omega a (rho / E*)^(1/2) [rad/m]."""
        w = np.asarray(omega)
        plain = w * np.sqrt(self.bar.density / self.modulus(w))
        if not self.dispersive:
            return plain
        radius = 0.5 * self.bar.diameter
        return np.asarray(wavenumber(plain * radius, self.bar.poisson) / radius)

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


Waveguide = ElasticWaveguide | ViscoelasticWaveguide
