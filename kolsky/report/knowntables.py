"""Profiles, posterior and declared uncertainties as rows of the report's tables."""

from typing import Any

import numpy as np

from doe.uncertainty import VerdictKind
from kolsky.inverse.result import Identification
from kolsky.inverse.uncertainty_results import Declaration, ParameterProfile
from kolsky.report import numbers
from kolsky.report.nomenclature import name_of

INPUTS = {
    "poisson": "Poisson’s ratio ν",
    "damping": "damping β",
    "friction": "friction f",
    "curve_scale": "scale of the quasi-static stress",
    "specimen_diameter": "specimen’s diameter",
    "specimen_length": "specimen’s length",
    "specimen_density": "specimen’s density",
    "sensitivity": "sensitivity of the force",
    "clock_offset": "clock of the force against the cameras’",
    "Z_offset": "axis of the outline, Z",
    "y_offset": "height of the outline, y",
}
"""Words for the keys of [uncertainty]."""
FACTORS = {"s": (1e6, "µs"), "m": (1e6, "µm")}
"""Factor and unit in which an uncertainty is shown."""
PLAIN = ("poisson", "friction")
"""Keys whose uncertainty is a number and no share."""
OPEN = "open"


def known(result: Identification) -> dict[str, Any]:
    """Rows of the section, from a result in shown units."""
    return {
        "verdicts": [_verdict(result, profile) for profile in result.profiles],
        "posterior": _posterior(result),
        "declared": [_declared(result, part) for part in result.systematic],
    }


def _verdict(result: Identification, profile: ParameterProfile) -> dict[str, Any]:
    name = name_of(profile.name, result.estimates[profile.name].unit)
    ends = (*profile.interval, *profile.alone)
    width = float(np.nanmax(np.abs([end - result.estimates[profile.name].value for end in ends] + [0.0])))
    # What the table says already is not said again.
    more = profile.verdict != VerdictKind.IDENTIFIED.value or ";" in profile.text
    return {
        "symbol": name.symbol,
        "unit": "" if name.unit == "1" else name.unit,
        "ends": [OPEN if np.isnan(end) else numbers.like(end, width) for end in ends],
        "verdict": profile.verdict,
        "text": profile.text + (" (in SI)" if name.factor != 1.0 else "") if more else "",
    }


def _posterior(result: Identification) -> list[tuple[str, str]]:
    chains = result.posterior
    if chains is None:
        return []
    rows = []
    for name, middle, low, high in zip(chains.names, chains.median, chains.lower, chains.upper, strict=True):
        shown = name_of(name)
        unit = "" if shown.unit in ("1", "SI") else f" {shown.unit}"
        width = 0.5 * (high - low)
        texts = (numbers.like(float(x), width) for x in (middle, low, high))
        rows.append((shown.symbol, "{}, {} to {}".format(*texts) + unit))
    state = "converged" if chains.converged else "too short"
    rows.append(("chains", f"{state}: {chains.steps} steps, autocorrelation {chains.autocorrelation:.0f}"))
    rows.append(("priors", chains.prior))
    return rows


def _declared(result: Identification, part: Declaration) -> dict[str, Any]:
    factor, unit = FACTORS.get(part.unit, (1.0, "") if part.key in PLAIN else (100.0, "%"))
    known = np.isfinite(part.sigma)
    return {
        "words": INPUTS.get(part.key, part.key),
        "sigma": f"{numbers.plain(factor * part.sigma, 3)} {unit}".rstrip() if known else numbers.NOTHING,
        "shifts": [
            numbers.plain(part.shifts[name], 2) if name in part.shifts else numbers.NOTHING
            for name in result.estimates
        ],
        "status": part.status,
    }
