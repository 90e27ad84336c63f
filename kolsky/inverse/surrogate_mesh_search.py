"""Several parameters on the coarse meshes: the right valley first, then least squares on the solver.

The force rings at the period of the pressure waves, some ten times in a test. Poisson's ratio sets that
period through K / G = 2 (1 + nu) / (3 (1 - 2 nu)), so that the misfit has a valley wherever the model's
oscillations match the measured ones in step, or one whole oscillation off. A valley is a few percent of
1 - 2 nu wide, whatever nu is: so the logarithm of 1 - 2 nu is the coordinate of the search, and a scan in
steps of that size finds all valleys. On a coarse mesh that is some tens of runs. Searches from the deepest
of them, side by side, are least squares on the solver itself (`doe.least_squares`): its steps need no
surrogate.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log

import numpy as np

from doe import Box, from_points, latin_hypercube
from doe.least_squares import least_squares
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective
from kolsky.inverse.staged_runs import StagedRuns

VALLEY = "poisson"
"""The parameter whose misfit has many valleys."""
RATIO = 1.085
"""Ratio of neighbouring values of 1 - 2 nu in the scan: 4 % of a period, a third of an oscillation at the
end of a test of ten."""
VALLEYS = 3
"""Valleys that are searched, the deepest first."""
FIRST_STEPS, MOST_STEPS = 4, 8
"""Trial points of each search before the best of them goes on alone, and of that one on each mesh."""
AT_REST = 0.5
"""Length of the next step, in standard deviations, at which a search is at rest: the refined mesh's optimum
is some ten of them away."""
STEP = 1e-3
"""Half the distance of the differences in the unit box of the search."""


@dataclass(frozen=True)
class MeshOptimum:
    """The optimum on one mesh."""

    x: FloatArray
    """In parameter units, shape [d]."""
    sigma: FloatArray
    """Standard deviation from independent residuals, shape [d]; infinite where no entry varies."""
    deviance: float
    """-2 ln L up to a constant [-]."""
    converged: bool
    """Whether the search came to rest."""


def search_box(box: Box) -> Box:
    """The box in the coordinates of the search: 1 - 2 nu, logarithmic, in place of Poisson's ratio."""
    bounds = {name: (low, high) for name, low, high in zip(box.names, box.lower, box.upper, strict=True)}
    if VALLEY not in bounds:
        return box
    low, high = bounds[VALLEY]
    bounds[VALLEY] = 1.0 - 2.0 * high, 1.0 - 2.0 * low
    return Box.of(bounds, logarithmic=[VALLEY])


def to_search(box: Box, points: FloatArray) -> FloatArray:
    """Points in the coordinates of the search, shape [..., d]."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 1.0 - 2.0 * x[..., i]
    return x


def from_search(box: Box, points: FloatArray) -> FloatArray:
    """The inverse of `to_search`."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 0.5 * (1.0 - x[..., i])
    return x


def valley_levels(low: float, high: float) -> FloatArray:
    """Values of Poisson's ratio from `low` to `high` whose 1 - 2 nu have equal ratios of at most `RATIO`."""
    first, last = 1.0 - 2.0 * low, 1.0 - 2.0 * high
    n = ceil(log(first / last) / log(RATIO)) + 1
    return np.asarray(0.5 * (1.0 - np.geomspace(first, last, n)))


def local_minima(values: FloatArray) -> list[int]:
    """Places of the values that are below both neighbours, the lowest first; NaN is no minimum."""
    padded = np.concatenate([[np.inf], np.where(np.isnan(values), np.inf, values), [np.inf]])
    found = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    return sorted(found.tolist(), key=lambda i: float(values[i]))


def search_meshes(stages: StagedRuns, start: FloatArray) -> dict[tuple[int, int], MeshOptimum]:
    """Optima on the mesh of the replicates and on the surrogate's, the second from the first.

    Parameters
    ----------
    stages
        The identification's simulations; all runs join their table.
    start
        A first guess in parameter units, shape [d].

    Raises
    ------
    ValueError
        If no run of the scan completes, or no search can start.
    """
    surrogate = stages.settings.numerics
    first = surrogate.with_mesh(min(surrogate.mesh, stages.settings.replicate_mesh))
    points, objective = starts(stages, start, first)
    some = _searches(stages, objective, first, points, FIRST_STEPS)
    (best, *_) = _searches(stages, objective, first, some[0].x[None], MOST_STEPS)
    found = {first.mesh: best}
    if surrogate.mesh not in found:
        (found[surrogate.mesh],) = _searches(stages, objective, surrogate, best.x[None], MOST_STEPS)
    return found


def starts(stages: StagedRuns, start: FloatArray, numerics: Numerics) -> tuple[FloatArray, Objective]:
    """Points to search from, the most likely first, [n, d], and the objective over what the first reaches.

    Parameters
    ----------
    stages
        The identification's simulations.
    start
        A first guess in parameter units, shape [d].
    numerics
        Of the scan.

    Raises
    ------
    ValueError
        If no run of the scan completes.
    """
    box = stages.box
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        levels = valley_levels(box.lower[i], box.upper[i])
        points = np.tile(start, (len(levels), 1))
        points[:, i] = levels
    else:
        spread = latin_hypercube(box, 4 * box.dimension, rng=stages.settings.seed).points
        points = np.concatenate([start[None], spread])
    done = stages.simulate("design", from_points(box, points), numerics)
    every = Objective(stages.observations, np.asarray(done.prediction.inside.all(axis=0)))
    deviance = np.full(len(points), np.nan)
    deviance[done.rows] = every.deviance(every.vectors(done.prediction))
    order = local_minima(deviance) if VALLEY in box.names else np.argsort(deviance).tolist()
    best = order[:VALLEYS]
    inside = done.prediction.inside[np.searchsorted(done.rows, best[0])]
    return points[best], Objective(stages.observations, inside, prior=stages.prior)


def _searches(
    stages: StagedRuns, objective: Objective, numerics: Numerics, points: FloatArray, steps: int
) -> list[MeshOptimum]:
    """Least squares on a mesh from some points, the most likely end first; the prior is more data."""
    box, prior = stages.box, objective.prior
    inner, k = search_box(box), len(objective.data)
    known = np.zeros(0) if prior is None else np.zeros(len(prior.rows()))

    def run(points: FloatArray) -> FloatArray:
        x = from_search(box, points)
        vectors = stages.vectors("refinement", x, numerics, objective)
        return vectors if prior is None else np.hstack([vectors, prior.residuals(x)])

    def weighting(residual: FloatArray) -> FloatArray:
        sigma = objective.with_discrepancy(objective.data + residual[:k]).sigma
        return np.concatenate([sigma, np.ones(len(known))])

    found = least_squares(
        run,
        inner,
        to_search(box, points),
        data=np.concatenate([objective.data, known]),
        weighting=weighting,
        step=STEP,
        max_steps=steps,
        at_rest=AT_REST,
    )
    edges = np.array([0.5 if name == VALLEY else 1.0 for name in box.names])
    return [
        MeshOptimum(from_search(box, end.x), end.sigma * edges, end.deviance, end.converged) for end in found
    ]


def reached(stages: StagedRuns, inside: BoolArray) -> Objective:
    """The objective over the outline points that every run of some reaches, shape [n, n_points]."""
    return Objective(stages.observations, np.asarray(inside.all(axis=0)), prior=stages.prior)
