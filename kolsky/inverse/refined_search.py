"""The optimum of one parameter on the refined mesh: run there until a run leaves it where it is.

A run on the refined mesh differs from the surrogate's by the mesh's error, which changes slowly with the
parameter. The surrogate is corrected to agree with the runs, exactly at the last one and in its slope
between the last two (Broyden's update). With several parameters a difference along one direction says
nothing of the others, and where a surface slides a single run is no measure: see
`kolsky.inverse.quadratic_fit`.
"""

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import Coarse
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import CorrectedSurrogate, jacobian, leaves, search
from kolsky.inverse.quadratic_fit import averaged
from kolsky.inverse.refined_runs import CONFIRMED, Refined, run_refined, slides
from kolsky.inverse.stages import Runs, Stages

MOST_CHECKS = 6
"""Most rounds on the refined mesh."""
COMPANION = 0.05
"""Distance of the first check's companion run over the second design's edge."""


def check_refined(stages: Stages, coarse: Coarse) -> Refined:
    """Stage 3 of `kolsky.identification.identify`.

    Raises
    ------
    ValueError
        If a run on the refined mesh does not complete.
    """
    alone = stages.box.dimension == 1 and not slides(stages)
    return _one(stages, coarse) if alone else averaged(stages, coarse)


def _one(stages: Stages, coarse: Coarse) -> Refined:
    model, objective, optimum = CorrectedSurrogate(coarse.surrogate), coarse.objective, coarse.x
    # A scale is one number, which nothing averages: of two slopes of the model, that between two runs on the
    # refined mesh and that of the last design, the one with the larger shift counts.
    wide = jacobian(model.predict, coarse.box, optimum)
    wave = np.stack([optimum, _beside(optimum, coarse.box, stages.box)])
    for _ in range(MOST_CHECKS):
        check = run_refined(stages, wave)
        vectors = objective.vectors(check.prediction)
        missed = vectors[0] - model.predict(optimum)[0]
        for point, vector in zip(check.points[::-1], vectors[::-1], strict=True):
            model = model.through(point, vector)
        found, best = _judged(stages, coarse, objective, model, optimum, check, missed, wide)
        objective = found.objective
        if found.moved <= CONFIRMED and len(wave) == 1:
            break
        optimum, wave = best, best[None]
    return found


def _judged(
    stages: Stages,
    coarse: Coarse,
    objective: Objective,
    model: CorrectedSurrogate,
    optimum: FloatArray,
    check: Runs,
    missed: FloatArray,
    wide: FloatArray,
) -> tuple[Refined, FloatArray]:
    """What a run at `optimum` leaves of it, and where it should be instead."""
    best = search(coarse.box, objective, model.predict)
    slope = jacobian(model.predict, coarse.box, best.x)
    sigma = np.sqrt(np.diag(best.objective.covariance(slope, model.predict(best.x)[0])))
    moved = float(np.max(np.abs(best.x - optimum) / sigma))
    found = Refined(
        x=optimum,
        box=coarse.box,
        objective=best.objective,
        model=model.predict,
        surrogate=CorrectedSurrogate(coarse.surrogate).predict,
        jacobian=slope,
        slopes=(slope, wide),
        sigma=sigma,
        check=check,
        moved=moved,
        confirmed=moved <= CONFIRMED and not leaves(optimum, coarse.box, stages.box),
        missed=missed,
        mesh_shift=optimum - coarse.x,
    )
    return found, best.x


def _beside(x: FloatArray, box: Box, whole: Box) -> FloatArray:
    """A companion of the first check: their difference corrects the surrogate's slope.

    It lies below, because a coarse mesh is too soft and its optimum too high (verification manual).
    """
    step = COMPANION * (box.upper[0] - box.lower[0])
    down = min(step, x[0] - whole.lower[0])
    beside = x.copy()
    beside[0] -= down if down > 0.0 else -step
    return beside
