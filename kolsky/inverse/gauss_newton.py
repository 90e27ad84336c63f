"""Several parameters on the refined mesh: Gauss-Newton steps with the slopes of the surrogate's mesh.

A coarse mesh is too soft and its waves are too slow, so that it fits the data at other parameters than the
refined one. At its own optimum, though, its response has the measured oscillations at the measured times,
and so have its derivatives: they are the refined mesh's at the refined mesh's optimum, up to a share that
a few steps make good. So the slopes are taken once, from runs about the surrogate mesh's optimum, and every
step takes one run on the refined mesh (the chord method). A rank-one update of the slopes by what two runs
differ by was tried and makes it worse: what the steps fall short of comes from the residual times the
response's curvature as much as from the slopes. Where the steps do not lead to rest, others with the refined
mesh's own slopes do (`kolsky.inverse.refined_descent`). Where the response jumps, a run is no measure: then
`kolsky.inverse.quadratic_fit` searches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe import from_points, latin_hypercube
from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, surrogate_kind
from kolsky.inverse.early_run import LIKELY, EarlyRun
from kolsky.inverse.linear_step import linear_step
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.optimum import CorrectedSurrogate, jacobian
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.refined_descent import descend, differences, neighbours
from kolsky.inverse.refined_path import follow_on_refined
from kolsky.inverse.refined_run import RefinedRun, bounds, completed_apart, cost, judged
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.refined_steps import foretold, lengthening
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.surrogate_mesh_search import MeshOptimum

WORSE = 4.0
"""Rise of -2 ln L by a step that makes it too long [-]: two standard deviations. The slopes of the coarser
mesh lead to a point that is not quite the least misfit, and near it a good step may rise by less."""
MOST_RUNS = 8
"""Most rounds on the refined mesh with the slopes of the coarser one."""
MISLED = 2
"""Steps that made the misfit worse after which those slopes are given up."""
NEIGHBOUR = 0.5
"""Half the distance of the differences for the slopes, in standard deviations of the optimum."""
REACH = 8.0
"""Half the edge of the box about the answer in which its surrogate holds, in standard deviations."""
RUNS_PER_PARAMETER = 12
"""Runs of that surrogate for each parameter."""


@dataclass(frozen=True)
class Beside:
    """A run on the refined mesh at another point than those of the search."""

    x: FloatArray
    """Where, shape [d]."""
    prediction: Prediction
    """What it predicts, one row."""
    response: Response
    """The run, a batch of one."""


def search_by_gauss_newton(
    stages: StagedRuns, optima: dict[tuple[int, int], MeshOptimum], beside: FloatArray | None = None
) -> tuple[CoarseOptimum, RefinedOptimum, Beside | None]:
    """Move the optimum of the surrogate's mesh to the refined mesh, and build the surrogate about it.

    Parameters
    ----------
    stages
        The identification's simulations.
    optima
        As `kolsky.inverse.surrogate_mesh_search.search_meshes` finds them.
    beside
        Another point of the surrogate's mesh, shape [d], whose counterpart on the refined mesh is run too,
        in a batch with the others: a second core has time for it.

    Raises
    ------
    ValueError
        If a run on the refined mesh does not complete, or the data do not depend on a parameter.
    """
    numerics = stages.settings.numerics
    coarse = optima[numerics.mesh]
    blind = [name for name, s in zip(stages.box.names, coarse.sigma, strict=True) if not np.isfinite(s)]
    if blind:
        raise ValueError(f"the data do not depend on {', '.join(blind)}: hold it (--hold {blind[0]})")
    slope, centre, objective = slopes(stages, coarse)
    start = np.clip(foretold(optima, numerics.mesh, stages.settings.refined_mesh), *bounds(stages.box))
    last, other = _on_refined(
        stages, objective, slope, start, beside, shift=start - coarse.x, final=stages.front is None
    )
    last, slope = _at_rest(stages, objective, slope, last)
    last, slope = follow_on_refined(stages, objective, slope, last, _found_again)
    for mesh, optimum in optima.items():
        stages.offset(mesh, optimum.x - last.x)
    return *_with_surrogate(stages, last, slope, centre, coarse), other


def _at_rest(
    stages: StagedRuns, objective: Objective, slope: FloatArray, last: RefinedRun
) -> tuple[RefinedRun, FloatArray]:
    """The run, or where steps with the refined mesh's own slopes end, and the slopes that judge it."""
    return (last, slope) if last.confirmed else descend(stages, objective, slope, last)


def _found_again(
    stages: StagedRuns, objective: Objective, slope: FloatArray, start: FloatArray
) -> tuple[RefinedRun, FloatArray]:
    """The optimum on the refined mesh from a point near it, and the slopes that judge it."""
    last, _ = _on_refined(stages, objective, slope, start, None, shift=np.zeros(len(start)), final=True)
    return _at_rest(stages, objective, slope, last)


def slopes(stages: StagedRuns, optimum: MeshOptimum) -> tuple[FloatArray, FloatArray, Objective]:
    """Jacobian at the surrogate mesh's optimum, [k, d], the data vector there, [k], and the objective.

    Raises
    ------
    ValueError
        If one of the runs does not complete.
    """
    box = stages.box
    up, down = neighbours(box, optimum.x, NEIGHBOUR * optimum.sigma)
    points = np.concatenate([optimum.x[None], up, down])
    done = stages.simulate("refinement", from_points(box, points), stages.settings.numerics)
    if len(done.points) < len(points):
        raise ValueError(f"the slopes at the optimum need every run beside it to complete: {done.lost}")
    inside = np.asarray(done.prediction.inside.all(axis=0))
    objective = Objective(stages.observations, inside, prior=stages.prior, slowly=True)
    vectors = objective.vectors(done.prediction)
    return differences(vectors[1:], up, down), vectors[0], objective


def _on_refined(
    stages: StagedRuns,
    objective: Objective,
    slope: FloatArray,
    start: FloatArray,
    beside: FloatArray | None,
    *,
    shift: FloatArray,
    final: bool = False,
) -> tuple[RefinedRun, Beside | None]:
    """Steps on the refined mesh until a run leaves the optimum where it is.

    `shift` is by how much the start lies from the coarser mesh's optimum; where it is not known, zero. The
    end is `final` if the path is not moved behind it.
    """
    found, x, other, misled = None, start, None, 0
    for number in range(MOST_RUNS):
        points, moved = x[None], x - start + shift
        if beside is not None and other is None and (number > 0 or moved.any()):
            # The meshes' difference at the optimum is as good for a point not far away.
            points = np.stack([_counterpart(stages, beside, moved), x])
        if final and len(points) == 1 and (found.step.moved <= LIKELY if found else not shift.any()):
            stages.early = EarlyRun.begun(stages.prepared.forward, stages.settings, stages.box.names, x)
        check = completed_apart(stages, points)
        if len(check) == 2:
            other = Beside(points[0], check[0].prediction, check[0].response)
        run = judged(stages, objective, slope, x, check[-1], found)
        if run.confirmed and (beside is None or other is not None):
            return run, other
        if found is not None and cost(run) > cost(found) + WORSE:
            misled += 1
            if misled == MISLED:
                break
            x = 0.5 * (found.x + run.x)  # the step was too long for a linear model
        else:
            factor = 1.0
            if found is not None and cost(run) <= cost(found):  # uphill no step is lengthened
                sigma = run.step.sigma
                steps = found.step.change / sigma, run.step.change / sigma, (run.x - found.x) / sigma
                factor = lengthening(*steps)
            found, x = run, np.clip(run.x + factor * run.step.change, *bounds(stages.box))
    assert found is not None
    return found, other


def _counterpart(stages: StagedRuns, point: FloatArray, shift: FloatArray) -> FloatArray:
    """A point of the surrogate's mesh on the refined one: only what is searched for there is moved."""
    moved = point.copy()
    if MOVED in stages.box.names:
        i = stages.box.names.index(MOVED)
        moved[i] += shift[i]
    return moved


def _with_surrogate(
    stages: StagedRuns, last: RefinedRun, slope: FloatArray, centre: FloatArray, coarse: MeshOptimum
) -> tuple[CoarseOptimum, RefinedOptimum]:
    """A design about the answer on the surrogate's mesh, its surrogate, and what that says of the optimum."""
    numerics, whole, sigma = stages.settings.numerics, stages.box, last.step.sigma
    lower = np.maximum(last.x - REACH * sigma, whole.lower)
    upper = np.minimum(last.x + REACH * sigma, whole.upper)
    box = replace(whole, lower=tuple(lower.tolist()), upper=tuple(upper.tolist()))
    many = RUNS_PER_PARAMETER * box.dimension
    design = (
        stages.design(box)
        if box.dimension == 1
        else latin_hypercube(box, many, rng=stages.rng, optimise=True)
    )
    runs = stages.simulate("refinement", design, numerics)
    counted = last.step.objective.counted & last.check.prediction.inside[0]
    objective = replace(last.step.objective, counted=counted & runs.prediction.inside.all(axis=0))
    kept = np.concatenate([np.ones(objective.n_force, bool), objective.counted[last.step.objective.counted]])
    surrogate = surrogate_kind(box, smooth=True).fit(
        box, runs.points, objective.vectors(runs.prediction), scale=objective.noise
    )
    weighed = objective.with_discrepancy(last.vector[kept])
    x, slope, plain = last.x, slope[kept], CorrectedSurrogate(surrogate)
    # The answer and its interval rest on these slopes, which may be the refined mesh's own.
    steeper = slope - jacobian(plain.predict, box, x)
    model = replace(plain.through(x, last.vector[kept]), slope=steeper)
    on_coarse = coarse.x + linear_step(weighed, slope, centre[kept], coarse.x)
    on_refined = x + linear_step(weighed, slope, last.vector[kept], x)
    return CoarseOptimum(box, surrogate, weighed, x), RefinedOptimum(
        x=x,
        box=box,
        objective=weighed,
        model=model.predict,
        surrogate=plain.predict,
        jacobian=slope,
        slopes=(slope,),
        sigma=np.sqrt(np.diag(weighed.covariance(slope, last.vector[kept]))),
        check=last.check,
        moved=last.step.moved,
        confirmed=last.confirmed,
        missed=last.missed[kept],
        mesh_shift=on_refined - on_coarse,
    )
