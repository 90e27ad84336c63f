"""Table of the report's section "What is wrong?": inputs that, changed, explain the misfit."""

from typing import Any

from kolsky.diagnosis.cause_inputs import CANDIDATES, WITHOUT_TRACE
from kolsky.diagnosis.cause_words import SHOWN
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.result import Identification
from kolsky.report import numbers
from kolsky.report.nomenclature import name_of

FURTHER = 5
"""Inputs that are listed though they are no likely cause."""


def cause_table(result: Identification) -> dict[str, Any]:
    """Rows of the likely causes and of the next ones, and what no table can show.

    Parameters
    ----------
    result
        In SI: a cause has units of its own.
    """
    named = [c for c in result.causes if c.named]
    others = [c for c in result.causes if not c.named and c.value == c.value]
    return {
        "tried": len(result.causes),
        "named": [_row(result, c) for c in named],
        "others": [_row(result, c) for c in others[:FURTHER]],
        "solved": any(c.solved for c in named),
        "invisible": WITHOUT_TRACE,
    }


def _row(result: Identification, cause: CauseFinding) -> dict[str, Any]:
    factor, unit = SHOWN.get(cause.unit, (1.0, "" if cause.unit == "1" else cause.unit))
    unit = unit.replace("u", "µ", 1) if unit in ("us", "um") else unit
    value, half = numbers.measured(factor * cause.value, 2.0 * factor * cause.sigma)
    declared = numbers.plain(factor * cause.exact, 6) if cause.exact == cause.exact else numbers.NOTHING
    check = next((c.check for c in CANDIDATES if c.key == cause.key), cause.key)
    words = cause.words + (f", beside {cause.beside}" if cause.beside else "")
    return {
        "words": words,
        "value": f"{value} ± {half} {unit}".rstrip(),
        "declared": f"{declared} {unit}".rstrip(),
        "explained": numbers.percent(cause.explained),
        "probability": "< 0.0001" if cause.probability < 1e-4 else numbers.plain(cause.probability, 2),
        "answers": [_answer(name, cause.parameters.get(name)) for name in result.estimates],
        "solved": [
            _answer(name, cause.solved.get(name), cause.solved_sigmas.get(name)) for name in result.estimates
        ],
        "check": check,
        "within": cause.within,
        "alike": ", ".join(cause.alike),
    }


def _answer(name: str, value: float | None, sigma: float | None = None) -> str:
    if value is None:
        return numbers.NOTHING
    factor = name_of(name).factor
    if sigma is None:
        return numbers.plain(factor * value, 5)
    best, half = numbers.measured(factor * value, 2.0 * factor * sigma)
    return f"{best} ± {half}"
