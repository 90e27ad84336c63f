"""Goodness of fit and clocks as rows of a terminal and tables of a page."""

from collections.abc import Mapping
from typing import Any

from kolsky.diagnosis.thresholds import LATE
from kolsky.inverse.fit_results import ClockLag, FitQuality
from kolsky.inverse.result import Identification
from kolsky.report import numbers
from kolsky.report.nomenclature import name_of

UNITS = {"N": (1.0, "N"), "m": (1e6, "µm")}
"""Factor and unit in which a residual is shown."""
NOT_RECORDED = "not recorded"
"""What stands for the goodness of fit of a file that does not hold it."""


def fit_line(found: Identification) -> str:
    """Return the goodness of fit in one line, "fit: force explained (0.79 of at most 2), outline ..."."""
    if not found.fit:
        return f"fit: {NOT_RECORDED}"
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
        return {"goodness of fit": NOT_RECORDED}
    rows = {}
    for f in found.fit:
        factor, unit = UNITS[f.unit]
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
    factor, unit = UNITS[f.unit]
    plain = numbers.plain
    return {
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
