"""The optimum on the surrogate's mesh: designs of runs, and a surrogate.

First a design covers the whole box. Then a surrogate is fitted, and more runs are made near the optimum.

With one parameter, a second design of seven levels about the first optimum is enough. With several, runs are
placed in small batches (`doe.refine`). The surrogate is searched by bounded least squares.
`CorrectedSurrogate` is corrected to agree with a run on another mesh.

Replicates of the fitted path give the patterns of data changes by the noise of the front face's motion.
`weigh_front_noise` finds the optimum again with weights that include them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doe import SURROGATES, Box, Surrogate, from_points
from doe.refine import Refinement, refine
from doe.surrogates import ProcessSurrogate, SurrogateError
from doe.uncertainty import Channel, Likelihood
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective, Part
from kolsky.inverse.path_noise import FrontPath, data_change, drawn_modes, noise_of
from kolsky.inverse.run_table import CompletedRuns, Replicates
from kolsky.inverse.runner import Runner

Model = Callable[[FloatArray], FloatArray]
"""Predicted data vectors, shape [n, k], of parameter points, shape [n, d] or [d]."""

ON_EDGE = 1e-5
"""A coordinate lies on a bound if it is closer to the bound than this share of the box edge."""


@dataclass(frozen=True)
class Optimum:
    """The optimum of a model, and the objective that it minimises."""

    x: FloatArray
    """The point, shape [d]."""
    objective: Objective


def search(
    box: Box, objective: Objective, model: Model, part: Part = "joint", *, start: FloatArray | None = None
) -> Optimum:
    """Find the optimum and the discrepancies at it, which depend on each other, in three rounds.

    ``box``: the range. ``objective``: its discrepancies are replaced. ``model``: predicts data vectors.
    ``part``: of the data. ``start``: shape [d]; default: the best point of a grid, see `STARTS`.
    """
    for _ in range(3):
        start = _by_least_squares(box, objective, model, part, start)
        objective = objective.with_discrepancy(model(start)[0])
    assert start is not None
    return Optimum(start, objective)


STARTS = 3
"""Number of start values along each edge of the box, against several minima; for one parameter its cube."""
REST = 1e-6
"""The search ends if it expects a smaller decrease of chi-square: a thousandth of a standard deviation."""


def _by_least_squares(
    box: Box, objective: Objective, model: Model, part: Part, start: FloatArray | None
) -> FloatArray:
    prior = objective.prior if part == "joint" else None

    def residuals(points: FloatArray) -> FloatArray:
        weighted = objective.whitened(model(points) - objective.data, part)
        return weighted if prior is None else np.hstack([weighted, prior.residuals(points)])

    if start is None:
        each = STARTS if box.dimension > 1 else STARTS**3
        levels = np.meshgrid(*[(np.arange(each) + 0.5) / each] * box.dimension)
        points = np.stack([axis.ravel() for axis in levels], axis=1)
    else:
        points = box.unit(np.clip(start, box.lower, box.upper)[None])
    left = residuals(box.scale(points))
    k = left.shape[1]
    likelihood = Likelihood(box, residuals, np.zeros(k), [Channel("data and prior", np.ones(k))])
    return likelihood.maximise(points[np.argmin((left**2).sum(axis=1))], rest=REST).point


@dataclass(frozen=True)
class CorrectedSurrogate:
    """A surrogate corrected to agree with a run on another mesh."""

    surrogate: Surrogate
    """The surrogate of the coarser mesh."""
    anchor: FloatArray | None = None
    """Point of the run, shape [d]; None without a run."""
    shift: FloatArray | float = 0.0
    """The run minus the surrogate, shape [k]."""
    slope: FloatArray = field(default_factory=lambda: np.zeros((1, 1)))
    """Derivative of that difference by the parameters, shape [k, d]; without a run not used."""

    def predict(self, points: FloatArray) -> FloatArray:
        """Data vectors at points of shape [n, d] or [d], shape [n, k]."""
        x = np.atleast_2d(points)
        change = 0.0 if self.anchor is None else (x - self.anchor) @ np.transpose(self.slope)
        return self.surrogate.predict(x, extrapolate=True) + self.shift + change

    def through(
        self, point: FloatArray, vector: FloatArray, slope: FloatArray | None = None
    ) -> "CorrectedSurrogate":
        """The surrogate with the value `vector` at `point`, and with `slope` added to its slopes."""
        miss = vector - self.surrogate.predict(np.atleast_2d(point), extrapolate=True)[0]
        added = np.zeros((len(vector), len(point))) if slope is None else slope
        return replace(self, anchor=point, shift=miss, slope=added)


def jacobian(model: Model, box: Box, x: FloatArray) -> FloatArray:
    """Central differences of a model, one-sided at a bound, shape [k, d]."""
    columns = []
    for i in range(box.dimension):
        step = 1e-3 * (box.upper[i] - box.lower[i])
        up, down = x.copy(), x.copy()
        up[i], down[i] = min(x[i] + step, box.upper[i]), max(x[i] - step, box.lower[i])
        columns.append((model(up)[0] - model(down)[0]) / (up[i] - down[i]))
    return np.array(columns).T


def on_edge(x: FloatArray, box: Box) -> NDArray[np.bool_]:
    """Mask of the coordinates of a point that lie on a bound of the box, shape [d]."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    return np.asarray(np.minimum(x - lower, upper - x) < ON_EDGE * (upper - lower))


def at_inner_face(x: FloatArray, local: Box, whole: Box) -> bool:
    """True if a point lies on a face of the local box inside the whole box: the optimum may lie outside."""
    return bool((on_edge(x, local) & ~on_edge(x, whole)).any())


SMOOTH, ROUGH = "response", "process"
"""Surrogates, by their names in `doe.SURROGATES`. The first is for one free parameter. It is also for several
parameters in a small box about the optimum of a smooth response. The second is for several parameters in a
wide box, or with a rough response. In that case some directions matter little, and an isotropic kernel would
waste runs."""
LOCAL_FRACTION = 0.05
"""Box edge of the second design divided by that of the first."""
MOST_REFINEMENTS = 3
"""Maximum number of second designs, each around the optimum of the previous one."""
MOST_ROUNDS = 10
"""Maximum number of batches of adaptive refinement."""


@dataclass(frozen=True)
class CoarseOptimum:
    """The optimum on the surrogate's mesh."""

    box: Box
    """Box in which the surrogate was refined."""
    surrogate: Surrogate
    objective: Objective
    x: FloatArray
    """The optimum, shape [d]."""


def surrogate_kind(box: Box, *, smooth: bool = False) -> Any:
    """The surrogate for a number of free parameters, from the registry.

    ``smooth``: True if the response is smooth in the box and the box is small about the optimum.
    """
    return SURROGATES[SMOOTH if smooth or box.dimension == 1 else ROUGH]


def search_coarse(runner: Runner) -> CoarseOptimum:
    """Stages 1 and 2 of `kolsky.identification.identify`; ValueError if no surrogate can be fitted."""
    wide = runner.simulate("design", runner.design(runner.problem.box), runner.problem.numerics)
    if runner.problem.box.dimension == 1:
        return second_design(runner, wide)
    # batches of runs about the optimum until it converges
    objective = runner.objective(np.asarray(wide.prediction.inside.all(axis=0)))
    try:
        return _refined_surrogate(runner, _refine(runner, objective))
    except SurrogateError as error:
        raise no_surrogate(error, wide) from error


def second_design(runner: Runner, wide: CompletedRuns) -> CoarseOptimum:
    """Use smaller boxes until the optimum lies inside one."""
    numerics, whole = runner.problem.numerics, runner.problem.box
    objective, surrogate = _fit(runner, whole, wide)
    centre = search(whole, objective, CorrectedSurrogate(surrogate).predict).x
    for _ in range(MOST_REFINEMENTS):
        box = whole.around(centre, LOCAL_FRACTION)
        local = runner.simulate("refinement", runner.design(box), numerics)
        objective, surrogate = _fit(runner, box, local)
        best = search(box, objective, CorrectedSurrogate(surrogate).predict)
        if not at_inner_face(best.x, box, whole):
            break
        centre = best.x
    return CoarseOptimum(box, surrogate, best.objective, best.x)


def _fit(runner: Runner, box: Box, runs: CompletedRuns) -> tuple[Objective, Surrogate]:
    """The objective over the points that every run reaches, and the surrogate of its data vector."""
    objective = runner.objective(np.asarray(runs.prediction.inside.all(axis=0)))
    use = box.contains(runs.points)
    vectors = objective.vectors(runs.prediction)
    try:
        surrogate = surrogate_kind(box).fit(box, runs.points[use], vectors[use], scale=objective.noise)
    except SurrogateError as error:
        raise no_surrogate(error, runs) from error
    return objective, surrogate


def _refine(runner: Runner, objective: Objective) -> Refinement:
    points, prediction = runner.on_surrogate_mesh()
    vectors = objective.vectors(prediction)
    whole = np.isfinite(vectors).all(axis=1)

    def run(points: FloatArray) -> FloatArray:
        done = runner.simulate("refinement", from_points(runner.problem.box, points), runner.problem.numerics)
        vectors = np.full((len(points), len(objective.data)), np.nan)
        vectors[done.rows] = objective.vectors(done.prediction)
        return vectors

    def locate(surrogate: Surrogate, region: Box, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        model = CorrectedSurrogate(surrogate).predict
        best = search(region, objective, model, start=start)
        covariance = best.objective.covariance(jacobian(model, region, best.x), model(best.x)[0])
        return best.x, np.sqrt(np.diag(covariance))

    return refine(
        run,
        runner.problem.box,
        points[whole],
        vectors[whole],
        misfit=objective.deviance,
        locate=locate,
        scale=objective.noise,
        rng=runner.problem.settings.seed,
        max_rounds=MOST_ROUNDS,
    )


def _refined_surrogate(runner: Runner, found: Refinement) -> CoarseOptimum:
    """The surrogate over the outline points that its runs reach, which are more than in the first design."""
    points, prediction = runner.on_surrogate_mesh()
    places = {tuple(x): row for row, x in enumerate(points)}  # of the runs used, without duplicates
    rows = [places[tuple(x)] for x in found.surrogate.points]
    points, prediction = points[rows], prediction.select(rows)
    objective = runner.objective(np.asarray(prediction.inside.all(axis=0)))
    surrogate = ProcessSurrogate.fit(
        found.surrogate.box,
        points,
        objective.vectors(prediction),
        scale=objective.noise,
        like=found.surrogate,
    )
    best = search(found.region, objective, CorrectedSurrogate(surrogate).predict, start=found.x)
    return CoarseOptimum(found.region, surrogate, best.objective, best.x)


def no_surrogate(error: SurrogateError, runs: CompletedRuns) -> ValueError:
    lost = f": {runs.lost}" if runs.lost else ""
    return ValueError(f"no surrogate can be fitted to the runs that completed ({error}){lost}")


def front_with_noise(runner: Runner, replicates: Replicates | None) -> FrontPath:
    """The path with the noise modes from replicates; unchanged if there are none."""
    if replicates is None or not replicates.lesson.any():
        return runner.front
    change = data_change(replicates.prediction)[replicates.lesson]
    return runner.front.with_noise(drawn_modes(change, noise_of(runner.problem.observations)))


def weigh_front_noise(coarse: CoarseOptimum, front: FrontPath) -> CoarseOptimum:
    """The optimum on the surrogate's mesh. The weights include the front face's noise if it is known."""
    if front.noise.patterns is None:
        return coarse
    objective = replace(coarse.objective, front=front.noise)
    model = CorrectedSurrogate(coarse.surrogate).predict
    best = search(coarse.box, objective, model, start=coarse.x)
    return replace(coarse, objective=best.objective, x=best.x)
