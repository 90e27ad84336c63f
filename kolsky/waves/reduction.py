"""Strain, rate and stress by one, two and three waves, from the waves at the specimen's faces."""

from math import pi

import numpy as np

from kolsky.apparatus import Bar, Specimen
from kolsky.waves.equilibrium import ALLOWANCE, balanced_span, imbalance
from kolsky.waves.records import FaceWaves, FloatArray, History, Reduction

ANALYSES = ("one wave", "two waves", "three waves")
"""Keys of a `Reduction`."""
WAVES = ("incident", "reflected", "transmitted")
"""Keys of `FaceWaves.sigma`."""

Weights = tuple[float, float, float]
"""Factors of the incident, reflected and transmitted strain."""


def reduce(
    faces: FaceWaves,
    specimen: Specimen,
    *,
    allowance: float = ALLOWANCE,
    average: float | None = None,
) -> Reduction:
    """Reduce the waves at the faces to the specimen's nominal strain, rate and stress.

    With compression positive the faces move with v1 = c1 (e_i - e_r) and v2 = c2 e_t and carry the forces
    F1 = E1 A1 (e_i + e_r) and F2 = E2 A2 e_t, Eqs. (R.5) and (R.6). Three waves: the rate (v1 - v2) / L and
    the mean force. Equilibrium, F1 = F2, makes one wave superfluous: two waves are the incident and the
    transmitted one, with the force F1; one wave is the reflected, with the force F2. If the bars' impedances
    differ, "one wave" needs a share of the transmitted one too, Eqs. (R.7) to (R.9). In tension all of it
    holds with negative strains.

    Parameters
    ----------
    faces
        The waves at the faces.
    specimen
        The specimen before the test.
    allowance
        |R| up to which it counts as in equilibrium [-].
    average
        Time over which the forces are averaged for R [s]; without it the time a wave needs to cross the
        diameter of the thicker bar.

    Returns
    -------
    Reduction
        Each sigma is that of the gauges' noise alone, white and independent, carried exactly through the
        linear combinations and the trapezoidal sum, Eq. (R.12).

    Raises
    ------
    ValueError
        If the specimen's sizes are not positive or it is wider than the bars.
    """
    _check(faces, specimen)
    first, second = faces.incident_bar, faces.transmission_bar
    c1, c2 = first.wave_speed, second.wave_speed
    k1, k2 = stiffness(first), stiffness(second)
    step = float(faces.time[1] - faces.time[0])
    waves = np.stack([faces.incident, faces.reflected, faces.transmitted])
    noise = np.array([faces.sigma[name] for name in WAVES])

    def combined(weights: Weights, unit: str) -> History:
        factor = np.array(weights)
        sigma = float(np.linalg.norm(factor * noise))
        return History(factor @ waves, np.full(faces.time.size, sigma), unit)

    z = second.impedance / first.impedance
    L, area = specimen.length, specimen.area
    rates: dict[str, Weights] = {
        "one wave": (0.0, -2.0 * c1 / L, c2 * (z - 1.0) / L),  # Eq. (R.7)
        "two waves": (2.0 * c1 / L, 0.0, -c2 * (z + 1.0) / L),  # Eq. (R.8)
        "three waves": (c1 / L, -c1 / L, -c2 / L),  # Eq. (R.9)
    }
    stresses: dict[str, Weights] = {
        "one wave": (0.0, 0.0, k2 / area),
        "two waves": (k1 / area, k1 / area, 0.0),
        "three waves": (0.5 * k1 / area, 0.5 * k1 / area, 0.5 * k2 / area),
    }
    rate = {key: combined(rates[key], "1/s") for key in ANALYSES}
    front, back = combined((k1, k1, 0.0), "N"), combined((0.0, 0.0, k2), "N")
    time = average if average is not None else max(b.diameter / b.wave_speed for b in (first, second))
    width = max(1, round(time / step))
    ratio = imbalance(front.value, back.value, front.sigma[0], back.sigma[0], width=width)
    return Reduction(
        time=faces.time,
        strain={key: integrated(rate[key], step) for key in ANALYSES},
        rate=rate,
        stress={key: combined(stresses[key], "Pa") for key in ANALYSES},
        front_force=front,
        back_force=back,
        front_velocity=combined((c1, -c1, 0.0), "m/s"),
        back_velocity=combined((0.0, 0.0, c2), "m/s"),
        imbalance=ratio,
        balanced=balanced_span(faces.time, ratio, allowance=allowance, bridge=width * step),
    )


def stiffness(bar: Bar) -> float:
    """Force per strain of a bar, E A [N]."""
    return bar.youngs_modulus * pi * bar.diameter**2 / 4.0


def integrated(history: History, step: float) -> History:
    """Trapezoidal sum from the first sample on, and the sigma of it for white noise, Eq. (R.12).

    Parameters
    ----------
    history
        A rate, its sigma constant.
    step
        Sampling interval [s].

    Returns
    -------
    History
        Starts at 0; sigma_k = step sigma sqrt(k - 1/2) after k steps.
    """
    value = history.value
    total = np.concatenate([[0.0], np.cumsum(0.5 * step * (value[1:] + value[:-1]))])
    count = np.arange(value.size)
    sigma = step * history.sigma * np.sqrt(np.maximum(count - 0.5, 0.0))
    return History(total, sigma, "1")


def hencky_strain(strain: History) -> History:
    """Logarithmic strain, compression positive: -ln(1 - e), Eq. (R.13).

    In tension e < 0, the stretch 1 - e exceeds 1 and the result is negative, as all tension is here.

    Raises
    ------
    ValueError
        If a nominal strain reaches 1: nothing would be left of the specimen.
    """
    left = _stretch(strain)
    return History(-np.log(left), strain.sigma / left, "1")


def cauchy_stress(stress: History, strain: History) -> History:
    """True stress of a specimen that keeps its volume, compression positive: s (1 - e), Eq. (R.14).

    A compressed specimen is wider, so that its true stress is smaller than the nominal one; a stretched one
    is thinner. Barrelling and necking are not seen. The sigma takes the two noises as independent.

    Parameters
    ----------
    stress, strain
        Nominal stress [Pa] and strain [-] at the same times.

    Returns
    -------
    History
        True stress [Pa].

    Raises
    ------
    ValueError
        If a nominal strain reaches 1.
    """
    left = _stretch(strain)
    sigma = np.sqrt((left * stress.sigma) ** 2 + (stress.value * strain.sigma) ** 2)
    return History(stress.value * left, sigma, stress.unit)


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
                f"{bar.diameter} m: a bar cannot press on what lies beside it"
            )
