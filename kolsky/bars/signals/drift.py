"""Drift of a signal's zero beyond its baseline: its strength, and its covariance as inputs of a budget."""

from math import pi, sqrt

import numpy as np

from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray

CONTRASTS = 3
"""Slowest parts of the baseline that the drift's strength is estimated from."""
WEAKEST = 1.0
"""Strength D0 beyond which the prior density (1 + D / D0)^-1 falls, as a share of that whose slowest part
is as strong as the noise's [-]; with `CONTRASTS` so chosen that steady drifts are covered too."""
MODES = 4
"""Modes that the drift beyond the baseline is made of; they hold 95 % of its variance."""
DRIFTING = ("gauge, zero", "gauge, drift", "gauge, drift's slope")
"""Ends of the names of the budget's inputs for zero and drift, numbers left away."""


def diffusion(value: FloatArray, interval: float, *, sigma: float, memory: float) -> float:
    """Strength D of a random walk that the baseline shows, by its posterior mean [unit^2/s].

    A random walk of variance D t, less its mean over the baseline T, is the sum of cosines cos(k pi t / T)
    whose coefficients a_k, sqrt(2) times the mean of value times cosine, are independent with the variance
    D T / (k pi)^2; noise adds s^2 = sigma^2 memory / n to each, Eq. (U.17). D is the mean of its posterior
    from the first `CONTRASTS` of them, with the prior density (1 + D / D0)^-1,
    D0 = `WEAKEST` s^2 pi^2 / T. It changes steadily with the samples: no test decides whether there is
    one.

    Parameters
    ----------
    value
        Samples of the baseline, shape [n].
    interval
        Sampling interval [s].
    sigma
        Standard deviation of a sample's noise, > 0.
    memory
        Samples that carry the information of one [-], >= 1.
    """
    n = value.size
    T = n * interval
    k = np.arange(1, CONTRASTS + 1)
    cosine = np.cos(np.outer(k, pi * (np.arange(n) + 0.5) / n))
    a = sqrt(2.0) * cosine @ (value - value.mean()) / n
    gain = T / (k * pi) ** 2
    s2 = sigma**2 * memory / n
    weakest = WEAKEST * s2 / gain[0]
    strongest = max(weakest, float((a**2 / gain).max()))
    D = np.geomspace(1e-4 * weakest, 1e6 * strongest, 2000)
    variance = np.outer(D, gain) + s2
    log = -0.5 * (np.log(variance) + a**2 / variance).sum(axis=1) - np.log1p(D / weakest)
    density = np.exp(log - log.max()) * D  # over equal steps of log D
    return float((density * D).sum() / density.sum())


def drift_quantities(gauge: str, strength: float, length: float, unit: str = "1") -> list[Quantity]:
    """The drift from the baseline's end to `length` later as independent inputs of a budget.

    Karhunen's modes of a random walk: input k is the amplitude of sin((k - 1/2) pi t / length), with the
    variance 2 D length / ((k - 1/2) pi)^2, Eq. (U.18), raised so that `MODES` of them hold all of the walk's
    variance over the time.

    Parameters
    ----------
    gauge
        Whose drift it is; begins the names.
    strength
        D [unit^2/s].
    length
        Time from the baseline's end to the last sample that is used [s], > 0.
    unit
        Unit of the signal.
    """
    k = np.arange(1, MODES + 1)
    share = 2.0 / ((k - 0.5) * pi) ** 2
    sigma = np.sqrt(strength * length * share / share.sum())
    return [
        Quantity(f"{gauge}, drift {i}", 0.0, float(s), unit, "A", CONTRASTS)
        for i, s in zip(k, sigma, strict=True)
    ]


def drift_at(time: FloatArray, end: float, length: float, amplitudes: FloatArray) -> FloatArray:
    """Drift after the baseline's end for amplitudes of its modes, zero before; shape [n].

    Parameters
    ----------
    time
        Times [s], shape [n].
    end
        The baseline's last time [s].
    length
        As for `drift_quantities`.
    amplitudes
        One for each mode, shape [MODES].
    """
    t = np.clip((time - end) / length, 0.0, 1.0)
    k = np.arange(1, amplitudes.size + 1)
    return np.asarray(amplitudes @ np.sin(np.outer(k - 0.5, pi * t)))
