"""The optimum on the refined mesh: run there until a run leaves it where it is.

A run on the refined mesh differs from the surrogate's by the mesh's error, which changes slowly with the
parameters. With one parameter the surrogate is corrected to agree with the runs, exactly at the last one
and in its slope between the last two (Broyden's update). With several, a difference along one direction
says nothing of the others, and the corrected optimum may lie where the surrogate was not refined: only the
shift is carried over, and the surrogate is refined again about the optimum that it leads to.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import Box, from_points
from kolsky.coarse import Coarse, refined_about
from kolsky.objective import Objective
from kolsky.optimum import CorrectedSurrogate, Model, jacobian, search
from kolsky.stages import Runs, Stages

FloatArray = NDArray[np.float64]

CONFIRMED = 0.2
"""An optimum is confirmed when the check run moves it by less than this share of the residuals' sigma."""
MOST_CHECKS = 6
"""Most rounds on the refined mesh."""
COMPANION = 0.05
"""Distance of the first check's companion run over the second design's edge."""


@dataclass(frozen=True)
class Refined:
    """The optimum on the refined mesh, confirmed or not by its last run."""

    x: FloatArray
    """The point of the last run, shape [d]."""
    objective: Objective
    """With the discrepancies of the optimum."""
    model: Model
    """The surrogate, corrected by the last run."""
    jacobian: FloatArray
    """Of the model at the optimum, shape [k, d]."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals, shape [d]."""
    check: Runs
    """The last run."""
    moved: float
    """How far it moved the optimum, in units of sigma."""
    missed: FloatArray
    """The last run minus what the surrogate had foretold for it, shape [k]."""


def check_refined(stages: Stages, coarse: Coarse) -> tuple[Refined, Coarse]:
    """Stage 3 of `kolsky.identify.identify`, and the surrogate in the end.

    Raises
    ------
    ValueError
        If a run on the refined mesh does not complete.
    """
    return _one(stages, coarse) if stages.box.dimension == 1 else _several(stages, coarse)


def _one(stages: Stages, coarse: Coarse) -> tuple[Refined, Coarse]:
    model, objective, optimum = CorrectedSurrogate(coarse.surrogate), coarse.objective, coarse.x
    wave = np.stack([optimum, _beside(optimum, coarse.box, stages.box)])
    for _ in range(MOST_CHECKS):
        check = _run(stages, wave)
        vectors = objective.vectors(check.prediction)
        missed = vectors[0] - model.predict(optimum)[0]
        for point, vector in zip(check.points[::-1], vectors[::-1], strict=True):
            model = model.through(point, vector)
        found, best = _judged(coarse, objective, model, optimum, check, missed)
        objective = found.objective
        if found.moved <= CONFIRMED and len(wave) == 1:
            break
        optimum, wave = best, best[None]
    return found, coarse


def _several(stages: Stages, coarse: Coarse) -> tuple[Refined, Coarse]:
    optimum, shift = coarse.x, 0.0
    for number in range(MOST_CHECKS):
        check = _run(stages, optimum[None])
        vector = coarse.objective.vectors(check.prediction)[0]
        missed = vector - coarse.surrogate.predict(optimum[None], extrapolate=True)[0] - shift
        model = CorrectedSurrogate(coarse.surrogate).through(optimum, vector)
        found, best = _judged(coarse, coarse.objective, model, optimum, check, missed)
        if found.moved <= CONFIRMED or number == MOST_CHECKS - 1:
            break
        coarse = refined_about(stages, coarse, best, model.shift)
        again = coarse.objective.vectors(check.prediction)[0]
        shift = again - coarse.surrogate.predict(optimum[None], extrapolate=True)[0]
        optimum = coarse.x
    return found, coarse


def _judged(
    coarse: Coarse,
    objective: Objective,
    model: CorrectedSurrogate,
    optimum: FloatArray,
    check: Runs,
    missed: FloatArray,
) -> tuple[Refined, FloatArray]:
    """What a run at `optimum` leaves of it, and where it should be instead."""
    start = np.clip(optimum, coarse.box.lower, coarse.box.upper)
    best = search(coarse.box, objective, model.predict, start=start if len(start) > 1 else None)
    slope = jacobian(model.predict, coarse.box, best.x)
    sigma = np.sqrt(np.diag(best.objective.covariance(slope, model.predict(best.x)[0])))
    moved = float(np.max(np.abs(best.x - optimum) / sigma))
    return Refined(optimum, best.objective, model.predict, slope, sigma, check, moved, missed), best.x


def _run(stages: Stages, points: FloatArray) -> Runs:
    numerics = stages.settings.numerics.with_mesh(stages.settings.refined_mesh)
    check = stages.simulate("check", from_points(stages.box, points), numerics, all_nodes=True)
    if len(check.points) < len(points):
        raise ValueError(f"the check needs every run on the refined mesh to complete: {check.lost}")
    return check


def _beside(x: FloatArray, box: Box, whole: Box) -> FloatArray:
    """A companion of the first check: their difference corrects the surrogate's slope.

    It lies below, because a coarse mesh is too soft and its optimum too high (verification manual).
    """
    step = COMPANION * (box.upper[0] - box.lower[0])
    down = min(step, x[0] - whole.lower[0])
    beside = x.copy()
    beside[0] -= down if down > 0.0 else -step
    return beside
