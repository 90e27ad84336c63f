"""The sensitivities of an answer to its inputs, in words: amounts, cautions, what the data cannot see."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

from kolsky.inverse.uncertainty_results import Declaration
from kolsky.uncertainty.inputs import INPUTS
from kolsky.uncertainty.systematic import UNDECLARED

INVISIBLE = 1e-3
"""Share of an input's change that stays in the residual, below which the data do not show it [-]."""
SHOWN = {"s": (1e6, "us"), "m": (1e6, "um")}
"""Factor and unit in which an amount is written."""


def amount_text(part: Declaration) -> str:
    """The plain amount of an input as text: "1 %", "1 us", "10 um", "1e-05"."""
    if INPUTS[part.key].relative:
        return f"{100.0 * part.amount:g} %"
    factor, unit = SHOWN.get(part.unit, (1.0, ""))
    return f"{factor * part.amount:g} {unit}".rstrip()


def relative_moves(part: Declaration, answer: Mapping[str, float]) -> dict[str, float]:
    """By what share each free parameter moves if the input is larger by its plain amount [-].

    Parameters
    ----------
    part
        The input.
    answer
        Parameter -> value, in the unit of `part.moves`; one that is zero has no share.
    """
    return {name: move / answer[name] for name, move in part.moves.items() if answer.get(name)}


def elasticity(part: Declaration, answer: Mapping[str, float]) -> dict[str, float]:
    """The logarithmic derivative of each free parameter by an input that is a scale; empty for others."""
    if not INPUTS[part.key].relative:
        return {}
    return {name: share / part.amount for name, share in relative_moves(part, answer).items()}


def taken_as_exact(parts: Sequence[Declaration]) -> list[Declaration]:
    """Inputs that move the answer and were not declared uncertain."""
    return [part for part in parts if part.status == UNDECLARED and part.moves]


def caution(parts: Sequence[Declaration], answer: Mapping[str, float]) -> Iterator[str]:
    """Say what a plain amount of the input that moves the first free parameter most would do."""
    open_ = taken_as_exact(parts)
    name = next(iter(answer), "")
    shares = {part.key: relative_moves(part, answer).get(name, 0.0) for part in open_}
    if not shares:
        return
    worst = max(open_, key=lambda part: abs(shares[part.key]))
    one = INPUTS[worst.key]
    others = f", and so are {len(open_) - 1} other inputs" if len(open_) > 1 else ""
    yield (
        f"{one.words} ({one.place}) is taken as exact{others}: {amount_text(worst)} of it would move {name} "
        f"by {100.0 * shares[worst.key]:+.2g} %; declare {worst.key} in [uncertainty]"
    )


def unseen(parts: Sequence[Declaration]) -> Iterator[str]:
    """Say which inputs leave no residual, and which the data do not tell apart."""
    for part in parts:
        if isfinite(part.visible) and part.visible < INVISIBLE:
            words = INPUTS[part.key].words
            reason = "m times the curve is all that is seen" if part.key == "curve_scale" else "m follows it"
            yield (
                f"{words} is invisible to the data: {reason}, and an error of it leaves no residual; only a "
                f"declared uncertainty ({part.key}) covers it"
            )
    known = {part.key: part for part in parts}
    for part in parts:
        for other in part.alike:
            if other not in known or list(known).index(other) < list(known).index(part.key):
                continue
            pair = {part.key, other}
            if pair == {"specimen_density", "sensitivity"}:
                yield (
                    "stress and density scaled alike leave the motion and scale the force: a wrong "
                    "specimen_density is a force gain, told from a wrong sensitivity only by a declared "
                    "uncertainty"
                )
            else:
                yield (
                    f"{INPUTS[part.key].words} and {INPUTS[other].words} leave the same residual: the data "
                    "do not tell which of them is wrong"
                )
