"""A force transducer, its amplifier, its cable and the recorder: from newtons to codes, element by element.

The order is that of the laboratory: inertia of the platen, sensitivity, droop, bandwidth, the cable's delay,
sampling with jitter, baseline and noise, quantisation with clipping. Signals are piecewise linear between
samples and at rest before the first, and the two filters are exact for such signals.
"""

import numpy as np
from scipy.signal import lfilter

from kolsky.base.arrays import FloatArray


def with_inertia(force: FloatArray, mass: float, acceleration: FloatArray) -> FloatArray:
    """Force on the sensing plane [N]: that on the specimen and what moves the platen between, Eq. (E.5).

    Parameters
    ----------
    force
        Force between platen and specimen, compression-positive [N], shape [n].
    mass
        Of the platen [kg].
    acceleration
        Of the platen, toward the specimen [m/s^2], shape [n].
    """
    return np.asarray(force + mass * acceleration)


def low_pass(signal: FloatArray, step: float, frequency: float) -> FloatArray:
    """The signal after a first-order low-pass, Eq. (E.6).

    Parameters
    ----------
    signal
        Uniform samples, shape [n]; the filter is at rest with the first one.
    step
        Time from sample to sample [s].
    frequency
        Where the filter has -3 dB [Hz].
    """
    x = 2.0 * np.pi * frequency * step
    decay = np.exp(-x)
    # Exact for a straight line between samples: y_1 = d y_0 + (g - d) u_0 + (1 - g) u_1, g = (1 - d) / x.
    share = -np.expm1(-x) / x
    level = signal[0]
    filtered = lfilter([1.0 - share, share - decay], [1.0, -decay], signal - level)
    return np.asarray(filtered + level)


def droop(signal: FloatArray, step: float, time_constant: float) -> FloatArray:
    """The signal of a transducer whose charge leaks: a first-order high-pass, the inverse of Eq. (U.6).

    Parameters
    ----------
    signal
        Uniform samples, 0 at rest, shape [n].
    step
        Time from sample to sample [s].
    time_constant
        Time in which the output of a constant force falls to 1/e [s].
    """
    return np.asarray(signal - low_pass(signal, step, 1.0 / (2.0 * np.pi * time_constant)))


def sampled(
    signal: FloatArray,
    start: float,
    step: float,
    times: FloatArray,
    *,
    delay: float = 0.0,
    jitter: float = 0.0,
    rng: np.random.Generator,
) -> FloatArray:
    """Samples of a signal that arrives late, taken at times that scatter, of the times' shape.

    Parameters
    ----------
    signal
        Uniform samples, at rest before the first, shape [n].
    start, step
        Time of the first sample and from one to the next [s].
    times
        Nominal times of the recorder [s].
    delay
        How late the signal arrives [s].
    jitter
        Standard deviation of a sample's time [s].
    rng
        Stream of the jitter.

    Raises
    ------
    ValueError
        If the recorder goes on after the signal ends.
    """
    at = times - delay + jitter * rng.standard_normal(len(times))
    known = start + step * np.arange(len(signal))
    if at.max() > known[-1] + 1e-12:
        raise ValueError(f"the recorder asks for {at.max():.9g} s, the signal ends at {known[-1]:.9g} s")
    return np.interp(at, known, signal)


def baseline(times: FloatArray, level: float, drift: float) -> FloatArray:
    """The recorder's zero: a level at time 0 and its change with time [V], of the times' shape."""
    return np.asarray(level + drift * times)


def code_step(full_scale: float, bits: int) -> float:
    """Volts of one code of a recorder from -full_scale to +full_scale."""
    return 2.0 * full_scale / 2**bits


def quantised(volts: FloatArray, full_scale: float, bits: int) -> FloatArray:
    """Volts as the recorder's nearest codes give them, clipped to the first and last code, Eq. (E.7)."""
    step = code_step(full_scale, bits)
    codes = np.clip(np.rint(volts / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return np.asarray(codes * step)
