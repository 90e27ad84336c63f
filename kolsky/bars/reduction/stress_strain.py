"""Strain, rate and stress by one, two and three waves.

They are linear combinations of the waves at the specimen's faces.

The weights are constants or functions of frequency. Punching is the indentation of the bars' faces by a
narrower specimen. It is subtracted from the strain.
"""

from dataclasses import replace
from math import pi

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.interpolate import PchipInterpolator

from dic.basics import check_interval
from kolsky.bars.guides.propagation import edge_filter, fade_ends, mean_square
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import ANALYSES, Correction, FaceWaves, History, Reduction
from kolsky.bars.reduction.validity import ALLOWANCE, balanced_span, imbalance
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import ComplexArray, FloatArray

WAVES = ("incident", "reflected", "transmitted")
"""Keys of `FaceWaves.sigma`."""

Factor = float | ComplexArray
"""A constant, or a complex factor at each frequency."""
Weights = tuple[Factor, Factor, Factor]
"""Factors of the incident, reflected and transmitted strain."""


class BarWaves:
    """The three waves, and the factors from strain to force and velocity in the bars.

    ``guides``: the incident and the transmission bar as waveguides; None: constant E A and rho c0 A.
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
        self._spectra: ComplexArray | None = None
        if guides is None:
            first, second = faces.incident_bar, faces.transmission_bar
            self.stiffness_1, self.stiffness_2 = stiffness(first), stiffness(second)
            self.impedance_1, self.impedance_2 = first.impedance, second.impedance
            return
        n = faces.time.size
        self._fade = max(64, n // 4)
        # The memory of a viscoelastic bar decays over the padding and does not wrap around.
        self._length = next_fast_len(6 * n + 2 * self._fade, real=True)
        frequency = rfftfreq(self._length, float(faces.time[1] - faces.time[0]))
        omega = 2.0 * pi * frequency
        self._heard = edge_filter(frequency, faces.band)  # frequencies at which the waves have noise
        self.stiffness_1, self.stiffness_2 = (guide.stiffness(omega) for guide in guides)
        self.impedance_1, self.impedance_2 = (guide.impedance(omega) for guide in guides)
        padded = [fade_ends(wave, self._fade, self._length, fade=self._fade) for wave in self._waves]
        self._spectra = np.asarray(rfft(np.stack(padded), axis=1))

    def combined(self, weights: Weights, unit: str) -> History:
        """The weighted sum of the waves, with the sigma of its samples for white, independent noise."""
        n = self._waves.shape[1]
        if self._spectra is None:
            factor = np.array(weights, dtype=np.float64)
            value: FloatArray = factor @ self._waves
            noise = np.abs(factor) * self._noise
        else:
            parts = [weight * wave for weight, wave in zip(weights, self._spectra, strict=True)]
            total = irfft(np.sum(parts, axis=0), self._length)
            value = np.asarray(total[self._fade : self._fade + n], dtype=np.float64)
            heard = [np.asarray(self._heard * weight, dtype=np.complex128) for weight in weights]
            noise = np.array([self._gain(factor) for factor in heard]) * self._white
        return History(value, np.full(n, float(np.linalg.norm(noise))), unit)

    def slow_sigma(self, weights: Weights) -> float:
        """Sigma of white noise with the sum's level at low frequencies.

        This level determines the noise of an integral.
        """
        gains = np.array([abs(np.ravel(weight)[0]) for weight in weights])
        return float(np.linalg.norm(gains * self._white))

    def _gain(self, factor: ComplexArray) -> float:
        """Root mean square of a factor over all frequencies: ratio of sigma after and before."""
        return float(np.sqrt(mean_square(factor, self._length)))


def noise_correlation(faces: FaceWaves) -> float:
    """Samples per independent one in the waves' noise [-]: 1 if white, more after filtering."""
    if faces.white is None:
        return 1.0
    return max(
        ((faces.white[name] / faces.sigma[name]) ** 2 for name in WAVES if faces.sigma[name] > 0.0),
        default=1.0,
    )


def stiffness(bar: Bar) -> float:
    """Force per strain of a bar, E A [N]."""
    return bar.youngs_modulus * pi * bar.diameter**2 / 4.0


def reduce(
    faces: FaceWaves,
    specimen: Specimen,
    *,
    guides: tuple[Waveguide, Waveguide] | None = None,
    allowance: float = ALLOWANCE,
    average: float | None = None,
) -> Reduction:
    """Reduce the waves at the faces to the specimen's nominal strain, rate and stress.

    Compression is positive. The velocities of the faces are v1 = c1 (e_i - e_r) and v2 = c2 e_t. The forces
    are F1 = E1 A1 (e_i + e_r) and F2 = E2 A2 e_t, Eqs. (R.5) and (R.6). Three waves give the rate (v1 - v2) /
    L and the mean force. In equilibrium, F1 = F2, and one wave is redundant. Two waves are the incident and
    the transmitted one, with the force F1. One wave is the reflected one, with the force F2. If the bars'
    impedances differ, "one wave" also needs a share of the transmitted wave, Eqs. (R.7) to (R.9). In tension
    the same equations hold with negative strains.

    Each sigma contains only the gauges' noise, which is white and independent. It is propagated exactly
    through the linear combinations and the trapezoidal sum, Eq. (R.12). ``guides``: the incident and the
    transmission bar as waveguides. Their stiffness and impedance are used at each frequency, which a
    viscoelastic bar requires. None: constant E A and rho c0 A. ``allowance``: |R| up to which the specimen is
    in equilibrium [-]. ``average``: time over which the forces are averaged for R [s]; default: the time of a
    wave across the diameter of the thicker bar.
    """
    _check(faces, specimen)
    check_interval("[0, inf) s", average=0.0 if average is None else average)
    bars = BarWaves(faces, guides)
    k1, k2, z1, z2 = bars.stiffness_1, bars.stiffness_2, bars.impedance_1, bars.impedance_2
    step = float(faces.time[1] - faces.time[0])
    L, area = specimen.length, specimen.area
    rates = {
        "one wave": (0.0, -2.0 * k1 / z1 / L, k2 * (1.0 / z1 - 1.0 / z2) / L),  # Eq. (R.7)
        "two waves": (2.0 * k1 / z1 / L, 0.0, -k2 * (1.0 / z1 + 1.0 / z2) / L),  # Eq. (R.8)
        "three waves": (k1 / z1 / L, -k1 / z1 / L, -k2 / z2 / L),  # Eq. (R.9)
    }
    stresses = {
        "one wave": (0.0, 0.0, k2 / area),
        "two waves": (k1 / area, k1 / area, 0.0),
        "three waves": (0.5 * k1 / area, 0.5 * k1 / area, 0.5 * k2 / area),
    }
    rate = {key: bars.combined(rates[key], "1/s") for key in ANALYSES}
    front, back = bars.combined((k1, k1, 0.0), "N"), bars.combined((0.0, 0.0, k2), "N")
    both = (faces.incident_bar, faces.transmission_bar)
    time = average if average is not None else max(bar.diameter / bar.wave_speed for bar in both)
    width = max(1, round(time / step))
    # Averaging reduces band-limited noise less than white noise. Its level at low frequencies is therefore
    # used.
    loud = (bars.slow_sigma((k1, k1, 0.0)), bars.slow_sigma((0.0, 0.0, k2)))
    noise = [min(s, width**0.5 * float(f.sigma[0])) for s, f in zip(loud, (front, back), strict=True)]
    ratio = imbalance(front.value, back.value, *noise, width=width)
    return Reduction(
        time=faces.time,
        strain={key: integrated(rate[key], step, sigma=bars.slow_sigma(rates[key])) for key in ANALYSES},
        rate=rate,
        stress={key: bars.combined(stresses[key], "Pa") for key in ANALYSES},
        front_force=front,
        back_force=back,
        front_velocity=bars.combined((k1 / z1, -k1 / z1, 0.0), "m/s"),
        back_velocity=bars.combined((0.0, 0.0, k2 / z2), "m/s"),
        imbalance=ratio,
        balanced=balanced_span(faces.time, ratio, allowance=allowance, bridge=width * step),
    )


def integrated(history: History, step: float, *, sigma: float | None = None) -> History:
    """Trapezoidal sum from the first sample on, and its sigma for white noise, Eq. (R.12).

    ``step``: sampling interval [s]. ``sigma``: standard deviation of white noise with the rate's level at low
    frequencies, if it differs from the rate's sigma. Returns: starts at 0; sigma_k = step sigma sqrt(k - 1/2)
    after k steps.
    """
    value = history.value
    total = np.concatenate([[0.0], np.cumsum(0.5 * step * (value[1:] + value[:-1]))])
    count = np.arange(value.size)
    white = history.sigma if sigma is None else np.full(value.size, sigma)
    return History(total, step * white * np.sqrt(np.maximum(count - 0.5, 0.0)), "1")


def hencky_strain(strain: History) -> History:
    """Logarithmic strain, compression positive: -ln(1 - e), Eq. (R.13).

    In tension e < 0. The stretch 1 - e then exceeds 1 and the result is negative.
    """
    left = _stretch(strain)
    return History(-np.log(left), strain.sigma / left, "1")


def cauchy_stress(stress: History, strain: History) -> History:
    """True stress of a specimen of constant volume, compression positive: s (1 - e), Eq. (R.14).

    Barrelling and necking are not considered. The sigma assumes that the two noises are independent.
    """
    left = _stretch(strain)
    sigma = np.sqrt((left * stress.sigma) ** 2 + (stress.value * strain.sigma) ** 2)
    return History(stress.value * left, sigma, stress.unit)


TRUE = {"true strain": "1", "true stress": "Pa"}
"""Histories of `true_curve` and their units."""


def true_curve(reduction: Reduction, analysis: str) -> dict[str, History]:
    """True strain and true stress of one analysis, for a specimen that keeps its volume, Eqs. (R.13), (R.14).

    ``reduction``: the reduction, compression positive. ``analysis``: "one wave", "two waves" or "three
    waves". Returns: the histories of `TRUE`, shape [n] each. Raises ValueError if a nominal strain reaches 1.
    """
    strain, stress = reduction.strain[analysis], reduction.stress[analysis]
    return dict(zip(TRUE, (hencky_strain(strain), cauchy_stress(stress, strain)), strict=True))


def _stretch(strain: History) -> FloatArray:
    left = 1.0 - strain.value
    if not (left > 0.0).all():
        raise ValueError(
            f"the nominal compression reaches {strain.value.max():.4g}; it must stay below 1. Cure: end the "
            "windows earlier, check the specimen's length and the gauges' calibration"
        )
    return left


def _check(faces: FaceWaves, specimen: Specimen) -> None:
    if not (specimen.length > 0.0 and specimen.diameter > 0.0):
        raise ValueError(
            f"the specimen's length = {specimen.length} m and diameter = {specimen.diameter} m must be > 0"
        )
    for bar, name in ((faces.incident_bar, "incident"), (faces.transmission_bar, "transmission")):
        if specimen.diameter > bar.diameter * (1.0 + 1e-9):
            raise ValueError(
                f"the specimen's diameter = {specimen.diameter} m must not exceed the {name} bar's, "
                f"{bar.diameter} m: a bar loads only the area of its face"
            )


_HALF_SPACE = 16.0 / (3.0 * pi**2)
"""Mean indentation under a uniform pressure on a half-space, in units of (1 - nu^2) F / (E a) (Love 1929)."""

_RATIO = np.array([0.0, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
# Static finite elements of a half-infinite bar with a free side, nu = 0.29, extrapolated over three meshes.
# tests/validation/test_punching_elements.py computes these values again. Over 0 <= nu < 0.5 they vary by 4 %.
_SHARE = np.array(
    [1.0, 0.87847, 0.81791, 0.75775, 0.63881, 0.52260, 0.41026, 0.30319, 0.20332, 0.11371, 0.04015, 0.0]
)
_share = PchipInterpolator(_RATIO, _SHARE)


def punching_compliance(bar: Bar, radius: float) -> float:
    """Mean indentation of a bar's face relative to one-dimensional theory, per force [m/N].

    Eq. (R.15): (16 / (3 pi^2)) (1 - nu^2) / (E a) times the factor f(a/b) for the bar's finite radius b; f(0)
    = 1 and f(1) = 0. The pressure is uniform over the circle of radius a, as under a specimen much softer
    than the bar. Under a rigid specimen the mean is 8 % smaller.
    """
    ratio = radius / (0.5 * bar.diameter)
    if not 0.0 < ratio <= 1.0 + 1e-9:
        raise ValueError(
            f"the specimen's radius = {radius} m must be > 0 and not exceed the bar's, {0.5 * bar.diameter} m"
        )
    share = float(_share(ratio)) if ratio < 1.0 else 0.0
    return _HALF_SPACE * share * (1.0 - bar.poisson**2) / (bar.youngs_modulus * radius)


def correct_punching(
    reduction: Reduction, specimen: Specimen, incident_bar: Bar, transmission_bar: Bar, *, apply: bool = True
) -> tuple[Reduction, Correction]:
    """Subtract the indentation of both faces from the shortening of the specimen.

    Eq. (R.16): e - (C1 F1 + C2 F2) / L, with the forces of the analysis: F2 twice for one wave, F1 twice for
    two, both for three. The difference quotient of the same term is subtracted from the rate. It is taken
    over the time of a wave across the bar's diameter. Over shorter times, the indentation is not
    quasi-static. The velocities of the faces remain those of one-dimensional theory. ``apply``: False returns
    the reduction unchanged. The sizes of the correction are changes of the nominal strain by three waves.
    """
    C1 = punching_compliance(incident_bar, specimen.radius)
    C2 = punching_compliance(transmission_bar, specimen.radius)
    F1, F2 = reduction.front_force, reduction.back_force
    step = float(reduction.time[1] - reduction.time[0])
    width = max(2, round(max(b.diameter / b.wave_speed for b in (incident_bar, transmission_bar)) / step))
    L = specimen.length
    shares = {"one wave": (0.0, C1 + C2), "two waves": (C1 + C2, 0.0), "three waves": (C1, C2)}
    strain, rate = {}, {}
    for key, (first, second) in shares.items():
        sunk = (first * F1.value + second * F2.value) / L
        noise = np.hypot(first * F1.sigma, second * F2.sigma) / L
        e, r = reduction.strain[key], reduction.rate[key]
        strain[key] = History(e.value - sunk, np.hypot(e.sigma, noise), e.unit)
        slope_noise = noise / (width * step)  # means of two neighbours at either end
        slope = np.gradient(moving_mean(sunk, width), step)
        rate[key] = History(r.value - slope, np.hypot(r.sigma, slope_noise), r.unit)
    change = strain["three waves"].value - reduction.strain["three waves"].value
    verb = "shortens" if apply else "would shorten"
    correction = Correction(
        name="punching of the bars' faces",
        key="punching",
        applied=apply,
        size=float(np.abs(change).max()),
        rms=float(np.sqrt(np.mean(change**2))),
        unit="1",
        reason=(
            f"a specimen of {specimen.diameter * 1e3:.4g} mm on bars of {incident_bar.diameter * 1e3:.4g} "
            f"and {transmission_bar.diameter * 1e3:.4g} mm sinks in by {C1 * 1e9:.3g} and {C2 * 1e9:.3g} "
            f"nm/N; this {verb} the strain"
        ),
    )
    return (replace(reduction, strain=strain, rate=rate) if apply else reduction), correction
