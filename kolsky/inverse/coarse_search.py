"""The optimum on the surrogate's mesh: a design over the whole box, then more runs where they matter.

With one parameter a second design of seven levels about the first optimum is as good as anything, and one
batch. With several a design fine enough everywhere would be too large, and the runs are placed one small
batch after the other (`doe.refine`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import SURROGATES, Box, Surrogate, from_points
from doe.refine import Refinement, refine
from doe.surrogates import ProcessSurrogate, ResponseSurrogate, SurrogateError, SurrogateKind
from doe.surrogates.quality import Fitness, fitness
from kolsky.base.arrays import FloatArray
from kolsky.inverse.completed_runs import CompletedRuns
from kolsky.inverse.method_comparison import AGREEMENT
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.optimum import CorrectedSurrogate, at_inner_face, jacobian, search
from kolsky.inverse.staged_runs import StagedRuns

SMOOTH, ROUGH = "response", "process"
"""Surrogates, by their names in `doe.SURROGATES`: for one free parameter, and for several in a small box
about a smooth response's optimum; and for several in a wide box or of a rough response, where a direction
matters little and a kernel that is the same in all of them wastes its runs."""
LOCAL_FRACTION = 0.05
"""Edge of the second design's box over the first one's."""
MOST_REFINEMENTS = 3
"""Most second designs, each around the optimum of the last one."""
MOST_ROUNDS = 10
"""Most batches of adaptive refinement."""
ON_THE_WAY = 1e-4
"""Tolerance of the searches between two batches, in the unit box."""


@dataclass(frozen=True)
class CoarseOptimum:
    """The optimum on the surrogate's mesh."""

    box: Box
    """Where the surrogate was refined."""
    surrogate: Surrogate
    """Of the data vector."""
    objective: Objective
    """With the discrepancies of the optimum."""
    x: FloatArray
    """The optimum, shape [d]."""


def surrogate_kind(box: Box, *, smooth: bool = False) -> SurrogateKind:
    """The surrogate for a number of free parameters, from the registry.

    Parameters
    ----------
    box
        Where it shall hold.
    smooth
        Whether the response is smooth there and the box of the optimum's size.
    """
    return SURROGATES[SMOOTH if smooth or box.dimension == 1 else ROUGH]


def search_coarse(stages: StagedRuns) -> CoarseOptimum:
    """Stages 1 and 2 of `kolsky.identification.identify`.

    Raises
    ------
    ValueError
        If the runs that completed do not carry a surrogate.
    """
    wide = stages.simulate("design", stages.design(stages.box), stages.settings.numerics)
    return second_design(stages, wide) if stages.box.dimension == 1 else adaptive(stages, wide)


def second_design(stages: StagedRuns, wide: CompletedRuns) -> CoarseOptimum:
    """Smaller boxes until the optimum lies inside one."""
    numerics, whole = stages.settings.numerics, stages.box
    objective, surrogate = _fit(stages, whole, wide)
    centre = search(whole, objective, CorrectedSurrogate(surrogate).predict).x
    for _ in range(MOST_REFINEMENTS):
        box = whole.around(centre, LOCAL_FRACTION)
        local = stages.simulate("refinement", stages.design(box), numerics)
        objective, surrogate = _fit(stages, box, local)
        best = search(box, objective, CorrectedSurrogate(surrogate).predict)
        if not at_inner_face(best.x, box, whole):
            break
        centre = best.x
    return CoarseOptimum(box, surrogate, best.objective, best.x)


def _fit(stages: StagedRuns, box: Box, runs: CompletedRuns) -> tuple[Objective, Surrogate]:
    """The objective over the points that every run reaches, and the surrogate of its data vector."""
    objective = Objective(stages.observations, _reached(runs.prediction.inside), prior=stages.prior)
    use = box.contains(runs.points)
    vectors = objective.vectors(runs.prediction)
    try:
        surrogate = surrogate_kind(box).fit(box, runs.points[use], vectors[use], scale=objective.noise)
    except SurrogateError as error:
        raise _no_surrogate(error, runs) from error
    return objective, surrogate


def adaptive(stages: StagedRuns, wide: CompletedRuns) -> CoarseOptimum:
    """Batches of runs about the optimum until it stays."""
    objective = Objective(stages.observations, _reached(wide.prediction.inside), prior=stages.prior)
    try:
        found = _refine(stages, objective)
    except SurrogateError as error:
        raise _no_surrogate(error, wide) from error
    return _settled(stages, found)


def _refine(stages: StagedRuns, objective: Objective) -> Refinement:
    points, prediction = stages.on_surrogate_mesh()
    vectors = objective.vectors(prediction)
    whole = np.isfinite(vectors).all(axis=1)

    def run(points: FloatArray) -> FloatArray:
        done = stages.simulate("refinement", from_points(stages.box, points), stages.settings.numerics)
        vectors = np.full((len(points), len(objective.data)), np.nan)
        vectors[done.rows] = objective.vectors(done.prediction)
        return vectors

    def locate(surrogate: Surrogate, region: Box, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        model = CorrectedSurrogate(surrogate).predict
        best = search(region, objective, model, start=start, tolerance=ON_THE_WAY)
        covariance = best.objective.covariance(jacobian(model, region, best.x), model(best.x)[0])
        return best.x, np.sqrt(np.diag(covariance))

    return refine(
        run,
        stages.box,
        points[whole],
        vectors[whole],
        misfit=objective.deviance,
        locate=locate,
        scale=objective.noise,
        rng=stages.settings.seed,
        max_rounds=MOST_ROUNDS,
    )


def _settled(stages: StagedRuns, found: Refinement) -> CoarseOptimum:
    """The surrogate over the outline points that its own runs reach: more than the first design's."""
    points, prediction = _used(stages, found.surrogate)
    objective = Objective(stages.observations, _reached(prediction.inside), prior=stages.prior)
    surrogate = ProcessSurrogate.fit(
        found.surrogate.box,
        points,
        objective.vectors(prediction),
        scale=objective.noise,
        like=found.surrogate,
    )
    best = search(found.region, objective, CorrectedSurrogate(surrogate).predict, start=found.x)
    return CoarseOptimum(found.region, surrogate, best.objective, best.x)


def fit_for_purpose(stages: StagedRuns, coarse: CoarseOptimum, gain: FloatArray) -> Fitness:
    """Compare the move of the optimum by the surrogate's error with what its interval allows.

    Parameters
    ----------
    stages, coarse
        The simulations and the optimum on their mesh.
    gain
        Linear map from a change of the data vector to the move of the optimum over its half width, [d, k].
    """
    points, prediction = _used(stages, coarse.surrogate)
    vectors = coarse.objective.vectors(prediction)
    scale, box = coarse.objective.noise, coarse.surrogate.box
    kind = surrogate_kind(box, smooth=isinstance(coarse.surrogate, ResponseSurrogate))

    def fit(x: FloatArray, y: FloatArray) -> Surrogate:
        found: Surrogate = kind.fit(box, x, y, scale=scale)
        return found

    return fitness(fit, box, points, vectors, sigma=scale, allowed=AGREEMENT, gain=gain)


def _used(stages: StagedRuns, surrogate: Surrogate) -> tuple[FloatArray, Prediction]:
    """The runs that a surrogate was built from, each once, and what they predict."""
    points, prediction = stages.on_surrogate_mesh()
    places = {tuple(x): row for row, x in enumerate(points)}
    rows = [places[tuple(x)] for x in surrogate.points]
    parts = {name: getattr(prediction, name)[rows] for name in Prediction.__dataclass_fields__}
    return points[rows], Prediction(**parts)


def _reached(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(inside.all(axis=0))


def _no_surrogate(error: SurrogateError, runs: CompletedRuns) -> ValueError:
    lost = f": {runs.lost}" if runs.lost else ""
    return ValueError(f"the runs that completed do not carry a surrogate ({error}){lost}")
