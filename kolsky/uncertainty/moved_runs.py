"""Runs of the shot with its inputs moved one by one, all on the surrogate's mesh.

Parameters and curves share one batch; what changes the mesh or its mass, and friction that is not named,
has a batch of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from explicit import Response
from explicit.materials import MaterialLaw
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import Forward, material_law
from kolsky.inverse.launches import Launch, run_side_by_side
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.shot.records import Shot
from kolsky.uncertainty.inputs import CLOCK, parameter_step

SPECIMEN = {"specimen_diameter": "diameter", "specimen_length": "length", "specimen_density": "density"}
"""Inputs that change the mesh or its mass, and their field of the specimen."""


class RunLost(ValueError):
    """A run with a moved input did not complete."""


@dataclass(frozen=True)
class MovedRuns:
    """Runs with moved parameters, curves and specimens, all on the surrogate's mesh."""

    stages: StagedRuns
    """The identification's simulations."""
    x: FloatArray
    """The optimum in SI, shape [d]."""
    objective: Objective
    """The objective."""
    steps: Mapping[str, float]
    """Key -> step of each input to be moved."""

    @property
    def mesh_point(self) -> FloatArray:
        """Where the surrogate's mesh answers like the refined one at the optimum, shape [d]."""
        return np.asarray(self.stages.solver_values(self.x[None], self.stages.settings.numerics.mesh)[0])

    @property
    def forward(self) -> Forward:
        """The shot ready to run, its surface kept beside the frames too."""
        forward = self.stages.prepared.forward
        frames = self.stages.observations.frame_times
        if not frames.size:
            return forward
        first, last = forward.sampling.surface_times[[0, -1]]
        close = np.concatenate([frames - CLOCK, frames, frames + CLOCK])
        close = close[(close >= first) & (close <= last)]
        return replace(forward, sampling=replace(forward.sampling, surface_times=np.unique(close)))

    @property
    def point(self) -> dict[str, float]:
        """The optimum and what is held, by name."""
        found = dict(zip(self.stages.box.names, self.mesh_point.tolist(), strict=True))
        return {**self.stages.settings.held, **found}

    @property
    def named(self) -> tuple[str, ...]:
        """Inputs that join the common batch: parameters that change nothing but their value when named."""
        held = self.stages.settings.held
        return tuple(
            key
            for key in self.steps
            if key in PARAMETERS and (PARAMETERS[key].changed is None or key in held)
        )

    @cached_property
    def rows(self) -> dict[tuple[str, int], int]:
        """Row of the common batch by name and sign; ("", 0) is the optimum."""
        keys = [("", 0)] + [(name, sign) for name in self.stages.box.names for sign in (1, -1)]
        for key in self.named:
            value = self.value(key)
            low, high = PARAMETERS[key].allowed
            keys += [(key, sign) for sign in (1, -1) if low <= value + sign * self.steps[key] <= high]
        keys += [("curve_scale", sign) for sign in (1, -1) if "curve_scale" in self.steps]
        return {key: row for row, key in enumerate(keys)}

    def value(self, key: str) -> float:
        """The value of a parameter that is not free."""
        return self.stages.settings.held.get(key, PARAMETERS[key].held(self.forward.shot))

    @property
    def common(self) -> Response:
        """The common batch."""
        return self._responses[""]

    @cached_property
    def _responses(self) -> dict[str, Response]:
        """The common batch, and each changed shot's by key and sign: all of them side by side."""
        keys, numerics = {"": self._common}, self.stages.settings.numerics
        for key, step in self.steps.items():
            if self._is_alone(key):
                for sign in (1, -1):
                    changed = self._changed(key, sign * step)
                    if changed is not None:
                        forward = replace(self.forward, shot=changed)
                        keys[f"{key}{sign:+d}"] = Launch(forward, self.point, numerics)
        return dict(zip(keys, run_side_by_side(list(keys.values())), strict=True))

    @property
    def _common(self) -> Launch:
        point = {**self.point, **{key: self.value(key) for key in self.named}}
        columns = {name: np.full(len(self.rows), value) for name, value in point.items()}
        material = np.zeros(len(self.rows), dtype=np.int64)
        forward, low, high = self.forward, *self._design
        for (key, sign), row in self.rows.items():
            if key == "curve_scale":
                material[row] = 1 if sign > 0 else 2
            elif key in self.stages.box.names:
                i = self.stages.box.names.index(key)
                columns[key][row] = (high if sign > 0 else low)[i]
            elif key:
                columns[key][row] += sign * self.steps[key]
        if "curve_scale" in self.steps:
            curve, step = forward.shot.curve, self.steps["curve_scale"]
            forward = replace(
                forward, laws=(forward.laws[0], *(scaled_law(curve, 1.0 + s * step) for s in (1.0, -1.0)))
            )
        return Launch(forward, columns, self.stages.settings.numerics, material=material)

    @property
    def _design(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends of the central differences by the free parameters, shape [d] each."""
        lower, upper = np.array(self.stages.box.lower), np.array(self.stages.box.upper)
        x = self.mesh_point
        values = zip(self.stages.box.names, x.tolist(), strict=True)
        step = np.array([parameter_step(name, value) for name, value in values])
        return np.maximum(x - step, lower), np.minimum(x + step, upper)

    def reference_and_jacobian(self) -> tuple[Response, FloatArray]:
        """The run at the optimum, and the Jacobian of the data vector, shape [k, d]."""
        down, up = self._design
        try:
            slopes = [
                (self._vector((name, 1)) - self._vector((name, -1))) / (up - down)[i]
                for i, name in enumerate(self.stages.box.names)
            ]
            self._vector(("", 0))
        except RunLost as lost:
            raise ValueError(f"beside the optimum, {lost}") from None
        return self.common.select([0]), np.nan_to_num(np.array(slopes)).T

    def change(self, key: str, step: float) -> FloatArray:
        """Change of the predicted data vector, up and down where both are possible, shape [k].

        Raises
        ------
        RunLost
            If a run with the moved input did not complete.
        """
        up, down = self.moved(key, 1, step), self.moved(key, -1, step)
        if up is not None and down is not None:
            return np.asarray(0.5 * (up - down))
        centre = self.moved("", 0, 0.0)
        assert centre is not None
        if up is not None:
            return np.asarray(up - centre)
        assert down is not None  # a range is wider than one step on one side at least
        return np.asarray(centre - down)

    def moved(self, key: str, sign: int, step: float) -> FloatArray | None:
        """The predicted data vector with an input moved up or down; None where it cannot be."""
        if self._is_alone(key):
            if step != self.steps[key]:
                raise ValueError(f"{key} was moved by {self.steps[key]:.6g}, not by {step:.6g}")
            response = self._responses.get(f"{key}{sign:+d}")
            return None if response is None else self._seen(response, 0, key)
        return self._vector((key, sign)) if (key, sign) in self.rows else None

    def _is_alone(self, key: str) -> bool:
        """Whether an input needs a model of its own."""
        return key in SPECIMEN or (key in PARAMETERS and key not in self.named)

    def _changed(self, key: str, step: float) -> Shot | None:
        """The shot with an input moved by a step; None where the value is not allowed."""
        shot = self.forward.shot
        if key in SPECIMEN:
            name = SPECIMEN[key]
            value = getattr(shot.specimen, name) * (1.0 + step)
            return replace(shot, specimen=replace(shot.specimen, **{name: value}))
        p, value = PARAMETERS[key], self.value(key) + step
        if not p.allowed[0] <= value <= p.allowed[1]:
            return None
        assert p.changed is not None  # else it joins the common batch
        return p.changed(shot, value)

    def _vector(self, key: tuple[str, int]) -> FloatArray:
        return self._seen(self.common, self.rows[key], key[0])

    def _seen(self, response: Response, row: int, key: str) -> FloatArray:
        if not response.outcomes[row].ok:
            raise RunLost(f"the run with a changed {key or 'nothing'} ended {response.describe(row)}")
        prediction = predict(response.select([row]), self.objective.observations)
        return np.asarray(self.objective.vectors(prediction)[0])


def scaled_law(curve: MaterialCurve, factor: float) -> MaterialLaw:
    """The law of a curve whose stresses are all multiplied."""
    if curve.law is not None:
        return curve.law.scaled(factor)
    return material_law(replace(curve, stress=factor * curve.stress))
