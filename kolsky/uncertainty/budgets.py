"""The uncertainty budget of every route, of their difference, and of several shots.

The noise of flyer motion and material curve comes from replicates, that of the outline from its modes.

For several shots, a material constant has one value for all of them. Specimen dimensions and outline
positions are independent in each shot; their parts add in quadrature. Scale and clock of the force are in the
weights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.estimates import RouteOptimum
from kolsky.inverse.joint_problem import JointProblem, ShotData, information
from kolsky.inverse.joint_runs import JointRuns
from kolsky.inverse.joint_search import Optimum
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Observations
from kolsky.inverse.parameters import MOVED, PARAMETERS, has_effect
from kolsky.inverse.path_noise import replicate_uncertainty
from kolsky.inverse.problem import PreparedShot
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import Contribution, Route, RouteDifference
from kolsky.inverse.run_table import Replicates
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import Shot
from kolsky.uncertainty.input_changes import WEIGHINGS, height_follows, outline_follows, parameter_step
from kolsky.uncertainty.mesh_error import MeshChange, numerical_parts

OUTLINE = "common errors of the outline"
"""Name of the part from errors common to outline points."""


@dataclass(frozen=True)
class InputChanges:
    """Changes of the data vector by the noise of the inputs."""

    replicates: Mapping[str, FloatArray]
    """Source -> data of each replicate minus the reference's, shape [n, k]: "flyer motion", "material curve".
    Sources given as patterns of one standard deviation are scaled by root n (`as_drawn`). They are `OUTLINE`
    and, if the path is a nuisance of the fit, "flyer motion"."""
    scales: Mapping[str, FloatArray]
    """Source -> change by one standard uncertainty of "force scale" or "motion scale", shape [k]."""

    def parts(self, gain: FloatArray) -> dict[str, FloatArray]:
        """Standard uncertainties by source, [d] each; ``gain``: data -> optimum, [d, k]."""
        drawn = {key: replicate_uncertainty(changes @ gain.T) for key, changes in self.replicates.items()}
        return {key: np.abs(gain @ change) for key, change in self.scales.items()} | drawn


def as_drawn(patterns: FloatArray) -> FloatArray:
    """Patterns of one standard deviation, scaled to replicates with the same mean square, shape [n, k]."""
    none = np.zeros((1, patterns.shape[1]))
    return np.asarray(np.sqrt(len(patterns)) * patterns) if len(patterns) else none


def input_changes(objective: Objective, replicates: Replicates | None) -> InputChanges:
    """Changes of the data vector by every known source.

    ``replicates``: runs with other motions and curves, the reference first; None omits their noise. An
    outline point that a replicate does not reach has zero change. Without runs of other motions, the noise
    patterns in the weights are used.
    """
    scales = {}
    if objective.observations.force_sigma_gain > 0.0:
        scales["force scale"] = objective.scale_error
    outline = objective.outline_errors
    known = {OUTLINE: as_drawn(outline)} if len(outline) else {}
    if replicates is None:
        return InputChanges(known, scales)
    vectors = objective.vectors(replicates.prediction)
    change = np.nan_to_num(vectors - vectors[0])
    if replicates.scale.any():
        scales["motion scale"] = change[replicates.scale][0]
    motions = change[replicates.flyer] if replicates.flyer.any() else as_drawn(objective.front_noise)
    drawn = {"flyer motion": motions, "material curve": change[replicates.curve]}
    return InputChanges({**drawn, **known}, scales)


RESIDUALS = "force and shape"
"""Name of the part that comes from the residuals."""
DECLARED = "declared inputs"
"""Name of the part that comes from [uncertainty] of the shot file."""


@dataclass(frozen=True)
class Sources:
    """All error sources of an optimum, as changes of the data vector."""

    inputs: InputChanges
    mesh: MeshChange
    deviations: FloatArray | None = None
    """Deviations of runs from the model of a rough response (`RefinedOptimum.deviations`), shape [n, k]. Each
    route, and the difference of two routes, applies its linear map to them."""
    declared: FloatArray | None = None
    """Changes by the declared uncertainties of shot.toml, shape [n, k]. Their mean square is the sum over the
    keys. For the joint answer they are a separate part, `Estimate.sigma_systematic`."""

    def roughness(self, gain: FloatArray) -> FloatArray | None:
        """Standard deviation of an optimum from the response's roughness, shape [d]; None if it is smooth."""
        if self.deviations is None:
            return None
        return np.asarray(np.sqrt(np.sum((self.deviations @ gain.T) ** 2, axis=0)))

    def parts(self, residual: FloatArray, gain: FloatArray) -> dict[str, FloatArray]:
        """Standard uncertainties by source, [d] each; ``residual``: covariance from the residuals, [d, d]."""
        found = {
            RESIDUALS: np.sqrt(np.diag(residual)),
            **self.inputs.parts(gain),
            **numerical_parts(self.mesh, gain, roughness=self.roughness(gain)),
        }
        if self.declared is not None and len(self.declared):
            found[DECLARED] = replicate_uncertainty(self.declared @ gain.T)
        return found


def noise_parts(fine: RefinedOptimum, sources: Sources) -> dict[str, FloatArray]:
    """Standard uncertainties of the joint answer by source of noise, shape [d] each."""
    objective, vector = fine.objective, fine.model(fine.x)[0]
    residual = objective.residual_covariance(fine.jacobian, vector)
    return {RESIDUALS: np.sqrt(np.diag(residual)), **sources.inputs.parts(objective.gain(fine.jacobian))}


def budgeted(names: Sequence[str], optimum: RouteOptimum, sources: Sources) -> Route:
    """A route with its correction for the mesh and its budget."""
    parts = sources.parts(optimum.residual, optimum.gain)
    correction = sources.mesh.correction(optimum.gain)
    return Route(
        name=optimum.name,
        parameters=_named(names, optimum.x + correction),
        cost=optimum.cost,
        correction=_named(names, correction),
        **_budget(names, parts),
    )


def route_difference(
    names: Sequence[str], optima: Sequence[RouteOptimum], sources: Sources
) -> RouteDifference | None:
    """Force-only minus outline-only result, residuals independent, and its budget; None without both."""
    by_part = {optimum.part: optimum for optimum in optima}
    if not {"force", "shape"} <= set(by_part):
        return None
    force, shape = by_part["force"], by_part["shape"]
    gain = force.gain - shape.gain
    parts = sources.parts(force.residual + shape.residual, gain)
    values = _named(names, force.x - shape.x + sources.mesh.correction(gain))
    return RouteDifference(values=values, **_budget(names, parts))


def _named(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, np.asarray(values).tolist(), strict=True))


def _budget(names: Sequence[str], parts: dict[str, FloatArray]) -> dict[str, Any]:
    """The root sum of squares of the parts, and each of them, as fields of a route."""
    whole = np.sqrt(np.sum([part**2 for part in parts.values()], axis=0))
    budget = tuple(Contribution(source, _named(names, sigma)) for source, sigma in parts.items())
    return {"sigma": _named(names, whole), "budget": budget}


def declared_changes(problem: JointProblem, found: Optimum) -> dict[str, FloatArray]:
    """Changes of all data by one standard uncertainty of each declared source, shape [n, k].

    A material constant has one row, an independent input of each shot one row per shot. The scale of the
    curve is excluded, because m absorbs it. Raises ValueError if a run does not complete.
    """
    changes: dict[str, FloatArray] = {}
    base = problem.predict("inputs", found.x[None], problem.mesh)[0]
    for key, sigmas in _declared_sigmas(problem).items():
        if key == "curve_scale" and MOVED in problem.unknowns.names:
            continue
        if INPUTS[key].specimen:
            changes[key] = problem.stack.of_each(_specimen_change(problem, found, base, sigmas, key))
        elif key in ("Z_offset", "y_offset"):
            changes[key] = problem.stack.of_each(_place_change(problem, sigmas, key))
        elif key in PARAMETERS and key not in problem.unknowns.names:
            p, faces = PARAMETERS[key], problem.first.interface
            if p.belongs_to(problem.first) and has_effect(p, (faces.faces, faces.side)):
                changes[key] = _constant_change(problem, found, base, float(sigmas.max()), key)[None]
    return changes


def _declared_sigmas(problem: JointProblem) -> dict[str, FloatArray]:
    """Declared standard uncertainties by key, one per shot, shape [n_shots]."""
    declared = [shot.uncertainty for shot in problem.shots]
    keys = sorted({key for one in declared for key, sigma in one.items() if sigma > 0.0})
    return {key: np.array([one.get(key, 0.0) for one in declared]) for key in keys}


def declared_parts(
    problem: JointProblem, found: Optimum, changes: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Standard uncertainties of the unknowns by declared source, [d], from `declared_changes`."""
    parts: dict[str, FloatArray] = {}
    for key, sigmas in _declared_sigmas(problem).items():
        if key == "curve_scale" and MOVED in problem.unknowns.names:
            # the data depend on m times the curve: m absorbs the whole scale
            moved = np.array([name == MOVED for name in problem.unknowns.names])
            parts[key] = np.where(moved, sigmas.max() * found.x, 0.0)
        elif key in changes:
            shifts = [_repeated_shift(problem, found, change) for change in changes[key]]
            parts[key] = np.sqrt(np.square(shifts).sum(axis=0))
    return parts


def _repeated_shift(problem: JointProblem, found: Optimum, change: FloatArray) -> FloatArray:
    """Shift of the optimum by a change of all data, as in `InputDirections.repeated_shift`, shape [d]."""
    stack, ends = problem.stack, []
    for sign in (1.0, -1.0):
        left = found.vector - stack.data
        residual = left + sign * change
        for _ in range(1 + WEIGHINGS):
            whitening = stack.weighting(left)
            rows = whitening.apply(found.slopes.T)
            known = information(rows, problem.unknowns.widths)
            shift = -np.linalg.solve(known, rows @ whitening.apply(residual))
            left = residual + found.slopes @ shift
        ends.append(shift)
    return np.asarray(0.5 * (ends[0] - ends[1]))


def _constant_change(
    problem: JointProblem, found: Optimum, base: FloatArray, sigma: float, key: str
) -> FloatArray:
    """Change of all data by a held material constant, changed in all shots together."""
    p = PARAMETERS[key]
    value = problem.runs.held.get(key, p.held(problem.first))
    step = parameter_step(key, value)
    if value + step > p.allowed[1]:
        step = -step
    held = {**problem.runs.held, key: value + step}
    changed = _changed_vector(problem, problem.runs.prepared, held, found.x)
    return np.asarray(sigma * (changed - base) / step)


def _specimen_change(
    problem: JointProblem, found: Optimum, base: FloatArray, sigmas: FloatArray, key: str
) -> FloatArray:
    """Change of all data by a length or the density of every shot's specimen."""
    applied = INPUTS[key].applied
    assert applied is not None  # every factor on the specimen has one
    prepared = zip(problem.runs.prepared, sigmas, strict=True)
    moved = [one.with_shot(applied(one.shot, 1.0 + sigma)) for one, sigma in prepared]
    change = _changed_vector(problem, moved, problem.runs.held, found.x) - base
    if key == "specimen_diameter":
        stack = problem.stack
        change = outlines_with_diameter(change, problem.shots, stack.shots, stack.ends, sigmas)
    if key == "specimen_length":
        heights = map(height_follows, problem.shots, sigmas.tolist())
        change = change + _place_change(problem, np.array([*heights]), "y_offset")
    return change


def outlines_with_diameter(
    change: FloatArray,
    shots: Sequence[Shot],
    data: Sequence[ShotData],
    ends: Sequence[int],
    sigmas: FloatArray,
) -> FloatArray:
    """Change of prediction minus data by larger diameters, if they define the outline's axis."""
    found, starts = change.copy(), (0, *ends[:-1])
    for shot, one, start, end, sigma in zip(shots, data, starts, ends, sigmas.tolist(), strict=True):
        if shot.axis_by_radius:
            diameter, n_force = shot.specimen.diameter, one.objective.n_force
            found[start:end] = outline_follows(change[start:end], sigma, diameter, n_force)
    return found


def _place_change(problem: JointProblem, sigmas: FloatArray, key: str) -> FloatArray:
    """Change of prediction minus data by a larger Z or y of every outline, with the same model, shape [k]."""
    change, stack = np.zeros(len(problem.stack.data)), problem.stack
    for k, (one, sigma) in enumerate(zip(stack.shots, sigmas, strict=True)):
        moved = -1.0 if key == "Z_offset" else _outline_slope(one.observations)[one.counted]
        change[stack.place(k)][one.objective.n_force :] = sigma * moved
    return change


def _outline_slope(seen: Observations) -> FloatArray:
    """dZ/dy along the measured outline of each frame [-], shape [Q]."""
    line, found = seen.centre_line, np.zeros(len(seen.centre_line.Z))
    for frame in np.unique(line.frame):
        rows = np.flatnonzero(line.frame == frame)
        if len(rows) > 2:
            fit = np.polynomial.Polynomial.fit(line.y[rows], line.Z[rows], min(4, len(rows) - 1))
            found[rows] = fit.deriv()(line.y[rows])
    return found


def _changed_vector(
    problem: JointProblem, prepared: Sequence[PreparedShot], held: Mapping[str, float], x: FloatArray
) -> FloatArray:
    """All data at a point with other shots or held values, shape [k]."""
    ledger, progress = problem.runs.ledger, problem.runs.progress
    runs = JointRuns(prepared, problem.unknowns, held=held, ledger=ledger, progress=progress)
    vectors = runs.vectors("inputs", x[None], problem.mesh)
    slow = problem.slow_values(x, held=runs.held)
    whole = problem.stack.joined(vectors, slow[None], problem.known(x)[None])[0]
    if np.isnan(whole).any():
        raise ValueError("a run with an input moved by its uncertainty did not complete")
    problem.runs.made += runs.made
    return whole
