"""The quoted values of a reduction: their budget, facts of the record, remarks with their cures."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kolsky.bars.budget.budget import Budget, budget_table
from kolsky.bars.records import Quantity, Reduction, Windows
from kolsky.bars.reduction.equilibrium import report_equilibrium
from kolsky.bars.reduction.inputs import WavesInput
from kolsky.bars.reduction.plateau import END_SIGMA, ENDS, Plateau, Span, weighted_mean
from kolsky.bars.reduction.pulse_checks import PulseCheck
from kolsky.bars.reduction.signal_remarks import SMALL, arrival_remarks, drift_remarks
from kolsky.bars.reduction.summary import Summary, spread_of
from kolsky.bars.result import BudgetTable
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.bridge import Bridge, Calibration
from kolsky.bars.signals.stations import Station
from kolsky.base.apparatus import Specimen

WAY = "three waves"
"""The analysis whose numbers are quoted where a shot names none."""
UNITS = {"largest strain": "1", "peak stress": "Pa", "mean stress": "Pa", "mean rate": "1/s"}
BEND = 0.2
"""Second-order term over the standard uncertainty above which a value's band is a first estimate [-]."""


def calibration_sigma(calibration: Calibration, relative: float) -> dict[str, float]:
    """Relative uncertainty of a gauge's calibration as one of the field that scales it."""
    if isinstance(calibration, Bridge):
        return {"gauge_factor": relative * calibration.gauge_factor}
    return {"factor": relative * calibration.factor}


def numbers(reduction: Reduction, summary: Summary, span: Span | None) -> dict[str, np.ndarray]:
    """Quoted values: strain and stress of largest magnitude, means over a span where the summary has them.

    Where a varied input leaves no plateau, and so no span, the means are those over the summary's own span:
    they say what the input does to the test's values, plateau or not.

    Raises
    ------
    ValueError
        If the summary has means and neither has a span.
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
    """Standard uncertainties of the quoted values from the gauges' noise."""
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
    """The choice of both ends of the plateau as inputs of the budget: times by which they are moved."""
    span = summary.plateau.span
    if span is None:
        return []
    return [Quantity(name, 0.0, END_SIGMA * (span.last - span.first), "s", "B") for name in ENDS]


def with_both_sides(budget: Budget) -> Budget:
    """The budget, a quoted value's contribution being the root mean square of its changes to either side.

    With the central difference c and the second difference b the value changes by c + b and by b - c over one
    standard uncertainty, in the mean square by c^2 + b^2: a peak that wanders along the history when two
    waves are moved against each other has little of the first and much of the second.
    """
    contribution = dict(budget.contribution)
    for name in UNITS:
        if name in contribution:
            straight = contribution[name]
            contribution[name] = np.copysign(np.hypot(straight, budget.curvature[name]), straight)
    return replace(budget, contribution=contribution)


def table(budget: Budget, sign: float) -> BudgetTable:
    """Quoted values with the share of every input, largest first; `sign` -1 makes tension positive."""
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
    specimen: Specimen,
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
    balance = report_equilibrium(reduction, specimen_length=specimen.length)
    if balance.ring_up is not None:
        found["time to equilibrium"] = (balance.ring_up, "s")
    return found


def remarks(
    reduction: Reduction,
    budget: Budget,
    checks: tuple[PulseCheck, PulseCheck],
    given: WavesInput,
    plateau: Plateau,
) -> list[str]:
    """Remarks on conditions that limit the use of the values, each with its cure."""
    found = []
    if reduction.balanced is None:
        found.append(
            f"the forces on the faces are nowhere in equilibrium within {100 * given.allowance:g} %, so that "
            "no stress-strain curve of the material follows; cure: a shorter specimen, a pulse shaper, or "
            "the inverse method (kolsky identify)"
        )
    else:
        cure = "; cure: a longer pulse, a pulse shaper, or waves.plateau where a shorter span is meant"
        quoted = (("stress", plateau.stress_fault), ("rate", plateau.rate_fault))
        missing = [(name, fault) for name, fault in quoted if fault is not None]
        if len(missing) == 2 and missing[0][1] == missing[1][1]:
            found.append(f"no mean stress and no mean rate are quoted: {missing[0][1]}{cure}")
        else:
            found += [f"no mean {name} is quoted: {fault}{cure}" for name, fault in missing]
    found += arrival_remarks(reduction, checks, given)
    found += drift_remarks(budget, UNITS)
    bent = [name for name in UNITS if name in budget.value and _bent(budget, name)]
    if bent:
        found.append(
            f"the {', the '.join(bent)} depends on its inputs nonlinearly within their "
            "uncertainty, so that the band is a first estimate; cure: a better wave speed (kolsky wavespeed)"
        )
    systematic = {key: value for key, value in given.uncertainty.items() if value > 0.0}
    if not systematic:
        found.append(
            "no standard uncertainty is declared, so that the bands hold the gauges' noise and zero only; "
            "cure: add a table [uncertainty]"
        )
    return found


def _bent(budget: Budget, name: str) -> bool:
    """Whether a quoted value depends on its inputs nonlinearly, and by an amount that matters."""
    ratio, value = budget.nonlinearity(name), abs(float(budget.value[name]))
    return ratio > BEND and ratio * float(budget.sigma(name)) > SMALL * value


def _instants(reduction: Reduction, way: str) -> tuple[int, int]:
    """Samples of the largest strain and of the largest stress by one analysis."""
    strain, stress = reduction.strain[way].value, reduction.stress[way].value
    return int(np.abs(strain).argmax()), int(np.abs(stress).argmax())
