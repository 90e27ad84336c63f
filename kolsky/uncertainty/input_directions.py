"""Directions of the inputs: the change of "prediction minus data" when an input is moved by a step.

Every direction, and the Jacobian by the free parameters beside them, is from runs on one mesh, the
surrogate's: a map from another would not cancel what rings in the mesh. Parameters and curves share one
batch; what changes the mesh or its mass, and friction that is not named, has a batch of its own.

An input that is wrong moves the optimum by the part of its direction that the free parameters can follow,
and leaves the rest in the residual:

    shift = -G c,    rest = c + J shift,    visible share = |rest / sigma|^2 / |c / sigma|^2

with the direction c, the Jacobian J and the least-squares map G (`Objective.gain`). A share near zero is an
input that the data cannot show to be wrong.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.shot.records import Shot
from kolsky.uncertainty.inputs import INPUTS, no_part
from kolsky.uncertainty.moved_inputs import MovedInputs, outline_follows
from kolsky.uncertainty.moved_runs import SPECIMEN, MovedRuns, RunLost


@dataclass(frozen=True)
class InputDirection:
    """One input, and what a step of it does to the data vector."""

    key: str
    """Its key of `kolsky.uncertainty.inputs.INPUTS`."""
    step: float
    """By how much it is larger, in its unit, or relative."""
    change: FloatArray
    """Change of prediction minus data by the step, shape [k]; zero at an outline point that the moved model
    does not reach."""
    value: float
    """Its declared value in SI; NaN where it is a scale or an offset that no number stands for."""

    @property
    def slope(self) -> FloatArray:
        """Change of prediction minus data for one unit of it, shape [k]."""
        return self.change / self.step


@dataclass(frozen=True)
class InputDirections:
    """The directions of all inputs at an optimum, beside the Jacobian by the free parameters."""

    names: tuple[str, ...]
    """Free parameters, length d."""
    x: FloatArray
    """The optimum in SI, shape [d]."""
    objective: Objective
    """With the discrepancies of the optimum."""
    vector: FloatArray
    """Predicted data vector there on the surrogate's mesh, shape [k]."""
    jacobian: FloatArray
    """Its derivative by the free parameters, shape [k, d]."""
    directions: tuple[InputDirection, ...]
    """One an input that has a part in the answer."""
    absent: Mapping[str, str] = field(default_factory=dict)
    """Key -> why an input has none: it is free, has no part here, or its run did not complete."""

    def __getitem__(self, key: str) -> InputDirection:
        """The direction of an input.

        Raises
        ------
        KeyError
            If it has none; the message says why.
        """
        for one in self.directions:
            if one.key == key:
                return one
        raise KeyError(f"{key}: {self.absent.get(key, 'no such input')}")

    @property
    def keys(self) -> tuple[str, ...]:
        """Inputs that have a direction."""
        return tuple(one.key for one in self.directions)

    @cached_property
    def gain(self) -> FloatArray:
        """Linear map from a change of the prediction to minus that of the optimum, shape [d, k]."""
        return self.objective.gain(self.jacobian)

    def shift(self, key: str) -> FloatArray:
        """Change of the optimum by the input's step, in SI, shape [d]."""
        # The optimum follows what the prediction is short of.
        return np.asarray(-self.gain @ self[key].change)

    def rest(self, key: str) -> FloatArray:
        """What the step leaves in the residual once the free parameters have followed, shape [k]."""
        return np.asarray(self[key].change + self.jacobian @ self.shift(key))

    def visible(self, key: str) -> float:
        """Share of the direction that stays in the residual, 0 to 1, in weighted squares [-]."""
        whitened = self.objective.whitened
        whole = float(np.sum(whitened(self[key].change) ** 2))
        return float(np.sum(whitened(self.rest(key)) ** 2)) / whole if whole > 0.0 else 0.0

    def likeness(self, one: str, other: str) -> float:
        """Cosine between what two inputs leave in the residual, -1 to 1; near +-1 none tells them apart.

        Zero where one of them leaves nothing.
        """
        a, b = self.objective.whitened(self.rest(one)), self.objective.whitened(self.rest(other))
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        return float(a @ b) / size if size > 0.0 else 0.0


def input_directions(
    stages: StagedRuns,
    x: FloatArray,
    objective: Objective,
    *,
    steps: Mapping[str, float] | None = None,
    only: Collection[str] | None = None,
) -> InputDirections:
    """Move every input that has a part in the answer, and return what that does to the data vector.

    Parameters
    ----------
    stages
        The identification's simulations.
    x
        The optimum in SI, shape [d].
    objective
        With the discrepancies of the optimum.
    steps
        Key -> step, in place of the input's own; a declared uncertainty, for one.
    only
        Inputs to be moved; all of them if left out.

    Raises
    ------
    ValueError
        If the run at the optimum, or one for the Jacobian, does not complete.
    """
    shot, box, held = stages.prepared.forward.shot, stages.box, stages.settings.held
    absent = {
        key: why
        for key in INPUTS
        if (why := no_part(key, free=box.names, held=held, shot=shot, seen=stages.observations))
    }
    wanted = {
        key: (steps or {}).get(key, one.step(shot, objective))
        for key, one in INPUTS.items()
        if key not in absent and (only is None or key in only)
    }
    stages.progress("inputs", 0, len(wanted))
    batch = MovedRuns(stages, x, objective, wanted)
    reference, jacobian = batch.reference_and_jacobian()
    moved = MovedInputs(objective, stages.observations, reference)
    found = []
    for done, (key, step) in enumerate(wanted.items()):
        if INPUTS[key].acts_on == "data" or key == "flyer_clock":
            change = moved.change(key, step)
        else:
            try:
                change = batch.change(key, step)
            except RunLost as lost:
                absent[key] = str(lost)
                continue
            if key == "specimen_diameter" and shot.axis_by_radius:
                change = outline_follows(change, step, shot.specimen.diameter, objective.n_force)
            if key == "specimen_length":
                change = change + moved.heights_with_length(shot, step)
        found.append(InputDirection(key, step, np.nan_to_num(change), declared_value(key, shot, held)))
        stages.progress("inputs", done + 1, len(wanted))
    stages.progress("inputs", len(wanted), len(wanted))
    vector = objective.vectors(predict(reference, objective.observations))[0]
    return InputDirections(box.names, x, objective, vector, jacobian, tuple(found), absent)


def declared_value(key: str, shot: Shot, held: Mapping[str, float]) -> float:
    """The value in SI that a shot declares for an input, or that it is held at; NaN if no number does."""
    if key in PARAMETERS:
        return held.get(key, PARAMETERS[key].held(shot))
    if key in SPECIMEN:
        return float(getattr(shot.specimen, SPECIMEN[key]))
    return float("nan")


def declared_changes(directions: InputDirections, uncertainty: Mapping[str, float]) -> FloatArray:
    """Changes by the declared standard uncertainties in quadrature, shape [n, k]."""
    keys = [key for key, sigma in uncertainty.items() if sigma > 0.0 and key in directions.keys]
    return in_quadrature([uncertainty[key] * directions[key].slope for key in keys])


def in_quadrature(rows: list[FloatArray]) -> FloatArray:
    """Changes as rows whose mean square is the sum of their squares, shape [n, k]."""
    return np.asarray(np.sqrt(len(rows)) * np.array(rows))
