"""The report's table of what each input does to the answer, and what of that the data can show."""

from __future__ import annotations

from math import isfinite
from typing import Any

from kolsky.inverse.result import Identification
from kolsky.inverse.uncertainty_results import Declaration
from kolsky.report import numbers
from kolsky.report.typography import typeset
from kolsky.uncertainty.inputs import INPUTS
from kolsky.uncertainty.sensitivities import INVISIBLE, amount_text, relative_moves, taken_as_exact, unseen


def sensitivity_rows(result: Identification) -> list[dict[str, Any]]:
    """Return one row for each input that moves the answer: amount, effect, what shows, how declared."""
    answer = {name: e.value for name, e in result.estimates.items()}
    open_ = {part.key for part in taken_as_exact(result.systematic)}
    return [_row(part, answer, open_) for part in result.systematic if part.moves]


def _row(part: Declaration, answer: dict[str, float], open_: set[str]) -> dict[str, Any]:
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
    return list(unseen(result.systematic))


def printed_sensitivities(result: Identification, symbol: dict[str, str]) -> dict[str, str]:
    """Return rows for a terminal: "per 1 % of specimen_length" -> "m +1.8 % (taken as exact)".

    Parameters
    ----------
    result
        The identification.
    symbol
        Symbol of each free parameter.
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
