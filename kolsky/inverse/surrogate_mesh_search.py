"""Several parameters on the coarse meshes: first the correct valley, then least squares on the solver.

A scan of Poisson's ratio on the mesh of the replicates finds the valleys of the misfit
(`kolsky.inverse.valleys`). Least-squares searches start in the likeliest valleys and run in parallel. They
use the solver directly, without a surrogate (`doe.least_squares`). From the likeliest result, the maximum of
the likelihood is searched (`kolsky.inverse.valleys`). The search on the surrogate's mesh starts there. In all
searches, the points of a frame count as one value. The outline's error on a coarse mesh is a smooth field.
Point by point, it would lead least squares out of the valley in which model and force are in phase. The
search coordinate of Poisson's ratio is the logarithm of 1 - 2 nu: a valley is a few percent of 1 - 2 nu wide
for any nu. A single parameter is found with a surrogate; its path is corrected as for several.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from doe import from_points, latin_hypercube
from doe.least_squares import least_squares
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, CorrectedSurrogate, jacobian
from kolsky.inverse.objective import FrontNoise, Objective, weighting_with_prior
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.path_noise import (
    FrontPath,
    MovedFront,
    PathModes,
    credible,
    data_change,
    likely_amplitudes,
    noise_of,
)
from kolsky.inverse.run_table import Replicates
from kolsky.inverse.runner import Mesh, Runner
from kolsky.inverse.settings import Numerics
from kolsky.inverse.valleys import (
    VALLEY,
    from_search,
    likeliest_floor,
    likely_valleys,
    search_box,
    to_search,
    valley_levels,
)

BEST = 3
"""Number of starts with Poisson's ratio held: the best points of a design."""
FIRST_STEPS, MOST_STEPS = 4, 8
"""Maximum number of trial points: of each search before the best one is chosen, and of that on each mesh."""
AT_REST = 1.0
"""A search has converged if its next step is shorter than this, in standard deviations. The refined mesh's
optimum is about ten standard deviations away."""
GIVE_UP = 10.0
"""A search is given up if another one is better by more than this many times the predicted decrease of its
step [-]. The discrepancies decrease with the residual, so a step lowers -2 ln L by two to three times the
prediction."""
SHORT = 4.0
"""A step shorter than this uses Broyden's update of the slopes [standard deviations]. The weights still
change along such steps; the slopes change little."""
MOST_MOVES = 4
"""Maximum number of corrections of the front face's path. Patterns are recomputed for each."""
STILL = 1.0
"""The patterns are not recomputed if the optimum shifts by less than this, in standard deviations. Their
phase error is then within that of the answer's uncertainty."""
STEP = 1e-3
"""Half step of the central differences, in the unit box of the search."""


@dataclass(frozen=True)
class MeshOptimum:
    """The optimum on one mesh."""

    x: FloatArray
    """Point in parameter units, shape [d]."""
    sigma: FloatArray
    """Standard deviation with a frame's points as one value, shape [d]; infinite if no entry varies."""
    least_sigma: FloatArray
    """Standard deviation if every value counted as often as a frame has points, shape [d]."""


@dataclass(frozen=True)
class MeshOptima:
    """Optima on the coarse meshes, with their path and replicates."""

    optima: Mapping[Mesh, MeshOptimum]
    """Optima on the mesh of the replicates and on the surrogate's mesh."""
    front: FrontPath
    replicates: Callable[[], Replicates] | None
    """Gives runs at the optimum with other motions and curves; None if none were requested."""
    valley_margin: float = np.inf
    """-2 ln L of the next valley of Poisson's ratio minus that of this one [-]; infinite if there is none."""


def search_meshes(runner: Runner, start: FloatArray) -> MeshOptima:
    """Optima on the replicates' mesh, and from there on the surrogate's mesh.

    ``start``: initial values in parameter units, shape [d]. Raises ValueError if no run of the scan
    completes, or no search can start.
    """
    problem = runner.problem
    surrogate, first = problem.numerics, problem.first
    points, objective = starts(runner, start, first)
    ends = _least_squares_on(runner, objective, first, points, FIRST_STEPS)
    begin, margin = ends[0].x, np.inf
    if VALLEY in problem.box.names:
        floor = likeliest_floor(runner, np.array([end.x for end in ends]), first, objective.counted)
        begin, margin = floor.x, floor.margin
        if problem.settings.replicates:
            runner = runner.under(runner.front.with_noise(floor.patterns))
            objective = replace(objective, front=runner.front.noise)
    (best,) = _least_squares_on(runner, objective, first, begin[None], MOST_STEPS)
    fine = best
    if surrogate.mesh != first.mesh:
        (fine,) = _least_squares_on(runner, objective, surrogate, best.x[None], MOST_STEPS)
    return replace(follow_meshes(runner, objective, fine, best.x - fine.x), valley_margin=margin)


def search_meshes_for_one(runner: Runner, coarse: CoarseOptimum) -> MeshOptima:
    """Optima of one parameter on both coarse meshes, from the optimum of a surrogate with the fitted path."""
    model, box = CorrectedSurrogate(coarse.surrogate).predict, coarse.box
    vector, slope = model(coarse.x)[0], jacobian(model, box, coarse.x)
    sigma = np.sqrt(np.diag(coarse.objective.covariance(slope, vector)))
    best = MeshOptimum(coarse.x, sigma, sigma)
    objective = replace(runner.objective(coarse.objective.counted), balanced=True)
    return follow_meshes(runner, objective, best, np.zeros(1))


def follow_meshes(runner: Runner, objective: Objective, fine: MeshOptimum, shift: FloatArray) -> MeshOptima:
    """Optima on both coarse meshes with the corrected path of the front face, and its replicates."""
    problem, replicates = runner.problem, None
    surrogate, first, box = problem.numerics, problem.first, problem.box
    if problem.settings.replicates:
        # On this mesh, the ringing and its noise patterns are closer to those of the refined mesh.
        fine, front = follow_front(runner, objective, surrogate, fine)
        runner, objective = runner.under(front), replace(objective, front=front.noise)
    optima = {surrogate.mesh: fine}
    if first.mesh != surrogate.mesh:
        near = np.clip(fine.x + shift, box.lower, box.upper)
        (optima[first.mesh],) = _least_squares_on(runner, objective, first, near[None], MOST_STEPS)
    if problem.settings.replicates:
        replicates = runner.replicate(optima[first.mesh].x, lesson=False)
    return MeshOptima(optima, runner.front, replicates)


def follow_front(
    runner: Runner, objective: Objective, numerics: Numerics, best: MeshOptimum
) -> tuple[MeshOptimum, FrontPath]:
    """The optimum on a mesh with the corrected path of the front face, and its patterns.

    The patterns ring at the frequency of their point. They are recomputed until the optimum converges. If
    noise of the record cannot explain the residual, the path is not corrected.
    """
    front, noise = runner.front, noise_of(runner.problem.observations)
    fitted, first = front.path, best
    jerks = runner.front_jerks
    shares = np.zeros(len(jerks))
    for _ in range(MOST_MOVES):
        runs = runner.under(front).under_other_motions(best.x[None], jerks, numerics)[0]
        if runs is None or len(runs.force_bins) <= len(jerks):  # it is not known which motion failed
            break
        change = data_change(runs)[1:]
        modes = PathModes.of(change, noise, jerks)
        front = front.with_noise(modes.patterns, shares @ change if shares.any() else None)
        weighed = replace(objective, front=front.noise)
        vector = weighed.reached(runs)[0]
        weighed = weighed.with_discrepancy(vector)
        amplitudes = likely_amplitudes(weighed, weighed.data - vector)
        if not credible(amplitudes):
            # A new path object: no surrogate with it can use earlier runs.
            return first, FrontPath(replace(fitted), FrontNoise(modes.patterns))
        shares = amplitudes @ modes.shares
        front = FrontPath.following(MovedFront(fitted, modes, amplitudes))
        before, weighed = best, replace(objective, front=front.noise)
        (best,) = _least_squares_on(runner.under(front), weighed, numerics, best.x[None], MOST_STEPS)
        if (np.abs(best.x - before.x) <= STILL * best.sigma).all():
            break
        jerks, shares = modes.own_jerks, modes.amplitudes(shares)
    return best, front


def starts(runner: Runner, start: FloatArray, numerics: Numerics) -> tuple[FloatArray, Objective]:
    """Search starts, the most likely first, [n, d], and the objective over the outline points of the first.

    ``start``: initial values in parameter units, shape [d]. ``numerics``: of the scan. Raises ValueError if
    no run of the scan completes.
    """
    box = runner.problem.box
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        factor = start[box.names.index(MOVED)] if MOVED in box.names else 1.0
        levels = valley_levels(runner.problem.prepared, float(factor), (box.lower[i], box.upper[i]))
        points = np.tile(start, (len(levels), 1))
        points[:, i] = levels
    else:
        spread = latin_hypercube(box, 4 * box.dimension, rng=runner.problem.settings.seed).points
        points = np.concatenate([start[None], spread])
    done = runner.simulate("design", from_points(box, points), numerics)
    every = runner.objective(np.asarray(done.prediction.inside.all(axis=0)))
    vectors = every.vectors(done.prediction)
    if VALLEY in box.names:
        seen = to_search(box, done.points)[:, i]
        order = likely_valleys(every, vectors, np.abs(np.log(seen / to_search(box, start)[i])))
    else:
        order = np.argsort(every.deviance(vectors)).tolist()[:BEST]
    inside = done.prediction.inside[order[0]]
    return done.points[order], replace(runner.objective(inside), balanced=True)


def _least_squares_on(
    runner: Runner, objective: Objective, numerics: Numerics, points: FloatArray, steps: int
) -> list[MeshOptimum]:
    """Least squares on a mesh from several starts, the most likely result first. The prior counts as data."""
    box, prior = runner.problem.box, objective.prior
    known = np.zeros(0 if prior is None else len(prior.rows()))

    def run(points: FloatArray) -> FloatArray:
        x = from_search(box, points)
        vectors = runner.vectors("refinement", x, numerics, objective)
        return vectors if prior is None else np.hstack([vectors, prior.residuals(x)])

    found = least_squares(
        run,
        search_box(box),
        to_search(box, points),
        data=np.concatenate([objective.data, known]),
        weighting=weighting_with_prior(objective, len(known)),
        step=STEP,
        max_steps=steps,
        at_rest=AT_REST,
        give_up=GIVE_UP,
        short=SHORT,
    )
    edges = np.array([0.5 if name == VALLEY else 1.0 for name in box.names])
    many = np.sqrt(objective.points_per_frame)
    return [
        MeshOptimum(from_search(box, end.x), end.sigma * edges, end.sigma * edges / many) for end in found
    ]
