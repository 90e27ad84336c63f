"""Baseline of a signal: zero, noise with its correlation, drift, quantisation, clipping.

Zero and noise are measured before the pulse. Drift after the baseline is a random walk. A few modes represent
its covariance in the budget.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from dic.basics import check_shape
from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray, IntArray


class Noise(NamedTuple):
    """Stationary noise on uniform samples."""

    sigma: float
    """Standard deviation of a sample."""
    memory: float
    """Number of samples with the information of one independent sample, 1 + 2 sum rho, Eq. (U.8) [-]. It is 1
    for white noise."""


def estimate_noise(value: FloatArray, *, freedom_lost: int = 1) -> Noise:
    """Size and memory of noise from its samples, without mean (and trend).

    The sample autocorrelation, with the divisor n, is tapered by a Parzen
    window over four times the reach at which its sum settles (Sokal 1997: five correlation times), at most
    half of the record. ``value``: residuals at rest of a fit of `freedom_lost` parameters, shape [n], n >= 8.
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
    memory = 1.0 + 2.0 * float((rho[1 : lags + 1] * parzen[1:]).sum())
    return Noise(float(np.sqrt(power / (n - freedom_lost))), memory)


FEWEST_SAMPLES = 20
"""Smallest number of samples of a baseline. With 20, the noise is known to 16 %."""
RESTING_SHARE = 8.0
"""Deviation of a part of the baseline from the median part, in scaled median deviations. Above it, the signal
is not at rest."""
_FEWEST_BLOCKS = 8
"""Smallest number of parts of a baseline that are compared with each other."""
SIGNIFICANCE = 0.01
"""Probability that a baseline without drift is classified as drifting."""


@dataclass(frozen=True)
class SignalZero:
    """The baseline: a part of the record without signal. Values are in the unit of the signal."""

    first: float
    """Time of its first sample [s]."""
    last: float
    """Time of its last sample [s]."""
    count: int
    """Number of samples."""
    mean: float
    """Mean: the signal's zero."""
    mean_sigma: float
    """Standard uncertainty of the mean with the memory of the noise, Eq. (U.8)."""
    slope: float
    """Slope of the best line [unit/s]."""
    slope_sigma: float
    """Its standard uncertainty with the memory of the noise [unit/s]."""
    noise: Noise
    """Scatter about the line. Its sigma is at least that of rounding to a step."""
    step: float
    """Quantisation step of the recorder from the values; 0 if no step is visible."""
    longest_run: int
    """Largest number of successive equal samples."""

    @property
    def freedom(self) -> float:
        """Degrees of freedom of mean and slope: independent samples minus the two of the line, at least 1."""
        return max(self.count / max(self.noise.memory, 1.0) - 2.0, 1.0)

    @property
    def drifts(self) -> bool:
        """True if the slope is significant by Student's t at the level of 1 %."""
        limit = float(stdtrit(self.freedom, 1.0 - 0.5 * SIGNIFICANCE))
        return abs(self.slope) > limit * self.slope_sigma

    def line(self, time: FloatArray) -> FloatArray:
        """The drift relative to the baseline's middle, at any time [unit]. It is zero in the middle."""
        return self.slope * (time - 0.5 * (self.first + self.last))


def measure_signal_zero(
    time: FloatArray, value: FloatArray, span: tuple[float, float], *, name: str
) -> SignalZero:
    """Zero, noise and drift of a signal at rest.

    ``time``: uniform sample times [s], shape [n]. ``value``: samples, shape [n]. ``span``: first and last
    time of the rest [s]. ``name``: name of the signal, for messages. Raises ValueError if the span is
    reversed, has fewer than 20 samples, or has only equal samples.
    """
    first, last = span
    if not first < last:
        raise ValueError(f"{name}: the baseline must start before it ends, got {first:.9g} to {last:.9g} s")
    check_shape(time.shape, **{name: value})
    inside = (time >= first) & (time <= last)
    t, v = time[inside], value[inside]
    if t.size < FEWEST_SAMPLES:
        raise ValueError(
            f"{name}: the baseline {first:.9g} to {last:.9g} s holds {t.size} samples, at least"
            f" {FEWEST_SAMPLES} are needed; widen it within the pre-trigger stretch, on the shot's clock"
            f" (the record spans {time[0]:.9g} to {time[-1]:.9g} s)"
        )
    if np.ptp(v) == 0.0:
        raise ValueError(
            f"{name}: all {t.size} baseline samples are {v[0]:.6g}, so the noise is unknown (it must be > 0);"
            " record with a finer range, check that the channel was connected, or choose another baseline"
        )
    tc = t - 0.5 * (t[0] + t[-1])
    mean, slope = float(v.mean()), float(tc @ v / (tc @ tc))
    noise = estimate_noise(v - mean - slope * tc, freedom_lost=2)
    step = quantisation_step(v)
    # If the noise is well below half a step, the codes rarely change. The noise then looks smaller than it
    # may be.
    noise = Noise(max(noise.sigma, step / np.sqrt(12.0)), noise.memory)
    memory = max(
        noise.memory, 1.0
    )  # alternating noise does not count as having a better mean than white noise
    return SignalZero(
        first=float(t[0]),
        last=float(t[-1]),
        count=t.size,
        mean=mean,
        mean_sigma=float(noise.sigma * np.sqrt(memory / t.size)),
        slope=slope,
        slope_sigma=float(noise.sigma * np.sqrt(memory / (tc @ tc))),
        noise=noise,
        step=step,
        longest_run=int(_runs(v)[1].max()),
    )


def check_rest(value: FloatArray, width: int, *, name: str, times: tuple[float, float]) -> None:
    """Raise ValueError, with the time at which the rest ends, if the baseline contains part of a pulse.

    Means over `width` samples, the fastest rise of a pulse, are compared with their median. The signal is not
    at rest if two successive means, or the last one, deviate by more than `REST` times their median
    deviation. Noise, hum and a steady drift are accepted, because the median deviation contains them.
    ``times``: first and last time of the baseline [s].
    """
    count = value.size // width
    if count < _FEWEST_BLOCKS:
        return  # too short for a median of its parts; the arrivals are checked against its end
    first = value.size - count * width
    mean = value[first:].reshape(count, width).mean(axis=1)
    off = np.abs(mean - np.median(mean))
    floor = max(quantisation_step(value), 1e-9 * float(np.abs(value).max())) / np.sqrt(12.0)
    beyond = off > RESTING_SHARE * max(1.4826 * float(np.median(off)), floor)
    bad = np.flatnonzero(beyond & (np.append(beyond[1:], True)))
    if not bad.size:
        return
    step = (times[1] - times[0]) / max(value.size - 1, 1)
    at = times[0] + step * (first + width * int(bad[0]))
    raise ValueError(
        f"{name}: the baseline {times[0]:.6g} to {times[1]:.6g} s is not at rest: from {at:.6g} s on it "
        f"is off its median by {off[bad[0]]:.3g}, more than {RESTING_SHARE:g} times the scatter of its "
        "parts: it contains part of the pulse or a disturbance. Cure: end the baseline before, or begin "
        "it behind"
    )


def quantisation_step(value: FloatArray) -> float:
    """Distance of neighbouring codes: the median gap of the distinct values; 0 if most are distinct.

    If the codes are far finer than the noise, a short record does not show them. They then have no effect.
    """
    distinct = np.unique(value)
    if distinct.size < 2 or distinct.size > 0.5 * value.size:
        return 0.0
    return float(np.median(np.diff(distinct)))


def check_clipping(value: FloatArray, baseline: SignalZero, *, name: str, full_scale: float | None) -> None:
    """Raise ValueError if a signal left the recorder's range, with the first such sample.

    With a full scale, no sample may reach it. Without a full scale (None), a signal is clipped under two
    conditions. Its largest or smallest value occurs in at least 8 successive samples, and in three times as
    many as any value of the baseline. Noise does not disappear at the top of a pulse. ``value``: recorded
    samples with their offset, shape [n].
    """
    if full_scale is not None:
        if not full_scale > 0.0:
            raise ValueError(f"{name}: full_scale must be > 0, got {full_scale}")
        beyond = np.flatnonzero(np.abs(value) >= full_scale)
        if beyond.size:
            raise ValueError(
                f"{name}: {beyond.size} samples reach full scale, the first {value[beyond[0]]:.6g} at sample"
                f" {beyond[0]}; all must be below {full_scale:.6g}: choose a wider range on the recorder, or"
                " correct full_scale"
            )
        return
    starts, lengths = _runs(value)
    limit = max(8, 3 * baseline.longest_run)
    for extreme in (value.max(), value.min()):
        held = np.flatnonzero((value[starts] == extreme) & (lengths >= limit))
        if held.size:
            i, n = int(starts[held[0]]), int(lengths[held[0]])
            raise ValueError(
                f"{name}: stays at its extreme {extreme:.6g} for {n} samples from sample {i} on, the baseline"
                f" at no value for more than {baseline.longest_run}: it is clipped; choose a wider range on"
                " the recorder, or state full_scale if it is not"
            )


def _runs(value: FloatArray) -> tuple[IntArray, IntArray]:
    """First sample and length of every stretch of equal samples."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(value) != 0.0) + 1])
    return starts, np.diff(starts, append=value.size)


CONTRASTS = 3
"""Number of the slowest cosine components of the baseline. They give the strength of the drift."""
WEAKEST = 1.0
"""Strength D0 above which the prior density (1 + D / D0)^-1 decreases [-]. Its unit is the strength at which
the slowest part of the drift equals that of the noise. With `CONTRASTS` it is chosen to cover steady drifts
too."""
MODES = 4
"""Number of modes of the drift after the baseline. They contain 95 % of its variance."""
DRIFTING = ("gauge, zero", "gauge, drift", "gauge, drift's slope")
"""Ends of the names of the budget's inputs for zero and drift, without numbers."""


def diffusion(value: FloatArray, interval: float, *, sigma: float, memory: float) -> float:
    """Strength D of the random walk in the baseline, by its posterior mean [unit^2/s].

    A random walk of variance D t, minus its mean over the baseline T, is a sum of cosines cos(k pi t / T).
    Their coefficients a_k are sqrt(2) times the mean of value times cosine. They are independent and have the
    variance D T / (k pi)^2. Noise adds s^2 = sigma^2 memory / n to each, Eq. (U.17). D is the mean of its
    posterior from the first `CONTRASTS` of them. The prior density is (1 + D / D0)^-1, D0 = `WEAKEST` s^2
    pi^2 / T. The estimate is a continuous function of the samples. No test decides whether there is drift.

    ``value``: samples of the baseline, shape [n]. ``interval``: sampling interval [s]. ``sigma``: standard
    deviation of a sample's noise, > 0. ``memory``: number of samples per independent one [-], >= 1.
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


def drift_quantities(gauge: str, strength: float, length: float) -> list[Quantity]:
    """The drift up to `length` after the baseline's end, as independent inputs of a budget.

    Karhunen's modes of a random walk. Input k is the amplitude of sin((k - 1/2) pi t / length), with the
    variance 2 D length / ((k - 1/2) pi)^2, Eq. (U.18). The variances are scaled: the first `MODES` contain
    all of the walk's variance over the time.

    ``gauge``: name of the gauge, with which the names begin. ``strength``: D [1/s]. ``length``: time
    from the baseline's end to the last used sample [s], > 0.
    """
    k = np.arange(1, MODES + 1)
    share = 2.0 / ((k - 0.5) * pi) ** 2
    sigma = np.sqrt(strength * length * share / share.sum())
    return [
        Quantity(f"{gauge}, drift {i}", 0.0, float(s), "1", "A", CONTRASTS)
        for i, s in zip(k, sigma, strict=True)
    ]


def drift_at(time: FloatArray, end: float, length: float, amplitudes: FloatArray) -> FloatArray:
    """Drift after the baseline's end [s] for amplitudes of its modes, shape [n]. It is zero before.

    ``length``: as for `drift_quantities`.
    """
    t = np.clip((time - end) / length, 0.0, 1.0)
    k = np.arange(1, amplitudes.size + 1)
    return np.asarray(amplitudes @ np.sin(np.outer(k - 0.5, pi * t)))
