"""The optimum on the refined mesh, and the search for it by single runs that correct the surrogate.

A run on the refined mesh differs from the surrogate's by the mesh's error, which changes slowly with the
parameter. The surrogate is corrected to agree with the runs, exactly at the last one and in its slope
between the last two (Broyden's update), until a run leaves the optimum where it is. With several parameters
a difference along one direction says nothing of the others, and where a surface slides a single run is no
measure: then `kolsky.inverse.quadratic_fit` searches.
"""

from dataclasses import dataclass, replace

import numpy as np

from doe import Box, from_points
from explicit.contact import contact_law
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum
from kolsky.inverse.completed_runs import CompletedRuns
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import CorrectedSurrogate, Model, at_inner_face, jacobian, search
from kolsky.inverse.parameters import any_slides
from kolsky.inverse.staged_runs import StagedRuns

CONFIRMED = 0.2
"""An optimum is confirmed when the check run moves it by less than this share of the residuals' sigma."""
ROUGH = 3.0
"""Or by less than so many standard deviations of the response's roughness, which is in the interval."""


MOST_CHECKS = 6
"""Most rounds on the refined mesh."""
COMPANION = 0.05
"""Distance of the first check's companion run over the second design's edge."""


@dataclass(frozen=True)
class RefinedOptimum:
    """The optimum on the refined mesh, confirmed or not by its last run."""

    x: FloatArray
    """The answer, shape [d]; the last run is there."""
    box: Box
    """Where the model holds."""
    objective: Objective
    """With the discrepancies of the optimum."""
    model: Model
    """What the runs on the refined mesh would give."""
    surrogate: Model
    """What `model` was before it was bent to agree with runs on the refined mesh; itself if it never was."""
    jacobian: FloatArray
    """Of the model at the optimum, shape [k, d]."""
    slopes: tuple[FloatArray, ...]
    """Every slope of the model that may be the right one for a common scale, shape [k, d] each."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals, shape [d]."""
    check: CompletedRuns
    """The last run."""
    moved: float
    """How far it moved the optimum, in units of sigma."""
    confirmed: bool
    """Whether that is little."""
    missed: FloatArray
    """The last run minus what the model had predicted for it, shape [k]."""
    mesh_shift: FloatArray
    """Optimum on the refined mesh minus that on the surrogate's, shape [d]."""
    roughness: FloatArray | None = None
    """Standard deviation of the optimum from the response's roughness, shape [d]; None if it is smooth."""
    deviations: FloatArray | None = None
    """What a run deviates from the model, one row a run over the root of the degrees of freedom, so that
    squares of what a map makes of them add up to a variance, shape [n, k]; None if the response is smooth."""
    element_shift: FloatArray | None = None
    """Optimum with the other element minus the answer, shape [d]; None if it was not asked."""


def confirms(move: FloatArray, sigma: FloatArray, roughness: FloatArray | float = 0.0) -> bool:
    """True if the last run moves every parameter of the optimum by little.

    Parameters
    ----------
    move
        By how much it moves the optimum, shape [d].
    sigma
        Standard deviation of the optimum from the residuals, shape [d].
    roughness
        Standard deviation of the optimum from the response's roughness, shape [d].
    """
    little = np.fmax(CONFIRMED * sigma, ROUGH * np.asarray(roughness))
    return bool((np.abs(move) <= little).all())


def run_refined(stages: StagedRuns, points: FloatArray) -> CompletedRuns:
    """Run points on the refined mesh with all nodes; all of them must complete.

    Raises
    ------
    ValueError
        If one does not.
    """
    check = stages.simulate(
        "check", from_points(stages.box, points), refined_numerics(stages), all_nodes=True
    )
    if len(check.points) < len(points):
        raise ValueError(f"the check needs every run on the refined mesh to complete: {check.lost}")
    return check


def refined_numerics(stages: StagedRuns) -> Numerics:
    """The numerical choices of the refined mesh."""
    return stages.settings.numerics.with_mesh(stages.settings.refined_mesh)


def slides(stages: StagedRuns) -> bool:
    """True if a surface slides with friction: as declared, or because a parameter makes it so."""
    settings, interface = stages.settings, stages.prepared.forward.shot.interface
    laws = [contact_law(interface.faces), contact_law(interface.side)]
    return any_slides([*(settings.free or ()), *settings.held]) or any(law.needs_friction for law in laws)


def search_by_single_runs(stages: StagedRuns, coarse: CoarseOptimum) -> RefinedOptimum:
    """Stage 3 of `kolsky.identification.identify` for one parameter where a surface lets go and none slides.

    Raises
    ------
    ValueError
        If a run on the refined mesh does not complete.
    """
    model, optimum = CorrectedSurrogate(coarse.surrogate), coarse.x
    objective = replace(coarse.objective, slowly=True)
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
        if found.confirmed:
            break
        if at_inner_face(best, coarse.box, stages.box):
            # The optimum lies beyond the second design: the next run on the refined mesh judges it there.
            coarse = replace(coarse, box=_wider(coarse.box, stages.box))
            best = search(coarse.box, objective, model.predict).x
        optimum, wave = best, best[None]
    return found


def _judged(
    stages: StagedRuns,
    coarse: CoarseOptimum,
    objective: Objective,
    model: CorrectedSurrogate,
    optimum: FloatArray,
    check: CompletedRuns,
    missed: FloatArray,
    wide: FloatArray,
) -> tuple[RefinedOptimum, FloatArray]:
    """The optimum as a run there judges it, and the point where it should be instead."""
    best = search(coarse.box, objective, model.predict)
    slope = jacobian(model.predict, coarse.box, best.x)
    sigma = np.sqrt(np.diag(best.objective.covariance(slope, model.predict(best.x)[0])))
    moved = float(np.max(np.abs(best.x - optimum) / sigma))
    found = RefinedOptimum(
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
        confirmed=moved <= CONFIRMED and not at_inner_face(optimum, coarse.box, stages.box),
        missed=missed,
        mesh_shift=optimum - coarse.x,
    )
    return found, best.x


def _wider(box: Box, whole: Box) -> Box:
    """The box with half its edges more on every side, inside the whole one."""
    low, high = np.array(box.lower), np.array(box.upper)
    more = 0.5 * (high - low)
    lower, upper = np.maximum(low - more, whole.lower), np.minimum(high + more, whole.upper)
    return replace(box, lower=tuple(lower.tolist()), upper=tuple(upper.tolist()))


def _beside(x: FloatArray, box: Box, whole: Box) -> FloatArray:
    """A companion of the first check: their difference corrects the surrogate's slope.

    It lies below, because a coarse mesh is too soft and its optimum too high (verification manual).
    """
    step = COMPANION * (box.upper[0] - box.lower[0])
    down = min(step, x[0] - whole.lower[0])
    beside = x.copy()
    beside[0] -= down if down > 0.0 else -step
    return beside
