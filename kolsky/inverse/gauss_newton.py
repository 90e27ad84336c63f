"""Gauss-Newton steps on the refined mesh, with slopes from the surrogate's mesh or from the refined mesh.

A coarse mesh is too soft and its waves are too slow. It therefore fits the data at other parameters. At its
optimum, however, its oscillations are in phase with the measured ones. There its derivatives nearly equal
those of the refined mesh at the refined mesh's optimum. A few steps correct the difference. Slopes are
therefore computed once, about the optimum of the surrogate's mesh. Every step needs one run on the refined
mesh (chord method). If these steps do not converge, `descend` computes slopes on the refined mesh. It halves
each step that increases the misfit.

The front face's path is then corrected by amplitudes estimated from the residual on a graded mesh. The
optimum is searched again with this path. Both are repeated until they converge.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from doe import Box, from_points
from doe.designs import maximin
from doe.least_squares import secant
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, CorrectedSurrogate, jacobian, surrogate_kind
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.path_noise import FrontPath, MovedFront, credible, likely_amplitudes, rms_amplitude
from kolsky.inverse.refined_search import RefinedOptimum, check_run
from kolsky.inverse.run_table import CompletedRuns
from kolsky.inverse.runner import Mesh, Runner
from kolsky.inverse.settings import Numerics
from kolsky.inverse.surrogate_mesh_search import MeshOptimum


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from a run on the refined mesh."""

    change: FloatArray
    """Step to the optimum of the linear model, inside the box, shape [d]."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals and the prior, shape [d]."""
    noise_sigma: FloatArray
    """Standard deviation of the optimum from the noise and the prior alone, shape [d]."""
    objective: Objective

    @property
    def moved(self) -> float:
        """Largest component of the step, divided by its standard deviation [-]."""
        return float(np.max(np.abs(self.change) / self.sigma))


def gauss_newton_step(
    objective: Objective, slope: FloatArray, vector: FloatArray, x: FloatArray, box: Box
) -> Step:
    """Solve the linear least-squares problem of data and prior inside a box.

    ``objective``: its discrepancies are replaced by those of the run. ``slope``: of the data vector, [k, d].
    ``vector``, ``x``: data vector, [k], and point of the run, [d].
    """
    weighed = objective.with_discrepancy(vector)
    sigma = np.sqrt(np.diag(weighed.covariance(slope, vector)))
    rows, right = weighed.whitened(slope.T).T, weighed.whitened(weighed.data - vector)
    if weighed.prior is not None:
        rows = np.vstack([rows, weighed.prior.rows()])
        right = np.concatenate([right, -weighed.prior.residuals(x)])
    low, high = (np.array(box.lower) - x) / sigma, (np.array(box.upper) - x) / sigma
    # On a face of the box, one bound is zero. The two bounds must not be equal.
    bounds = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    found = lsq_linear(rows * sigma, right, bounds, method="bvls").x
    return Step(np.clip(found, low, high) * sigma, sigma, _noise_sigma(weighed, slope), weighed)


def _noise_sigma(objective: Objective, slope: FloatArray) -> FloatArray:
    """Standard deviation of the optimum without discrepancies, from (J^T C^-1 J + P)^-1, shape [d]."""
    noisy = replace(objective, force_discrepancy=0.0, shape_discrepancy=0.0, slow_discrepancy=0.0)
    normal = noisy.information(slope) + noisy.prior_precision(slope.shape[1])
    return np.sqrt(np.diag(np.linalg.inv(normal)))


def linear_step(objective: Objective, slope: FloatArray, vector: FloatArray, x: FloatArray) -> FloatArray:
    """Step to the optimum of the linear model with the weights of the objective, without a box, shape [d]."""
    gain = objective.gain(slope)
    step: FloatArray = gain @ (objective.data - vector)
    if objective.prior is None:
        return step
    normal = objective.information(slope) + objective.prior.precision
    pull = objective.prior.precision @ (objective.prior.mean - x)
    return step + np.linalg.solve(normal, pull)


CONFIRMED = 1.0
"""A run confirms the optimum if the step from it is shorter than this [standard deviations]. The answer is
moved by this step; in `runs/open-05` an uncorrected step leaves a third of the distance."""
CONFIRMED_NOISE = 3.5
"""The step must also be shorter than this many standard deviations of the noise alone. The residuals'
standard deviation is two to three times as large where the model fits, and more where it does not."""
LONGER = 3.0
"""Largest length of a corrected step over that of the step itself [-]. In `runs/open-05` it is 1.5."""


@dataclass(frozen=True)
class RefinedRun:
    """A run on the refined mesh and the step computed from it."""

    x: FloatArray
    """Point of the run, or of the optimum estimated from it, shape [d]."""
    vector: FloatArray
    """Data vector there, shape [k], with the measured value at an outline point that is not reached."""
    check: CompletedRuns
    numerics: Numerics
    step: Step
    missed: FloatArray
    """The run minus the linear prediction by the slopes, shape [k]."""
    pace: FloatArray | None = None
    """Change of the point over that of the step, from the runs, shape [d, d]; None: minus one."""

    @property
    def confirmed(self) -> bool:
        """True if the run confirms the optimum."""
        step = self.step
        limit = np.minimum(CONFIRMED * step.sigma, CONFIRMED_NOISE * step.noise_sigma)
        return bool((np.abs(step.change) <= limit).all())

    @property
    def corrected_step(self) -> FloatArray:
        """Step to the optimum, corrected by the pace, shape [d]."""
        change, sigma = self.step.change, self.step.sigma
        if self.pace is None:
            return change
        step = -self.pace @ change
        reach, size = (float(np.linalg.norm(each / sigma)) for each in (LONGER * change, step))
        return step if size <= reach else np.asarray(step * (reach / size))

    def moved_by_step(self, slope: FloatArray, box: Box) -> RefinedRun:
        """The linear model at the optimum estimated from the run; ``slope``: of the step, shape [k, d].

        The step's slopes give the change of the data, and the pace the parameters that cause it.
        """
        x = np.clip(self.x + self.corrected_step, *_box_bounds(box))
        return replace(self, x=x, vector=self.vector + slope @ self.step.change)


def judge_run(
    runner: Runner,
    objective: Objective,
    slope: FloatArray,
    x: FloatArray,
    numerics: Numerics,
    before: RefinedRun | None,
    check: CompletedRuns | None = None,
) -> RefinedRun:
    """A run and the step computed from it. The run is made only if `check` is not given."""
    check = check or check_run(runner, x, numerics)
    vector = objective.reached(check.prediction)[0]
    missed = np.zeros(len(vector))
    if before is not None:
        missed = vector - before.vector - slope @ (x - before.x)
    step = gauss_newton_step(objective, slope, vector, x, runner.problem.box)
    return RefinedRun(x, vector, check, numerics, step, missed)


def run_deviance(run: RefinedRun) -> float:
    """-2 ln of likelihood and prior at a run, up to a constant."""
    weighed = run.step.objective
    return float(weighed.chi2(run.vector)) + weighed.whitening().log_determinant + weighed.prior_chi2(run.x)


def _box_bounds(box: Box) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of a box, shape [d] each."""
    return np.array(box.lower), np.array(box.upper)


MOST_STEPS = 6
"""Maximum number of points at which slopes are computed. A converging search needs two or three."""
MOST_HALVINGS = 5
"""Maximum number of halvings of a step."""
OWN_DIFFERENCE_STEP = 0.25
"""Half step of the central differences for the slopes, in standard deviations of the optimum. It is half the
step on the surrogate's mesh, because the point is nearer to its optimum."""


def descend(
    runner: Runner, objective: Objective, slope: FloatArray, last: RefinedRun
) -> tuple[RefinedRun, FloatArray]:
    """The final run of steps with slopes of the refined mesh, and the slopes used to assess it, [k, d].

    ``objective``: selects the outline points and holds the prior. ``slope``: of the coarser mesh, [k, d],
    kept if a neighbouring run does not complete. ``last``: the run from which to continue.
    """
    for _ in range(MOST_STEPS):
        own = refined_slopes(runner, objective, last)
        if own is None:
            break
        slope = own
        again = judge_run(runner, objective, slope, last.x, last.numerics, last, last.check)
        last = replace(again, missed=last.missed)
        if last.confirmed:
            break
        better = _downhill_run(runner, objective, slope, last)
        if better is None or better.confirmed:
            last = last if better is None else better
            break
        last = better
    return last, slope


def refined_slopes(runner: Runner, objective: Objective, run: RefinedRun) -> FloatArray | None:
    """Jacobian of the data vector at a run on the refined mesh, shape [k, d]; None if a run fails."""
    up, down = difference_points(runner.problem.box, run.x, OWN_DIFFERENCE_STEP * run.step.sigma)
    vectors = runner.vectors("check", np.concatenate([up, down]), run.numerics, objective)
    return differences(vectors, up, down) if np.isfinite(vectors).all() else None


def _downhill_run(
    runner: Runner, objective: Objective, slope: FloatArray, last: RefinedRun
) -> RefinedRun | None:
    """A run along the step that completes without increasing the misfit; None if there is none."""
    share = 1.0
    for _ in range(MOST_HALVINGS):
        x = np.clip(last.x + share * last.step.change, *_box_bounds(runner.problem.box))
        share *= 0.5
        try:
            run = judge_run(runner, objective, slope, x, last.numerics, last)
        except ValueError:  # a failed run is not a better point
            continue
        if run_deviance(run) <= run_deviance(last):
            return run
    return None


def difference_points(box: Box, x: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points above and below a point in every coordinate, all inside the box, shape [d, d] each."""
    lower, upper = _box_bounds(box)
    h = np.diag(np.minimum(step, 0.1 * (upper - lower)))
    return np.minimum(x + h, upper), np.maximum(x - h, lower)


def differences(vectors: FloatArray, up: FloatArray, down: FloatArray) -> FloatArray:
    """Jacobian from data vectors at the points above, then at those below, [2 d, k] -> [k, d]."""
    d = len(up)
    return np.asarray(((vectors[:d] - vectors[d:]) / (up - down).sum(axis=1)[:, None]).T)


MOST_MOVES = 2
"""Maximum number of path corrections: each reduces the path error to the relative error of the patterns."""
AMPLITUDES_STAY = 0.2
"""Rms change of the path's amplitudes at convergence [-]. Each amplitude has a standard normal prior."""


SearchUnderPath = Callable[
    [Runner, Objective, FloatArray, FloatArray, Numerics, FloatArray | None], tuple[RefinedRun, FloatArray]
]
"""Function from slopes, [k, d], a start, [d], and a pace to the optimum on a mesh and its slopes."""


def follow_on_refined(
    runner: Runner, objective: Objective, slope: FloatArray, last: RefinedRun, search: SearchUnderPath
) -> tuple[RefinedRun, FloatArray, FrontPath]:
    """The optimum on the refined mesh with the path corrected by its residual, slopes [k, d], and path.

    It is unchanged if the path was not corrected on the surrogate's mesh, or if the search has not converged.
    """
    path, front = runner.front, runner.front.moved
    if front is None or not last.confirmed:
        return last, slope, path
    for _ in range(MOST_MOVES):
        amplitudes = _amplitudes_of_residual(front, last.step.objective, last.vector)
        stay = rms_amplitude(amplitudes - front.amplitudes) <= AMPLITUDES_STAY
        if stay or not credible(amplitudes):
            break
        front = replace(front, amplitudes=amplitudes)
        path = FrontPath.following(front)
        under = replace(objective, front=path.noise)
        last, slope = search(runner.under(path), under, slope, last.x, last.numerics, last.pace)
        if not last.confirmed:
            break
    return last, slope, path


def _amplitudes_of_residual(front: MovedFront, objective: Objective, vector: FloatArray) -> FloatArray:
    """The most likely amplitudes of a path's modes for the residual of a vector, shape [q]."""
    noise = FrontNoise(front.modes.patterns, front.offset)
    weighed = replace(objective, front=noise).with_discrepancy(vector)
    return likely_amplitudes(weighed, weighed.data - vector)


WORSE_STEP = 4.0
"""A step is too long if -2 ln L rises by more than this [-]; it equals two standard deviations. The slopes of
the coarser mesh lead to a point near the least misfit. There a good step may cause a smaller rise."""
MOST_RUNS = 8
"""Maximum number of iterations on the refined mesh with the slopes of the coarser one."""
MISLED = 2
"""Number of steps with increasing misfit after which those slopes are replaced."""
DIFFERENCE_STEP = 0.5
"""Half step of the central differences for the slopes, in standard deviations of the optimum."""
REACH = 8.0
"""Half edge of the surrogate's box about the answer, in standard deviations."""
RUNS_PER_PARAMETER = 6
"""Number of runs of that surrogate per parameter."""


def search_by_gauss_newton(
    runner: Runner, optima: Mapping[Mesh, MeshOptimum]
) -> tuple[CoarseOptimum, RefinedOptimum]:
    """Move the optimum of the surrogate's mesh to the refined mesh, and build a surrogate about it.

    The steps and the path correction use a coarser graded mesh. One or two runs on the refined mesh follow.
    ``runner``, ``optima``: with the path, and the optima, of
    `kolsky.inverse.surrogate_mesh_search.search_meshes`.

    Raises ValueError if a run does not complete, or the data do not depend on a parameter.
    """
    problem = runner.problem
    coarse = optima[problem.numerics.mesh]
    slope, objective = slopes(runner, coarse)
    if blind := [name for name, effect in zip(problem.box.names, slope.T, strict=True) if not effect.any()]:
        raise ValueError(f"the data do not depend on {', '.join(blind)}: hold it (--hold {blind[0]})")
    last, slope = _search_on(runner, objective, slope, coarse.x, problem.halfway)
    last, slope, front = follow_on_refined(runner, objective, slope, last, _search_on)
    if problem.halfway != problem.refined:
        under = replace(objective, front=front.noise)
        last, slope = _search_on(runner.under(front), under, slope, last.x, problem.refined, last.pace)
    runner = runner.under(front, {mesh: optimum.x - last.x for mesh, optimum in optima.items()})
    return _with_surrogate(runner, last, slope)


def _search_on(
    runner: Runner,
    objective: Objective,
    slope: FloatArray,
    start: FloatArray,
    numerics: Numerics,
    pace: FloatArray | None = None,
) -> tuple[RefinedRun, FloatArray]:
    """The optimum on a mesh from a nearby point, and the slopes used to assess it, shape [k, d]."""
    last = _chord_steps(runner, objective, slope, start, numerics, pace)
    if not last.confirmed or last.numerics != numerics:
        last, slope = descend(runner, objective, slope, replace(last, numerics=numerics))
    return (last.moved_by_step(slope, runner.problem.box) if last.confirmed else last), slope


def slopes(runner: Runner, optimum: MeshOptimum) -> tuple[FloatArray, Objective]:
    """Jacobian [k, d] and objective at the surrogate mesh's optimum, or ValueError.

    The rounding of single precision can hide a small effect. The standard uncertainty is then infinite, and
    the slopes are those over a tenth of the range, in double precision.
    """
    box, numerics = runner.problem.box, runner.problem.numerics
    if not np.isfinite(optimum.sigma).all():
        numerics = replace(numerics, precision="fp64")
    up, down = difference_points(box, optimum.x, DIFFERENCE_STEP * optimum.sigma)
    points = np.concatenate([optimum.x[None], up, down])
    done = runner.simulate("refinement", from_points(box, points), numerics)
    if len(done.points) < len(points):
        raise ValueError(f"the slopes at the optimum need every neighbouring run to complete: {done.lost}")
    inside = np.asarray(done.prediction.inside.all(axis=0))
    objective = runner.objective(inside, slowly=True)
    vectors = objective.vectors(done.prediction)
    return differences(vectors[1:], up, down), objective


def _chord_steps(
    runner: Runner,
    objective: Objective,
    slope: FloatArray,
    start: FloatArray,
    numerics: Numerics,
    pace: FloatArray | None = None,
) -> RefinedRun:
    """Steps on a mesh until a run confirms the optimum.

    The first run, which rarely confirms it, is in single precision if none is chosen.
    With slopes of this mesh the step would change by minus the change of the point. Those of a coarser mesh
    give shorter steps. Broyden's update of this ratio, the ``pace``, corrects them.
    """
    found, x, misled = None, start, 0
    pace = -np.eye(len(start)) if pace is None else pace
    for _ in range(MOST_RUNS):
        run = judge_run(runner, objective, slope, x, numerics if found else numerics.for_search(), found)
        if found is not None:
            pace = secant(pace, found.step.change, found.x, run.step.sigma, run.step.change, x)
        run = replace(run, pace=pace)
        if run.confirmed and run.numerics == numerics:
            return run
        if found is not None and run_deviance(run) > run_deviance(found) + WORSE_STEP:
            misled += 1
            if misled == MISLED:
                break
            x = 0.5 * (found.x + run.x)  # the step was too long for a linear model
        else:
            found, x = run, np.clip(run.x + run.corrected_step, *_box_bounds(runner.problem.box))
    assert found is not None
    return found


def _with_surrogate(
    runner: Runner, last: RefinedRun, slope: FloatArray
) -> tuple[CoarseOptimum, RefinedOptimum]:
    """A design about the answer on the surrogate's mesh, and both optima with its surrogate."""
    numerics, whole, sigma = runner.problem.numerics, runner.problem.box, last.step.sigma
    lower = np.maximum(last.x - REACH * sigma, whole.lower)
    upper = np.minimum(last.x + REACH * sigma, whole.upper)
    box = replace(whole, lower=tuple(lower.tolist()), upper=tuple(upper.tolist()))
    many = RUNS_PER_PARAMETER * box.dimension
    design = runner.design(box) if box.dimension == 1 else maximin(box, many, rng=runner.rng)
    runs = runner.simulate("refinement", design, numerics)
    counted = last.step.objective.counted & last.check.prediction.inside[0]
    objective = replace(last.step.objective, counted=counted & runs.prediction.inside.all(axis=0))
    kept = np.concatenate([np.ones(objective.n_force, bool), objective.counted[last.step.objective.counted]])
    surrogate = surrogate_kind(box, smooth=True).fit(
        box, runs.points, objective.vectors(runs.prediction), scale=objective.noise
    )
    weighed = objective.with_discrepancy(last.vector[kept])
    x, slope, plain = last.x, slope[kept], CorrectedSurrogate(surrogate)
    # The slopes at the answer, which may come from the refined mesh. They determine the answer and its
    # interval.
    steeper = slope - jacobian(plain.predict, box, x)
    model = plain.through(x, last.vector[kept], steeper)
    return CoarseOptimum(box, surrogate, weighed, x), RefinedOptimum(
        x=x,
        front=runner.front,
        offsets=runner.offsets,
        box=box,
        objective=weighed,
        model=model.predict,
        jacobian=slope,
        sigma=np.sqrt(np.diag(weighed.covariance(slope, last.vector[kept]))),
        check=last.check,
        moved=last.step.moved,
        confirmed=last.confirmed,
        missed=last.missed[kept],
    )
