"""What the inputs do to the answer: by their declared uncertainties, and by a plain amount where undeclared.

Each declared input is moved by its standard uncertainty, up and down where both are possible, and the
change of the predicted data vector, or of the measured one, is carried to the parameters by the linear map
of the least-squares problem (`kolsky.uncertainty.input_directions`). Every input, declared or not, has its
sensitivity: what a plain amount of it would do, and how much of that the residuals would show.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kolsky.base.arrays import FloatArray
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.uncertainty_results import Declaration
from kolsky.shot.schema.uncertainty import IDENTIFIED
from kolsky.uncertainty.input_directions import InputDirections, input_directions
from kolsky.uncertainty.inputs import INPUTS, no_part, plain_amount

UNDECLARED = "not declared, counted as exact"
VARIED = "varied"
ALIKE = 0.95
"""Cosine between what two inputs leave in the residual, from which on the data do not tell them apart [-]."""


def declarations(stages: StagedRuns, directions: InputDirections) -> tuple[Declaration, ...]:
    """Every key that shot.toml may declare uncertain, and by how much it moves the optimum.

    Parameters
    ----------
    stages
        The identification's simulations.
    directions
        What every input does, at the optimum.

    Raises
    ------
    ValueError
        If a run with an input moved by its declared uncertainty does not complete.
    """
    shot, box = stages.prepared.forward.shot, stages.box
    told = {
        key: no_part(key, free=box.names, held=stages.settings.held, shot=shot, seen=stages.observations)
        for key in IDENTIFIED
    }
    declared = {key: sigma for key, sigma in shot.uncertainty.items() if sigma > 0.0 and not told.get(key)}
    shifts: dict[str, Mapping[str, float]] = {}
    if declared:
        moved = input_directions(
            stages, directions.x, directions.objective, steps=declared, only=tuple(declared)
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
        for key in IDENTIFIED
    )


def _sensitivity(directions: InputDirections, key: str) -> dict[str, Any]:
    """The fields of a `Declaration` that need no declared uncertainty; none where it has no direction."""
    if key not in directions.keys:
        return {}
    one = directions[key]
    amount = plain_amount(key, one.value)
    others = [other for other in IDENTIFIED if other != key and other in directions.keys]
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
