"""The numbers that a reduction is quoted by: their budget, the record's facts, what has to be said."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from kolsky.bars.budget.budget import Budget, quoted
from kolsky.bars.records import Reduction, Windows
from kolsky.bars.reduction.equilibrium import report_equilibrium
from kolsky.bars.reduction.inputs import WavesInput
from kolsky.bars.reduction.summary import Summary, mean_over, spread_of
from kolsky.bars.reduction.windows import Reckoning
from kolsky.bars.result import BudgetTable
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.bridge import Bridge, Calibration
from kolsky.bars.signals.stations import Station
from kolsky.base.apparatus import Specimen

WAY = "three waves"
"""The analysis whose numbers are quoted."""
UNITS = {"largest strain": "1", "peak stress": "Pa", "mean stress": "Pa", "mean rate": "1/s"}
BEND = 0.2
"""Curvature over the standard uncertainty from which a number's band is called a first estimate [-]."""
LATE = 3.0
"""A pulse this many of its own sigmas (and two samples) from where it is reckoned is worth a remark."""


def calibration_sigma(calibration: Calibration, relative: float) -> dict[str, float]:
    """The relative uncertainty of a gauge's calibration on the field that carries it."""
    if isinstance(calibration, Bridge):
        return {"gauge_factor": relative * calibration.gauge_factor}
    return {"factor": relative * calibration.factor}


def numbers(reduction: Reduction, summary: Summary) -> dict[str, np.ndarray]:
    """The quoted numbers at fixed instants and spans, so that they vary smoothly with the inputs."""
    strain, stress = reduction.strain[WAY].value, reduction.stress[WAY].value
    last, peak = _instants(reduction)
    found = {"largest strain": strain[last], "peak stress": stress[peak]}
    if summary.plateau is not None:
        for name, history in (("mean stress", reduction.stress[WAY]), ("mean rate", reduction.rate[WAY])):
            found[name] = mean_over(history, reduction.time, summary.plateau, name).value
    return {name: np.asarray(value, dtype=float) for name, value in found.items()}


def noise(reduction: Reduction, summary: Summary) -> dict[str, float]:
    """What the gauges' noise adds to them."""
    last, peak = _instants(reduction)
    found = {
        "largest strain": float(reduction.strain[WAY].sigma[last]),
        "peak stress": float(reduction.stress[WAY].sigma[peak]),
    }
    if summary.mean_stress is not None and summary.mean_rate is not None:
        found |= {"mean stress": summary.mean_stress.sigma, "mean rate": summary.mean_rate.sigma}
    return found


def table(budget: Budget, sign: float) -> BudgetTable:
    """Quoted numbers with the share of every input, largest first; `sign` turns tension positive."""
    found = quoted(budget, {name: (name, None, unit) for name, unit in UNITS.items() if name in budget.value})
    rows = sorted(found.contributions, key=lambda row: -max(map(abs, row.shares.values()), default=0.0))
    return BudgetTable(
        results={name: (sign * value, sigma, unit) for name, (value, sigma, unit) in found.results.items()},
        contributions=tuple(rows),
    )


def facts(
    best: Mapping[str, Station],
    arrival: Arrival,
    seen: tuple[Reckoning, Reckoning],
    windows: Windows,
    reduction: Reduction,
    summary: Summary,
    specimen: Specimen,
) -> dict[str, tuple[float, str]]:
    """Numbers of the record and of its reduction: value and unit by name."""
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
    for name, reckoning in zip(("reflected", "transmitted"), seen, strict=True):
        if reckoning.seen is not None:
            found[f"{name} pulse, later than reckoned by"] = (reckoning.late, "s")
    found |= {
        "energy of the incident wave": (energy.incident, "J"),
        "energy of the reflected wave": (energy.reflected, "J"),
        "energy of the transmitted wave": (energy.transmitted, "J"),
        "energy absorbed by the specimen": (energy.absorbed, "J"),
        "work of deformation": (energy.deformation, "J"),
        "spread of the largest strain over the analyses": (spread_of(reduction.strain), "1"),
    }
    if summary.modulus is not None:
        found["loading modulus in equilibrium"] = (summary.modulus.value, "Pa")
    balance = report_equilibrium(reduction, specimen_length=specimen.length)
    if balance.ring_up is not None:
        found["time to equilibrium"] = (balance.ring_up, "s")
    return found


def remarks(
    reduction: Reduction, budget: Budget, seen: tuple[Reckoning, Reckoning], given: WavesInput
) -> list[str]:
    """What must be known before the numbers are used, each with its cure."""
    found = []
    if reduction.balanced is None:
        found.append(
            f"the forces on the faces are nowhere balanced within {100 * given.allowance:g} %, so that no "
            "curve of the material follows; cure: a shorter specimen, a pulse shaper, or the inverse method "
            "(kolsky identify)"
        )
    reflected = seen[0]
    interval = float(reduction.time[1] - reduction.time[0])
    if reflected.seen is None:
        found.append(f"no reflected pulse is seen: {reflected.reason}")
    elif abs(reflected.late) > LATE * reflected.seen.sigma + 2.0 * interval:
        found.append(
            f"the reflected pulse is seen {1e6 * reflected.late:+.2f} us from where the gauge's distance and "
            "the wave speed put it; cure: check both, or measure the wave speed (kolsky wavespeed)"
        )
    bent = [name for name in UNITS if name in budget.value and budget.nonlinearity(name) > BEND]
    if bent:
        found.append(
            f"the {', the '.join(bent)} does not follow its inputs on a straight line within their "
            "uncertainty, so that the band is a first estimate; cure: a better wave speed (kolsky wavespeed)"
        )
    systematic = {key: value for key, value in given.uncertainty.items() if value > 0.0}
    if not systematic:
        found.append(
            "no standard uncertainty is declared, so that the bands hold the gauges' noise and zero only; "
            "cure: add a table [uncertainty]"
        )
    return found


def _instants(reduction: Reduction) -> tuple[int, int]:
    """Samples of the largest strain and of the largest stress."""
    strain, stress = reduction.strain[WAY].value, reduction.stress[WAY].value
    return int(np.abs(strain).argmax()), int(np.abs(stress).argmax())


def as_text(value: Any) -> str:
    """A declared value as a reader wants it."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
