"""Strain, rate and stress by one, two and three waves, from the waves at the specimen's faces."""

import numpy as np

from kolsky.bars.guides.combine import BarWaves
from kolsky.bars.guides.waveguide import Waveguide
from kolsky.bars.records import ANALYSES, FaceWaves, History, Reduction
from kolsky.bars.reduction.equilibrium import ALLOWANCE, balanced_span, imbalance
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray


def reduce(
    faces: FaceWaves,
    specimen: Specimen,
    *,
    guides: tuple[Waveguide, Waveguide] | None = None,
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
    guides
        The incident and the transmission bar as waveguides: their stiffness and impedance then hold at each
        frequency, as a viscoelastic bar needs. None takes E A and rho c0 A throughout.
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
    # Noise that lies below a band is averaged less than white noise: from its level at low frequencies.
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
    """Trapezoidal sum from the first sample on, and the sigma of it for white noise, Eq. (R.12).

    Parameters
    ----------
    history
        A rate.
    step
        Sampling interval [s].
    sigma
        Standard deviation of white noise as strong as the rate's at low frequencies, where it differs from
        the rate's own.

    Returns
    -------
    History
        Starts at 0; sigma_k = step sigma sqrt(k - 1/2) after k steps.
    """
    value = history.value
    total = np.concatenate([[0.0], np.cumsum(0.5 * step * (value[1:] + value[:-1]))])
    count = np.arange(value.size)
    white = history.sigma if sigma is None else np.full(value.size, sigma)
    return History(total, step * white * np.sqrt(np.maximum(count - 0.5, 0.0)), "1")


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


TRUE = {"true strain": "1", "true stress": "Pa"}
"""Histories of `true_curve` and their units."""


def true_curve(reduction: Reduction, analysis: str) -> dict[str, History]:
    """True strain and true stress of one analysis, for a specimen that keeps its volume, Eqs. (R.13), (R.14).

    Parameters
    ----------
    reduction
        The reduction, compression positive.
    analysis
        "one wave", "two waves" or "three waves".

    Returns
    -------
    dict
        The histories of `TRUE`, shape [n] each.

    Raises
    ------
    ValueError
        If a nominal strain reaches 1.
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
                f"{bar.diameter} m: a bar cannot press on what lies beside it"
            )
