"""Rows shared by terminal and page of an identification: fit, clocks, held parameters, sensitivities."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from kolsky.diagnosis.fit_quality import LATE
from kolsky.inverse.result import ClockLag, Declaration, FitQuality, Identification
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
        state = "explained" if f.explained else "NOT EXPLAINED"
        said.append(f"{f.channel} {state} ({worst[0]:.2g}{limit})")
    return f"fit: {', '.join(said)}"


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
        rows[f"{f.channel}, over right model"] = _limited(f.excess, f.limit)
        rows[f"{f.channel}, the same, slow"] = _limited(f.slow_excess, f.slow_limit)
        rows[f"{f.channel}, neighbours"] = (
            f"correlation {f.correlation:.2g}, white with p = {f.whiteness:.2g}"
        )
        if f.weight:
            shares = (f"{100.0 * w:.2g} % of {symbols.get(name, name)}" for name, w in f.weight.items())
            rows[f"{f.channel}, information"] = ", ".join(shares)
    for lag in found.clocks:
        rows[f"{lag.recording}, late by"] = f"{1e6 * lag.lag:.2f} ± {2e6 * lag.sigma:.2f} us (k = 2)"
    return rows


def _limited(value: float, limit: float) -> str:
    return f"{value:.3g}" + (f", at most {limit:g}" if limit < float("inf") else ", no limit")


def fit_tables(result: Identification) -> dict[str, Any]:
    """Return what a page shows of fit and clocks."""
    return {
        "symbols": [name_of(name).symbol for name in result.estimates],
        "channels": [_channel(result, f) for f in result.fit],
        "clocks": [_clock(lag) for lag in result.clocks],
    }


def _channel(result: Identification, f: FitQuality) -> dict[str, Any]:
    factor, unit = _CHANNEL_UNITS[f.unit]
    plain = numbers.plain
    return {
        "channel": f.channel,
        "words": f"{f.channel}, {f.values} values",
        "explained": f.explained,
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


def _clock(lag: ClockLag) -> tuple[str, str, str]:
    value, U = numbers.measured(1e6 * lag.lag, 2e6 * lag.sigma)
    state = "not found" if lag.sigma != lag.sigma else "late" if lag.significance > LATE else "on time"
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
