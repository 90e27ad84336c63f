"""The search for the optimum, from the choice of the free parameters to the refined mesh.

If the specimen sticks to the platens, the front face's path is first corrected on the surrogate's mesh
(`kolsky.inverse.surrogate_mesh_search`). Gauss-Newton steps then move the optimum to the refined mesh
(`kolsky.inverse.gauss_newton`). If a surface slides or lets go, a quadratic through many runs averages its
jumps (`kolsky.inverse.refined_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from doe import Box
from doe.surrogates import SurrogateError
from explicit import Response
from kolsky.base.apparatus import INCOMPRESSIBLE
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import (
    CoarseOptimum,
    front_with_noise,
    on_edge,
    search_coarse,
    weigh_front_noise,
)
from kolsky.inverse.estimates import paper_route
from kolsky.inverse.gauss_newton import search_by_gauss_newton
from kolsky.inverse.incompressible import AT_LIMIT, COUNTED, NEAR_LIMIT, is_distinguished, rise_at_limit
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.problem import InverseProblem, rough
from kolsky.inverse.refined_search import RefinedOptimum, search_by_quadratic
from kolsky.inverse.result import Route
from kolsky.inverse.run_table import Replicates, RunTable
from kolsky.inverse.runner import Runner, compile_for
from kolsky.inverse.surrogate_mesh_search import search_meshes, search_meshes_for_one
from kolsky.inverse.valleys import VALLEY
from kolsky.inverse.work import Work

LEAST_RESOLUTION = 4.0
"""The data do not constrain a parameter if its standard deviation times this exceeds its range."""


@dataclass(frozen=True)
class HeldSearch:
    """The search for the stiffness factor alone, with all other parameters at the shot's values."""

    values: Mapping[str, float]
    """Held values of the parameters that are free in the full search, in SI."""
    runner: Runner
    coarse: CoarseOptimum


@dataclass(frozen=True)
class Search:
    """Result of the search."""

    runner: Runner
    """Runs points of the final free parameters, with the path of the optimum."""
    coarse: CoarseOptimum
    fine: RefinedOptimum
    replication: Callable[[], Replicates] | None = None
    """Gives the runs with other motions and curves; None if not requested."""
    held: HeldSearch | None = None
    """Result with the stiffness factor as the only free parameter. None if that is the full search."""
    designs: RunTable | None = None
    """The runs of designs over the whole range, used for the paper's cost; None if all runs are used."""
    valley_margin: float = np.inf
    """-2 ln L of the next valley (of the limit of nu, `COUNTED` of its rise) minus that of this one [-]."""
    valley: float = np.inf
    """Poisson's ratio of the deepest valley [-]; infinite if the ratio was not held at the limit instead."""
    limit_rise: float = np.inf
    """See `kolsky.inverse.incompressible.rise_at_limit`; infinite if the limit was not compared."""

    @property
    def problem(self) -> InverseProblem:
        """The problem with the final free parameters."""
        return self.runner.problem

    @property
    def replicates(self) -> Replicates | None:
        """The runs with other motions and curves."""
        return None if self.replication is None else self.replication()

    def held_run(self) -> tuple[FloatArray, Response] | None:
        """The optimum of the stiffness factor alone on the refined mesh, [d], and its run, if any."""
        if self.held is None:
            return None
        runner, i = self.runner, self.problem.box.names.index(MOVED)
        x = self.problem.declared
        x[i] = self.held.coarse.x[0] - runner.offset(self.problem.numerics.mesh)[i]
        response = runner.respond("check", x[None], self.problem.refined)
        return (x, response) if response.outcomes[0].ok else None

    def paper_route(self) -> Route | None:
        """The optimum of the paper's cost, of the stiffness-only search if one was made.

        None if no surrogate can be fitted to that cost: this comparison must not stop an identification.
        """
        try:
            if self.held is None:
                return paper_route(self.problem.box, self.designs or self.runner.table)
            return paper_route(self.held.runner.problem.box, self.held.runner.table, self.held.values)
        except SurrogateError:
            return None


def search_shot(problem: InverseProblem, work: Work) -> Search:
    """Find the optimum on the refined mesh; parameters that the data do not constrain are held by default."""
    valley = rise = np.inf
    while True:
        compile_for(problem, work)
        runner = Runner.of(problem, work)
        if rough(problem.shot, [*problem.freed.free, *problem.settings.held]):
            return _search_rough(runner)
        search = _search_one(runner) if problem.box.dimension == 1 else _search_several(runner)
        if isinstance(search, Search):
            return replace(search, valley=valley, limit_rise=min(search.limit_rise, rise))
        limit = {}
        if search.reasons.get(VALLEY) == AT_LIMIT:
            limit = {VALLEY: INCOMPRESSIBLE}
            valley, rise = float(search.x[problem.box.names.index(VALLEY)]), search.limit_rise
        problem = problem.holding(search.reasons, limit)


def _search_rough(runner: Runner) -> Search:
    """Search the parameters of a surface that slides or lets go."""
    coarse = search_coarse(runner)
    designs = _designs_so_far(runner)
    replication = runner.replicate(coarse.x) if runner.problem.settings.replicates else None
    runner = runner.under(front_with_noise(runner, None if replication is None else replication()))
    coarse = weigh_front_noise(coarse, runner.front)
    return Search(runner, coarse, search_by_quadratic(runner, coarse), replication, designs=designs)


def _search_one(runner: Runner) -> Search:
    """Search one smooth parameter as several, but with a first optimum from designs over the whole range."""
    wide = search_coarse(runner)
    designs = _designs_so_far(runner)
    meshes = search_meshes_for_one(runner, wide)
    coarse, fine = search_by_gauss_newton(runner.under(meshes.front), meshes.optima)
    return Search(runner.under(fine.front, fine.offsets), coarse, fine, meshes.replicates, designs=designs)


def _designs_so_far(runner: Runner) -> RunTable:
    """The runs of designs over the whole range. Those on the refined mesh are too close to each other."""
    designs = RunTable(runner.problem.box.names)
    designs.take(runner.table, {})
    return designs


@dataclass(frozen=True)
class NotIdentifiable:
    """Parameters that must be held."""

    reasons: dict[str, str]
    x: FloatArray
    """The optimum with all of them free, shape [d]."""
    limit_rise: float
    """See `Search`."""


def _search_several(runner: Runner) -> Search | NotIdentifiable:
    """Search several smooth parameters, or return those that must be held (by default)."""
    problem = runner.problem
    box, by_default = problem.box, problem.freed.by_default
    held = _search_held(runner) if MOVED in box.names else None
    start = problem.declared
    if held is not None:
        start[box.names.index(MOVED)] = held.coarse.x[0]
    meshes = search_meshes(runner, np.clip(start, box.lower, box.upper))
    coarse = meshes.optima[problem.numerics.mesh]
    lost = not_identifiable(box, coarse.x, coarse.least_sigma)
    rise = rise_at_limit(runner, coarse.x, meshes.front.noise.patterns)
    if not is_distinguished(rise) and coarse.x[box.names.index(VALLEY)] >= NEAR_LIMIT:
        lost[VALLEY] = AT_LIMIT
    if by_default and lost:
        return NotIdentifiable(lost, coarse.x, rise)
    runner = runner.under(meshes.front)
    optimum, fine = search_by_gauss_newton(runner, meshes.optima)
    lost = not_identifiable(box, fine.x, fine.sigma)
    if by_default and lost:
        return NotIdentifiable(lost, fine.x, rise)
    if held is not None:
        runner.table.take(held.runner.table, held.values)
    runner = runner.under(fine.front, fine.offsets)
    margin = min(meshes.valley_margin, COUNTED * rise)
    return Search(runner, optimum, fine, meshes.replicates, held, valley_margin=margin, limit_rise=rise)


def _search_held(runner: Runner) -> HeldSearch:
    """The search of the stiffness factor on the surrogate's mesh. The others keep the shot's values."""
    problem = runner.problem
    values = {name: PARAMETERS[name].held(problem.shot) for name in problem.box.names if name != MOVED}
    alone = Runner.of(problem.of_one(MOVED), runner.work)
    return HeldSearch(values, alone, search_coarse(alone))


def not_identifiable(box: Box, x: FloatArray, sigma: FloatArray) -> dict[str, str]:
    """Parameters that the data do not constrain, with the reason. The stiffness factor is never listed."""
    found, edge = {}, on_edge(x, box)
    for i, name in enumerate(box.names):
        if name == MOVED:
            continue
        if not LEAST_RESOLUTION * sigma[i] <= box.upper[i] - box.lower[i]:
            found[name] = "held because the data do not constrain it"
        elif edge[i]:
            found[name] = f"held because its optimum lies at the bound {x[i]:.5g} of its design"
    return found
