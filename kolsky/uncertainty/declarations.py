"""Declared uncertainties propagated to the answer, and its sensitivity to every input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np

from kolsky.inverse.result import Declaration
from kolsky.schema.apparatus import IDENTIFY_KEYS
from kolsky.shot.input_records import SHOWN
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import Shot
from kolsky.uncertainty.input_changes import InputDirections, plain_amount

UNDECLARED = "not declared, counted as exact"
VARIED = "varied"
ALIKE = 0.95
"""The data cannot distinguish two inputs if the cosine of their residual changes exceeds this value [-]."""


def declarations(shot: Shot, directions: InputDirections) -> tuple[Declaration, ...]:
    """Every key that shot.toml may declare uncertain, and the shift of the optimum due to it."""
    names, found = directions.names, []
    for key in IDENTIFY_KEYS:
        sigma, seen = shot.uncertainty.get(key), key in directions.keys
        shifts = directions.repeated_shift(key, sigma) if sigma and seen else np.empty(0)
        known = UNDECLARED if sigma is None else VARIED if sigma > 0.0 else "declared exact"
        part = Declaration(
            key=key,
            sigma=float("nan") if sigma is None else sigma,
            unit=INPUTS[key].unit,
            shifts=dict(zip(names, shifts.tolist(), strict=False)),
            status=directions.absent.get(key, "") or known,
        )
        if seen:
            amount = plain_amount(key, directions[key].value)
            others = [other for other in IDENTIFY_KEYS if other != key and other in directions.keys]
            moves = dict(zip(names, directions.repeated_shift(key, amount).tolist(), strict=True))
            alike = tuple(other for other in others if abs(directions.likeness(key, other)) > ALIKE)
            part = replace(part, amount=amount, moves=moves, visible=directions.visible(key), alike=alike)
        found.append(part)
    return tuple(found)


INVISIBLE = 1e-3
"""The data do not reveal an error of an input if the visible share of its change is below this [-]."""


def amount_text(part: Declaration) -> str:
    """The reference change of an input as text: "1 %", "1 us", "10 um", "1e-05"."""
    if INPUTS[part.key].relative:
        return f"{100.0 * part.amount:g} %"
    factor, unit = SHOWN.get(part.unit, (1.0, ""))
    return f"{factor * part.amount:g} {unit}".rstrip()


def relative_moves(part: Declaration, answer: Mapping[str, float]) -> dict[str, float]:
    """Relative shift of each free parameter in ``answer`` by the input's reference change [-]."""
    return {name: move / answer[name] for name, move in part.moves.items() if answer.get(name)}


def elasticity(part: Declaration, answer: Mapping[str, float]) -> dict[str, float]:
    """The logarithmic derivative of each free parameter by an input. Empty if the input is no scale."""
    if not INPUTS[part.key].relative:
        return {}
    return {name: share / part.amount for name, share in relative_moves(part, answer).items()}


def taken_as_exact(parts: Sequence[Declaration]) -> list[Declaration]:
    """Inputs that affect the answer and were not declared uncertain."""
    return [part for part in parts if part.status == UNDECLARED and part.moves]


def caution(parts: Sequence[Declaration], answer: Mapping[str, float]) -> Iterator[str]:
    """Warning on the undeclared input with the largest effect on the first free parameter."""
    open_ = taken_as_exact(parts)
    name = next(iter(answer), "")
    shares = {part.key: relative_moves(part, answer).get(name, 0.0) for part in open_}
    if not shares:
        return
    worst = max(open_, key=lambda part: abs(shares[part.key]))
    one = INPUTS[worst.key]
    beside = len(open_) - 1
    others = "" if not beside else ", and so is one more" if beside == 1 else f", and so are {beside} more"
    yield (
        f"{one.words} ({one.place}) counts as exact{others}: {amount_text(worst)} of it would change "
        f"{name} by {100.0 * shares[worst.key]:+.2g} %; declare {worst.key} in [uncertainty]"
    )


def invisible_inputs(parts: Sequence[Declaration]) -> Iterator[str]:
    """Report inputs without a visible residual, and inputs that the data cannot distinguish."""
    for part in parts:
        if isfinite(part.visible) and part.visible < INVISIBLE:
            words = INPUTS[part.key].words
            reason = "the data show only m times the curve" if part.key == "curve_scale" else "m follows it"
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
                    "a common factor on stress and density scales the force and does not change the "
                    "motion: a wrong specimen_density acts as a force gain, and only a declared "
                    "uncertainty distinguishes it from a wrong sensitivity"
                )
            else:
                yield (
                    f"{INPUTS[part.key].words} and {INPUTS[other].words} leave the same residual: the data "
                    "do not show which of them is wrong"
                )
