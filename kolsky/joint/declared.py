"""What [uncertainty] declares of specimens, places and held constants, carried to the joint answer.

A constant of the material is one number for all shots. A specimen and the place of an outline are each shot's
own: their parts add in quadrature over the shots. The force's scale and clock are in the weights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Observations
from kolsky.inverse.parameters import MOVED, PARAMETERS, has_effect
from kolsky.inverse.prepared_shot import PreparedShot
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.runs import JointRuns
from kolsky.joint.weights import ShotData
from kolsky.shot.records import Shot
from kolsky.uncertainty.inputs import parameter_step
from kolsky.uncertainty.moved_inputs import height_follows, outline_follows
from kolsky.uncertainty.moved_runs import SPECIMEN


def declared_parts(problem: JointProblem, found: Optimum, gain: FloatArray) -> dict[str, FloatArray]:
    """Standard uncertainties of the unknowns by declared source, shape [d] each.

    Parameters
    ----------
    problem, found
        The problem and its optimum.
    gain
        Linear map from a change of the data to the move of the optimum, shape [d, k].

    Raises
    ------
    ValueError
        If a run with a moved input does not complete.
    """
    parts: dict[str, FloatArray] = {}
    base = problem.predict("inputs", found.x[None], problem.mesh)[0]
    shots = [p.forward.shot for p in problem.runs.prepared]
    names = sorted({key for shot in shots for key, sigma in shot.uncertainty.items() if sigma > 0.0})
    for key in names:
        sigmas = np.array([shot.uncertainty.get(key, 0.0) for shot in shots])
        if key == "curve_scale" and MOVED in problem.unknowns.names:
            # m times the curve is what the data see: the whole of it goes into m
            i = problem.unknowns.names.index(MOVED)
            parts[key] = np.zeros(len(found.x))
            parts[key][i] = float(sigmas.max()) * float(found.x[i])
        elif key in SPECIMEN:
            parts[key] = _each(problem, found, gain, base, sigmas, key)
        elif key in ("Z_offset", "y_offset"):
            parts[key] = _places(problem, gain, sigmas, key)
        elif _held_constant(problem, key):
            parts[key] = _constant(problem, found, gain, base, float(sigmas.max()), key)
    return parts


def _held_constant(problem: JointProblem, key: str) -> bool:
    if key not in PARAMETERS or key in problem.unknowns.names:
        return False
    shot = problem.first.shot
    return PARAMETERS[key].belongs_to(shot) and has_effect(
        PARAMETERS[key], (shot.interface.faces, shot.interface.side)
    )


def _constant(
    problem: JointProblem, found: Optimum, gain: FloatArray, base: FloatArray, sigma: float, key: str
) -> FloatArray:
    """A constant of the material that is held: moved in all shots together."""
    p = PARAMETERS[key]
    value = problem.runs.held.get(key, p.held(problem.first.shot))
    step = parameter_step(key, value)
    if value + step > p.allowed[1]:
        step = -step
    runs = _runs(problem, problem.runs.prepared, {**problem.runs.held, key: value + step})
    change = (_vector(problem, runs, found.x) - base) / step
    return np.abs(sigma * gain @ change)


def _each(
    problem: JointProblem, found: Optimum, gain: FloatArray, base: FloatArray, sigmas: FloatArray, key: str
) -> FloatArray:
    """A length or the density of every shot's own specimen."""
    moved: list[PreparedShot] = []
    for prepared, sigma in zip(problem.runs.prepared, sigmas, strict=True):
        shot = prepared.forward.shot
        value = getattr(shot.specimen, SPECIMEN[key]) * (1.0 + sigma)
        changed = replace(shot, specimen=replace(shot.specimen, **{SPECIMEN[key]: value}))
        moved.append(replace(prepared, forward=replace(prepared.forward, shot=changed)))
    change = _vector(problem, _runs(problem, moved, problem.runs.held), found.x) - base
    if key == "specimen_diameter":
        shots = [prepared.forward.shot for prepared in problem.runs.prepared]
        change = with_outlines(change, shots, problem.stack.shots, problem.stack.ends, sigmas)
    if key == "specimen_length":
        shots = [prepared.forward.shot for prepared in problem.runs.prepared]
        heights = [height_follows(shot, sigma) for shot, sigma in zip(shots, sigmas.tolist(), strict=True)]
        change = change + _moved_places(problem, np.array(heights), "y_offset")
    return _in_quadrature(problem, gain, change)


def with_outlines(
    change: FloatArray,
    shots: Sequence[Shot],
    data: Sequence[ShotData],
    ends: Sequence[int],
    sigmas: FloatArray,
) -> FloatArray:
    """Change of prediction minus data by larger diameters: outlines move whose axis was placed by theirs.

    Parameters
    ----------
    change
        Change of the predictions, shape [k].
    shots, data, ends
        The shots, their data, and where each ends in the vector.
    sigmas
        By how much each diameter is larger, relative to it, shape [n_shots].
    """
    found, start = change.copy(), 0
    for shot, one, end, sigma in zip(shots, data, ends, sigmas.tolist(), strict=True):
        if shot.axis_by_radius:
            diameter, n_force = shot.specimen.diameter, one.objective.n_force
            found[start:end] = outline_follows(change[start:end], sigma, diameter, n_force)
        start = end
    return found


def _places(problem: JointProblem, gain: FloatArray, sigmas: FloatArray, key: str) -> FloatArray:
    """Axis or height of every shot's own outline."""
    return _in_quadrature(problem, gain, _moved_places(problem, sigmas, key))


def _moved_places(problem: JointProblem, sigmas: FloatArray, key: str) -> FloatArray:
    """Change of prediction minus data by a larger Z or y of every outline: the data move, the model does not,
    shape [k]."""
    change = np.zeros(len(problem.stack.data))
    start = 0
    for one, end, sigma in zip(problem.stack.shots, problem.stack.ends, sigmas, strict=True):
        first = start + one.objective.n_force
        change[first:end] = -sigma if key == "Z_offset" else sigma * _slope(one.observations)[one.counted]
        start = end
    return change


def _slope(seen: Observations) -> FloatArray:
    """dZ/dy along each frame's outline as it was measured [-], shape [Q]."""
    line, found = seen.centre_line, np.zeros(len(seen.centre_line.Z))
    for frame in np.unique(line.frame):
        rows = np.flatnonzero(line.frame == frame)
        if len(rows) > 2:
            fit = np.polynomial.Polynomial.fit(line.y[rows], line.Z[rows], min(4, len(rows) - 1))
            found[rows] = fit.deriv()(line.y[rows])
    return found


def _in_quadrature(problem: JointProblem, gain: FloatArray, change: FloatArray) -> FloatArray:
    """Root of the sum over shots of the squared moves by each shot's part of a change, shape [d]."""
    moves = [gain @ problem.stack.of_shot(k, change) for k in range(len(problem.stack.shots))]
    return np.sqrt((np.array(moves) ** 2).sum(axis=0))


def _runs(problem: JointProblem, prepared: Sequence[PreparedShot], held: Mapping[str, float]) -> JointRuns:
    return JointRuns(
        prepared, problem.unknowns, held=held, ledger=problem.runs.ledger, progress=problem.runs.progress
    )


def _vector(problem: JointProblem, runs: JointRuns, x: FloatArray) -> FloatArray:
    vectors = runs.vectors("inputs", x[None], problem.mesh)
    stack = problem.stack
    slow = problem.slow_values(x, held=runs.held)
    whole = stack.joined(vectors, slow[None], problem.known(x)[None])[0]
    if np.isnan(whole).any():
        raise ValueError("a run with an input moved by its uncertainty did not complete")
    problem.runs.made += runs.made
    return whole
