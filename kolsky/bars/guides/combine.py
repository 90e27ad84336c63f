"""Linear combinations of the waves at the faces, by constants or by what the bars are at each frequency."""

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from kolsky.bars.guides.spectra import edge_filter, faded, mean_square
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import FaceWaves, History
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray

WAVES = ("incident", "reflected", "transmitted")
"""Keys of `FaceWaves.sigma`."""

Factor = float | NDArray[np.complex128]
"""A constant, or a complex factor at each frequency."""
Weights = tuple[Factor, Factor, Factor]
"""Factors of the incident, reflected and transmitted strain."""


class BarWaves:
    """The three waves and what the bars make of a strain: force and velocity.

    Parameters
    ----------
    faces
        The waves at the faces.
    guides
        The incident and the transmission bar as waveguides; None takes constants, E A and rho c0 A.
    """

    stiffness_1: Factor
    """Force per strain of the incident bar [N]."""
    stiffness_2: Factor
    """Force per strain of the transmission bar [N]."""
    impedance_1: Factor
    """Force per velocity of the incident bar [N s/m]."""
    impedance_2: Factor
    """Force per velocity of the transmission bar [N s/m]."""

    def __init__(self, faces: FaceWaves, guides: tuple[Waveguide, Waveguide] | None) -> None:
        self._waves = np.stack([faces.incident, faces.reflected, faces.transmitted])
        self._noise = np.array([faces.sigma[name] for name in WAVES])
        self._white = np.array([(faces.white or faces.sigma)[name] for name in WAVES])
        self._spectra: NDArray[np.complex128] | None = None
        if guides is None:
            first, second = faces.incident_bar, faces.transmission_bar
            self.stiffness_1, self.stiffness_2 = stiffness(first), stiffness(second)
            self.impedance_1, self.impedance_2 = first.impedance, second.impedance
            return
        n = faces.time.size
        self._fade = max(64, n // 4)
        # What a viscoelastic bar remembers dies away over the padding instead of coming round.
        self._length = next_fast_len(6 * n + 2 * self._fade, real=True)
        frequency = rfftfreq(self._length, float(faces.time[1] - faces.time[0]))
        limit = min(guide.largest_frequency for guide in guides)
        kept = frequency <= limit
        omega = 2.0 * pi * frequency[kept]
        self._edge = np.zeros(frequency.size)
        self._edge[kept] = edge_filter(frequency[kept], limit)

        heard = frequency <= min(limit, faces.band)  # where the waves have noise at all
        self._heard = np.zeros(frequency.size)
        self._heard[heard] = edge_filter(frequency[heard], min(limit, faces.band))

        def whole(factor: NDArray[np.complex128]) -> NDArray[np.complex128]:
            spread = np.ones(frequency.size, dtype=complex)  # beyond the band the edge makes it 0
            spread[kept] = factor
            return spread

        self.stiffness_1, self.stiffness_2 = (whole(guide.stiffness(omega)) for guide in guides)
        self.impedance_1, self.impedance_2 = (whole(guide.impedance(omega)) for guide in guides)
        padded = [faded(wave, self._fade, self._length, fade=self._fade) for wave in self._waves]
        self._spectra = np.asarray(rfft(np.stack(padded), axis=1))

    def combined(self, weights: Weights, unit: str) -> History:
        """The weighted sum of the waves, with the sigma of its samples for white, independent noise."""
        n = self._waves.shape[1]
        if self._spectra is None:
            factor = np.array(weights, dtype=np.float64)
            value: FloatArray = factor @ self._waves
            noise = np.abs(factor) * self._noise
        else:
            factors = np.stack([self._edge * weight for weight in weights])
            total = irfft((factors * self._spectra).sum(axis=0), self._length)
            value = np.asarray(total[self._fade : self._fade + n], dtype=np.float64)
            noise = np.array([self._gain(self._heard * weight) for weight in weights]) * self._white
        return History(value, np.full(n, float(np.linalg.norm(noise))), unit)

    def slow_sigma(self, weights: Weights) -> float:
        """Sigma of white noise as strong as the sum's at low frequencies, which an integral collects."""
        gains = np.array([abs(np.ravel(weight)[0]) for weight in weights])
        return float(np.linalg.norm(gains * self._white))

    def _gain(self, factor: NDArray[np.complex128]) -> float:
        """Root mean square of a factor over all frequencies: sigma after over sigma before."""
        return float(np.sqrt(mean_square(factor, self._length)))


def noise_correlation(faces: FaceWaves) -> float:
    """Samples for each independent one in the waves' noise [-]: 1 if white, more where a band was cut."""
    if faces.white is None:
        return 1.0
    return max(
        ((faces.white[name] / faces.sigma[name]) ** 2 for name in WAVES if faces.sigma[name] > 0.0),
        default=1.0,
    )


def stiffness(bar: Bar) -> float:
    """Force per strain of a bar, E A [N]."""
    return bar.youngs_modulus * pi * bar.diameter**2 / 4.0
