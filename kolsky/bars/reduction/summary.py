"""Results of a test with their budget, facts of the recording, and remarks with remedies.

Means are taken over a plateau. A modulus is given only in equilibrium.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from kolsky.bars.budget import Budget, budget_table
from kolsky.bars.records import BudgetTable, FaceWaves, History, Quantity, Reduction, Windows
from kolsky.bars.reduction.stress_strain import noise_correlation, stiffness
from kolsky.bars.reduction.validity import (
    ALLOWANCE,
    END_SIGMA,
    ENDS,
    PLATEAU_SHARE,
    Plateau,
    Span,
    judge_plateau,
    weighted_mean,
)
from kolsky.bars.reduction.windows import SIDES, PulseCheck, WavesInput
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.baseline import DRIFTING
from kolsky.bars.signals.bridge import Bridge, Calibration
from kolsky.bars.signals.stations import Station
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray

RISING_SHARE = 0.5
"""Share of the largest stress up to which a loading modulus is fitted."""
FEWEST_SAMPLES = 10
"""Smallest number of samples for a loading modulus."""


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
    """Incident minus reflected minus transmitted: work of both faces on the specimen [J]."""
    deformation: float
    """Volume times the integral of stress over strain, by three waves [J]. It differs from `absorbed` by the
    work of the force imbalance on the rigid motion of the specimen."""


@dataclass(frozen=True)
class Summary:
    """Results of one test by one analysis. Compression is positive; sigmas contain only the gauges' noise."""

    analysis: str
    """The analysis: "one wave", "two waves" or "three waves"."""
    plateau: Plateau
    """Time span of the means, or the reason why there is none."""
    mean_stress: Quantity | None
    """Mean nominal stress over the plateau [Pa]; None without a plateau."""
    mean_rate: Quantity | None
    """Mean nominal strain rate over the plateau [1/s]; None without a plateau."""
    absorbed: Quantity
    """Energy per volume up to the largest strain [J/m^3]."""
    modulus: Quantity | None
    """Slope of stress over strain while loading in equilibrium [Pa]; None if it cannot be determined."""
    modulus_reason: str
    """Reason for the modulus, or reason why there is none."""
    energy: EnergyBalance
    """Energies of the waves and of the deformation."""


def summarise(
    reduction: Reduction,
    faces: FaceWaves,
    specimen: Specimen,
    *,
    analysis: str = "three waves",
    allowance: float = ALLOWANCE,
    share: float = PLATEAU_SHARE,
) -> Summary:
    """Summary of a reduction by "one wave", "two waves" or "three waves".

    ``allowance``: |R| up to which the forces are balanced [-]. ``share``: least balanced length of the
    plateau, as a share of the incident pulse's length [-].
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
        plateau=plateau,
        mean_stress=_mean(stress, plateau, plateau.stress_fault, "mean nominal stress", alike),
        mean_rate=_mean(rate, plateau, plateau.rate_fault, "mean nominal strain rate", alike),
        absorbed=_absorbed(time, stress, rate, last, alike),
        modulus=modulus,
        modulus_reason=reason,
        energy=energy_balance(reduction, faces, specimen),
    )


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
    """Largest difference between the largest strains of the analyses, divided by their mean [-].

    It is 0 in equilibrium.
    """
    largest = np.array([history.value[np.abs(history.value).argmax()] for history in strain.values()])
    return float(np.ptp(largest) / abs(largest.mean()))


def _balanced_loading(balanced: tuple[float, float] | None, end: float) -> tuple[float, float] | None:
    """Part of the equilibrium span up to the largest strain."""
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
        return None, f"no modulus: {e.size} samples rise in equilibrium; at least {FEWEST_SAMPLES} are needed"
    centred = e - e.mean()
    spread = float(centred @ centred)
    slope = float(centred @ s) / spread
    sigma = float(stress.sigma[begin]) * sqrt(alike / spread)
    span = f"strains {e[0]:.3g} to {e[-1]:.3g}"
    return Quantity("loading modulus", slope, sigma, "Pa", "A"), f"{e.size} samples in equilibrium, {span}"


LARGEST_DELAY = 3.0
"""Deviation of a pulse's arrival above which a remark is made. It is in sigmas of the arrival, beyond two
samples."""
LARGEST_TOE = 0.01
"""Strain before the stress rises, by the tangent of the transmitted flank [-]. A larger strain is reported as
a gap."""
DOMINATES = 0.5
"""Share of a result's variance from the zero and drift of the gauges [-]. A larger share is reported."""
SMALL = 1e-3
"""Second-order term divided by the result, up to which it is negligible for any uncertainty of the result
[-]."""


def arrival_remarks(
    reduction: Reduction, checks: tuple[PulseCheck, PulseCheck], given: WavesInput
) -> list[str]:
    """Remarks on pulses that arrive earlier or later than distances and wave speeds allow.

    The reflected pulse must arrive at the predicted time. The transmitted pulse must not arrive earlier; its
    delay depends on the specimen. It is late if the specimen was shortened by more than `LARGEST_TOE` before
    its stress rises.
    """
    found = []
    interval = float(reduction.time[1] - reduction.time[0])
    reflected, transmitted = checks
    if reflected.observed is None:
        found.append(f"no reflected pulse is found: {reflected.reason}")
    for name, check, sigma in zip(("reflected", "transmitted"), checks, way_sigmas(given), strict=True):
        allowed = LARGEST_DELAY * float(np.hypot(check.offset_sigma, sigma)) + 2.0 * interval
        late = name == "reflected" and check.offset > allowed
        if late or check.offset < -allowed:
            found.append(
                f"the {name} pulse arrives {1e6 * check.offset:+.2f} us from the time that the gauges' "
                f"distances and the wave speeds predict, and {1e6 * allowed:.2g} us can be explained; cure: "
                "check both, or measure the wave speed (kolsky wavespeed)"
            )
    if transmitted.observed is not None and transmitted.delay > 0.0:
        strain = np.abs(reduction.strain["three waves"].value)
        toe = float(np.interp(transmitted.delay, reduction.time, strain))
        if toe > LARGEST_TOE:
            found.append(
                f"the transmitted pulse rises {1e6 * transmitted.delay:.3g} us late, when the specimen is "
                f"shortened by {100 * toe:.2g} %: a gap, a face that is not plane, a wrong distance, or a "
                "material that begins so soft; cure: check the specimen's contact, its faces and the gauge's "
                "distance"
            )
    return found


def way_sigmas(given: WavesInput) -> tuple[float, float]:
    """Standard uncertainties of the predicted arrivals of the reflected and the transmitted pulse [s].

    Travel times x / c. Their uncertainties come from the declared uncertainties of the gauges' distances, the
    same for all, and of the wave speeds. The latter are u(c)/c, or half of hypot(u(E)/E, u(rho)/rho).
    """
    stated = given.uncertainty
    speed = stated.get("bar_wave_speed", 0.0) or 0.5 * float(
        np.hypot(stated.get("bar_modulus", 0.0), stated.get("bar_density", 0.0))
    )
    distance = stated.get("gauge_distance", 0.0)
    ways = [
        (given.stations[side].position / given.bars[side].wave_speed, distance / given.bars[side].wave_speed)
        for side in SIDES
    ]
    (first, first_off), (second, second_off) = ways
    return (
        float(np.hypot(2.0 * first * speed, 2.0 * first_off)),
        float(np.hypot(np.hypot(first, second) * speed, np.hypot(first_off, second_off))),
    )


def _drift_remarks(budget: Budget, quoted: Iterable[str]) -> list[str]:
    """Remarks on results with an uncertainty dominated by the zero and the drift of the gauges."""
    found = []
    rows = [i for i, q in enumerate(budget.quantities) if q.name.rstrip("1234567890 ").endswith(DRIFTING)]
    for name in quoted:
        if name not in budget.value:
            continue
        variance = float(budget.sigma(name)) ** 2
        share = float((budget.contribution[name][rows] ** 2).sum()) / variance if variance > 0.0 else 0.0
        if share > DOMINATES and np.sqrt(variance) > SMALL * abs(float(budget.value[name])):
            found.append(
                f"the zero of the gauges and its drift dominate the uncertainty of the {name} "
                f"({100 * share:.0f} % of its variance); cure: a longer baseline that ends shortly before "
                "the pulse, or a bridge that drifts less"
            )
    return found


WAY = "three waves"
"""The analysis of the reported results if the shot declares none."""
UNITS = {"largest strain": "1", "peak stress": "Pa", "mean stress": "Pa", "mean rate": "1/s"}
BEND = 0.2
"""Second-order term divided by the standard uncertainty [-]. Above this limit a value's band is only a first
estimate."""


def calibration_sigma(calibration: Calibration, relative: float) -> dict[str, float]:
    """Relative uncertainty of a gauge's calibration, as an uncertainty of the field that scales it."""
    if isinstance(calibration, Bridge):
        return {"gauge_factor": relative * calibration.gauge_factor}
    return {"factor": relative * calibration.factor}


def numbers(reduction: Reduction, summary: Summary, span: Span | None) -> dict[str, np.ndarray]:
    """Reported results: strain and stress of largest magnitude, and means over a span.

    The means are given if the summary has them.

    With a varied input, there may be no plateau and thus no span. The means are then taken over the span of
    the summary. They still show the effect of the input on the results.

    Raises ValueError if the summary has means and there is no span.
    """
    way = summary.analysis
    strain, stress = reduction.strain[way].value, reduction.stress[way].value
    last, peak = _instants(reduction, way)
    found = {"largest strain": strain[last], "peak stress": stress[peak]}
    over = summary.plateau.span if span is None else span
    for name, said, kind in (
        ("mean stress", summary.mean_stress, reduction.stress),
        ("mean rate", summary.mean_rate, reduction.rate),
    ):
        if said is None:
            continue
        if over is None:
            raise ValueError(f"{name}: nothing is left of the plateau")
        found[name] = np.float64(weighted_mean(kind[way], over)[0])
    return {name: np.asarray(value, dtype=float) for name, value in found.items()}


def noise(reduction: Reduction, summary: Summary) -> dict[str, float]:
    """Standard uncertainties of the reported results from the gauges' noise."""
    way = summary.analysis
    last, peak = _instants(reduction, way)
    found = {
        "largest strain": float(reduction.strain[way].sigma[last]),
        "peak stress": float(reduction.stress[way].sigma[peak]),
    }
    for name, said in (("mean stress", summary.mean_stress), ("mean rate", summary.mean_rate)):
        if said is not None:
            found[name] = said.sigma
    return found


def span_quantities(summary: Summary) -> list[Quantity]:
    """The choice of both ends of the plateau as inputs of the budget: their shifts in time."""
    span = summary.plateau.span
    if span is None:
        return []
    return [Quantity(name, 0.0, END_SIGMA * (span.last - span.first), "s", "B") for name in ENDS]


def with_both_sides(budget: Budget) -> Budget:
    """The budget with the root mean square of the changes to either side as contributions.

    Let c be the central difference and b the second difference. Over one standard uncertainty, the value
    changes by c + b and by b - c, in the mean square by c^2 + b^2. If two waves are shifted relative to each
    other and a peak moves along the history, c is small and b is large.
    """
    contribution = dict(budget.contribution)
    for name in UNITS:
        if name in contribution:
            straight = contribution[name]
            contribution[name] = np.copysign(np.hypot(straight, budget.curvature[name]), straight)
    return replace(budget, contribution=contribution)


def table(budget: Budget, sign: float) -> BudgetTable:
    """Reported results with the share of every input, largest first. `sign` -1 makes tension positive."""
    found = budget_table(
        budget, {name: (name, None, unit) for name, unit in UNITS.items() if name in budget.value}
    )
    turned = [
        replace(row, sensitivity={name: sign * slope for name, slope in row.sensitivity.items()})
        for row in found.contributions
    ]
    rows = sorted(turned, key=lambda row: -max(map(abs, row.shares.values()), default=0.0))
    return BudgetTable(
        results={name: (sign * value, sigma, unit) for name, (value, sigma, unit) in found.results.items()},
        contributions=tuple(rows),
    )


def facts(
    best: Mapping[str, Station],
    arrival: Arrival,
    checks: tuple[PulseCheck, PulseCheck],
    windows: Windows,
    reduction: Reduction,
    summary: Summary,
) -> dict[str, tuple[float, str]]:
    """Facts of the record and of its reduction: value and unit by name."""
    energy = summary.energy
    found: dict[str, tuple[float, str]] = {
        "sample interval": (best["incident"].signal.strain.interval, "s"),
        "arrival at the incident gauge": (arrival.time, "s"),
        "its standard uncertainty": (arrival.sigma, "s"),
        "duration of the incident pulse": (arrival.end - arrival.time, "s"),
        "length of the windows": (windows.incident[1] - windows.incident[0], "s"),
    }
    for side, station in best.items():
        found[f"wave speed, {side} bar"] = (station.signal.bar.wave_speed, "m/s")
        found[f"noise, {side} gauge"] = (station.signal.strain.sigma, "1")
    for name, check in zip(("reflected", "transmitted"), checks, strict=True):
        if check.observed is not None:
            found[f"{name} pulse, later than predicted by"] = (check.delay, "s")
    found |= {
        "energy of the incident wave": (energy.incident, "J"),
        "energy of the reflected wave": (energy.reflected, "J"),
        "energy of the transmitted wave": (energy.transmitted, "J"),
        "energy absorbed by the specimen": (energy.absorbed, "J"),
        "work of deformation": (energy.deformation, "J"),
        "spread of the largest strain over the analyses": (spread_of(reduction.strain), "1"),
    }
    found["incident pulse at half its height"] = (summary.plateau.pulse, "s")
    found["balanced length of the plateau"] = (summary.plateau.balanced, "s")
    if summary.plateau.span is not None:
        found["plateau from"] = (summary.plateau.span.first, "s")
        found["plateau to"] = (summary.plateau.span.last, "s")
    if summary.modulus is not None:
        found["loading modulus in equilibrium"] = (summary.modulus.value, "Pa")
    if reduction.balanced is not None:
        found["time to equilibrium"] = (max(0.0, reduction.balanced[0]), "s")
    return found


def remarks(
    reduction: Reduction,
    budget: Budget,
    checks: tuple[PulseCheck, PulseCheck],
    given: WavesInput,
    summary: Summary,
) -> list[str]:
    """Remarks on conditions that limit the use of the results, each with its remedy."""
    found = []
    if reduction.balanced is None:
        found.append(
            f"the forces on the faces are nowhere in equilibrium within {100 * given.allowance:g} %, so "
            "there is no stress-strain curve of the material; cure: a shorter specimen, a pulse shaper, "
            "or the inverse method (kolsky identify)"
        )
    else:
        cure = "; cure: a longer pulse, a pulse shaper, or waves.plateau where a shorter span is meant"
        quoted = (("stress", summary.plateau.stress_fault), ("rate", summary.plateau.rate_fault))
        missing = [(name, fault) for name, fault in quoted if fault is not None]
        if len(missing) == 2 and missing[0][1] == missing[1][1]:
            found.append(f"no mean stress and no mean rate are quoted: {missing[0][1]}{cure}")
        else:
            found += [f"no mean {name} is quoted: {fault}{cure}" for name, fault in missing]
        if summary.modulus is None:
            found.append(f"{summary.modulus_reason}; cure: a slower rise of the pulse (a pulse shaper)")
    found += arrival_remarks(reduction, checks, given)
    found += _drift_remarks(budget, UNITS)
    bent = [name for name in UNITS if name in budget.value and _bent(budget, name)]
    if bent:
        found.append(
            f"the {', the '.join(bent)} depends on its inputs nonlinearly within their uncertainty; the "
            "band is a first estimate; cure: a better wave speed (kolsky wavespeed)"
        )
    systematic = {key: value for key, value in given.uncertainty.items() if value > 0.0}
    if not systematic:
        found.append(
            "no standard uncertainty is declared, so the bands contain only the noise and zero of the "
            "gauges; cure: add a table [uncertainty]"
        )
    return found


def _bent(budget: Budget, name: str) -> bool:
    """True if a result depends on its inputs with a significant nonlinearity."""
    ratio, value = budget.nonlinearity(name), abs(float(budget.value[name]))
    return ratio > BEND and ratio * float(budget.sigma(name)) > SMALL * value


def _instants(reduction: Reduction, way: str) -> tuple[int, int]:
    """Samples of the largest strain and of the largest stress by one analysis."""
    strain, stress = reduction.strain[way].value, reduction.stress[way].value
    return int(np.abs(strain).argmax()), int(np.abs(stress).argmax())
