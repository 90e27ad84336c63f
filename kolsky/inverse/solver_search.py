"""The same optimum by other searches than the answer's: least squares on the solver itself."""

from dataclasses import replace

import numpy as np

from doe import Box, latin_hypercube
from doe.least_squares import LeastSquaresResult, least_squares
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.method_comparison import LEAST_SQUARES, SIMPLEX, Method
from kolsky.inverse.objective import Objective
from kolsky.inverse.result import Estimate, Identification
from kolsky.inverse.staged_runs import StagedRuns

STARTS = 3
"""Searches on the surrogate's mesh, from points that a Latin hypercube spreads over the box."""
ANSWER_STAGES = ("design", "refinement", "check")
"""The stages whose runs the answer rests on."""


def add_method_comparison(result: Identification, stages: StagedRuns, objective: Objective) -> Identification:
    """The result with what its own search and, if asked for, least squares on the solver find.

    Parameters
    ----------
    result
        The finished identification; methods it has already follow.
    stages
        Its simulations.
    objective
        Which outline points count; the discrepancies are estimated afresh.
    """
    routes = {route.name: {p: route.on_mesh(p) for p in route.parameters} for route in result.routes}
    own = routes.get("joint", routes.get("force only"))
    found = []
    if own is not None:
        last = result.surrogate["check_shift_sigmas"]
        found.append(
            _compared(
                SIMPLEX,
                own,
                result.estimates,
                runs=sum(stage in ANSWER_STAGES for stage in result.design.stage),
                converged=all(e.outcome.confirmed for e in result.estimates.values()),
                ended=f"the last run on the refined mesh moved the optimum by {last:.2g} sigma",
            )
        )
    if stages.settings.methods == "all":
        found.append(_on_the_solver(result, stages, objective))
    return replace(result, methods=(*found, *result.methods), seconds=dict(stages.seconds))


def _on_the_solver(result: Identification, stages: StagedRuns, objective: Objective) -> Method:
    """Several searches on the surrogate's mesh, and one on the refined mesh from where the best one ended."""
    box, numerics = stages.box, stages.settings.numerics
    starts = latin_hypercube(box, STARTS, rng=stages.settings.seed).points
    try:
        coarse = _least_squares(stages, objective, numerics, starts)
        refined = numerics.with_mesh(stages.settings.refined_mesh)
        fine = _least_squares(stages, objective, refined, coarse[0].x[None])[0]
    except ValueError as error:
        unknown = dict.fromkeys(box.names, float("nan"))
        return _compared(LEAST_SQUARES, unknown, result.estimates, runs=0, converged=False, ended=str(error))
    return _compared(
        LEAST_SQUARES,
        box.as_dict(fine.x),
        result.estimates,
        runs=sum(search.runs for search in coarse) + fine.runs,
        converged=fine.converged,
        ended=f"{fine.ended}; {_starts(coarse, box)}",
    )


def _starts(searches: tuple[LeastSquaresResult, ...], box: Box) -> str:
    """The ends of the searches from the other starts in words, in standard deviations of the best."""
    best, *others = searches
    sigma = np.maximum(best.sigma, np.finfo(float).tiny)
    away = [float(np.max(np.abs(other.x - best.x) / sigma)) for other in others]
    if not others or max(away) <= 1.0:
        return f"{len(searches)} starts ended within {max(away, default=0.0):.2g} sigma of each other"
    worse = max(other.deviance - best.deviance for other in others)
    return (
        f"of {len(searches)} starts {sum(a > 1.0 for a in away)} ended elsewhere, by up to {max(away):.2g} "
        f"sigma, where -2 ln L is higher by up to {worse:.2g}"
    )


def _least_squares(
    stages: StagedRuns, objective: Objective, numerics: Numerics, starts: FloatArray
) -> tuple[LeastSquaresResult, ...]:
    def run(points: FloatArray) -> FloatArray:
        rows, prediction = stages.evaluate("least squares", points, numerics)
        vectors = np.full((len(points), len(objective.data)), np.nan)
        if prediction is not None:
            vectors[rows] = objective.vectors(prediction)
        return vectors

    return least_squares(
        run,
        stages.box,
        starts,
        data=objective.data,
        weighting=lambda residual: objective.with_discrepancy(objective.data + residual).whitening(),
    )


def _compared(
    name: str,
    values: dict[str, float],
    estimates: dict[str, Estimate],
    *,
    runs: int,
    converged: bool,
    ended: str,
) -> Method:
    return Method.compared(
        name,
        values,
        answer={p: e.on_mesh for p, e in estimates.items()},
        half_width={p: 2.0 * e.sigma for p, e in estimates.items()},
        runs=runs,
        converged=converged,
        ended=ended,
    )
