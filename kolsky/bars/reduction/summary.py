"""Summary of a test: the values it is quoted by; means over a plateau and a modulus in equilibrium only."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from kolsky.bars.guides.combine import noise_correlation, stiffness
from kolsky.bars.records import FaceWaves, History, Quantity, Reduction
from kolsky.bars.reduction.equilibrium import ALLOWANCE
from kolsky.bars.reduction.plateau import SHARE, Plateau, judge_plateau, weighted_mean
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray

RISING_SHARE = 0.5
"""Share of the largest stress up to which a loading modulus is fitted."""
FEWEST_SAMPLES = 10
"""Samples that a loading modulus takes."""


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of the waves over the reduction's times, compression or tension alike."""

    incident: float
    """Energy of the incident wave, E A c0 times the time integral of its strain squared [J]."""
    reflected: float
    """Energy of the reflected wave [J]."""
    transmitted: float
    """Energy of the transmitted wave [J]."""
    absorbed: float
    """Incident less reflected less transmitted: work of both faces on the specimen [J]."""
    deformation: float
    """Volume times the integral of stress over strain, by three waves [J]; what is missing to `absorbed` is
    the work of the force's imbalance on the specimen's motion as a whole."""


@dataclass(frozen=True)
class Summary:
    """Numbers of one test by one analysis; compression positive, sigmas from the gauges' noise alone."""

    analysis: str
    """The analysis: "one wave", "two waves" or "three waves"."""
    maximum_strain: Quantity
    """Nominal strain of largest magnitude, with its sign [-]."""
    plateau: Plateau
    """Span that the means are taken over, or why there is none."""
    mean_stress: Quantity | None
    """Mean nominal stress over the plateau [Pa]; None without one."""
    mean_rate: Quantity | None
    """Mean nominal strain rate over the plateau [1/s]; None without one."""
    absorbed: Quantity
    """Energy per volume up to the largest strain [J/m^3]."""
    modulus: Quantity | None
    """Slope of stress over strain while loading in equilibrium [Pa]; None where it cannot be claimed."""
    modulus_reason: str
    """Why there is a modulus or none."""
    energy: EnergyBalance
    """Energies of the waves and of the deformation."""


def summarise(
    reduction: Reduction,
    faces: FaceWaves,
    specimen: Specimen,
    *,
    analysis: str = "three waves",
    allowance: float = ALLOWANCE,
    share: float = SHARE,
) -> Summary:
    """Summary of a reduction.

    Parameters
    ----------
    reduction
        The reduction.
    faces
        The waves it was made from.
    specimen
        The specimen before the test.
    analysis
        "one wave", "two waves" or "three waves".
    allowance
        |R| up to which the forces count as balanced [-].
    share
        Least balanced length of the plateau as a share of the incident pulse's [-].

    Returns
    -------
    Summary

    Raises
    ------
    ValueError
        If the analysis has another name.
    """
    if analysis not in reduction.strain:
        raise ValueError(f"analysis = {analysis!r} must be one of {', '.join(map(repr, reduction.strain))}")
    strain, rate, stress = (m[analysis] for m in (reduction.strain, reduction.rate, reduction.stress))
    time = reduction.time
    last = int(np.abs(strain.value).argmax())
    alike = noise_correlation(faces)
    plateau = judge_plateau(reduction, faces, analysis=analysis, allowance=allowance, share=share)
    loading = _balanced_loading(reduction.balanced, float(time[last]))
    modulus, reason = _modulus(reduction, strain, stress, last, loading, alike)
    return Summary(
        analysis=analysis,
        maximum_strain=Quantity(
            "largest nominal strain", float(strain.value[last]), float(strain.sigma[last]), "1", "A"
        ),
        plateau=plateau,
        mean_stress=_mean(stress, plateau, plateau.stress_fault, "mean nominal stress", alike),
        mean_rate=_mean(rate, plateau, plateau.rate_fault, "mean nominal strain rate", alike),
        absorbed=_absorbed(time, stress, rate, last, alike),
        modulus=modulus,
        modulus_reason=reason,
        energy=energy_balance(reduction, faces, specimen),
    )


def mean_over(
    history: History, time: FloatArray, span: tuple[float, float], name: str, *, alike: float = 1.0
) -> Quantity:
    """Mean of a history over a time span, with the sigma of the mean.

    Parameters
    ----------
    history
        The history; its noise is independent from one sample to the next, or from `alike` to the next.
    time
        Its times [s], shape [n].
    span
        First and last time [s].
    name
        Name of the result.
    alike
        Samples for each independent one [-], >= 1.

    Raises
    ------
    ValueError
        If no sample lies in the span.
    """
    inside = (time >= span[0]) & (time <= span[1])
    n = int(inside.sum())
    if n == 0:
        raise ValueError(f"no sample between {span[0]:.6g} s and {span[1]:.6g} s")
    sigma = sqrt(alike * float((history.sigma[inside] ** 2).sum())) / n
    return Quantity(name, float(history.value[inside].mean()), sigma, history.unit, "A")


def energy_balance(reduction: Reduction, faces: FaceWaves, specimen: Specimen) -> EnergyBalance:
    """Energies of the three waves and of the specimen's deformation, Eqs. (R.17) and (R.18)."""
    first, second = faces.incident_bar, faces.transmission_bar

    def energy(strain: FloatArray, bar: Bar) -> float:
        return stiffness(bar) * bar.wave_speed * float(np.trapezoid(strain**2, faces.time))

    incident, reflected = energy(faces.incident, first), energy(faces.reflected, first)
    transmitted = energy(faces.transmitted, second)
    power = reduction.stress["three waves"].value * reduction.rate["three waves"].value
    return EnergyBalance(
        incident=incident,
        reflected=reflected,
        transmitted=transmitted,
        absorbed=incident - reflected - transmitted,
        deformation=specimen.area * specimen.length * float(np.trapezoid(power, reduction.time)),
    )


def spread_of(strain: Mapping[str, History]) -> float:
    """Largest difference between the analyses' largest strains, over their mean [-]: 0 in equilibrium."""
    largest = np.array([history.value[np.abs(history.value).argmax()] for history in strain.values()])
    return float(np.ptp(largest) / abs(largest.mean()))


def _balanced_loading(balanced: tuple[float, float] | None, end: float) -> tuple[float, float] | None:
    """Span of equilibrium up to the largest strain."""
    if balanced is None or balanced[0] >= end:
        return None
    return balanced[0], min(balanced[1], end)


def _mean(history: History, plateau: Plateau, fault: str | None, name: str, alike: float) -> Quantity | None:
    if plateau.span is None or fault is not None:
        return None
    return Quantity(name, *weighted_mean(history, plateau.span, alike=alike), history.unit, "A")


def _absorbed(time: FloatArray, stress: History, rate: History, last: int, alike: float) -> Quantity:
    step = float(time[1] - time[0])
    s, r = stress.value[: last + 1], rate.value[: last + 1]
    variance = (r * stress.sigma[: last + 1]) ** 2 + (s * rate.sigma[: last + 1]) ** 2
    value = float(np.trapezoid(s * r, dx=step))
    return Quantity(
        "energy absorbed per volume", value, step * sqrt(alike * float(variance.sum())), "J/m^3", "A"
    )


def _modulus(
    reduction: Reduction,
    strain: History,
    stress: History,
    last: int,
    loading: tuple[float, float] | None,
    alike: float,
) -> tuple[Quantity | None, str]:
    """Slope of the least-squares line through the rising stress in equilibrium."""
    if loading is None:
        return None, "no modulus: the specimen is not in equilibrium while it is loaded"
    size = np.abs(stress.value)
    top = float(size[: last + 1].max())
    begin = int(np.searchsorted(reduction.time, loading[0]))
    if begin >= int(size[: last + 1].argmax()):
        return None, "no modulus: equilibrium begins after the largest stress, when the specimen is unloaded"
    reached = float(size[begin]) / top
    if reached > RISING_SHARE:
        return None, (
            f"no modulus: equilibrium begins at {100.0 * reached:.0f} % of the largest stress, and what "
            f"comes before shows waves; it must begin below {100.0 * RISING_SHARE:.0f} %"
        )
    above = np.flatnonzero(size[begin : last + 1] > RISING_SHARE * top)
    part = slice(begin, begin + int(above[0]))
    e, s = strain.value[part], stress.value[part]
    if e.size < FEWEST_SAMPLES:
        return None, f"no modulus: {e.size} samples rise in equilibrium; it takes {FEWEST_SAMPLES} or more"
    centred = e - e.mean()
    spread = float(centred @ centred)
    slope = float(centred @ s) / spread
    sigma = float(stress.sigma[begin]) * sqrt(alike / spread)
    span = f"strains {e[0]:.3g} to {e[-1]:.3g}"
    return Quantity("loading modulus", slope, sigma, "Pa", "A"), f"{e.size} samples in equilibrium, {span}"
