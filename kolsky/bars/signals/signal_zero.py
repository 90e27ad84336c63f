"""The stretch before the pulse: zero, noise with its correlation, drift, quantisation, clipping."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes a quarter of a second to load

from kolsky.bars.signals.noise import Noise, estimate_noise
from kolsky.base.arrays import FloatArray, IntArray

FEWEST_SAMPLES = 20
"""With 20 samples the noise is known to 16 %."""
REST = 8.0
"""Deviation of a part of the baseline from the median part, in scaled median deviations, that is no rest."""
FEWEST_BLOCKS = 8
"""Fewest parts of a baseline that are compared with each other."""
SIGNIFICANCE = 0.01
"""Probability with which a baseline without drift is said to have one."""


@dataclass(frozen=True)
class SignalZero:
    """A stretch in which nothing happens; values in the unit of the signal."""

    first: float
    """Time of its first sample [s]."""
    last: float
    """Time of its last sample [s]."""
    count: int
    """Samples."""
    mean: float
    """Mean: the signal's zero."""
    mean_sigma: float
    """Standard uncertainty of the mean, Eq. (U.8), memory of the noise included."""
    slope: float
    """Slope of the best line [unit/s]."""
    slope_sigma: float
    """Its standard uncertainty, memory of the noise included [unit/s]."""
    noise: Noise
    """Scatter about the line; its sigma is not below that of a step's rounding."""
    step: float
    """Quantisation step of the recorder as seen in the values; 0 where none is seen."""
    longest_run: int
    """Largest number of equal samples in a row."""

    @property
    def freedom(self) -> float:
        """Degrees of freedom of mean and slope: independent samples less the two of the line, at least 1."""
        return max(self.count / max(self.noise.memory, 1.0) - 2.0, 1.0)

    @property
    def drifts(self) -> bool:
        """True if the slope is significant by Student's t at the level of 1 %."""
        limit = float(stdtrit(self.freedom, 1.0 - 0.5 * SIGNIFICANCE))
        return abs(self.slope) > limit * self.slope_sigma

    def line(self, time: FloatArray) -> FloatArray:
        """The drift as seen from the baseline's middle, zero there, at any time [unit]."""
        return self.slope * (time - 0.5 * (self.first + self.last))


def measure_signal_zero(
    time: FloatArray, value: FloatArray, span: tuple[float, float], *, name: str
) -> SignalZero:
    """Zero, noise and drift of a signal at rest.

    Parameters
    ----------
    time
        Uniform sample times [s], shape [n].
    value
        Samples, shape [n].
    span
        First and last time of the rest [s].
    name
        Whose baseline it is, for messages.

    Raises
    ------
    ValueError
        If the span is reversed, holds fewer than 20 samples, or all its samples are the same.
    """
    first, last = span
    if not first < last:
        raise ValueError(f"{name}: the baseline must start before it ends, got {first:.9g} to {last:.9g} s")
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
    # Noise well below half a step leaves the codes still most of the time and looks smaller than it may be.
    noise = Noise(max(noise.sigma, step / np.sqrt(12.0)), noise.correlation)
    memory = max(
        noise.memory, 1.0
    )  # what alternates is not credited with a mean better than that of white noise
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
    """Refuse a baseline that holds part of a pulse.

    Means over `width` samples are compared with their median: two in a row, or the last one, that are off by
    more than `REST` times their median deviation are no rest. Noise, hum and a steady drift are: the median
    deviation has them in it.

    Parameters
    ----------
    value
        Samples of the baseline, shape [n].
    width
        Samples that are averaged, the fastest rise of a pulse, >= 1.
    name
        Whose baseline it is, for messages.
    times
        First and last time of the baseline [s], for messages.

    Raises
    ------
    ValueError
        With the time at which the rest ends.
    """
    count = value.size // width
    if count < FEWEST_BLOCKS:
        return  # too short for a median of its parts; the arrivals are checked against its end
    first = value.size - count * width
    mean = value[first:].reshape(count, width).mean(axis=1)
    off = np.abs(mean - np.median(mean))
    floor = max(quantisation_step(value), 1e-9 * float(np.abs(value).max())) / np.sqrt(12.0)
    beyond = off > REST * max(1.4826 * float(np.median(off)), floor)
    bad = np.flatnonzero(beyond & (np.append(beyond[1:], True)))
    if not bad.size:
        return
    step = (times[1] - times[0]) / max(value.size - 1, 1)
    at = times[0] + step * (first + width * int(bad[0]))
    raise ValueError(
        f"{name}: the baseline {times[0]:.6g} to {times[1]:.6g} s is not at rest: from {at:.6g} s on it is "
        f"off its median by {off[bad[0]]:.3g}, more than {REST:g} times the scatter of its parts, so that it "
        "holds part of the pulse or a disturbance. Cure: end the baseline before, or begin it behind"
    )


def quantisation_step(value: FloatArray) -> float:
    """Distance of neighbouring codes: the median gap of the distinct values; 0 if most samples are distinct.

    A recorder with codes finer than the noise by far shows none in a short stretch, and then they do not
    matter.
    """
    distinct = np.unique(value)
    if distinct.size < 2 or distinct.size > 0.5 * value.size:
        return 0.0
    return float(np.median(np.diff(distinct)))


def check_clipping(value: FloatArray, baseline: SignalZero, *, name: str, full_scale: float | None) -> None:
    """Check that a signal stayed within the recorder's range.

    With a full scale, no sample may reach it. Without, a signal is taken as clipped if it stays at its
    largest or smallest value for at least 8 samples in a row and three times as long as any value of the
    baseline: noise does not stop on top of a pulse.

    Parameters
    ----------
    value
        Recorded samples, offset included, shape [n].
    baseline
        Of the same samples.
    name
        Whose they are, for messages.
    full_scale
        Largest magnitude the recorder can show, in the unit of `value`; None if it is not known.

    Raises
    ------
    ValueError
        With the first such sample.
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
