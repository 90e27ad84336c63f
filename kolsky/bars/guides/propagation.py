"""A signal carried along a bar: forward or back, dispersed or shifted, without wrap-around."""

from dataclasses import dataclass, replace
from math import isfinite, pi

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from kolsky.bars.guides.spectra import edge_filter, faded, mean_square, windowed
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import Signal
from kolsky.base.arrays import FloatArray

LARGEST_GAIN = 10.0
"""Amplification of a spectral component that propagation allows before it ends the band [-]."""
_SLOPES = 1024
"""Frequencies at which the delay of the slowest component is sought."""
FEWEST_SAMPLES = 8
"""A signal with fewer samples has no spectrum worth the name."""


@dataclass(frozen=True)
class Propagation:
    """A signal at another place of the bar, and what the way has done to it."""

    signal: Signal
    """The signal there; its sigma is that of the samples' noise after the way."""
    band: float
    """Frequency above which nothing is left [Hz]; inf if all was kept."""
    energy: float
    """Sum of squares of the result over that of the signal (windowed, if there is a window) [-]: 1 in a bar
    without loss, less what lies outside the result's times."""
    noise_gain: float
    """Sigma of a sample after over before [-]."""
    largest_gain: float
    """Largest amplification of a spectral component in the band [-]."""
    size: float
    """Largest difference from a plain shift by distance / c0, in the signal's unit."""
    rms: float
    """Root mean square of that difference over the result, in the signal's unit."""


def propagate(
    signal: Signal,
    waveguide: Waveguide,
    distance: float,
    *,
    window: tuple[float, float] | None = None,
    band: float | None = None,
    start: float | None = None,
    samples: int | None = None,
    largest_gain: float = LARGEST_GAIN,
) -> Signal:
    """The signal of one wave at a distance along its way; see `propagation` for the parameters."""
    return propagation(
        signal,
        waveguide,
        distance,
        window=window,
        band=band,
        start=start,
        samples=samples,
        largest_gain=largest_gain,
    ).signal


def propagation(
    signal: Signal,
    waveguide: Waveguide,
    distance: float,
    *,
    window: tuple[float, float] | None = None,
    band: float | None = None,
    start: float | None = None,
    samples: int | None = None,
    largest_gain: float = LARGEST_GAIN,
) -> Propagation:
    """Carry a wave's signal along a bar, Eq. (B.9).

    The result starts when the signal's start arrives at `waveguide.wave_speed`, so that only the difference
    from a plain shift passes through the Fourier transform: in a bar without dispersion the samples stay
    what they are, and their times are exact. Beyond its ends the signal fades out over padding that is longer
    than the slowest component's delay, so that nothing wraps around.

    Parameters
    ----------
    signal : Signal
        One wave's signal (strain, force, velocity), free of other waves within `window` at least.
    waveguide : Waveguide
        The bar.
    distance : float
        Way along the wave's direction [m]; negative goes back to where the wave came from.
    window : tuple of float, optional
        First and last time that belong to the wave, on the shot's clock [s]; outside, the signal fades to
        zero within a fiftieth of the window.
    band : float, optional
        Frequency at which a half-cosine edge, `spectra.ROLL_OFF` of it wide, ends the spectrum [Hz].
    start : float, optional
        Time of the result's first sample [s], if it shall lie on a clock of its own; interpolated within the
        band of the sampling.
    samples : int, optional
        Length of the result; without it, that of the signal.
    largest_gain : float
        Amplification at which the band of a lossy bar ends when going back [-], > 1.

    Returns
    -------
    Propagation
        With the band that was kept and the amplification of the noise.

    Raises
    ------
    ValueError
        If an argument is outside its range, a sample is not finite, or the band leaves nothing.
    """
    _check(signal, distance, window, band, largest_gain)
    value = signal.value if window is None else windowed(signal, window).value
    n, step = value.size, signal.interval
    count = n if samples is None else samples
    arrival = signal.start + distance / waveguide.wave_speed
    first = arrival if start is None else start
    whole = round((first - arrival) / step)
    fraction = (first - arrival) / step - whole  # of a sample
    limit = min(waveguide.largest_frequency, np.inf if band is None else band)

    fade = max(64, n // 4)
    before = fade + _largest_delay(waveguide, distance, step, limit) + max(0, -whole)
    after = before + max(0, whole + count - n)
    length = next_fast_len(before + n + after, real=True)
    frequency = rfftfreq(length, step)
    kept = frequency <= limit
    turn = np.zeros(frequency.size, dtype=complex)
    omega = 2.0 * pi * frequency[kept]
    late = waveguide.wavenumber(omega) - omega / waveguide.wave_speed
    gain = np.exp(late.imag * distance)
    if gain.max(initial=0.0) > largest_gain * (1.0 + 1e-12):
        limit = min(limit, float(frequency[kept][np.argmax(gain > largest_gain)]))
        kept_again = frequency[kept] <= limit
        late, omega, gain = late[kept_again], omega[kept_again], gain[kept_again]
        kept = frequency <= limit
    edge = edge_filter(frequency[kept], limit)
    turn[kept] = edge * np.exp(-1j * late * distance + 1j * omega * fraction * step)
    if not edge[1:].any():
        raise ValueError(f"nothing is left below {limit:g} Hz. Cure: a wider band or a longer record")

    padded = faded(value, before, length, fade=fade)
    carried = irfft(rfft(padded) * turn, length)
    result = carried[before + whole : before + whole + count]
    shifted = padded[before + whole : before + whole + count]
    total = float(value @ value)
    noise = float(np.sqrt(mean_square(turn, length, signal.memory)))
    change = (
        result - shifted if fraction == 0.0 else result - _shifted(padded, fraction, before + whole, count)
    )
    return Propagation(
        signal=_with_noise(signal, first, result, noise, abs(turn[0]), signal.unit),
        band=float(limit),
        energy=float(result @ result) / total if total > 0.0 else 1.0,
        noise_gain=noise,
        largest_gain=float((edge * gain).max()),
        size=float(np.abs(change).max(initial=0.0)),
        rms=float(np.sqrt(np.mean(change**2))) if change.size else 0.0,
    )


def force_of(strain: Signal, waveguide: Waveguide, *, band: float | None = None) -> Signal:
    """Force through the section that goes with a strain, Eq. (B.6), component by component [N]."""
    return _multiplied(strain, waveguide, "N", band)


def velocity_of(strain: Signal, waveguide: Waveguide, *, band: float | None = None) -> Signal:
    """Mean particle velocity that goes with the strain of one wave, along its direction [m/s]."""
    return _multiplied(strain, waveguide, "m/s", band)


def _multiplied(strain: Signal, waveguide: Waveguide, unit: str, band: float | None) -> Signal:
    _check(strain, 0.0, None, band, LARGEST_GAIN)
    n = strain.value.size
    fade = max(64, n // 4)
    length = next_fast_len(n + 2 * fade, real=True)
    frequency = rfftfreq(length, strain.interval)
    limit = min(waveguide.largest_frequency, np.inf if band is None else band)
    kept = frequency <= limit
    omega = 2.0 * pi * frequency[kept]
    factor = np.zeros(frequency.size, dtype=complex)
    factor[kept] = waveguide.stiffness(omega) * edge_filter(frequency[kept], limit)
    if unit == "m/s":
        factor[kept] /= waveguide.impedance(omega)
    value = irfft(rfft(faded(strain.value, fade, length, fade=fade)) * factor, length)[fade : fade + n]
    noise = float(np.sqrt(mean_square(factor, length, strain.memory)))
    return _with_noise(strain, strain.start, value, noise, abs(factor[0]), unit)


def _with_noise(
    signal: Signal, start: float, value: FloatArray, noise: float, at_rest: float, unit: str
) -> Signal:
    """Filtered signal with the sigma and the memory of its noise; `at_rest` is the gain of slow noise."""
    memory = max(1.0, signal.memory * (at_rest / noise) ** 2) if noise > 0.0 else signal.memory
    return replace(signal, start=start, value=value, sigma=signal.sigma * noise, unit=unit, memory=memory)


def _largest_delay(waveguide: Waveguide, distance: float, step: float, limit: float) -> int:
    """Samples by which the slowest component is later than the arrival, from the slope of the phase."""
    omega = 2.0 * pi * np.linspace(0.0, min(0.5 / step, limit), _SLOPES)
    late = waveguide.wavenumber(omega).real - omega / waveguide.wave_speed
    slowest = float(np.abs(np.diff(late) / np.diff(omega)).max()) * abs(distance)
    return int(np.ceil(slowest / step)) + 1


def _shifted(padded: FloatArray, fraction: float, first: int, count: int) -> FloatArray:
    """A plain shift by a fraction of a sample, for the size of what dispersion adds."""
    omega = 2.0 * pi * rfftfreq(padded.size)
    return irfft(rfft(padded) * np.exp(1j * omega * fraction), padded.size)[first : first + count]


def _check(
    signal: Signal,
    distance: float,
    window: tuple[float, float] | None,
    band: float | None,
    largest_gain: float,
) -> None:
    if signal.value.ndim != 1 or signal.value.size < FEWEST_SAMPLES:
        raise ValueError(f"a signal needs {FEWEST_SAMPLES} samples or more, got {signal.value.size}")
    if not np.isfinite(signal.value).all():
        bad = int(np.argmin(np.isfinite(signal.value)))
        raise ValueError(
            f"sample {bad} of {signal.name or 'the signal'} is not finite, at {signal.time[bad]:g} s"
        )
    if not (isfinite(signal.interval) and signal.interval > 0.0):
        raise ValueError(f"the sampling interval must be > 0 s, got {signal.interval}")
    if not isfinite(distance):
        raise ValueError(f"the distance must be finite, got {distance} m")
    if band is not None and not band > 0.0:
        raise ValueError(f"a band limit must be > 0 Hz, got {band}")
    if not largest_gain > 1.0:
        raise ValueError(f"the largest gain must be > 1, got {largest_gain}")
