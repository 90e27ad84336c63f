"""Steps with the refined mesh's own slopes, where those of the surrogate's mesh do not lead to rest.

Where the residual is large beside the noise, what a step asks for depends on how it projects on the slopes,
and those of a mesh whose waves are a little slower may point uphill: the chord method of
`kolsky.inverse.gauss_newton` then goes to and fro about the optimum. Gauss-Newton steps with slopes from runs
beside each point settle; a step that makes the misfit worse is halved.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.refined_run import RefinedRun, bounds, completed_apart, cost, judged
from kolsky.inverse.refined_search import refined_numerics
from kolsky.inverse.staged_runs import StagedRuns

MOST_STEPS = 6
"""Most points at which the slopes are taken: a search that comes to rest has need of two or three."""
MOST_HALVINGS = 5
"""Most halvings of a step."""
APART = 0.25
"""Half the distance of the differences for the slopes, in standard deviations of the optimum: half that of
the surrogate mesh's, as the point is nearer to its optimum."""


def descend(
    stages: StagedRuns, objective: Objective, slope: FloatArray, last: RefinedRun
) -> tuple[RefinedRun, FloatArray]:
    """The run where steps with the refined mesh's own slopes end, and the slopes that judge it, [k, d].

    Parameters
    ----------
    stages
        The identification's simulations; all runs join their table.
    objective
        Which outline points count, and the prior.
    slope
        The coarser mesh's, shape [k, d]: they are kept where a run beside the point does not complete.
    last
        The run from which to go on.

    Raises
    ------
    ValueError
        If a run at a trial point does not complete.
    """
    for _ in range(MOST_STEPS):
        own = slopes_beside(stages, objective, last)
        if own is None:
            break
        slope = own
        last = replace(judged(stages, objective, slope, last.x, last.check, last), missed=last.missed)
        if last.confirmed:
            break
        better = _better(stages, objective, slope, last)
        if better is None or better.confirmed:
            last = last if better is None else better
            break
        last = better
    return last, slope


def slopes_beside(stages: StagedRuns, objective: Objective, run: RefinedRun) -> FloatArray | None:
    """Jacobian of the data vector at a run on the refined mesh, shape [k, d]; None if one run is lost."""
    up, down = neighbours(stages.box, run.x, APART * run.step.sigma)
    vectors = stages.vectors("check", np.concatenate([up, down]), refined_numerics(stages), objective)
    return differences(vectors, up, down) if np.isfinite(vectors).all() else None


def _better(
    stages: StagedRuns, objective: Objective, slope: FloatArray, last: RefinedRun
) -> RefinedRun | None:
    """A run along the step that is no worse; None if there is none."""
    share = 1.0
    for _ in range(MOST_HALVINGS):
        x = np.clip(last.x + share * last.step.change, *bounds(stages.box))
        run = judged(stages, objective, slope, x, completed_apart(stages, x[None])[0], last)
        if cost(run) <= cost(last):
            return run
        share *= 0.5
    return None


def neighbours(box: Box, x: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points above and below a point in every coordinate, inside the box, shape [d, d] each.

    Parameters
    ----------
    box
        Where they may lie; a step is at most a tenth of its edge.
    x
        The point, shape [d].
    step
        Their distances from it, shape [d].
    """
    lower, upper = bounds(box)
    h = np.diag(np.minimum(step, 0.1 * (upper - lower)))
    return np.minimum(x + h, upper), np.maximum(x - h, lower)


def differences(vectors: FloatArray, up: FloatArray, down: FloatArray) -> FloatArray:
    """Jacobian from data vectors at the points above, then at those below, [2 d, k] -> [k, d]."""
    d = len(up)
    return np.asarray(((vectors[:d] - vectors[d:]) / (up - down).sum(axis=1)[:, None]).T)
