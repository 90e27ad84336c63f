"""Results as plain text for a terminal of 80 columns, and as rows of the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from kolsky.diagnosis.causes import percent, sentence
from kolsky.inverse.parameters import PARAMETERS, reference_words
from kolsky.inverse.result import (
    LATE,
    NOISE,
    ClockLag,
    Declaration,
    Estimate,
    FitQuality,
    Identification,
    Method,
    Route,
    Verdict,
)
from kolsky.pictures.specimen_length import LengthByPictures, length_words
from kolsky.results import numbers
from kolsky.results.display import estimate_in_display_units, in_display_units
from kolsky.results.nomenclature import factor_of, heading, name_of, typeset, upper_first
from kolsky.results.numbers import plain_sentence
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.declarations import (
    INVISIBLE,
    amount_text,
    invisible_inputs,
    relative_moves,
    taken_as_exact,
)

_CHANNEL_UNITS = {"N": (1.0, "N"), "m": (1e6, "µm")}
"""Factor and unit of a displayed residual."""
_NOT_RECORDED = "not recorded"
"""Text for the goodness of fit if the file does not contain it."""


def fit_line(found: Identification) -> str:
    """Return the goodness of fit in one line, "fit: force explained (0.79 of at most 2), outline ..."."""
    if not found.fit:
        return f"fit: {_NOT_RECORDED}"
    said = []
    for f in found.fit:
        worst = max(((f.excess, f.limit), (f.slow_excess, f.slow_limit)), key=lambda pair: pair[0] / pair[1])
        limit = f" of at most {worst[1]:g}" if worst[1] < float("inf") else ", no limit"
        said.append(f"{f.channel} {fit_state(f)} ({worst[0]:.2g}{limit})")
    return f"fit: {', '.join(said)}"


NOT_TESTABLE = "not testable with the declared uncertainties"
"""Text for a check that could not fail with the declared uncertainties."""


def fit_state(f: FitQuality) -> str:
    """Return the outcome of a check: "explained", failed, or the reason why it could not have failed."""
    if not f.explained:
        return "NOT EXPLAINED"
    return "explained" if f.testable else NOT_TESTABLE


def lag_state(result: Identification, lag: ClockLag) -> str:
    """Return "late", or "on time" if a lag would be detected before it affects the result."""
    if not lag.sigma >= 0.0:
        return "not found"
    if lag.significance > LATE:
        return "late"
    return "on time" if lag.noticed <= result.lag_that_matters(lag.recording) else "not testable"


MANY_SIGMAS = 4.0
"""Squared ratio of residual to noise above which a page explains the residual: twice the noise."""


def why_beyond_noise(f: FitQuality) -> str:
    """Return why a residual far above the noise is expected; empty if it is small or not explained."""
    if not (f.explained and f.limit < float("inf") and f.chi2 > MANY_SIGMAS):
        return ""
    factor, unit = _CHANNEL_UNITS[f.unit]
    others = {source: part for source, part in f.predicted.items() if source != NOISE}
    if not others:
        return ""
    source = max(others, key=lambda name: others[name])
    return (
        f"The {f.channel}'s residual is {f.over_noise:.2g} times its noise, as expected ({source}: "
        f"{factor * others[source]:.2g} {unit}, noise: {factor * f.predicted[NOISE]:.2g} {unit}). The band "
        "of the figure includes all sources."
    )


def printed_fit(found: Identification, symbols: Mapping[str, str]) -> dict[str, str]:
    """Return the lines about fit and clocks for a terminal, in ASCII except for ±."""
    if not found.fit:
        return {"goodness of fit": _NOT_RECORDED}
    rows = {}
    for f in found.fit:
        factor, unit = _CHANNEL_UNITS[f.unit]
        unit = unit.replace("µ", "u")
        residual, peak = f"{factor * f.residual:.3g} {unit} rms", f"{100.0 * f.over_peak:.2g} % of peak"
        rows[f"{f.channel}, residual"] = f"{residual}, {f.over_noise:.2g} x noise, {peak}"
        tau = f"tau {100.0 * f.discrepancy_share:.2g} % of the variance"
        rows[f"{f.channel}, chi2/n"] = f"{f.chi2:.3g}, {tau}"
        rows[f"{f.channel}, over expected"] = _limited(f.excess, f.limit)
        rows[f"{f.channel}, the same, slow"] = _limited(f.slow_excess, f.slow_limit)
        if f.limit < float("inf"):
            rows[f"{f.channel}, detectable"] = f"a residual above {factor * f.noticed:.2g} {unit} rms"
        rows[f"{f.channel}, neighbours"] = (
            f"correlation {f.correlation:.2g}, white with p = {f.whiteness:.2g}"
        )
        if f.weight:
            shares = (f"{100.0 * w:.2g} % of {symbols.get(name, name)}" for name, w in f.weight.items())
            rows[f"{f.channel}, information"] = ", ".join(shares)
    for lag in found.clocks:
        rows[f"{lag.recording}, late by"] = (
            f"{1e6 * lag.lag:.2f} ± {2e6 * lag.sigma:.2f} us: {lag_state(found, lag)}, detects "
            f"{1e6 * lag.noticed:.2g} us"
        )
    return rows


def _limited(value: float, limit: float) -> str:
    return f"{value:.3g}" + (f", at most {limit:g}" if limit < float("inf") else ", no limit")


def fit_tables(result: Identification) -> dict[str, Any]:
    """Return the tables of fit and clocks for a page."""
    return {
        "symbols": [name_of(name).symbol for name in result.estimates],
        "channels": [_channel(result, f) for f in result.fit],
        "clocks": [_clock(result, lag) for lag in result.clocks],
    }


def _channel(result: Identification, f: FitQuality) -> dict[str, Any]:
    factor, unit = _CHANNEL_UNITS[f.unit]
    plain = numbers.plain
    return {
        "channel": f.channel,
        "words": f"{f.channel}, {f.values} values",
        "explained": f.explained,
        "state": fit_state(f),
        "noticed": f"{plain(factor * f.noticed, 2)} {unit}",
        "why": why_beyond_noise(f),
        "residual": f"{plain(factor * f.residual, 3)} {unit}",
        "noise": plain(f.over_noise, 3),
        "peak": numbers.percent(f.over_peak),
        "chi2": plain(f.chi2, 3),
        "tau": numbers.percent(f.discrepancy_share),
        "correlation": plain(f.correlation, 2),
        "whiteness": plain(f.whiteness, 2),
        "excess": plain(f.excess, 3),
        "limit": plain(f.limit, 3),
        "slow": plain(f.slow_excess, 3),
        "slow_limit": plain(f.slow_limit, 3),
        "weight": [
            numbers.percent(f.weight[name]) if name in f.weight else numbers.NOTHING
            for name in result.estimates
        ],
        "predicted": ", ".join(
            f"{source} {plain(factor * part, 2)} {unit}" for source, part in f.predicted.items()
        ),
    }


def _clock(result: Identification, lag: ClockLag) -> tuple[str, str, str]:
    value, U = numbers.measured(1e6 * lag.lag, 2e6 * lag.sigma)
    state = lag_state(result, lag)
    if state != "not found":
        state += f"; a lag above {1e6 * lag.noticed:.2g} µs would be detected"
    return lag.recording, f"{value} ± {U} µs", state


def _effects(result: Identification) -> Iterator[tuple[Declaration, dict[str, float], bool]]:
    """Inputs that affect the result, with their relative effects, and True if taken as exact."""
    exact = {part.key for part in taken_as_exact(result.systematic)}
    for part in result.systematic:
        if part.moves:
            yield part, relative_moves(part, _values(result)), part.key in exact


def sensitivity_rows(result: Identification) -> list[dict[str, Any]]:
    """Return one row for each input that affects the result: amount, effect, visibility, declaration."""
    return [
        {
            "Input": upper_first(INPUTS[part.key].words),
            "Declared in": INPUTS[part.key].place,
            "Larger by": amount_text(part).replace("us", "µs").replace("um", "µm"),
            **{
                heading(name, words="Moves {} by"): signed_percent(shares[name])
                if name in shares
                else numbers.NOTHING
                for name in result.estimates
            },
            "Stays in the residual": numbers.percent(part.visible),
            "Uncertainty": "taken as exact" if exact else part.status,
        }
        for part, shares, exact in _effects(result)
    ]


def signed_percent(share: float) -> str:
    """Return a share with its sign in percent: "+1.8 %"."""
    return typeset(f"{100.0 * share:+.2g} %")


def unseen_notes(result: Identification) -> list[str]:
    """Return sentences on inputs that leave no residual, and on inputs that the data cannot distinguish."""
    return list(invisible_inputs(result.systematic))


def printed_sensitivities(result: Identification, symbol: dict[str, str]) -> dict[str, str]:
    """Return rows for a terminal: "per 1 % of specimen_length" -> "m +1.8 % (taken as exact)"."""
    rows = {}
    for part, shares, exact in _effects(result):
        told = ", ".join(f"{symbol[name]} {100.0 * share:+.2g} %" for name, share in shares.items())
        notes = ["leaves no residual"] if part.visible < INVISIBLE else []
        notes += ["taken as exact"] if exact else []
        rows[f"per {amount_text(part)} of {part.key}"] = f"{told} ({', '.join(notes)})" if notes else told
    return rows


ROUTES = {"force only": "force only", "shape only": "outline only", "paper": "cost Phi, Eq. (M.5)"}


def answer(e: Estimate) -> str:
    """Return an estimate as one line, "m = 1.1220 ± 0.0040 (k = 2)", with any verdict but "identified"."""
    e = estimate_in_display_units(e)
    value, uncertainty = numbers.measured(e.value, 2.0 * e.sigma)
    unit = "" if e.unit == "1" else f" {plain_sentence(e.unit)}"
    line = f"{plain_symbol(e.name)} = {plain_sentence(value)} ± {plain_sentence(uncertainty)}{unit} (k = 2)"
    if e.outcome is Verdict.NOT_SEEN:
        low, high = (plain_sentence(numbers.like(end, 2.0 * e.sigma)) for end in e.interval)
        line = f"{plain_symbol(e.name)} = {low} to {high}{unit} (k = 2)"
    return line if e.outcome is Verdict.IDENTIFIED else f"{line}: {e.outcome.value.upper()}"


MOST_PARTS = 4
"""Maximum number of printed parts of an uncertainty, the largest first."""


def variance_shares(found: Identification, name: str) -> dict[str, float]:
    """Return the share of each source in a parameter's variance, the largest first; their sum is one.

    A declared input's part is the square of the shift that it causes, because inputs are independent.
    """
    e = found.estimates[name]
    parts = {"noise": e.sigma_noise**2, "mesh and step": e.sigma_numerical**2}
    parts |= {part.key: part.shifts.get(name, 0.0) ** 2 for part in found.systematic}
    total = sum(parts.values())
    if total <= 0.0:
        return {}
    return {key: part / total for key, part in sorted(parts.items(), key=lambda one: -one[1]) if part > 0.0}


def summary(found: Identification) -> dict[str, str]:
    """Return what dominates the first parameter's variance, likely causes of a misfit, and the next step."""
    first = next(iter(found.estimates))
    largest = list(variance_shares(found, first).items())[:MOST_PARTS]
    rows = {}
    if largest:
        words = ", ".join(f"{key.replace('_', ' ')} {100.0 * share:.2g} %" for key, share in largest)
        rows[f"variance of {plain_symbol(first)}"] = plain_sentence(words)
    return {**rows, **_causes(found), "next": plain_sentence(_next_step(found, [key for key, _ in largest]))}


def _next_step(found: Identification, largest: list[str]) -> str:
    """The next step for the user, in one sentence."""
    if any(not one.explained for one in found.fit):
        cause = next((c.key for c in found.causes if c.named), None)
        check = f"check {cause}" if cause else "check the inputs"
        return f"{check}; the report compares force and outline with the model"
    if any(e.outcome is not Verdict.IDENTIFIED for e in found.estimates.values()):
        return "see the warnings; a parameter that is known can be held (--hold NAME=VALUE)"
    if open_ := taken_as_exact(found.systematic):
        worst = max(open_, key=lambda part: max(map(abs, relative_moves(part, _values(found)).values())))
        return f"declare {worst.key} and {len(open_) - 1} more in [uncertainty]: they are taken as exact"
    declared = [key for key in largest if key in INPUTS]
    return f"a better known {declared[0].replace('_', ' ')} narrows the interval most" if declared else "none"


def _values(found: Identification) -> dict[str, float]:
    return {name: e.value for name, e in found.estimates.items()}


def details(found: Identification) -> dict[str, str]:
    """Return verdict, interval, uncertainties, optima of all routes, fit and clocks: names and values."""
    found = in_display_units(found)
    rows = [("shot", found.shot)]
    reference = reference_words((*found.estimates, *found.fixed))
    if reference:
        rows.append(("m refers to", plain_sentence(reference)))
    if "specimen_length" in found.provenance:
        length = LengthByPictures(**found.provenance["specimen_length"])
        rows.append(("specimen's length", plain_sentence(length_words(length))))
    for name, e in found.estimates.items():
        symbol, U = plain_symbol(name), 2.0 * e.sigma
        symbol += "" if e.unit == "1" else f" ({plain_sentence(e.unit)})"
        low, high = (plain_sentence(numbers.like(end, U)) for end in e.interval)
        rows.append((f"{symbol}, verdict", f"{name}: {e.outcome.value}"))
        rows.append((f"{symbol}, interval", f"{low} to {high}"))
        rows.append((f"{symbol}, u noise", f"{e.sigma_noise:.2g}"))
        rows.append((f"{symbol}, u mesh and step", f"{e.sigma_numerical:.2g}"))
        if e.mesh_correction:
            shown = plain_sentence(numbers.part(e.mesh_correction, U))
            rows.append((f"{symbol}, on the refined mesh", f"{plain_sentence(numbers.like(e.on_mesh, U))}"))
            rows.append((f"{symbol}, corrected for the mesh by", shown))
        if e.sigma_systematic > 0.0:
            rows.append((f"{symbol}, u declared", f"{e.sigma_systematic:.2g}"))
        rows += [(f"{symbol}, data say", p.verdict) for p in found.profiles if p.name == name]
        rows += [
            (f"{symbol}, {ROUTES[route.name]}", _route_line(route, name, U))
            for route in found.routes
            if route.name in ROUTES
        ]
        rows += [
            (f"{symbol}, {method.name}", _distant_lines(method, name, U)) for method in found.methods[1:]
        ]
    symbols = {name: plain_symbol(name) for name in found.estimates}
    causes = _causes(found)
    return {**dict(rows), **printed_fit(found, symbols), **causes, **printed_sensitivities(found, symbols)}


def _causes(found: Identification) -> dict[str, str]:
    """Likely causes of a misfit, the most likely first. Empty if there is none."""
    rows = {}
    for number, cause in enumerate((c for c in found.causes if c.named), start=1):
        solved = ", ".join(
            f"{plain_symbol(name)} = {value * factor_of(name):.5g} identified with it"
            for name, value in cause.solved.items()
        )
        said = f"{sentence(cause)} explains {percent(cause.explained)}" + (f"; {solved}" if solved else "")
        rows[f"likely cause {number}, {cause.key}"] = plain_sentence(said)
    return rows


def _distant_lines(method: Method, name: str, U: float) -> str:
    value, distance = numbers.like(method.values[name], U), numbers.plain(method.distances[name], 2)
    return f"{plain_sentence(value)}, {plain_sentence(distance)} U from the answer" + (
        "" if method.converged else ", not at rest"
    )


def _route_line(route: Route, name: str, U: float) -> str:
    value = route.parameters[name]
    if name not in route.sigma:
        return plain_sentence(numbers.like(value, U))
    best, uncertainty = numbers.measured(value, 2.0 * route.sigma[name])
    return f"{plain_sentence(best)} ± {plain_sentence(uncertainty)}"


def plain_symbol(name: str) -> str:
    """Return the symbol of a parameter in plain text."""
    return PARAMETERS[name].symbol if name in PARAMETERS else name
