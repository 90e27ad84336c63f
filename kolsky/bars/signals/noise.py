"""Stationary noise of a signal: its size, its correlation from sample to sample, realisations of it."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Noise:
    """Stationary Gaussian noise on uniform samples.

    Raises
    ------
    ValueError
        If sigma is negative, or the correlation does not start at 1 or belongs to no noise.
    """

    sigma: float
    """Standard deviation of a sample."""
    correlation: FloatArray
    """Autocorrelation at the lags 0, 1, ... m samples, shape [m + 1]; zero beyond. White noise: [1]."""

    def __post_init__(self) -> None:
        rho = self.correlation
        if not (np.isfinite(self.sigma) and self.sigma >= 0.0):
            raise ValueError(f"sigma of a noise must be finite and >= 0, got {self.sigma}")
        if rho.ndim != 1 or not rho.size or rho[0] != 1.0 or not np.isfinite(rho).all():
            raise ValueError("the correlation of a noise is one row of finite values that starts at 1")
        lowest = float(_spectrum(rho, 4 * rho.size).min())
        if lowest < -1e-9:  # round-off of the transform
            raise ValueError(
                f"no noise has this correlation: its spectrum falls to {lowest:.3g}, must be >= 0"
            )

    @property
    def memory(self) -> float:
        """Samples that carry the information of one, 1 + 2 sum rho, Eq. (U.8) [-]; 1 if white."""
        return float(1.0 + 2.0 * self.correlation[1:].sum())

    def sigma_of_sums(self, n: int) -> FloatArray:
        """Standard deviation of the sums of the first 1, 2, ... n samples, Eq. (U.9), shape [n]."""
        rho = np.zeros(n)
        m = min(n, self.correlation.size)
        rho[:m] = self.correlation[:m]
        # var S_k = var S_(k-1) + 1 + 2 (rho_1 + ... + rho_(k-1)); where sums cancel round-off may be negative
        variance = np.cumsum(2.0 * np.cumsum(rho) - 1.0)
        return self.sigma * np.sqrt(np.maximum(variance, 0.0))

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """One realisation of `n` samples with this size and correlation, shape [n].

        The spectrum of the circularly embedded correlation colours white noise; exact, since the embedding
        is longer than the record and the correlation's reach together.
        """
        size = max(n, self.correlation.size) + self.correlation.size
        white = rng.standard_normal(size)
        if self.correlation.size == 1:
            return self.sigma * white[:n]
        colour = np.sqrt(np.maximum(_spectrum(self.correlation, size), 0.0))
        return self.sigma * np.fft.irfft(colour * np.fft.rfft(white), size)[:n]


def estimate_noise(value: FloatArray, *, freedom_lost: int = 1) -> Noise:
    """Size and autocorrelation of noise from samples of it, mean (and trend) removed.

    The sample autocorrelation (with the divisor n, so that it belongs to a noise) is tapered by a Parzen
    window over four times the reach at which its sum settles (Sokal 1997: five correlation times), at most
    half of the record.

    Parameters
    ----------
    value
        Residuals at rest, shape [n], n >= 8.
    freedom_lost
        Parameters that were fitted to get the residuals.

    Raises
    ------
    ValueError
        If there are fewer than 8 samples or all are zero.
    """
    n = value.size
    if n < 8:
        raise ValueError(f"noise needs at least 8 samples, got {n}")
    power = float(value @ value)
    if not power > 0.0:
        raise ValueError(f"all {n} samples are the same, so the noise is unknown")
    size = 2 * n
    rho = np.fft.irfft(np.abs(np.fft.rfft(value, size)) ** 2, size)[:n] / power
    reach = np.arange(1, n)
    settled = np.flatnonzero(reach >= 5.0 * (1.0 + 2.0 * np.cumsum(rho[1:])))
    lags = min(4 * int(reach[settled[0]] if settled.size else n), n // 2)
    u = np.arange(lags + 1) / (lags + 1)
    parzen = np.where(u <= 0.5, 1.0 - 6.0 * u**2 * (1.0 - u), 2.0 * (1.0 - u) ** 3)
    correlation = rho[: lags + 1] * parzen
    correlation[0] = 1.0
    return Noise(sigma=float(np.sqrt(power / (n - freedom_lost))), correlation=correlation)


def _spectrum(rho: FloatArray, size: int) -> FloatArray:
    """Spectral density of a correlation of finite reach on a circle of `size` samples."""
    circle = np.zeros(max(size, 2 * rho.size))
    circle[: rho.size] = rho
    circle[circle.size - rho.size + 1 :] = rho[:0:-1]
    return np.fft.rfft(circle).real
