"""The optimum on the refined mesh for a rough response, by a quadratic through many runs.

`RefinedOptimum` is the result of every search on the refined mesh. If a surface slides or lets go, a small
change of a parameter can change whether a node sticks, slips or lifts. The response then jumps. A quadratic
through more runs than it has terms averages these jumps. Its residual is the roughness of the response, which
is a part of the uncertainty. Smooth responses: `kolsky.inverse.gauss_newton`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from doe import Box, latin_hypercube
from doe.surrogates import QuadraticSurrogate, SurrogateError
from doe.surrogates.quadratic import runs_wanted
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, Model, at_inner_face, jacobian, no_surrogate, search
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import slides
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.run_table import CompletedRuns
from kolsky.inverse.runner import Mesh, Runner
from kolsky.inverse.settings import Numerics

CONFIRMED = 0.2
"""An optimum is confirmed if the check run shifts it by less than this share of the residuals' sigma."""
CONFIRMED_ROUGH = 3.0
"""It is also confirmed if the shift is below this many standard deviations of the roughness."""


@dataclass(frozen=True)
class RefinedOptimum:
    """The optimum on the refined mesh, confirmed or not by its last run."""

    x: FloatArray
    """The answer, shape [d]. A confirming run is at this point, or a short step away."""
    front: FrontPath
    box: Box
    """The box in which the model is valid."""
    objective: Objective
    model: Model
    """Model of the data vectors of runs on the refined mesh."""
    jacobian: FloatArray
    """Jacobian of the model at the optimum, shape [k, d]."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals, shape [d]."""
    check: CompletedRuns
    moved: float
    """Shift of the optimum by the last run, in units of sigma."""
    confirmed: bool
    """True if that shift is small enough."""
    missed: FloatArray
    """The last run minus the model's prediction for it, shape [k]."""
    roughness: FloatArray | None = None
    """Standard deviation of the optimum from the response's roughness, shape [d]; None if it is smooth."""
    deviations: FloatArray | None = None
    """Deviation of each run from the model, divided by the square root of the degrees of freedom, shape [n,
    k]. The sum of squares of a linear map of the rows is a variance. None if the response is smooth."""
    offsets: Mapping[Mesh, FloatArray] = field(default_factory=dict)
    """Optimum on each coarser mesh minus the answer, shape [d], for meshes that are run at shifted points."""


def confirms(move: FloatArray, sigma: FloatArray, roughness: FloatArray | float = 0.0) -> bool:
    """True if the last run shifts every parameter of the optimum by little.

    ``move``, ``sigma``, ``roughness``: shift of the optimum, its sigma by residuals and by roughness, [d].
    """
    little = np.fmax(CONFIRMED * sigma, CONFIRMED_ROUGH * np.asarray(roughness))
    return bool((np.abs(move) <= little).all())


def check_run(runner: Runner, x: FloatArray, numerics: Numerics) -> CompletedRuns:
    """A run at a point with all nodes; raises ValueError if it does not complete."""
    runs = runner.run("check", x[None], numerics, all_nodes=True)
    return runs.completed("the check needs every run on the refined mesh to complete")


EDGE = 0.2
"""Edge of the first box in the unit box. A wide box makes the jumps small compared with the response."""
LEFTOVER = 0.3
"""The box is halved while a run's deviation moves the optimum by more, in shares of the residuals' sigma."""
GAIN = 0.7
"""A halved box is kept if the residual of the fit is below this share of its previous value."""
PATIENCE = 2
"""Maximum number of halvings until it decreases. A ringing response is fitted only within a period."""
SMALLEST = 0.01
"""Smallest edge of a box to be halved. The boxes are halved on the surrogate's mesh, where runs are cheap."""
MOST_MOVES = 4
"""Maximum number of designs on the refined mesh, each about the last optimum until that lies inside."""
REACH = 4.0
"""Largest move of a narrow box by a Gauss-Newton step, in edges of the box."""


@dataclass(frozen=True)
class QuadraticFit:
    """A quadratic through runs on one mesh, and its optimum."""

    surrogate: QuadraticSurrogate
    objective: Objective
    x: FloatArray
    """The optimum, shape [d]."""
    jacobian: FloatArray
    """Jacobian at the optimum, shape [k, d]."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals, shape [d]."""
    edge: float
    """Edge of the quadratic's box, relative to the unit box [-]."""

    def model(self, points: FloatArray) -> FloatArray:
        """Data vectors at points of shape [n, d] or [d], shape [n, k]."""
        return self.surrogate.predict(np.atleast_2d(points), extrapolate=True)

    @property
    def gain(self) -> FloatArray:
        """Linear map from a change of the data vector to the shift of the optimum, shape [d, k]."""
        return self.objective.gain(self.jacobian)

    @property
    def leftover(self) -> float:
        """Root mean square of run minus quadratic, by the degrees of freedom, over the data's noise [-]."""
        square = ((self.surrogate.residuals / self.objective.noise) ** 2).mean(axis=1).sum()
        return float(np.sqrt(square / self.surrogate.degrees_of_freedom))

    @property
    def roughness(self) -> FloatArray:
        """Standard deviation of the optimum from one run's deviation from the quadratic, shape [d]."""
        return np.asarray(np.sqrt(np.diag(self.surrogate.roughness(self.gain))))


def search_by_quadratic(runner: Runner, coarse: CoarseOptimum) -> RefinedOptimum:
    """Stage 3 of `kolsky.identification.identify` if a surface slides or lets go; ValueError if runs fail."""
    found = _moved_to_inside(runner, *_first_box(runner, coarse))
    x = found.x
    check = check_run(runner, x, runner.problem.refined)
    missed = found.objective.vectors(check.prediction)[0] - found.model(x)[0]
    move = np.abs(found.gain @ missed)
    inside = not at_inner_face(x, found.surrogate.box, runner.problem.box)
    return RefinedOptimum(
        x=x,
        front=runner.front,
        box=found.surrogate.box,
        objective=found.objective,
        model=found.model,
        jacobian=found.jacobian,
        sigma=found.sigma,
        check=check,
        moved=float(np.max(move / np.hypot(found.sigma, found.roughness))),
        confirmed=inside and confirms(move, found.sigma, found.roughness),
        missed=missed,
        roughness=found.roughness,
        deviations=found.surrogate.residuals / np.sqrt(found.surrogate.degrees_of_freedom),
    )


def _first_box(runner: Runner, coarse: CoarseOptimum) -> tuple[FloatArray, float]:
    """Middle and edge of the first box on the refined mesh.

    If a surface slides, the box stays wide: in a narrow one, a few jumps would determine the slope. Otherwise
    the response is quadratic in it, about the optimum estimated from one run on the refined mesh.
    """
    problem, settings = runner.problem, runner.problem.settings
    if slides(problem.shot.interface, [*(settings.free or ()), *settings.held]):
        return coarse.x, EDGE
    own = _halved_box(runner, coarse)
    first = check_run(runner, own.x, problem.refined)
    change = own.objective.vectors(first.prediction)[0] - own.model(own.x)[0]
    guess = own.x - own.gain @ np.nan_to_num(change)  # a point that the run does not reach adds 0
    return np.clip(guess, problem.box.lower, problem.box.upper), own.edge


def _halved_box(runner: Runner, coarse: CoarseOptimum) -> QuadraticFit:
    """A quadratic on the surrogate's mesh. Its box is halved until the fit is good."""
    numerics, edge, patience = runner.problem.numerics, EDGE, PATIENCE
    found = last = _fit(runner, coarse.x, edge, numerics)
    while patience and (found.roughness > LEFTOVER * found.sigma).any() and edge > SMALLEST:
        edge *= 0.5
        last = _fit(runner, last.x, edge, numerics)
        if last.leftover <= GAIN * found.leftover:
            found, patience = last, PATIENCE
        else:
            patience -= 1
    return found


def _moved_to_inside(runner: Runner, middle: FloatArray, edge: float) -> QuadraticFit:
    """A quadratic on the refined mesh. Its box is moved until the optimum lies inside."""
    for _ in range(MOST_MOVES):
        found = _fit(runner, middle, edge, runner.problem.refined)
        if not at_inner_face(found.x, found.surrogate.box, runner.problem.box):
            break
        middle = found.x
        if edge < EDGE:
            further = found.gain @ (found.objective.data - found.model(found.x)[0])
            reach = runner.problem.box.around(found.x, min(2.0 * REACH * edge, 1.0))
            middle = np.clip(found.x + further, reach.lower, reach.upper)
    return found


def _fit(runner: Runner, middle: FloatArray, edge: float, numerics: Numerics) -> QuadraticFit:
    """A design in a box about a point, its runs, and the quadratic through them."""
    box = runner.problem.box.around(middle, edge)
    design = latin_hypercube(box, runs_wanted(box.dimension), rng=runner.rng, optimise=True)
    stage = "refinement" if numerics.mesh == runner.problem.numerics.mesh else "check"
    runs = runner.simulate(stage, design, numerics)
    inside = np.asarray(runs.prediction.inside.all(axis=0))
    objective = runner.objective(inside, slowly=stage == "check")
    try:
        surrogate = QuadraticSurrogate.fit(box, runs.points, objective.vectors(runs.prediction))
    except SurrogateError as error:
        raise no_surrogate(error, runs) from error
    start = np.clip(middle, box.lower, box.upper)

    def model(points: FloatArray) -> FloatArray:
        return surrogate.predict(np.atleast_2d(points), extrapolate=True)

    best = search(box, objective, model, start=start)
    slope = jacobian(model, box, best.x)
    covariance = best.objective.covariance(slope, model(best.x)[0])
    return QuadraticFit(surrogate, best.objective, best.x, slope, np.sqrt(np.diag(covariance)), edge)
