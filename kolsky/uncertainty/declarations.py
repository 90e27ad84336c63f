"""Declared uncertainties carried to the answer, and its sensitivity to every input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

from kolsky.base.arrays import FloatArray
from kolsky.inverse.result import Declaration
from kolsky.inverse.runner import Runner
from kolsky.schema.apparatus import IDENTIFY_KEYS
from kolsky.shot.input_records import SHOWN
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.input_changes import InputDirections, input_directions, no_part, plain_amount

UNDECLARED = "not declared, counted as exact"
VARIED = "varied"
ALIKE = 0.95
"""Cosine between what two inputs leave in the residual, from which on the data do not tell them apart [-]."""


def declarations(runner: Runner, directions: InputDirections) -> tuple[Declaration, ...]:
    """Every key that shot.toml may declare uncertain, and by how much it moves the optimum.

    Parameters
    ----------
    runner
        Runs points of the identification's problem.
    directions
        What every input does, at the optimum.

    Raises
    ------
    ValueError
        If a run with an input moved by its declared uncertainty does not complete.
    """
    shot, box = runner.problem.shot, runner.problem.box
    told = {
        key: no_part(
            key,
            free=box.names,
            held=runner.problem.settings.held,
            shot=shot,
            seen=runner.problem.observations,
        )
        for key in IDENTIFY_KEYS
    }
    declared = {key: sigma for key, sigma in shot.uncertainty.items() if sigma > 0.0 and not told.get(key)}
    shifts: dict[str, Mapping[str, float]] = {}
    if declared:
        moved = input_directions(
            runner, directions.x, directions.objective, steps=declared, only=tuple(declared)
        )
        lost = [why for key, why in moved.absent.items() if key in declared]
        if lost:
            raise ValueError(f"{lost[0]}; a declared uncertainty cannot be left out: declare a smaller one")
        shifts = {key: _by_name(moved.names, moved.shift(key)) for key in declared}
    return tuple(
        Declaration(
            key=key,
            sigma=shot.uncertainty.get(key, float("nan")),
            unit=INPUTS[key].unit,
            shifts=shifts.get(key, {}),
            status=_status(key, shot.uncertainty, told[key] or directions.absent.get(key, "")),
            **_sensitivity(directions, key),
        )
        for key in IDENTIFY_KEYS
    )


def _sensitivity(directions: InputDirections, key: str) -> dict[str, Any]:
    """The fields of a `Declaration` that need no declared uncertainty; none where it has no direction."""
    if key not in directions.keys:
        return {}
    one = directions[key]
    amount = plain_amount(key, one.value)
    others = [other for other in IDENTIFY_KEYS if other != key and other in directions.keys]
    return {
        "amount": amount,
        "moves": _by_name(directions.names, amount / one.step * directions.shift(key)),
        "visible": directions.visible(key),
        "alike": tuple(other for other in others if abs(directions.likeness(key, other)) > ALIKE),
    }


def _status(key: str, uncertainty: Mapping[str, float], told: str) -> str:
    if told:
        return told
    if key not in uncertainty:
        return UNDECLARED
    return VARIED if uncertainty[key] > 0.0 else "declared exact"


def _by_name(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


INVISIBLE = 1e-3
"""Share of an input's change that stays in the residual, below which the data do not show it [-]."""


def amount_text(part: Declaration) -> str:
    """The plain amount of an input as text: "1 %", "1 us", "10 um", "1e-05"."""
    if INPUTS[part.key].relative:
        return f"{100.0 * part.amount:g} %"
    factor, unit = SHOWN.get(part.unit, (1.0, ""))
    return f"{factor * part.amount:g} {unit}".rstrip()


def relative_moves(part: Declaration, answer: Mapping[str, float]) -> dict[str, float]:
    """By what share each free parameter moves if the input is larger by its plain amount [-].

    ``part``: the input. ``answer``: parameter -> value, in the unit of `part.moves`; one that is zero has no
    share.
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
    beside = len(open_) - 1
    others = "" if not beside else ", and so is one more" if beside == 1 else f", and so are {beside} more"
    yield (
        f"{one.words} ({one.place}) is taken as exact{others}: {amount_text(worst)} of it would move {name} "
        f"by {100.0 * shares[worst.key]:+.2g} %; declare {worst.key} in [uncertainty]"
    )


def invisible_inputs(parts: Sequence[Declaration]) -> Iterator[str]:
    """Say which inputs leave no residual, and which the data do not tell apart."""
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
                    "stress and density scaled alike leave the motion and scale the force: a wrong "
                    "specimen_density is a force gain, distinguished from a wrong sensitivity only by a "
                    "declared uncertainty"
                )
            else:
                yield (
                    f"{INPUTS[part.key].words} and {INPUTS[other].words} leave the same residual: the data "
                    "do not show which of them is wrong"
                )
