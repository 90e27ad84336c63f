"""Rows shared by terminal and page of an identification: fit, clocks, held parameters, sensitivities."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from kolsky.inverse.result import LATE, NOISE, ClockLag, Declaration, FitQuality, Identification
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of, typeset
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.declarations import (
    INVISIBLE,
    amount_text,
    invisible_inputs,
    relative_moves,
    taken_as_exact,
)

_CHANNEL_UNITS = {"N": (1.0, "N"), "m": (1e6, "µm")}
"""Factor and unit in which a residual is shown."""
_NOT_RECORDED = "not recorded"
"""What stands for the goodness of fit of a file that does not hold it."""


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
"""What a check says that passes by what is declared alone."""


def fit_state(f: FitQuality) -> str:
    """Return "explained" of a check that could have failed, or why it could not, or that it has."""
    if not f.explained:
        return "NOT EXPLAINED"
    return "explained" if f.testable else NOT_TESTABLE


def lag_state(result: Identification, lag: ClockLag) -> str:
    """Return "late", or "on time" of a clock whose lag would be seen before it matters to the answer."""
    if not lag.sigma >= 0.0:
        return "not found"
    if lag.significance > LATE:
        return "late"
    return "on time" if lag.noticed <= result.lag_that_matters(lag.recording) else "not testable"


MANY_SIGMAS = 4.0
"""Residual over the noise, squared, from which on a page explains it: twice the noise."""


def why_beyond_noise(f: FitQuality) -> str:
    """Return why a residual far above the noise is expected; empty where it is not, or is not explained."""
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
    """Return the lines that a terminal gets of fit and clocks, in ASCII but for ±."""
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
            f"{1e6 * lag.lag:.2f} ± {2e6 * lag.sigma:.2f} us: {lag_state(found, lag)}, notices "
            f"{1e6 * lag.noticed:.2g} us"
        )
    return rows


def _limited(value: float, limit: float) -> str:
    return f"{value:.3g}" + (f", at most {limit:g}" if limit < float("inf") else ", no limit")


def fit_tables(result: Identification) -> dict[str, Any]:
    """Return what a page shows of fit and clocks."""
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


def sensitivity_rows(result: Identification) -> list[dict[str, Any]]:
    """Return one row for each input that moves the answer: amount, effect, what shows, how declared."""
    answer = {name: e.value for name, e in result.estimates.items()}
    open_ = {part.key for part in taken_as_exact(result.systematic)}
    return [_sensitivity_row(part, answer, open_) for part in result.systematic if part.moves]


def _sensitivity_row(part: Declaration, answer: dict[str, float], open_: set[str]) -> dict[str, Any]:
    shares = relative_moves(part, answer)
    return {
        "words": INPUTS[part.key].words,
        "place": INPUTS[part.key].place,
        "amount": amount_text(part).replace("us", "µs").replace("um", "µm"),
        "shares": [signed_percent(shares[name]) if name in shares else numbers.NOTHING for name in answer],
        "visible": numbers.percent(part.visible) if isfinite(part.visible) else numbers.NOTHING,
        "taken": "taken as exact" if part.key in open_ else part.status,
    }


def signed_percent(share: float) -> str:
    """Return a share with its sign in percent: "+1.8 %"."""
    return typeset(f"{100.0 * share:+.2g} %")


def unseen_notes(result: Identification) -> list[str]:
    """Return sentences on what leaves no residual, and on what the data do not tell apart."""
    return list(invisible_inputs(result.systematic))


def printed_sensitivities(result: Identification, symbol: dict[str, str]) -> dict[str, str]:
    """Return rows for a terminal: "per 1 % of specimen_length" -> "m +1.8 % (taken as exact)".

    ``result``: the identification. ``symbol``: symbol of each free parameter.
    """
    answer = {name: e.value for name, e in result.estimates.items()}
    open_ = {part.key for part in taken_as_exact(result.systematic)}
    rows = {}
    for part in result.systematic:
        if not part.moves:
            continue
        shares = relative_moves(part, answer)
        told = ", ".join(f"{symbol[name]} {100.0 * share:+.2g} %" for name, share in shares.items())
        notes = ["leaves no residual"] if part.visible < INVISIBLE else []
        notes += ["taken as exact"] if part.key in open_ else []
        rows[f"per {amount_text(part)} of {part.key}"] = f"{told} ({', '.join(notes)})" if notes else told
    return rows
