"""Propagation of a signal along a bar, and the bar's wave speed from a pulse that passes two stations.

Signals are padded and tapered, because they would otherwise wrap around. They move forward or back, with or
without dispersion.
"""

from dataclasses import dataclass, replace
from math import isfinite, pi, sqrt

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.optimize import least_squares

from dic.basics import check_interval
from dic.views import ResultViews
from kolsky.bars.guides.waveguide import ElasticWaveguide, Waveguide
from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import ComplexArray, FloatArray

_ROLL_OFF = 0.2
"""Width of a band's half-cosine edge, as a share of its limit. It ends at the limit."""


def windowed(signal: Signal, window: tuple[float, float]) -> Signal:
    """The signal within a window [s]. Outside, half-cosines over a fiftieth of it fade it to zero."""
    first, last = window
    if not (signal.start - signal.interval <= first < last <= signal.end + signal.interval):
        raise ValueError(
            f"a window must be ascending and within [{signal.start:.6g}, {signal.end:.6g}] s, "
            f"got [{first:.6g}, {last:.6g}] s"
        )
    length = 0.02 * (last - first)
    outside = np.maximum(np.maximum(first - signal.time, signal.time - last), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(outside > 0.0, np.minimum(outside / length, 1.0), 0.0)
    value = signal.value * 0.5 * (1.0 + np.cos(pi * share))
    return replace(signal, value=value)


def fade_ends(value: FloatArray, before: int, length: int, *, fade: int, rising: bool = True) -> FloatArray:
    """Samples after `before` zeros, with half-cosines of `fade` samples from both ends' values to zero.

    Shape [length]. The result has no jump even if the record does not end at zero. Without `rising`, only the
    end is faded.
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
    """Low-pass [-] at frequencies [Hz]: 1, then a half-cosine to 0 at the limit.

    The half-cosine is `ROLL_OFF` of the limit wide.
    """
    if not isfinite(limit):
        return np.ones(frequency.size)
    share = np.clip((frequency / limit - 1.0 + _ROLL_OFF) / _ROLL_OFF, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(pi * share))


def mean_square(factor: ComplexArray, length: int, memory: float = 1.0) -> float:
    """Mean square of a filter's response [-]: variance of the noise after the filter over that before.

    Noise with a given `memory` (samples per independent one) is modelled as white up to a part of the band,
    and zero above.
    """
    weight = np.full(factor.size, 2.0)
    weight[0] = 1.0
    if length % 2 == 0:
        weight[-1] = 1.0
    weight[max(8, round(factor.size / max(memory, 1.0))) :] = 0.0
    return float((weight * np.abs(factor) ** 2).sum() / weight.sum())


_LARGEST_GAIN = 10.0
"""Largest amplification of a spectral component [-]. Propagation ends the band where this is exceeded."""
_SLOPES = 1024
"""Number of frequencies in the search for the delay of the slowest component."""


@dataclass(frozen=True)
class Propagation:
    """A signal at another position of the bar, and the effects of propagation."""

    signal: Signal
    """The signal at the other position. Its sigma is that of the samples' noise after propagation."""
    band: float
    """Frequency above which the signal was filtered out [Hz]; inf without a filter."""
    energy: float
    """Sum of squares of the result, divided by that of the signal (in its window, if any) [-]. It is 1 in a
    bar without loss, minus the part outside the result's times."""
    noise_gain: float
    """Sigma of a sample after propagation, divided by sigma before [-]."""
    size: float
    """Largest difference from a plain shift by distance / c0, in the signal's unit."""
    rms: float
    """Root mean square of that difference over the result, in the signal's unit."""


def propagation(
    signal: Signal,
    waveguide: Waveguide,
    distance: float,
    *,
    window: tuple[float, float] | None = None,
    band: float | None = None,
    start: float | None = None,
    samples: int | None = None,
) -> Propagation:
    """Propagate a wave's signal along a bar, Eq. (B.9).

    The result begins at the arrival of the signal's start with `waveguide.wave_speed`. The Fourier transform
    applies only the deviation from a pure time shift. In a bar without dispersion, the samples are unchanged
    and their times exact. The padding of the signal is longer than the delay of the slowest component.
    Therefore no component wraps around.

    ``signal``: one wave's signal (strain, force, velocity), free of other waves within `window` at least.
    ``waveguide``: the bar. ``distance``: distance along the wave's direction [m]; negative: back toward the
    wave's origin. ``window``: first and last time of the wave on the shot's clock [s]. Outside, the signal
    fades to zero within a fiftieth of the window. ``band``: frequency at which the spectrum ends [Hz]. Its
    half-cosine edge is `spectra.ROLL_OFF` of the band wide. ``start``: time of the result's first sample [s],
    if the result needs a different clock. The result is interpolated within the band of the sampling.
    ``samples``: length of the result; default: that of the signal. Returns: with the band that was kept and
    the amplification of the noise. For propagation back, the band of a lossy bar ends at an amplification of
    10. Raises ValueError if an argument is outside its range, or if the band is empty.
    """
    check_interval("(-inf, inf)", distance=distance)
    check_interval("(0, inf] Hz", band=np.inf if band is None else band)
    check_interval("[8, inf)", **{"number of samples": signal.value.size})
    value = signal.value if window is None else windowed(signal, window).value
    n, step = value.size, signal.interval
    count = n if samples is None else samples
    arrival = signal.start + distance / waveguide.wave_speed
    first = arrival if start is None else start
    whole = round((first - arrival) / step)
    fraction = (first - arrival) / step - whole  # of a sample
    limit = np.inf if band is None else band

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
    if gain.max(initial=0.0) > _LARGEST_GAIN * (1.0 + 1e-12):
        limit = min(limit, float(frequency[kept][np.argmax(gain > _LARGEST_GAIN)]))
        kept_again = frequency[kept] <= limit
        late, omega, gain = late[kept_again], omega[kept_again], gain[kept_again]
        kept = frequency <= limit
    edge = edge_filter(frequency[kept], limit)
    turn[kept] = edge * np.exp(-1j * late * distance + 1j * omega * fraction * step)
    if not edge[1:].any():
        raise ValueError(f"nothing is left below {limit:g} Hz. Cure: a wider band or a longer record")

    padded = fade_ends(value, before, length, fade=fade)
    carried = irfft(rfft(padded) * turn, length)
    result = carried[before + whole : before + whole + count]
    shifted = padded[before + whole : before + whole + count]
    total = float(value @ value)
    noise = float(np.sqrt(mean_square(turn, length, signal.memory)))
    change = (
        result - shifted if fraction == 0.0 else result - _shifted(padded, fraction, before + whole, count)
    )
    # The memory grows by the gain of slow noise over that of all noise.
    memory = max(1.0, signal.memory * (abs(turn[0]) / noise) ** 2) if noise > 0.0 else signal.memory
    return Propagation(
        signal=replace(signal, start=first, value=result, sigma=signal.sigma * noise, memory=memory),
        band=float(limit),
        energy=float(result @ result) / total if total > 0.0 else 1.0,
        noise_gain=noise,
        size=float(np.abs(change).max(initial=0.0)),
        rms=float(np.sqrt(np.mean(change**2))) if change.size else 0.0,
    )


def _largest_delay(waveguide: Waveguide, distance: float, step: float, limit: float) -> int:
    """Delay of the slowest component after the arrival, in samples, from the slope of the phase."""
    omega = 2.0 * pi * np.linspace(0.0, min(0.5 / step, limit), _SLOPES)
    late = waveguide.wavenumber(omega).real - omega / waveguide.wave_speed
    slowest = float(np.abs(np.diff(late) / np.diff(omega)).max()) * abs(distance)
    return int(np.ceil(slowest / step)) + 1


def _shifted(padded: FloatArray, fraction: float, first: int, count: int) -> FloatArray:
    """A plain shift by a fraction of a sample, for comparison with the effect of dispersion."""
    omega = 2.0 * pi * rfftfreq(padded.size)
    return irfft(rfft(padded) * np.exp(1j * omega * fraction), padded.size)[first : first + count]


_SEARCH = 0.1
"""The wave speed is searched within this share of the declared one [-]."""
_POISSON_STEP = 0.01
"""Difference of Poisson's ratio over which sensitivities are taken [-]."""


@dataclass(frozen=True)
class BarsTogether(ResultViews):
    """Wave speed and relative gain from a pulse between two stations, Eq. (B.11)."""

    bar: Bar
    """The bar with Young's modulus from the fitted speed and the declared density."""
    wave_speed: float
    """Fitted c0 [m/s]."""
    gain: float
    """Fitted ratio of the later to the earlier pulse [-]; ideally 1 (-1 after one free end)."""
    covariance: FloatArray
    """Covariance of `wave_speed` and `gain`, shape [2, 2]. It is based on the residual's variance times its
    correlation length in samples. The noise of both gauges is used if it is larger. Distance and Poisson's
    ratio are not included."""
    distance: float
    """Distance between the stations [m]; d(c0) / c0 = d(distance) / distance."""
    time: FloatArray
    """Times of the residual on the shot's clock [s], shape [n]."""
    measured: FloatArray
    """The later pulse [-], shape [n]."""
    residual: FloatArray
    """Fitted minus measured later pulse [-], shape [n]."""
    rms: float
    """Root mean square of the residual, divided by the peak of the later pulse [-]."""
    largest: float
    """Largest residual divided by that peak [-]."""
    plain_rms: float
    """The residual's rms for a plain shift with its best speed and gain [-]."""
    plain_wave_speed: float
    """Speed of that plain shift [m/s]."""
    band: float
    """Frequency up to which the earlier pulse exceeds its noise and is used [Hz]; inf without noise."""
    alike: float
    """Correlation length of the residuals in samples, by their integrated correlation [-], >= 1."""
    by_poisson: float
    """Change of the fitted c0 per unit of Poisson's ratio [m/s]."""
    rms_by_poisson: tuple[float, float]
    """`rms` with Poisson's ratio `POISSON_STEP` lower and higher [-]."""

    @property
    def wave_speed_sigma(self) -> float:
        """Standard uncertainty of `wave_speed` from the fit [m/s]."""
        return sqrt(self.covariance[0, 0])

    @property
    def gain_sigma(self) -> float:
        """Standard uncertainty of `gain` from the fit [-]."""
        return sqrt(self.covariance[1, 1])


def wave_speed(
    incident: BarSignal,
    transmission: BarSignal,
    *,
    incident_window: tuple[float, float],
    transmitted_window: tuple[float, float],
) -> BarsTogether:
    """Fit c0 and the relative gain to a test of the two bars without a specimen.

    The pulse at the transmission gauge is computed from that at the incident gauge. It is dispersed over the
    distance between them and multiplied by the ratio of the two channels' gains.

    ``incident``, ``transmission``: the stations; bars of the same diameter, density, modulus and Poisson's
    ratio. ``incident_window``: first and last time of the pulse at the incident gauge [s], without any other
    wave. ``transmitted_window``: times at the transmission gauge over which the pulses are compared [s].
    Raises ValueError if the bars or sampling intervals differ, if a window is outside its signal, or if the
    fitted speed is at an end of the search range.
    """
    for name in ("diameter", "density", "youngs_modulus", "poisson"):
        one, other = getattr(incident.bar, name), getattr(transmission.bar, name)
        if one != other:
            raise ValueError(
                f"bars together must be alike, {name} is {one:g} and {other:g}. Cure: calibrate each bar by "
                "its echo"
            )
    first, later, bar = incident.strain, transmission.strain, incident.bar
    distance = incident.position + transmission.position
    if abs(first.interval / later.interval - 1.0) > 1e-9:
        raise ValueError(f"sampling intervals must be equal, got {first.interval:g} and {later.interval:g} s")
    a, b = transmitted_window
    if not (later.start <= a < b <= later.end + later.interval):
        raise ValueError(
            f"the later window must be ascending and within [{later.start:.6g}, {later.end:.6g}] s, "
            f"got [{a:.6g}, {b:.6g}] s"
        )
    kept = (later.time >= a) & (later.time <= b)
    time, measured = later.time[kept], later.value[kept]
    if measured.size < 20:
        raise ValueError(f"the later window holds {measured.size} samples, needs 20 or more")
    stated = bar.wave_speed
    peak = float(np.abs(measured).max())
    # Noise of the first pulse above that frequency would steepen the model's slopes. The uncertainty of the
    # speed would then be too small.
    band = _above_noise(windowed(first, incident_window))

    def model(speed: float, poisson: float | None) -> FloatArray:
        """The later pulse with gain 1; a plain shift without Poisson's ratio."""
        nu = bar.poisson if poisson is None else poisson
        trial = replace(bar, youngs_modulus=bar.density * speed**2, poisson=nu)
        guide = ElasticWaveguide(trial, dispersive=poisson is not None)
        return propagation(
            first, guide, distance, window=incident_window, band=band, start=float(time[0]), samples=time.size
        ).signal.value

    def solve(poisson: float | None, start: float) -> tuple[float, float, FloatArray, FloatArray]:
        """Speed, gain, residual divided by the peak, and its Jacobian by c0 / declared and gain."""
        found = least_squares(
            lambda x: (x[1] * model(x[0] * stated, poisson) - measured) / peak,
            [start / stated, 1.0],
            bounds=([1.0 - 1.5 * _SEARCH, -np.inf], [1.0 + 1.5 * _SEARCH, np.inf]),
            x_scale=[1e-3, 1e-2],
            xtol=1e-12,
            ftol=1e-12,
            diff_step=1e-5,
        )
        return float(found.x[0] * stated), float(found.x[1]), found.fun, found.jac

    # The sum of squares has a single minimum only near the correct shift. The search therefore starts at the
    # best of many shifts.
    trials = stated * np.linspace(1.0 - _SEARCH, 1.0 + _SEARCH, 81)
    overlap = [_cosine(model(float(speed), None), measured) for speed in trials]
    best = int(np.argmax(overlap))
    if best in (0, trials.size - 1):
        raise ValueError(
            f"no wave speed within {100 * _SEARCH:g} % of {stated:.0f} m/s fits. Cure: check the distances "
            "of the gauges, the modulus and density of the bar, and both windows"
        )
    plain = solve(None, float(trials[best]))
    speed, gain, residual, jacobian = solve(bar.poisson, plain[0])
    ends = max(bar.poisson - _POISSON_STEP, 0.0), min(bar.poisson + _POISSON_STEP, 0.499)
    low, high = (solve(nu, speed) for nu in ends)
    alike = _correlated_samples(residual)
    # Only slow noise changes speed and gain. All slow noise of the first pulse is in the band.
    noise = (gain * first.sigma) ** 2 * first.memory + later.sigma**2 * later.memory
    variance = max(alike * float(residual @ residual) / (residual.size - 2), noise / peak**2)
    scale = np.array([stated, 1.0])
    covariance = np.asarray(variance * np.linalg.inv(jacobian.T @ jacobian) * np.outer(scale, scale))
    return BarsTogether(
        bar=replace(bar, youngs_modulus=bar.density * speed**2),
        wave_speed=speed,
        gain=gain,
        covariance=covariance,
        distance=distance,
        time=time,
        measured=measured,
        residual=residual * peak,
        rms=_rms(residual),
        largest=float(np.abs(residual).max()),
        plain_rms=_rms(plain[2]),
        plain_wave_speed=plain[0],
        band=np.inf if band is None else band,
        alike=alike,
        by_poisson=(high[0] - low[0]) / (ends[1] - ends[0]),
        rms_by_poisson=(_rms(low[2]), _rms(high[2])),
    )


def _above_noise(pulse: Signal) -> float | None:
    """Frequency above which a pulse is below five times its noise, plus the width of an edge."""
    if not pulse.sigma > 0.0:
        return None
    spectrum = np.abs(rfft(pulse.value))
    noise = pulse.sigma * np.sqrt(pulse.memory * np.count_nonzero(pulse.value))
    above = np.flatnonzero(spectrum > 5.0 * noise)
    if above.size == 0:
        raise ValueError("the first window holds nothing above the noise. Cure: another window")
    return float(rfftfreq(pulse.value.size, pulse.interval)[above[-1]] / (1.0 - _ROLL_OFF))


def _cosine(a: FloatArray, b: FloatArray) -> float:
    """Cosine of the angle between two pulses [-]."""
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def _correlated_samples(residual: FloatArray) -> float:
    """Integrated correlation of a residual [samples], up to its first zero crossing."""
    n = residual.size
    lagged = np.correlate(residual, residual, mode="full")[n - 1 :]
    if lagged[0] == 0.0:
        return 1.0
    correlation = lagged / lagged[0]
    negative = np.flatnonzero(correlation <= 0.0)
    end = int(negative[0]) if negative.size else n
    return max(1.0, 1.0 + 2.0 * float(correlation[1:end].sum()))


def _rms(residual: FloatArray) -> float:
    return float(np.sqrt(np.mean(residual**2)))
