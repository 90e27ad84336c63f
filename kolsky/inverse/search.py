"""The search for the optimum, from the choice of the free parameters to the refined mesh.

The optimum of a specimen that keeps its hold is moved to the refined mesh by Gauss-Newton steps
(`kolsky.inverse.gauss_newton`), after the front face's path has been followed on the surrogate's mesh
(`kolsky.inverse.surrogate_mesh_search`). Where a surface slides or lets go, a quadratic through many runs
averages its jumps (`kolsky.inverse.refined_search`).

`held_answer` gives the stiffness factor with the other free parameters held at the shot's values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from doe import Box
from doe.surrogates import SurrogateError
from kolsky.base.apparatus import INCOMPRESSIBLE
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.coarse_search import (
    CoarseOptimum,
    CorrectedSurrogate,
    front_with_noise,
    jacobian,
    on_edge,
    search_coarse,
    weigh_front_noise,
)
from kolsky.inverse.estimates import paper_route
from kolsky.inverse.gauss_newton import ExtraRun, linear_step, search_by_gauss_newton
from kolsky.inverse.incompressible import AT_LIMIT, is_at_limit
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.path_noise import replicate_uncertainty
from kolsky.inverse.problem import InverseProblem, rough
from kolsky.inverse.refined_search import RefinedOptimum, search_by_quadratic
from kolsky.inverse.result import Estimate, HeldAnswer, Route
from kolsky.inverse.run_table import Replicates, RunTable
from kolsky.inverse.runner import Runner, compile_for
from kolsky.inverse.surrogate_mesh_search import search_meshes, search_meshes_for_one
from kolsky.inverse.valleys import VALLEY
from kolsky.inverse.work import Work

LEAST_RESOLUTION = 4.0
"""A parameter whose standard deviation times this is wider than its design is not told by the data."""


@dataclass(frozen=True)
class HeldSearch:
    """The search for the stiffness factor alone, everything else as the shot declares it."""

    values: Mapping[str, float]
    """The values that were held and are free otherwise, in SI."""
    runner: Runner
    """Its runs on the surrogate's mesh."""
    coarse: CoarseOptimum
    """Its optimum there."""
    refined: ExtraRun | None = None
    """The run at its counterpart on the refined mesh; None if there is none."""


@dataclass(frozen=True)
class Search:
    """Result of the search."""

    runner: Runner
    """Runs points of what was free in the end, under the path of the optimum."""
    coarse: CoarseOptimum
    """The optimum on the surrogate's mesh."""
    fine: RefinedOptimum
    """The optimum on the refined mesh."""
    replication: Callable[[], Replicates] | None = None
    """Gives the runs under other motions and curves; None if none were asked for."""
    held: HeldSearch | None = None
    """What the stiffness factor alone would have given; None where it was alone."""
    designs: RunTable | None = None
    """The runs of designs over the whole range, which the paper's cost is told by; None if all runs are."""
    valley_margin: float = np.inf
    """By how much -2 ln L of the next valley of Poisson's ratio lies above this one [-]."""

    @property
    def problem(self) -> InverseProblem:
        """What was free in the end."""
        return self.runner.problem

    @property
    def replicates(self) -> Replicates | None:
        """The runs under other motions and curves."""
        return None if self.replication is None else self.replication()

    def paper_route(self) -> Route | None:
        """The optimum of the paper's cost; as in the paper all but the stiffness is held, if it was tried.

        None if no surrogate can be fitted to that cost: a comparison must not cost the answer.
        """
        try:
            if self.held is None:
                return paper_route(self.problem.box, self.designs or self.runner.table)
            return paper_route(self.held.runner.problem.box, self.held.runner.table, self.held.values)
        except SurrogateError:
            return None


def search_shot(problem: InverseProblem, work: Work) -> Search:
    """Find the optimum on the refined mesh; hold by default what the data turn out not to tell.

    ``work``: is told of the stages. Raises ValueError if too few runs complete.
    """
    while True:
        compile_for(problem, work)
        runner = Runner.of(problem, work)
        if rough(problem.shot, [*problem.freed.free, *problem.settings.held]):
            return _search_rough(runner)
        if problem.box.dimension == 1:
            return _search_one(runner)
        search = _search_several(runner)
        if isinstance(search, Search):
            return search
        limit = {VALLEY: INCOMPRESSIBLE} if search.get(VALLEY) == AT_LIMIT else {}
        problem = problem.holding(search, limit)


def _search_rough(runner: Runner) -> Search:
    """Parameters of a surface that slides or lets go."""
    coarse = search_coarse(runner)
    designs = _designs_so_far(runner)
    replication = runner.replicate(coarse.x) if runner.problem.settings.replicates else None
    runner = runner.under(front_with_noise(runner, None if replication is None else replication()))
    coarse = weigh_front_noise(coarse, runner.front)
    return Search(runner, coarse, search_by_quadratic(runner, coarse), replication, designs=designs)


def _search_one(runner: Runner) -> Search:
    """One smooth parameter: like several, its first optimum from designs over the whole range."""
    wide = search_coarse(runner)
    designs = _designs_so_far(runner)
    meshes = search_meshes_for_one(runner, wide)
    coarse, fine, _ = search_by_gauss_newton(runner.under(meshes.front), meshes.optima)
    return Search(runner.under(fine.front, fine.offsets), coarse, fine, meshes.replicates, designs=designs)


def _designs_so_far(runner: Runner) -> RunTable:
    """The runs of designs over the whole range: those on the refined mesh lie too near to each other."""
    designs = RunTable(runner.problem.box.names)
    designs.take(runner.table, {})
    return designs


def _search_several(runner: Runner) -> Search | dict[str, str]:
    """Several smooth parameters; or, by default, why some of them must be held."""
    problem = runner.problem
    box, by_default = problem.box, problem.freed.by_default
    held = _search_held(runner) if MOVED in box.names else None
    start = problem.declared
    if held is not None:
        start[box.names.index(MOVED)] = held.coarse.x[0]
    meshes = search_meshes(runner, np.clip(start, box.lower, box.upper))
    coarse = meshes.optima[problem.numerics.mesh]
    lost = not_identifiable(box, coarse.x, coarse.sigma)
    if by_default and is_at_limit(runner, coarse.x):
        lost[VALLEY] = AT_LIMIT
    if by_default and lost:
        return lost
    runner, beside = runner.under(meshes.front), None if held is None else start
    optimum, fine, extra = search_by_gauss_newton(runner, meshes.optima, beside)
    lost = not_identifiable(box, fine.x, fine.sigma)
    if by_default and lost:
        return lost
    if held is not None:
        runner.table.take(held.runner.table, held.values)
        held = replace(held, refined=extra)
    runner = runner.under(fine.front, fine.offsets)
    return Search(runner, optimum, fine, meshes.replicates, held, valley_margin=meshes.valley_margin)


def _search_held(runner: Runner) -> HeldSearch:
    """The stiffness factor alone on the surrogate's mesh, the other free parameters at the shot's values."""
    problem = runner.problem
    values = {name: PARAMETERS[name].held(problem.shot) for name in problem.box.names if name != MOVED}
    alone = Runner.of(problem.of_one(MOVED), runner.work)
    return HeldSearch(values, alone, search_coarse(alone))


def not_identifiable(box: Box, x: FloatArray, sigma: FloatArray) -> dict[str, str]:
    """Why the data do not tell a parameter other than the stiffness factor, by name; empty if they do."""
    found, edge = {}, on_edge(x, box)
    for i, name in enumerate(box.names):
        if name == MOVED:
            continue
        if not LEAST_RESOLUTION * sigma[i] <= box.upper[i] - box.lower[i]:
            found[name] = "held because the data do not tell it"
        elif edge[i]:
            found[name] = f"held because its optimum lies at the bound {x[i]:.5g} of its design"
    return found


def held_answer(found: Search, estimate: Estimate) -> HeldAnswer | None:
    """The stiffness factor of one run with the others held, and a step from there; None if there is no run.

    ``found``: the search; its runner have run the replicates. ``estimate``: the stiffness factor with all of
    them free: the mesh's correction and the share of the numerics are taken from it.
    """
    held, fine = found.held, found.fine
    if held is None or held.refined is None:
        return None
    prediction = held.refined.prediction
    counted = fine.objective.counted & held.coarse.objective.counted & prediction.inside[0]
    objective = replace(found.runner.objective(counted, slowly=True), prior=None)
    vector = objective.vectors(prediction)[0]
    i = found.problem.box.names.index(MOVED)
    x = held.refined.x[[i]]
    model = CorrectedSurrogate(held.coarse.surrogate).predict
    slope = jacobian(model, held.coarse.box, held.coarse.x)[_entries_of(held.coarse.objective, counted)]
    objective = objective.with_discrepancy(vector)
    step = linear_step(objective, slope, vector, x)
    vector = vector + slope @ step
    objective = objective.with_discrepancy(vector)
    parts = [
        float(np.sqrt(objective.residual_covariance(slope, vector)[0, 0])),
        estimate.sigma_numerical,
        *_noise_sigmas(found.replicates, objective, slope),
        *_declared_sigmas(found.problem, held, fine, objective, slope),
    ]
    return HeldAnswer(
        name=MOVED,
        held=dict(held.values),
        value=float(x[0] + step[0]) + estimate.mesh_correction,
        sigma=float(np.hypot.reduce(parts)),
        **_mean_squares(objective, vector, ""),
        **_mean_squares(fine.objective, fine.objective.vectors(fine.check.prediction)[0], "free_"),
    )


def _entries_of(objective: Objective, counted: BoolArray) -> BoolArray:
    """Which entries of an objective's data vector are among the force bins and some outline points."""
    force = np.ones(objective.n_force, dtype=np.bool_)
    return np.concatenate([force, counted[objective.counted]])


def _noise_sigmas(replicates: Replicates | None, objective: Objective, slope: FloatArray) -> list[float]:
    """Standard uncertainties from the noise of flyer and curve; none without replicates."""
    if replicates is None:
        return []
    vectors = objective.vectors(replicates.prediction)
    moves = np.nan_to_num(vectors - vectors[0]) @ objective.gain(slope).T
    rows = (replicates.flyer, replicates.curve)
    return [float(replicate_uncertainty(moves[which])[0]) for which in rows if which.any()]


def _declared_sigmas(
    problem: InverseProblem, held: HeldSearch, fine: RefinedOptimum, objective: Objective, slope: FloatArray
) -> list[float]:
    """Standard uncertainties from what the shot declares of the held parameters."""
    declared, names = problem.shot.uncertainty, problem.box.names
    others = fine.jacobian[_entries_of(fine.objective, objective.counted)]
    gain = objective.gain(slope)[0]
    return [
        abs(float(gain @ others[:, names.index(name)])) * declared[name]
        for name in held.values
        if declared.get(name, 0.0) > 0.0
    ]


def _mean_squares(objective: Objective, vector: FloatArray, prefix: str) -> dict[str, float]:
    """Mean square of the residuals over the noise, of force and outline."""
    square = ((vector - objective.data) / objective.noise) ** 2
    force, shape = square[: objective.n_force], square[objective.n_force :]
    return {
        f"{prefix}chi2_force": float(force.mean()),
        f"{prefix}chi2_shape": float(shape.mean()) if shape.size else float("nan"),
    }
