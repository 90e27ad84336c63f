"""Shifts of the answer by declared uncertainties of inputs, which no residual shows to be wrong.

Each declared input is moved by its standard uncertainty, up and down where both are possible, and the
change of the predicted data vector, or of the measured one, is carried to the parameters by the linear map
of the least-squares problem. Changes and map are from runs on one mesh, the surrogate's: a map from
another would not cancel what rings in the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Forward, material_law
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS, has_effect
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.uncertainty_results import Declaration
from kolsky.shot.records import ForceChannel, Shot
from kolsky.shot.schema.uncertainty import IDENTIFIED

STEP = 0.02
"""Half the distance of the central differences by the parameters, over the edges of the whole design."""
UNDECLARED = "not declared, counted as exact"
VARIED = "varied"
UNITS = {"clock_offset": "s", "Z_offset": "m", "y_offset": "m"}
"""Units of the keys that are no parameters, and no shares or plain numbers."""
SPECIMEN = {"specimen_diameter": "diameter", "specimen_length": "length", "specimen_density": "density"}
"""Keys that change the mesh or its mass."""


@dataclass(frozen=True)
class DeclaredInput:
    """An input of declared uncertainty, and the change of the data vector when it is moved."""

    key: str
    """Its key of [uncertainty]."""
    sigma: float
    """Declared standard uncertainty, in SI or relative."""
    stages: StagedRuns
    """The identification's simulations."""
    x: FloatArray
    """The optimum in SI, shape [d]."""
    objective: Objective
    """With the discrepancies of the optimum."""
    reference: Response
    """The run at the optimum."""

    @property
    def shot(self) -> Shot:
        """The shot."""
        return self.stages.prepared.forward.shot

    def run(self, forward: Forward, **named: float) -> Response:
        """One run at the point."""
        settings, names = self.stages.settings, self.stages.box.names
        points = {**settings.held, **dict(zip(names, self.x, strict=True)), **named}
        return forward.run(points, settings.numerics)

    def vector(self, response: Response) -> FloatArray:
        """The predicted data vector, shape [k].

        Raises
        ------
        ValueError
            If the run did not complete.
        """
        if not response.outcomes[0].ok:
            raise ValueError(f"the run with a changed {self.key} ended {response.describe(0)}")
        return np.asarray(self.objective.vectors(predict(response, self.objective.observations))[0])

    def moved(self, sign: float) -> FloatArray | None:
        """The predicted data vector with the input moved by sign x sigma; None where it cannot be."""
        key, step, forward = self.key, sign * self.sigma, self.stages.prepared.forward
        if key in PARAMETERS:
            p, held = PARAMETERS[key], self.stages.settings.held
            value = held.get(key, p.held(self.shot)) + step
            if not p.allowed[0] <= value <= p.allowed[1]:
                return None
            if p.changed is not None and key not in held:
                # Named, it would change more than its value.
                return self.vector(self.run(replace(forward, shot=p.changed(self.shot, value))))
            return self.vector(self.run(forward, **{key: value}))
        if key == "curve_scale":
            curve = self.shot.curve
            law = material_law(replace(curve, stress=curve.stress * (1.0 + step)))
            return self.vector(self.run(replace(forward, laws=(law,))))
        specimen, name = self.shot.specimen, SPECIMEN[key]
        changed = replace(
            self.shot, specimen=replace(specimen, **{name: getattr(specimen, name) * (1.0 + step)})
        )
        return self.vector(self.run(replace(forward, shot=changed)))

    def change(self) -> FloatArray:
        """Change of prediction minus data when the input is larger by sigma, shape [k]."""
        objective, n, observations = self.objective, self.objective.n_force, self.stages.observations
        measured = np.zeros(len(objective.data))
        match self.key:
            case "sensitivity":
                measured[:n] = -self.sigma * objective.data[:n]
            case "clock_offset":
                # A force that comes later by sigma, through the model's, which has no noise.
                edges = observations.bins.edges
                force = np.interp(edges, self.reference.force_times, self.reference.force_transmission[0])
                measured[:n] = -self.sigma * np.diff(force) / np.diff(edges)
            case "Z_offset":
                measured[n:] = self.sigma
            case "y_offset":
                line = observations.centre_line
                higher, lower = (
                    replace(observations, centre_line=replace(line, y=line.y + sign * self.sigma))
                    for sign in (1.0, -1.0)
                )
                up, down = (objective.vectors(predict(self.reference, o))[0] for o in (higher, lower))
                return np.nan_to_num(0.5 * (up - down))
            case _:
                up, down = self.moved(1.0), self.moved(-1.0)
                centre = self.vector(self.reference)
                if up is not None and down is not None:
                    return np.nan_to_num(0.5 * (up - down))
                if up is not None:
                    return np.nan_to_num(up - centre)
                assert down is not None  # a range is wider than one sigma on one side at least
                return np.nan_to_num(centre - down)
        return -measured


def declarations(stages: StagedRuns, x: FloatArray, objective: Objective) -> tuple[Declaration, ...]:
    """Every key that shot.toml may declare uncertain, and by how much it moves the optimum.

    Parameters
    ----------
    stages
        The identification's simulations.
    x
        The optimum in SI, shape [d].
    objective
        With the discrepancies of the optimum.

    Raises
    ------
    ValueError
        If a run with a changed input, or one for the map, does not complete.
    """
    shot = stages.prepared.forward.shot
    declared = {key: sigma for key, sigma in shot.uncertainty.items() if sigma > 0.0}
    told = {key: _told(key, stages, shot) for key in IDENTIFIED}
    varied = [key for key in declared if not told[key]]
    shifts: dict[str, Mapping[str, float]] = {}
    if varied:
        reference, slope = _reference(stages, x, objective)
        gain = objective.gain(slope)
        for done, key in enumerate(varied):
            stages.progress("systematic", done, len(varied))
            change = DeclaredInput(key, declared[key], stages, x, objective, reference).change()
            # The optimum follows what the prediction is short of.
            shifts[key] = dict(zip(stages.box.names, (-gain @ change).tolist(), strict=True))
        stages.progress("systematic", len(varied), len(varied))
    return tuple(
        Declaration(
            key=key,
            sigma=shot.uncertainty.get(key, float("nan")),
            unit=PARAMETERS[key].unit if key in PARAMETERS else UNITS.get(key, "1"),
            shifts=shifts.get(key, {}),
            status=_status(key, shot.uncertainty, told[key]),
        )
        for key in IDENTIFIED
    )


def _reference(stages: StagedRuns, x: FloatArray, objective: Objective) -> tuple[Response, FloatArray]:
    """The run at the optimum, and the Jacobian of the data vector, shape [k, d]."""
    box, settings = stages.box, stages.settings
    lower, upper = np.array(box.lower), np.array(box.upper)
    step = STEP * (upper - lower) * np.eye(box.dimension)
    up, down = np.minimum(x + step, upper), np.maximum(x - step, lower)
    points = np.concatenate([x[None], up, down])
    response = stages.prepared.forward.run(
        {**settings.held, **{name: points[:, i] for i, name in enumerate(box.names)}},
        settings.numerics,
    )
    lost = np.flatnonzero(~response.completed)
    if len(lost):
        raise ValueError(f"a run beside the optimum ended {response.describe(int(lost[0]))}")
    vectors = objective.vectors(predict(response, objective.observations))[1:]
    change = (vectors[: box.dimension] - vectors[box.dimension :]) / (up - down).sum(axis=1)[:, None]
    return response.select([0]), np.nan_to_num(change).T


def _status(key: str, uncertainty: Mapping[str, float], told: str) -> str:
    if told:
        return told
    if key not in uncertainty:
        return UNDECLARED
    return VARIED if uncertainty[key] > 0.0 else "declared exact"


def _told(key: str, stages: StagedRuns, shot: Shot) -> str:
    """The reason why an input has no part, or none of its own, in this shot's answer; empty if it has."""
    if key in stages.box.names:
        return "free, found from the data"
    laws = {shot.interface.faces, shot.interface.side}
    p = PARAMETERS.get(key)
    if p is not None and key not in stages.settings.held and not has_effect(p, laws):
        return f"no part: {p.without}"
    if key in ("sensitivity", "clock_offset") and not isinstance(shot.force, ForceChannel):
        return "no part: the force is from the bar's waves"
    if key in ("Z_offset", "y_offset") and not stages.observations.has_shape:
        return "no part: no outline was measured"
    return ""
