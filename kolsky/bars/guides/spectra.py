"""Windows and filters of Fourier transforms: tapered ends, the edge of a band, the noise that it passes."""

from dataclasses import replace
from math import isfinite, pi

import numpy as np

from kolsky.bars.records import Signal
from kolsky.base.arrays import ComplexArray, FloatArray

ROLL_OFF = 0.2
"""Width of a band's half-cosine edge, as a share of its limit; it ends at the limit."""


def windowed(signal: Signal, window: tuple[float, float], *, taper: float | None = None) -> Signal:
    """The signal within a window, faded to zero by half-cosines outside.

    Parameters
    ----------
    signal : Signal
        The signal; samples inside the window stay what they are.
    window : tuple of float
        First and last time on the shot's clock [s].
    taper : float, optional
        Length of each fade [s]; without it a fiftieth of the window.

    Raises
    ------
    ValueError
        If the window is empty or outside the signal.
    """
    first, last = window
    if not (signal.start - signal.interval <= first < last <= signal.end + signal.interval):
        raise ValueError(
            f"a window must be ascending and within [{signal.start:.6g}, {signal.end:.6g}] s, "
            f"got [{first:.6g}, {last:.6g}] s"
        )
    length = 0.02 * (last - first) if taper is None else taper
    outside = np.maximum(np.maximum(first - signal.time, signal.time - last), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(outside > 0.0, np.minimum(outside / length, 1.0), 0.0)
    value = signal.value * 0.5 * (1.0 + np.cos(pi * share))
    return replace(signal, value=value)


def faded(value: FloatArray, before: int, length: int, *, fade: int, rising: bool = True) -> FloatArray:
    """Samples after `before` zeros, with half-cosines of `fade` samples from both ends' values to zero.

    Shape [length]; a record that does not end at zero leaves no jump. Without `rising` only the end fades.
    """
    padded = np.zeros(length)
    n = value.size
    padded[before : before + n] = value
    falling = 0.5 * (1.0 + np.cos(pi * np.arange(1, fade + 1) / (fade + 1)))
    padded[before + n : before + n + fade] = value[-1] * falling
    if rising:
        padded[before - fade : before] = value[0] * falling[::-1]
    return padded


def edge_filter(frequency: FloatArray, limit: float) -> FloatArray:
    """Low-pass [-] at frequencies [Hz]: 1, then a half-cosine to 0 at the limit, `ROLL_OFF` of it wide."""
    if not isfinite(limit):
        return np.ones(frequency.size)
    share = np.clip((frequency / limit - 1.0 + ROLL_OFF) / ROLL_OFF, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(pi * share))


def mean_square(factor: ComplexArray, length: int, memory: float = 1.0) -> float:
    """Mean square of a filter's response [-]: variance of noise after over before.

    Noise of which `memory` samples carry the information of one is even up to that part of the band, and
    nothing above.
    """
    weight = np.full(factor.size, 2.0)
    weight[0] = 1.0
    if length % 2 == 0:
        weight[-1] = 1.0
    weight[max(8, round(factor.size / max(memory, 1.0))) :] = 0.0
    return float((weight * np.abs(factor) ** 2).sum() / weight.sum())
