"""What would change an answer: the parts of its interval by size, and what is not in the interval at all.

Nothing is advised that the result does not hold: each sentence is a part of the estimate, scaled.
"""

from math import isclose, isfinite, sqrt

import numpy as np

from kolsky.inverse.result import Estimate, Identification
from kolsky.report import numbers
from kolsky.report.knowntables import INPUTS
from kolsky.report.nomenclature import name_of
from kolsky.uncertainty.warnings.runs import PAST_CURVE, equivalent_strain

SOURCES = {
    "force and shape": "the noise of force and outline",
    "force scale": "the uncertainty of the force’s scale",
    "motion scale": "the uncertainty of the motion’s scale",
    "flyer motion": "the noise of what moves the front face",
    "material curve": "the uncertainty of the quasi-static curve",
}
"""Words for the keys of `Estimate.noise_parts`."""
NUMERICS = {
    "mesh": "the error of mesh and step",
    "roughness": "the roughness of the simulated response",
}
"""Words for the keys of `Estimate.numerical_parts`."""
UNDECLARED = "not declared, counted as exact"
"""`Declaration.status` of an input that could be declared."""
LEAST = 0.02
"""Smallest share of the variance that is told."""


def changes(result: Identification) -> list[str]:
    """Sentences for the page, the largest effect on each parameter first.

    Parameters
    ----------
    result
        In shown units, see `kolsky.report.shown`.
    """
    said = [line for estimate in result.estimates.values() for line in _halved(result, estimate)]
    return [*said, *_others_known(result), *_curve(result), *_undeclared(result)]


def parts(result: Identification, estimate: Estimate) -> dict[str, float]:
    """Every standard uncertainty that is in the interval, by its cause, the largest first."""
    found = {SOURCES.get(source, source): sigma for source, sigma in estimate.noise_parts.items()}
    computed = estimate.numerical_parts or {"mesh": estimate.sigma_numerical}
    found |= {NUMERICS.get(source, source): sigma for source, sigma in computed.items()}
    for declared in result.systematic:
        if estimate.name in declared.shifts:
            words = INPUTS.get(declared.key, declared.key)
            found[f"the declared uncertainty of the {words}"] = abs(declared.shifts[estimate.name])
    return dict(sorted(found.items(), key=lambda part: -part[1]))


def _halved(result: Identification, estimate: Estimate) -> list[str]:
    """What half of each part would do, where the parts are independent and make up the whole."""
    total = estimate.sigma
    if not (isfinite(total) and total > 0.0):
        return []
    named = parts(result, estimate)
    if not isclose(sqrt(sum(sigma**2 for sigma in named.values())), total, rel_tol=0.02):
        return []
    symbol = name_of(estimate.name, estimate.unit).symbol
    now = numbers.like(2.0 * total, 2.0 * total)
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    lines = []
    for words, sigma in named.items():
        share = sigma**2 / total**2
        if share < LEAST:
            continue
        half = 2.0 * sqrt(total**2 - 0.75 * sigma**2)
        then = numbers.like(half, 2.0 * total)  # in the digits of the present U: the two are compared
        if then == now:
            continue
        lines.append(
            f"Halving {words} would bring U of {symbol} from {now} to {then}{unit} "
            f"({numbers.percent(share)} of the variance)"
        )
    return lines


def _others_known(result: Identification) -> list[str]:
    """What it costs that other parameters are free too."""
    lines = []
    for profile in result.profiles:
        together, alone = (0.5 * (high - low) for low, high in (profile.interval, profile.alone))
        if len(result.estimates) < 2 or not (isfinite(together) and 0.0 < alone < 0.95 * together):
            continue
        name = name_of(profile.name)
        unit = "" if name.unit in ("1", "SI") else f" {name.unit}"
        lines.append(
            f"Knowing the other free parameters would narrow the profile interval of {name.symbol} from "
            f"±{numbers.plain(together, 2)} to ±{numbers.plain(alone, 2)}{unit}"
        )
    return lines


def _curve(result: Identification) -> list[str]:
    """How far a quasi-static test would have to go."""
    share = float(result.response.extrapolated_share[0])
    last = result.provenance.get("checks", {}).get("curve_last_strain")
    reached = float(result.response.largest_strain_measure[0])
    if not (share > PAST_CURVE and isinstance(last, float) and np.isfinite(reached)):
        return []
    strain = equivalent_strain(reached, last)
    return [
        f"Measuring the quasi-static curve to a nominal strain of {numbers.plain(strain, 2)} instead of "
        f"{numbers.plain(last, 2)} would support what {numbers.percent(share)} of the specimen’s volume was "
        "strained to; no part of the interval stands for that"
    ]


def _undeclared(result: Identification) -> list[str]:
    """Inputs that count as exact."""
    open_ = [INPUTS.get(part.key, part.key) for part in result.systematic if part.status == UNDECLARED]
    if not open_:
        return []
    return [
        f"Counted as exact, because no uncertainty was declared: {', '.join(open_)}. A standard uncertainty "
        "in [uncertainty] of the shot file can only widen the interval"
    ]
