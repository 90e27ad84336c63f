"""Least squares on the refined mesh itself, where the slopes of the surrogate's mesh do not lead to rest.

Where the residual is large beside the noise, what a step asks for depends on how it projects on the slopes,
and those of a mesh whose waves are a little slower may point uphill: the chord method of
`kolsky.inverse.gauss_newton` then goes to and fro about the optimum. Steps with the refined mesh's own
slopes, damped so that the deviance never rises, settle where there is a minimum; each takes two runs a
parameter more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.refined_search import CONFIRMED, refined_numerics
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.surrogate_mesh_search import least_squares_on

MOST_OWN_STEPS = 12
"""Most trial points on the refined mesh: a search that comes to rest there takes some four."""
APART = 0.25
"""Half the distance of the differences for the slopes, in standard deviations of the optimum: half that of
the surrogate mesh's, as the point is nearer to its optimum."""


@dataclass(frozen=True)
class OwnSlopes:
    """Result of the search with the refined mesh's own slopes."""

    x: FloatArray
    """Where it ended, shape [d]."""
    slope: FloatArray
    """Jacobian of the data vector there, shape [k, d]."""


def search_on_refined(stages: StagedRuns, objective: Objective, start: FloatArray) -> OwnSlopes | None:
    """Search the refined mesh by least squares on it.

    Parameters
    ----------
    stages
        The identification's simulations; all runs join their table.
    objective
        Which outline points count, and the prior.
    start
        The best point so far, shape [d].

    Returns
    -------
    OwnSlopes, optional
        None if the start, or a run beside the end, does not complete.
    """
    numerics = refined_numerics(stages)
    try:
        (end,) = least_squares_on(
            stages, objective, numerics, start[None], MOST_OWN_STEPS, stage="check", at_rest=CONFIRMED
        )
    except ValueError:  # no run at the start: nothing to go on from
        return None
    if not np.isfinite(end.sigma).all():
        return None
    up, down = neighbours(stages.box, end.x, APART * end.sigma)
    vectors = stages.vectors("check", np.concatenate([up, down]), numerics, objective)
    if not np.isfinite(vectors).all():
        return None
    return OwnSlopes(end.x, differences(vectors, up, down))


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
    lower, upper = np.array(box.lower), np.array(box.upper)
    h = np.diag(np.minimum(step, 0.1 * (upper - lower)))
    return np.minimum(x + h, upper), np.maximum(x - h, lower)


def differences(vectors: FloatArray, up: FloatArray, down: FloatArray) -> FloatArray:
    """Jacobian from data vectors at the points above, then at those below, [2 d, k] -> [k, d]."""
    d = len(up)
    return np.asarray(((vectors[:d] - vectors[d:]) / (up - down).sum(axis=1)[:, None]).T)
