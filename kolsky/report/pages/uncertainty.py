"""Tables of the report about uncertainty: likelihood, declared uncertainties, improvements."""

from collections.abc import Callable
from math import isclose, isfinite, sqrt
from typing import Any

import numpy as np

from doe.uncertainty import VerdictKind
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Declaration, Estimate, Identification, ParameterProfile
from kolsky.results import numbers
from kolsky.results.nomenclature import heading, name_of, short, upper_first
from kolsky.results.printed import MOST_PARTS, sensitivity_rows, unseen_notes, variance_shares
from kolsky.schema.apparatus import IDENTIFY_KEYS
from kolsky.shot.curve import PAST_CURVE
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.warnings import equivalent_strain

FACTORS = {"s": (1e6, "µs"), "m": (1e6, "µm")}
"""Factor and unit in which an uncertainty is shown."""
OPEN = "open"
MOVES = "Moves {} by"
"""Heading of the effect of an input or a choice on a parameter."""


def _words(key: str) -> str:
    """Description of an input; a parameter with its symbol."""
    if key in PARAMETERS:
        return short(key)
    return INPUTS[key].words if key in INPUTS else key


def likelihood_tables(result: Identification) -> dict[str, Any]:
    """Return the tables of profile likelihood, posterior and declared uncertainties, from display units."""
    return {
        "verdicts": [_verdict(result, profile) for profile in result.profiles],
        "posterior": _posterior(result),
        "declared": [_declared(result, part) for part in result.systematic],
        "sensitivities": sensitivity_rows(result),
        "unseen": unseen_notes(result),
    }


def _verdict(result: Identification, profile: ParameterProfile) -> dict[str, Any]:
    name = name_of(profile.name, result.estimates[profile.name].unit)
    ends = (*profile.interval, *profile.alone)
    width = float(np.nanmax(np.abs([end - result.estimates[profile.name].value for end in ends] + [0.0])))
    # A text that repeats the table is left out.
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
    plain = part.key in INPUTS and not INPUTS[part.key].relative
    factor, unit = FACTORS.get(part.unit, (1.0, "") if plain else (100.0, "%"))
    declared = np.isfinite(part.sigma)
    return {
        "Input": upper_first(_words(part.key)),
        "Standard uncertainty": f"{numbers.plain(factor * part.sigma, 3)} {unit}".rstrip()
        if declared
        else numbers.NOTHING,
        **{
            heading(name, e.unit, MOVES): numbers.plain(part.shifts[name], 2)
            if name in part.shifts
            else numbers.NOTHING
            for name, e in result.estimates.items()
        },
        "What was done": part.status,
    }


SOURCES = {
    "force and shape": "noise of force and outline",
    "force scale": "uncertainty of the force’s scale",
    "motion scale": "uncertainty of the motion’s scale",
    "flyer motion": "noise of the front face's motion",
    "common errors of the outline": "errors common to outline points",
    "material curve": "uncertainty of the quasi-static curve",
    "mesh": "error of mesh and step",
    "roughness": "roughness of the simulated response",
}
"""Words for the keys of `Estimate.noise_parts` and `Estimate.numerical_parts`."""
UNDECLARED = "not declared, counted as exact"
"""`Declaration.status` of an input that could be declared."""
LEAST = 0.02
"""Smallest share of the variance that is listed."""


def changes(result: Identification) -> list[str]:
    """Return sentences on changes that would narrow the intervals (display units), the largest first."""
    lines = [line for estimate in result.estimates.values() for line in _halved(result, estimate)]
    return [*lines, *_others_known(result), *_curve(result), *_undeclared(result)]


def parts(result: Identification, estimate: Estimate) -> dict[str, float]:
    """Return the standard uncertainties in the interval by source, the largest first."""
    computed = estimate.numerical_parts or {"mesh": estimate.sigma_numerical}
    sigmas = {
        SOURCES.get(source, source): sigma for source, sigma in (estimate.noise_parts | computed).items()
    }
    for declared in result.systematic:
        if estimate.name in declared.shifts:
            words = _words(declared.key)
            sigmas[f"declared uncertainty of the {words}"] = abs(declared.shifts[estimate.name])
    return dict(sorted(sigmas.items(), key=lambda part: -part[1]))


def dominant(result: Identification, estimate: Estimate) -> str:
    """Return the largest shares of an estimate's variance in one line. "" if the estimate is not bounded."""
    if not isfinite(estimate.sigma):
        return ""
    largest = list(variance_shares(result, estimate.name).items())[:MOST_PARTS]
    return ", ".join(f"{_words(key)} {numbers.percent(share)}" for key, share in largest)


def _halved(result: Identification, estimate: Estimate) -> list[str]:
    """Return the effect of halving each part. The root sum of squares of the parts must be the whole."""
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
        then = numbers.like(half, 2.0 * total)  # in the digits of the present U, to compare the two
        if then == now:
            continue
        lines.append(
            f"Halving the {words} would bring U of {symbol} from {now} to {then}{unit} "
            f"({numbers.percent(share)} of the variance)"
        )
    return lines


def _others_known(result: Identification) -> list[str]:
    """Return the part of each interval's width that is due to the other free parameters."""
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
    """Return the strain up to which a quasi-static test is needed."""
    share = float(result.response.extrapolated_share[0])
    last = result.provenance.get("checks", {}).get("curve_last_strain")
    reached = float(result.response.largest_strain_measure[0])
    if not (share > PAST_CURVE and isinstance(last, float) and np.isfinite(reached)):
        return []
    strain = equivalent_strain(reached, last)
    return [
        f"Measuring the quasi-static curve to a nominal strain of {numbers.plain(strain, 2)} instead of "
        f"{numbers.plain(last, 2)} would cover the strains of {numbers.percent(share)} of the specimen’s "
        "volume; no part of the interval covers this"
    ]


def _undeclared(result: Identification) -> list[str]:
    """Return the inputs that are assumed to be exact."""
    open_ = [_words(part.key) for part in result.systematic if part.status == UNDECLARED]
    if not open_:
        return []
    return [
        f"Counted as exact, because no uncertainty was declared: {', '.join(open_)}. A standard uncertainty "
        "in [uncertainty] of the shot file can only widen the interval"
    ]


CHOSEN = tuple(key for key in IDENTIFY_KEYS if key in PARAMETERS)
"""Inputs that no file of the shot measures."""
NOT_VARIED = "not varied"
WINDOW_END, FORCE_BINS = "window_end", "force_bins"
"""Keys of `kolsky.inverse.result.Variation`."""


def choices(result: Identification) -> list[dict[str, Any]]:
    """Return the rows of the choices: the choice, its value, the shift of each parameter, the status."""
    return [*_inputs(result), *_window(result)]


def _row(
    result: Identification, words: str, taken: str, shifts: dict[str, float], done: str
) -> dict[str, Any]:
    return {
        "Choice": upper_first(words),
        "Taken": taken,
        **{
            heading(name, e.unit, MOVES): numbers.part(shifts[name], 2.0 * e.sigma)
            if name in shifts
            else numbers.NOTHING
            for name, e in result.estimates.items()
        },
        "What was done": upper_first(done),
    }


def _inputs(result: Identification) -> list[dict[str, Any]]:
    rows = []
    varied = {part.key: part for part in result.systematic}
    for key in CHOSEN:
        part, name = varied.get(key), name_of(key)
        unit = "" if name.unit == "1" else f" {name.unit}"
        held = result.fixed.get(key)
        taken = f"{numbers.plain(held)}{unit}" if held is not None else "free"
        done = NOT_VARIED if part is None else part.status
        if part is not None and part.shifts:
            done = "larger by its declared standard uncertainty"
        shifts = {} if part is None else dict(part.shifts)
        rows.append(_row(result, _words(key), taken, shifts, done))
    return rows


def _window(result: Identification) -> list[dict[str, Any]]:
    c, rows = result.comparison, []
    if len(window := result.provenance.get("window_s", [])) == 2:
        end, hint = milliseconds(float(window[1])), f"{NOT_VARIED}: set window.end and try"
        rows += _varied(result, WINDOW_END, "end of the window", end, milliseconds, hint)
    if c.force_time.size > 1:
        width = float(c.force_time[1] - c.force_time[0])
        means, words = (
            f"{c.force_time.size} means over {_microseconds(width)}",
            "bins of the force (no other filter)",
        )
        rows += _varied(result, FORCE_BINS, words, means, _microseconds, NOT_VARIED)
    return rows


def _varied(
    result: Identification, key: str, words: str, value: str, shown: Callable[[float], str], without: str
) -> list[dict[str, Any]]:
    """Rows of a choice with every other value that was tried."""
    return [
        _row(result, words, value, dict(v.shifts), f"{shown(v.value)} instead: {v.status}")
        for v in result.variations
        if v.key == key
    ] or [_row(result, words, value, {}, without)]


def milliseconds(time: float) -> str:
    """A time in ms."""
    return f"{numbers.rounded(1e3 * time, -3)} ms"


def _microseconds(time: float) -> str:
    return f"{numbers.plain(1e6 * time, 3)} µs"
