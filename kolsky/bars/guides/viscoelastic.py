"""A polymer bar's propagation coefficient and complex modulus from a pulse and its echoes at one gauge.

After Bacon (1998). Numbers of equations are those of docs/theory/bar_waves.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq
from scipy.optimize import nnls

from kolsky.bars.guides import pochhammer
from kolsky.bars.guides.propagation import windowed
from kolsky.bars.guides.waveguide import PronyModulus, TabulatedWaveguide, check_bar
from kolsky.bars.records import BarSignal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import ComplexArray, FloatArray

_ABOVE_NOISE = 10.0
"""Spectra enter where every pass stands above its noise by this factor: log amplitude and phase to 0.1."""
_LEAKAGE = 3e-3
"""Share of a pass's largest spectral component [-] below which the edges of windows speak, not the wave."""
_FADE = 8
"""Samples over which a passage fades to zero outside its window."""
PADDING = 8
"""The transform is this many times as long as the record, so that phases can be followed."""


@dataclass(frozen=True)
class Pass:
    """One passage of the pulse at the gauge."""

    window: tuple[float, float]
    """First and last time of the passage, on the shot's clock [s]; no other wave lies in it."""
    way: float
    """Way since the first passage [m]; 0 for the first."""
    reflections: int
    """Free ends met since the first passage; each changes the sign of the strain."""


@dataclass(frozen=True)
class PropagationCoefficient:
    """Phase velocity and attenuation of a bar over a band, with the modulus that they imply."""

    bar: Bar
    """The bar: diameter, density, Poisson's ratio."""
    frequency: FloatArray
    """Frequencies [Hz], ascending, shape [n]: those where every pass stands above its noise."""
    wavenumber: ComplexArray
    """Wavenumber k = omega / c - i attenuation [rad/m], shape [n]."""
    sigma: FloatArray
    """Standard deviation of its real and of its imaginary part from the gauge's noise [rad/m], shape [n]."""
    tail: float
    """Largest mean of the last twentieth of a window over that pass's peak [-]: what was cut off. It enters
    the coefficient at low frequency and is not in `sigma`."""

    @property
    def phase_velocity(self) -> FloatArray:
        """Phase velocity [m/s], shape [n]."""
        return 2.0 * pi * self.frequency / self.wavenumber.real

    @property
    def attenuation(self) -> FloatArray:
        """Attenuation [1/m], shape [n]; below zero where noise made it so."""
        return -self.wavenumber.imag

    def modulus(self, *, geometric: bool = True) -> ComplexArray:
        """Complex modulus E* [Pa], Eq. (B.17), shape [n].

        ``geometric``: whether the dispersion by the bar's radius is taken out, by the first mode at a complex
        frequency; without, E* = rho (omega / k)^2.
        """
        omega = 2.0 * pi * self.frequency
        if not geometric:
            return self.bar.density * (omega / self.wavenumber) ** 2
        radius = 0.5 * self.bar.diameter
        reduced = pochhammer.frequency(self.wavenumber * radius, self.bar.poisson)
        return np.asarray(self.bar.density * (omega * radius / reduced) ** 2)

    def waveguide(self) -> TabulatedWaveguide:
        """The bar as it was measured, up to the last frequency.

        Raises ValueError if noise made an attenuation negative; `fit_modulus` smooths it.
        """
        return TabulatedWaveguide(self.bar, self.frequency, self.phase_velocity, self.attenuation)


def propagation_coefficient(
    gauge: BarSignal, passes: Sequence[Pass], *, above_noise: float = _ABOVE_NOISE
) -> PropagationCoefficient:
    """Identify the propagation coefficient from two or more passages of one pulse, Eq. (B.16).

    Logarithms of the spectra lie on a straight line over the way, component by component, which is fitted
    with each passage weighted by its ratio of signal to noise. Two passages give Bacon's quotient.
    """
    check_bar(gauge.bar)
    ways = np.array([item.way for item in passes])
    if ways.size < 2 or ways[0] != 0.0 or not (np.diff(ways) > 0.0).all():
        raise ValueError(f"the ways of two passages or more must ascend from 0 m, got {ways.tolist()}")
    if not above_noise >= 1.0:
        raise ValueError(f"above_noise must be >= 1, got {above_noise}")
    for before, after in pairwise(passes):
        if before.window[1] > after.window[0]:
            raise ValueError(
                f"windows of passages must follow each other, the one up to {before.window[1]:.6g} s reaches "
                f"into that from {after.window[0]:.6g} s. Cure: shorter windows"
            )
    signal = gauge.strain
    length = next_fast_len(PADDING * signal.value.size, real=True)
    frequency = rfftfreq(length, signal.interval)
    omega = 2.0 * pi * frequency
    spectra, noise, tail = [], [], 0.0
    for item in passes:
        part = windowed(signal, item.window, taper=_FADE * signal.interval)
        first = item.window[0] - signal.start  # phases from the window's first time turn slowly
        turned = rfft(part.value, length) * np.exp(1j * omega * first)
        spectra.append(turned * (-1.0) ** item.reflections)
        inside = part.value[(signal.time >= item.window[0]) & (signal.time <= item.window[1])]
        last = inside[-max(1, inside.size // 20) :]
        tail = max(tail, abs(float(last.mean())) / max(float(np.abs(inside).max()), 1e-300))
        in_window = (item.window[1] - item.window[0]) / signal.interval
        noise.append(signal.sigma * np.sqrt(signal.memory * max(in_window, 1.0)))
    amplitude = np.abs(spectra)
    weight = (amplitude / np.array(noise)[:, None]) ** 2 if signal.sigma > 0.0 else amplitude**2
    shortest = min(item.window[1] - item.window[0] for item in passes)
    clear = (amplitude > _LEAKAGE * amplitude.max(axis=1, keepdims=True)).all(axis=0)
    if signal.sigma > 0.0:
        clear &= (weight > above_noise**2).all(axis=0)
    used = _band(frequency, clear, shortest)

    below = used[-1] + 1
    logs = np.array(
        [np.log(np.abs(s[used])) + 1j * _unwrapped(s[:below] / spectra[0][:below])[used] for s in spectra]
    )
    delay = np.array([item.window[0] - passes[0].window[0] for item in passes])
    logs = logs - 1j * omega[used] * delay[:, None]
    w = weight[:, used]
    mean_way = (w * ways[:, None]).sum(axis=0) / w.sum(axis=0)
    lever = ways[:, None] - mean_way
    spread = (w * lever**2).sum(axis=0)
    slope = (w * lever * logs).sum(axis=0) / spread  # = -i k
    # Each of log amplitude and phase has the variance 1 / (2 w): half of a component's noise is in either.
    sigma = np.sqrt(0.5 / spread) if signal.sigma > 0.0 else np.zeros(used.size)
    return PropagationCoefficient(gauge.bar, frequency[used], 1j * slope, sigma, tail)


@dataclass(frozen=True)
class FittedModulus:
    """A Prony series through a measured complex modulus."""

    modulus: PronyModulus
    """The series."""
    rms: float
    """Root mean square of its relative distance from the measured modulus [-]."""


def fit_modulus(coefficient: PropagationCoefficient, times: Sequence[float]) -> FittedModulus:
    """Non-negative Prony series with given relaxation times through a measured complex modulus.

    Each component has the weight of its relative sigma. A series is causal and extends beyond the band, which
    a table does not.
    """
    tau = np.asarray(times, dtype=float)
    if tau.size == 0 or not (np.isfinite(tau).all() and (tau > 0.0).all()):
        raise ValueError(f"relaxation times must be > 0 s, got {tau.tolist()}")
    measured = coefficient.modulus()
    omega = 2.0 * pi * coefficient.frequency
    turned = 1j * omega[:, None] * tau
    columns = np.concatenate([np.ones((omega.size, 1)), turned / (1.0 + turned)], axis=1)
    relative = 2.0 * coefficient.sigma / np.abs(coefficient.wavenumber)
    weight = 1.0 / np.abs(measured)
    if (relative > 0.0).all():
        weight = weight / relative
    rows = (columns * weight[:, None], measured * weight)
    scale = float(np.abs(measured).max())
    found, _ = nnls(
        np.concatenate([rows[0].real, rows[0].imag]) * scale, np.concatenate([rows[1].real, rows[1].imag])
    )
    moduli = found * scale
    if moduli[0] <= 0.0:
        raise ValueError("the modulus at rest comes out as zero. Cure: shorter relaxation times")
    kept = moduli[1:] > 0.0
    series = PronyModulus(float(moduli[0]), tuple(moduli[1:][kept]), tuple(tau[kept]))
    distance = np.abs(series(omega) / measured - 1.0)
    return FittedModulus(series, float(np.sqrt(np.mean(distance**2))))


def _band(frequency: FloatArray, clear: NDArray[np.bool_], shortest: float) -> NDArray[np.int64]:
    """Indices from one period in the shortest window up to where a passage is first no longer clear."""
    first = int(np.searchsorted(frequency, 1.0 / shortest))
    lost = np.flatnonzero(~clear[first:])
    last = first + (int(lost[0]) if lost.size else clear.size - first)
    if last - first < 2:
        raise ValueError(
            f"no band above {frequency[first]:g} Hz in which every pass stands above the noise. Cure: longer "
            "windows, a stronger or shorter pulse, or fewer passes"
        )
    return np.arange(first, last)


def _unwrapped(quotient: ComplexArray) -> FloatArray:
    """Phase of a quotient of spectra from frequency zero on, where it is 0."""
    phase = np.unwrap(np.angle(quotient))
    return np.asarray(phase - 2.0 * pi * np.round(phase[0] / (2.0 * pi)))
