"""The bars' own wave speed from a pulse that passes two stations: bars together, or one bar and its echo."""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.optimize import least_squares

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.spectra import ROLL_OFF, windowed
from kolsky.bars.guides.waveguide import ElasticWaveguide, check_bar
from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar
from kolsky.base.arrays import FloatArray

SEARCH = 0.1
"""The wave speed is sought within this share of the one that the bar is stated to have [-]."""
POISSON_STEP = 0.01
"""Difference of Poisson's ratio over which sensitivities are taken [-]."""


@dataclass(frozen=True)
class BarsTogether:
    """Wave speed and relative gain from a pulse between two stations, Eq. (B.11)."""

    bar: Bar
    """The bar with Young's modulus from the fitted speed and its stated density."""
    wave_speed: float
    """Fitted c0 [m/s]."""
    gain: float
    """Fitted ratio of the later to the earlier pulse, as it should be 1 (-1 after one free end) [-]."""
    covariance: FloatArray
    """Covariance of `wave_speed` and `gain`, shape [2, 2], from the residual's variance times the number of
    samples over which it is alike, or from the noise of both gauges if that is more. Distance and Poisson's
    ratio are not in it."""
    distance: float
    """Way between the stations [m]; d(c0) / c0 = d(distance) / distance."""
    time: FloatArray
    """Times of the residual on the shot's clock [s], shape [n]."""
    measured: FloatArray
    """The later pulse [-], shape [n]."""
    residual: FloatArray
    """Fitted less measured later pulse [-], shape [n]."""
    rms: float
    """Root mean square of the residual over the peak of the later pulse [-]."""
    largest: float
    """Largest residual over that peak [-]."""
    plain_rms: float
    """The same rms for a plain shift with its own best speed and gain [-]."""
    plain_wave_speed: float
    """Speed of that plain shift [m/s]."""
    band: float
    """Frequency up to which the earlier pulse stands above its noise and is used [Hz]; inf without noise."""
    alike: float
    """Samples over which residuals are alike: their integrated correlation [-], >= 1."""
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
    """Fit c0 and the relative gain to a shot of the two bars without a specimen.

    The pulse at the transmission gauge is the pulse at the incident gauge, dispersed over the way between
    them, times the ratio of what the two channels show of the same strain.

    Parameters
    ----------
    incident, transmission : BarSignal
        The stations; bars of the same diameter, density, modulus and Poisson's ratio.
    incident_window : tuple of float
        First and last time of the pulse at the incident gauge [s]: as long as no other wave is there.
    transmitted_window : tuple of float
        Times at the transmission gauge over which the pulses are compared [s].

    Raises
    ------
    ValueError
        If the bars or sampling intervals differ, a window is outside its signal, or the speed found is at the
        edge of the search.
    """
    for name in ("diameter", "density", "youngs_modulus", "poisson"):
        first, second = getattr(incident.bar, name), getattr(transmission.bar, name)
        if first != second:
            raise ValueError(
                f"bars together must be alike, {name} is {first:g} and {second:g}. Cure: calibrate each bar "
                "by its own echo"
            )
    distance = incident.position + transmission.position
    return _fit(
        incident.strain, transmission.strain, incident.bar, distance, incident_window, transmitted_window, 1.0
    )


def round_trip(
    gauge: BarSignal, *, first_window: tuple[float, float], echo_window: tuple[float, float], end: str
) -> BarsTogether:
    """Fit c0 to a pulse and its echo from a free end at the same gauge.

    Parameters
    ----------
    gauge : BarSignal
        The station.
    first_window, echo_window : tuple of float
        Times of the pulse and of its echo [s]; other waves lie in neither.
    end : str
        Where it was reflected: "specimen" or "far" for that end of the bar, free; "both" after a whole round
        trip, c0 = 2 L / T.

    Raises
    ------
    ValueError
        As `wave_speed`; or if `end` is not one of the three.
    """
    ways = {
        "specimen": 2.0 * gauge.position,
        "far": 2.0 * (gauge.bar.length - gauge.position),
        "both": 2.0 * gauge.bar.length,
    }
    if end not in ways:
        raise ValueError(f'end must be "specimen", "far" or "both", got {end!r}')
    sign = 1.0 if end == "both" else -1.0
    return _fit(gauge.strain, gauge.strain, gauge.bar, ways[end], first_window, echo_window, sign)


def _fit(
    first: Signal,
    later: Signal,
    bar: Bar,
    distance: float,
    first_window: tuple[float, float],
    later_window: tuple[float, float],
    sign: float,
) -> BarsTogether:
    check_bar(bar)
    if abs(first.interval / later.interval - 1.0) > 1e-9:
        raise ValueError(f"sampling intervals must be equal, got {first.interval:g} and {later.interval:g} s")
    if not distance > 0.0:
        raise ValueError(f"the way between the stations must be > 0 m, got {distance}")
    a, b = later_window
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
    # Noise of the first pulse above that would steepen the model's slopes and feign a better known speed.
    band = _above_noise(windowed(first, first_window))

    def model(speed: float, poisson: float | None) -> FloatArray:
        """The later pulse with gain `sign`; a plain shift without Poisson's ratio."""
        trial = replace(
            bar,
            youngs_modulus=bar.density * speed**2,
            poisson=bar.poisson if poisson is None else poisson,
        )
        guide = ElasticWaveguide(trial, dispersive=poisson is not None)
        carried = propagation(
            first,
            guide,
            distance,
            window=first_window,
            band=band,
            start=float(time[0]),
            samples=time.size,
        )
        return sign * carried.signal.value

    def solve(poisson: float | None, start: float) -> tuple[float, float, FloatArray, FloatArray]:
        """Speed, gain, residual over the peak, and its Jacobian by c0 / stated and gain."""
        found = least_squares(
            lambda x: (x[1] * model(x[0] * stated, poisson) - measured) / peak,
            [start / stated, 1.0],
            bounds=([1.0 - 1.5 * SEARCH, -np.inf], [1.0 + 1.5 * SEARCH, np.inf]),
            x_scale=[1e-3, 1e-2],
            xtol=1e-12,
            ftol=1e-12,
            diff_step=1e-5,
        )
        return float(found.x[0] * stated), float(found.x[1]), found.fun, found.jac

    # The squares of a shifted pulse have one minimum only near it: the best of many shifts is the start.
    trials = stated * np.linspace(1.0 - SEARCH, 1.0 + SEARCH, 81)
    overlap = [_cosine(model(float(speed), None), measured) for speed in trials]
    best = int(np.argmax(overlap))
    if best in (0, trials.size - 1):
        raise ValueError(
            f"no wave speed within {100 * SEARCH:g} % of {stated:.0f} m/s fits. Cure: check the distances of "
            "the gauges, the modulus and density of the bar, and both windows"
        )
    plain = solve(None, float(trials[best]))
    speed, gain, residual, jacobian = solve(bar.poisson, plain[0])
    low, high = (
        solve(nu, speed)
        for nu in (max(bar.poisson - POISSON_STEP, 0.0), min(bar.poisson + POISSON_STEP, 0.499))
    )
    width = min(bar.poisson + POISSON_STEP, 0.499) - max(bar.poisson - POISSON_STEP, 0.0)
    alike = _correlated_samples(residual)
    # Slow noise alone moves speed and gain, and all of the first pulse's is in the band.
    noise = (gain * first.sigma) ** 2 * first.memory + later.sigma**2 * later.memory
    variance = max(alike * float(residual @ residual) / (residual.size - 2), noise / peak**2)
    scale = np.array([stated, 1.0])
    covariance = np.asarray(variance * np.linalg.inv(jacobian.T @ jacobian) * np.outer(scale, scale))
    return BarsTogether(
        bar=replace(bar, youngs_modulus=bar.density * speed**2),
        wave_speed=speed,
        gain=sign * gain,
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
        by_poisson=(high[0] - low[0]) / width,
        rms_by_poisson=(_rms(low[2]), _rms(high[2])),
    )


def _above_noise(pulse: Signal) -> float | None:
    """Frequency above which no component of a pulse is five times its noise, with room for an edge."""
    if not pulse.sigma > 0.0:
        return None
    spectrum = np.abs(rfft(pulse.value))
    noise = pulse.sigma * np.sqrt(pulse.memory * np.count_nonzero(pulse.value))
    above = np.flatnonzero(spectrum > 5.0 * noise)
    if above.size == 0:
        raise ValueError("the first window holds nothing above the noise. Cure: another window")
    return float(rfftfreq(pulse.value.size, pulse.interval)[above[-1]] / (1.0 - ROLL_OFF))


def _cosine(a: FloatArray, b: FloatArray) -> float:
    """Cosine of the angle between two pulses [-]."""
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def _correlated_samples(residual: FloatArray) -> float:
    """Integrated correlation of a residual [samples], up to where it first passes zero."""
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
