"""The search for the optimum, from the choice of the free parameters to the refined mesh.

The optimum of a specimen that keeps its hold is moved to the refined mesh by Gauss-Newton steps
(`kolsky.inverse.gauss_newton`), after the front face's path has been followed on the surrogate's mesh
(`kolsky.inverse.surrogate_mesh_search`). Where a surface slides a quadratic through many runs averages its
jumps (`kolsky.inverse.quadratic_fit`), and where one lets go single runs move one parameter
(`kolsky.inverse.refined_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import explicit
from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, search_coarse
from kolsky.inverse.compiled import compile_for, other_element
from kolsky.inverse.estimates import paper_route
from kolsky.inverse.free_parameters import Freed, choose, rough
from kolsky.inverse.front_noise import weigh_front_noise
from kolsky.inverse.gauss_newton import Beside, search_by_gauss_newton
from kolsky.inverse.idle_core import IdleCore
from kolsky.inverse.optimum import on_edge
from kolsky.inverse.parameters import MOVED, PARAMETERS, design_box
from kolsky.inverse.prepared_shot import PreparedShot
from kolsky.inverse.quadratic_fit import search_by_quadratic
from kolsky.inverse.refined_search import RefinedOptimum, search_by_single_runs, slides
from kolsky.inverse.result import Route
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.settings import Settings
from kolsky.inverse.staged_runs import Progress, StagedRuns
from kolsky.inverse.surrogate_mesh_search import search_meshes, search_meshes_for_one
from kolsky.shot.records import Shot

SEEN = 4.0
"""A parameter whose standard deviation times this is wider than its design is not told by the data."""


@dataclass(frozen=True)
class HeldSearch:
    """The search for the stiffness factor alone, everything else as the shot declares it."""

    values: Mapping[str, float]
    """The values that were held and are free otherwise, in SI."""
    stages: StagedRuns
    """Its simulations on the surrogate's mesh."""
    coarse: CoarseOptimum
    """Its optimum there."""
    refined: Beside | None = None
    """The run at its counterpart on the refined mesh; None if there is none."""


@dataclass(frozen=True)
class Search:
    """Result of the search."""

    freed: Freed
    """What was free in the end, and why the rest was not."""
    stages: StagedRuns
    """Its simulations."""
    coarse: CoarseOptimum
    """The optimum on the surrogate's mesh."""
    fine: RefinedOptimum
    """The optimum on the refined mesh."""
    held: HeldSearch | None = None
    """What the stiffness factor alone would have given; None where it was alone."""
    designs: RunTable | None = None
    """The runs of designs over the whole range, which the paper's cost is told by; None if all runs are."""

    def paper_route(self) -> Route:
        """The optimum of the paper's cost; as in the paper all but the stiffness is held, if it was tried."""
        if self.held is None:
            return paper_route(self.stages.box, self.designs or self.stages.table)
        return paper_route(self.held.stages.box, self.held.stages.table, self.held.values)


def search_shot(
    prepared: PreparedShot,
    settings: Settings,
    progress: Progress,
    *,
    meanwhile: Sequence[Callable[[], object]] = (),
) -> Search:
    """Find the optimum on the refined mesh; hold by default what the data turn out not to tell.

    Parameters
    ----------
    prepared
        The shot.
    settings
        As the user gave them.
    progress
        Called with stage, runs done, runs in the stage.
    meanwhile
        What to load while a lone run leaves a core idle, see `kolsky.inverse.idle_core.IdleCore`.

    Raises
    ------
    ValueError
        If a parameter is unknown, a bound outside its range, or too few runs complete.
    """
    shot = prepared.forward.shot
    freed = choose(settings, shot)
    while True:
        stages = StagedRuns(
            prepared, freed.settings, design_box(freed.free), progress, prior=freed.prior(shot)
        )
        compile_for(stages)
        load = partial(_load_other_element, stages)
        if meanwhile:
            stages.idle_core = IdleCore([*meanwhile, load])
        else:  # so short a work leaves the first lone run room for the runs that are put off
            stages.idle_core.put_off(load)
        if rough(shot, [*freed.free, *freed.settings.held]):
            coarse = search_coarse(stages)
            replicates = stages.replicate(coarse.x)() if settings.replicates else None
            coarse = weigh_front_noise(stages, coarse, replicates)
            alone = stages.box.dimension == 1 and not slides(stages)
            fine = search_by_single_runs(stages, coarse) if alone else search_by_quadratic(stages, coarse)
            return Search(freed, stages, coarse, fine)
        if stages.box.dimension == 1:
            return _one(freed, stages)
        found = _several(freed, stages)
        if isinstance(found, Search):
            return found
        freed = freed.holding(found)


def _load_other_element(stages: StagedRuns) -> None:
    """Load the time loop of the other element, which the mesh's error is told by."""
    explicit.load_time_loop(other_element(stages), device=stages.settings.numerics.device)


def _one(freed: Freed, stages: StagedRuns) -> Search:
    """One smooth parameter: like several, its first optimum from designs over the whole range."""
    wide = search_coarse(stages)
    designs = RunTable(stages.box.names)
    designs.take(stages.table, {})
    coarse, fine, _ = search_by_gauss_newton(stages, search_meshes_for_one(stages, wide))
    return Search(freed, stages, coarse, fine, designs=designs)


def _several(freed: Freed, stages: StagedRuns) -> Search | dict[str, str]:
    """Several smooth parameters; or, by default, why some of them must be held."""
    box = stages.box
    held = search_held(stages) if MOVED in box.names else None
    start = _declared(stages.prepared.forward.shot, box)
    if held is not None:
        start[box.names.index(MOVED)] = held.coarse.x[0]
    optima = search_meshes(stages, np.clip(start, box.lower, box.upper))
    coarse = optima[stages.settings.numerics.mesh]
    lost = untold(box, coarse.x, coarse.sigma)
    if freed.by_default and lost:
        return lost
    found = search_by_gauss_newton(stages, optima, None if held is None else start)
    lost = untold(box, found[1].x, found[1].sigma)
    if freed.by_default and lost:
        return lost
    if held is not None:
        stages.table.take(held.stages.table, held.values)
        held = replace(held, refined=found[2])
    return Search(freed, stages, found[0], found[1], held)


def search_held(stages: StagedRuns) -> HeldSearch:
    """The stiffness factor alone on the surrogate's mesh, the other free parameters at the shot's values."""
    settings, shot, i = stages.settings, stages.prepared.forward.shot, stages.box.names.index(MOVED)
    box = Box.of({MOVED: (stages.box.lower[i], stages.box.upper[i])})
    alone = StagedRuns(stages.prepared, settings, box, stages.progress)
    alone.seconds = stages.seconds
    values = {name: PARAMETERS[name].held(shot) for name in stages.box.names if name != MOVED}
    return HeldSearch(values, alone, search_coarse(alone))


def untold(box: Box, x: FloatArray, sigma: FloatArray) -> dict[str, str]:
    """Why the data do not tell a parameter other than the stiffness factor, by name; empty if they do.

    Parameters
    ----------
    box
        The range of the design.
    x, sigma
        The optimum and its standard deviation, shape [d].
    """
    found, edge = {}, on_edge(x, box)
    for i, name in enumerate(box.names):
        if name == MOVED:
            continue
        if not SEEN * sigma[i] <= box.upper[i] - box.lower[i]:
            found[name] = "held because the data do not tell it"
        elif edge[i]:
            found[name] = f"held because its optimum lies at the bound {x[i]:.5g} of its design"
    return found


def _declared(shot: Shot, box: Box) -> FloatArray:
    return np.array([PARAMETERS[name].held(shot) for name in box.names])
