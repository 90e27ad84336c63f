"""The search for the optimum, from the choice of the free parameters to the refined mesh.

The optimum of a specimen that keeps its hold is moved to the refined mesh by Gauss-Newton steps
(`kolsky.inverse.gauss_newton`), after the front face's path has been followed on the surrogate's mesh
(`kolsky.inverse.surrogate_mesh_search`). Where a surface slides or lets go, a quadratic through many runs
averages its jumps (`kolsky.inverse.refined_search`).

`held_answer` gives the stiffness factor with the other free parameters held at the shot's values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from doe import Box
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.coarse_search import (
    CoarseOptimum,
    CorrectedSurrogate,
    jacobian,
    on_edge,
    replicate_uncertainty,
    search_coarse,
    weigh_front_noise,
)
from kolsky.inverse.estimates import paper_route
from kolsky.inverse.gauss_newton import ExtraRun, linear_step, search_by_gauss_newton
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED, PARAMETERS, design_box
from kolsky.inverse.problem import Freed, PreparedShot, Settings, choose, rough
from kolsky.inverse.refined_search import RefinedOptimum, search_by_quadratic
from kolsky.inverse.result import Estimate, HeldAnswer, Route
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.staged_runs import StagedRuns, compile_for
from kolsky.inverse.surrogate_mesh_search import search_meshes, search_meshes_for_one
from kolsky.inverse.work import Work
from kolsky.shot.records import Shot

LEAST_RESOLUTION = 4.0
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
    refined: ExtraRun | None = None
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
    valley_margin: float = np.inf
    """By how much -2 ln L of the next valley of Poisson's ratio lies above this one [-]."""

    def paper_route(self) -> Route:
        """The optimum of the paper's cost; as in the paper all but the stiffness is held, if it was tried."""
        if self.held is None:
            return paper_route(self.stages.box, self.designs or self.stages.table)
        return paper_route(self.held.stages.box, self.held.stages.table, self.held.values)


def search_shot(prepared: PreparedShot, settings: Settings, work: Work) -> Search:
    """Find the optimum on the refined mesh; hold by default what the data turn out not to tell.

    Parameters
    ----------
    prepared
        The shot.
    settings
        As the user gave them.
    work
        Is told of the stages.

    Raises
    ------
    ValueError
        If a parameter is unknown, a bound outside its range, or too few runs complete.
    """
    shot = prepared.forward.shot
    freed = choose(settings, shot)
    while True:
        stages = StagedRuns(prepared, freed.settings, design_box(freed.free), work, prior=freed.prior(shot))
        compile_for(stages)
        if rough(shot, [*freed.free, *freed.settings.held]):
            coarse = search_coarse(stages)
            replicates = stages.replicate(coarse.x)() if settings.replicates else None
            coarse = weigh_front_noise(stages, coarse, replicates)
            return Search(freed, stages, coarse, search_by_quadratic(stages, coarse))
        if stages.box.dimension == 1:
            return _search_one(freed, stages)
        found = _search_several(freed, stages)
        if isinstance(found, Search):
            return found
        freed = freed.holding(found)


def _search_one(freed: Freed, stages: StagedRuns) -> Search:
    """One smooth parameter: like several, its first optimum from designs over the whole range."""
    wide = search_coarse(stages)
    designs = RunTable(stages.box.names)
    designs.take(stages.table, {})
    coarse, fine, _ = search_by_gauss_newton(stages, search_meshes_for_one(stages, wide))
    return Search(freed, stages, coarse, fine, designs=designs)


def _search_several(freed: Freed, stages: StagedRuns) -> Search | dict[str, str]:
    """Several smooth parameters; or, by default, why some of them must be held."""
    box = stages.box
    held = _search_held(stages) if MOVED in box.names else None
    start = _declared_values(stages.prepared.forward.shot, box)
    if held is not None:
        start[box.names.index(MOVED)] = held.coarse.x[0]
    optima, margin = search_meshes(stages, np.clip(start, box.lower, box.upper))
    coarse = optima[stages.settings.numerics.mesh]
    lost = not_identifiable(box, coarse.x, coarse.sigma)
    if freed.by_default and lost:
        return lost
    found = search_by_gauss_newton(stages, optima, None if held is None else start)
    lost = not_identifiable(box, found[1].x, found[1].sigma)
    if freed.by_default and lost:
        return lost
    if held is not None:
        stages.table.take(held.stages.table, held.values)
        held = replace(held, refined=found[2])
    return Search(freed, stages, found[0], found[1], held, valley_margin=margin)


def _search_held(stages: StagedRuns) -> HeldSearch:
    """The stiffness factor alone on the surrogate's mesh, the other free parameters at the shot's values."""
    settings, shot, i = stages.settings, stages.prepared.forward.shot, stages.box.names.index(MOVED)
    box = Box.of({MOVED: (stages.box.lower[i], stages.box.upper[i])})
    alone = StagedRuns(stages.prepared, settings, box, stages.work)
    values = {name: PARAMETERS[name].held(shot) for name in stages.box.names if name != MOVED}
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


def _declared_values(shot: Shot, box: Box) -> FloatArray:
    return np.array([PARAMETERS[name].held(shot) for name in box.names])


def held_answer(found: Search, estimate: Estimate) -> HeldAnswer | None:
    """The stiffness factor of one run with the others held, and a step from there; None if there is no run.

    Parameters
    ----------
    found
        The search; its stages have run the replicates.
    estimate
        The stiffness factor with all of them free: the mesh's correction and the share of the numerics are
        taken from it.
    """
    held, fine = found.held, found.fine
    if held is None or held.refined is None:
        return None
    prediction = held.refined.prediction
    counted = fine.objective.counted & held.coarse.objective.counted & prediction.inside[0]
    objective = Objective(found.stages.observations, counted, slowly=True)
    vector = objective.vectors(prediction)[0]
    i = found.stages.box.names.index(MOVED)
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
        *_noise_sigmas(found.stages, objective, slope),
        *_declared_sigmas(found.stages, held, fine, objective, slope),
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


def _noise_sigmas(stages: StagedRuns, objective: Objective, slope: FloatArray) -> list[float]:
    """Standard uncertainties from the noise of flyer and curve; none without replicates."""
    if stages.replicates is None:
        return []
    vectors = objective.vectors(stages.replicates.prediction)
    moves = np.nan_to_num(vectors - vectors[0]) @ objective.gain(slope).T
    rows = (stages.replicates.flyer, stages.replicates.curve)
    return [float(replicate_uncertainty(moves[which])[0]) for which in rows if which.any()]


def _declared_sigmas(
    stages: StagedRuns, held: HeldSearch, fine: RefinedOptimum, objective: Objective, slope: FloatArray
) -> list[float]:
    """Standard uncertainties from what the shot declares of the held parameters."""
    declared, names = stages.prepared.forward.shot.uncertainty, stages.box.names
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
