"""The joint answer: shared values with intervals, each shot's own part, the curve that impacts ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.estimates import estimates, held_values
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.relaxing import reference_words
from kolsky.inverse.result import Estimate
from kolsky.joint.declared import declared_parts
from kolsky.joint.mesh_errors import mesh_change
from kolsky.joint.model_choice import held_against
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.records import CurveFound, JointResult, ModelChoice, ShotPart
from kolsky.joint.scatter import expanded
from kolsky.joint.unknowns import node_strains, with_factors
from kolsky.joint.unseen import needed, unseen
from kolsky.joint.weights import CLOCK, GAIN, SCATTER, Stack, covariance, information
from kolsky.uncertainty.numerical import numerical_parts
from kolsky.uncertainty.warnings.meshes import lost_mesh_runs

FEW_SHOTS = 5
"""Shots below which a scatter between them is hardly known."""


def answered(
    problem: JointProblem, found: Optimum, choice: ModelChoice | None, said: tuple[str, ...]
) -> JointResult:
    """Values, intervals and verdicts at an optimum.

    Raises
    ------
    ValueError
        If the run at the answer on the search's mesh does not complete.
    """
    stack, unknowns = problem.stack, problem.unknowns
    residual = found.vector - stack.data
    objectives = stack.weighed(residual)
    whitening = stack.whitening(objectives)
    known = information(whitening.apply(found.slopes.T), unknowns.widths)
    gain: FloatArray = np.asarray(
        np.linalg.solve(known, whitening.precision(found.slopes.T)), dtype=np.float64
    )
    cov = covariance(found.slopes, residual, whitening, stack, unknowns.widths)
    plain = np.diag(np.linalg.inv(known))
    between = np.zeros(len(found.x))
    if any(SCATTER in one.own for one in stack.shots):
        between = np.maximum(plain - _without(stack, problem, found, SCATTER), 0.0)
    curves = np.zeros(len(found.x))
    if stack.curve is not None:
        bare = replace(stack, curve=None)
        curves = np.maximum(plain - _without(bare, problem, found, ""), 0.0)
    noise = {
        "force and shape": np.sqrt(np.maximum(np.diag(cov) - between - curves, 0.0)),
        "scatter between shots": np.sqrt(between),
        "material curve": np.sqrt(curves),
        **declared_parts(problem, found, gain),
    }
    mesh = mesh_change(problem, found)
    numerical = numerical_parts(mesh, gain)
    n = unknowns.n_parameters
    shared: dict[str, Estimate] = {}
    if unknowns.parameters is not None:
        shared = estimates(
            unknowns.parameters,
            found.x[:n],
            noise={source: part[:n] for source, part in noise.items()},
            numerical={source: part[:n] for source, part in numerical.items()},
            mesh_shift=mesh.shift(gain)[:n],
            mesh_correction=mesh.correction(gain)[:n],
            confirmed=found.confirmed,
            outline=any(one.observations.has_shape for one in stack.shots),
        )
    choice = None if choice is None else held_against(choice, shared)
    if choice is not None and not choice.asked_for:
        shared = {name: unseen(e) for name, e in shared.items()}
    half = {
        name: expanded(e.sigma, e.noise_parts["scatter between shots"], len(stack.shots))
        for name, e in shared.items()
    }
    sizes = np.sqrt(np.diag(cov))
    shot = problem.first.shot
    held = held_values(shot, unknowns.parameters or Box.of({"none": (0.0, 1.0)}), problem.runs.held)
    return JointResult(
        estimates=shared,
        fixed=held,
        correlation=(cov / np.outer(sizes, sizes))[:n, :n],
        expanded=half,
        shots=_parts(problem, found, whitening.precision(residual), objectives),
        scatter=found.scatter,
        slow=_slow_misfits(problem, found.vector),
        choice=choice,
        curve=_curve(problem, found, noise, numerical, mesh.correction(gain)) if unknowns.nodes else None,
        mesh=problem.mesh.mesh,
        refined_mesh=problem.settings.refined_mesh,
        runs=problem.runs.made,
        warnings=(
            *said,
            *lost_mesh_runs(mesh.lost, problem.mesh.mesh),
            *_warnings(problem, found, choice, shared),
        ),
    )


def _without(stack: Stack, problem: JointProblem, found: Optimum, name: str) -> FloatArray:
    """Variances with the same discrepancies, as if the shots had no unknown of a name, shape [d]."""
    bare, residual = [], found.vector - stack.data
    for one, o in zip(stack.shots, stack.weighed(residual), strict=True):
        rest = {key: row for key, row in one.own.items() if key != name}
        bare.append(
            replace(
                replace(one, own=rest).objective,
                force_discrepancy=o.force_discrepancy,
                shape_discrepancy=o.shape_discrepancy,
            )
        )
    rows = stack.whitening(bare).apply(found.slopes.T)
    return np.diag(np.linalg.inv(information(rows, problem.unknowns.widths)))


def _parts(
    problem: JointProblem, found: Optimum, weighed: FloatArray, objectives: Sequence[Objective]
) -> tuple[ShotPart, ...]:
    """Each shot's own unknowns, most likely ones, and how well it is explained."""
    stack, parts = problem.stack, []
    m = float(problem.values(found.x).get(MOVED, 1.0))
    residuals = stack.parts(found.vector - stack.data)
    pulls = stack.parts(weighed)
    for k, (one, o, r) in enumerate(zip(stack.shots, objectives, residuals, strict=True)):
        shot = problem.runs.prepared[k].forward.shot
        own = {name: _own(row[one.kept], pulls[k], o) for name, row in one.own.items()}
        scatter = 0.0 if found.scatter is None else found.scatter.value
        size = {SCATTER: m * scatter, GAIN: problem.settings.gain_each}
        size[CLOCK] = shot.uncertainty.get("clock_offset", 0.0)
        share = {name: (size[name] * a, size[name] * s) for name, (a, s) in own.items()}
        n, squares = o.n_force, (r / o.noise) ** 2
        parts.append(
            ShotPart(
                name=shot.name,
                inputs=dict(shot.inputs),
                factor=m + share.get(SCATTER, (0.0, 0.0))[0],
                sigma_factor=share.get(SCATTER, (0.0, 0.0))[1],
                gain=share.get(GAIN, (0.0, 0.0))[0],
                sigma_gain=share.get(GAIN, (0.0, 0.0))[1],
                clock=share.get(CLOCK, (0.0, 0.0))[0],
                sigma_clock=share.get(CLOCK, (0.0, 0.0))[1],
                chi2_force=float(squares[:n].mean()),
                chi2_outline=float(squares[n:].mean()) if len(squares) > n else float("nan"),
                discrepancy_force=o.force_discrepancy,
                discrepancy_outline=o.shape_discrepancy,
            )
        )
    return tuple(parts)


def _own(row: FloatArray, pull: FloatArray, objective: Objective) -> tuple[float, float]:
    """Most likely amount of a pattern and what is left of its uncertainty, in standard deviations.

    With the residual r = prediction less data, of covariance C that knows the pattern u: -u C^-1 r, and
    the root of 1 - u C^-1 u.
    """
    left = 1.0 - float(row @ objective.whitening().precision(row[None])[0])
    return -float(row @ pull), float(np.sqrt(max(left, 0.0)))


def _slow_misfits(problem: JointProblem, vector: FloatArray) -> Mapping[str, float]:
    stack, found = problem.stack, {}
    start = stack.ends[-1]
    for one in problem.slow:
        n = int(np.isfinite(one.sigma).sum())
        part = slice(start, start + n)
        sigma = stack.slow_sigma[start - stack.ends[-1] :][:n]
        found[one.label] = float((((vector - stack.data)[part] / sigma) ** 2).mean())
        start += n
    return found


def _curve(
    problem: JointProblem,
    found: Optimum,
    noise: Mapping[str, FloatArray],
    numerical: Mapping[str, FloatArray],
    correction: FloatArray,
) -> CurveFound:
    """The curve with its band: k = 2 of the nodes' factors, between the nodes as their logarithm is."""
    n = problem.unknowns.n_parameters
    logs = (found.x + correction)[n:]
    sigma = np.sqrt(sum(part[n:] ** 2 for part in (*noise.values(), *numerical.values())))
    whitening = problem.whitening(found.vector - problem.stack.data)
    rows = whitening.apply(found.slopes.T)
    normal, known = rows @ rows.T, found.slopes[-problem.stack.known :]
    prior = np.diag(known.T @ known)[n:]
    curve = problem.first.shot.curve
    return CurveFound(
        strain=node_strains(curve, len(logs)),
        factor=np.exp(logs),
        sigma_log=np.asarray(sigma),
        prior_share=prior / np.diag(normal)[n:],
        stretch=curve.stretch,
        stress=with_factors(curve, logs),
        band=np.stack([with_factors(curve, logs + sign * 2.0 * sigma) for sign in (-1.0, 1.0)]),
    )


def _warnings(
    problem: JointProblem, found: Optimum, choice: ModelChoice | None, shared: Mapping[str, Estimate]
) -> list[str]:
    said = []
    if not found.confirmed:
        said.append(
            "the last run on the refined mesh still asks for another optimum: widen the bounds with --free, "
            "or refine --mesh, whose slopes the steps take"
        )
    if choice is not None and not choice.asked_for:
        said += [choice.sentence, *needed(shared)]
    reference = reference_words(shared)
    if reference:
        said.append(f"m refers to {reference}")
    m, size = shared.get(MOVED), 0.0 if found.scatter is None else found.scatter.value
    if m is not None and 0.0 < size * m.value <= m.sigma_numerical:
        said.append(
            f"the scatter between the shots, {100.0 * size:.2g} %, is within the uncertainty of the mesh, "
            "which errs differently at other speeds: refine both meshes before it is called scatter"
        )
    if found.scatter is not None and found.scatter.value > 0.0 and len(problem.stack.shots) < FEW_SHOTS:
        low, high = (100.0 * end for end in found.scatter.interval)
        said.append(
            f"the scatter between the shots is from {len(problem.stack.shots)} of them and hardly known: its "
            f"95 % interval is {low:.2g} to {high:.2g} %"
        )
    return said
