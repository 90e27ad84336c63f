"""The joint optimum: starting points, steps and noise patterns on the refined mesh, scatter of shots.

The first steps use the slopes of the search mesh, corrected by each run (Broyden's update). If a step
increases the misfit, or after `COARSE_SLOPE_RUNS` runs without convergence, slopes are computed on the
refined mesh. The patterns of the front faces' noise are then computed again at the optimum, on a graded mesh.

The scatter of the stiffness between shots is found by restricted maximum likelihood (Patterson and Thompson
1971). Shot k has the stiffness m (1 + s z_k) with z_k standard normal. A linear model about the optimum gives
the residual r = -J d + s sum_k u_k z_k + e. Here u_k is the change of shot k's data by a relative change of
its stiffness.

    -2 ln L(s) = ln det C + ln det (J^T C^-1 J) + r^T (C^-1 - C^-1 J (J^T C^-1 J)^-1 J^T C^-1) r,

C(s) = C_0 + s^2 sum_k u_k u_k^T. The second term counts the degrees of freedom of the shared unknowns:
without it, the scatter of few shots would be underestimated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ndtr, stdtrit

from doe.least_squares import Whitening, bounded_step, secant
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import coarser_graded
from kolsky.inverse.joint_problem import BLIND, SCATTER, JointProblem, information
from kolsky.inverse.joint_result import Scatter, is_strength, rate_of
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.settings import Numerics
from kolsky.inverse.valleys import VALLEY, local_minima, valley_levels

FACTORS = np.geomspace(0.6, 2.2, 10)
"""Stiffness factors of the first scan."""
STRENGTHS = (0.1, 0.5)
"""Strengths of a branch, or ratios of a network, of the scan [-]."""
TIME_LEVELS = 6
"""Number of relaxation times, or resistances, in the scan."""
MOST_VALLEYS = 3
"""Number of valleys of Poisson's ratio used as starts."""


def starts(problem: JointProblem, numerics: Numerics) -> FloatArray:
    """Starting points of the search, the likeliest first, shape [n, d].

    Raises ValueError if no point of a scan has runs that complete.
    """
    x = problem.declared
    names = list(problem.unknowns.bounds)
    weak = [i for i, name in enumerate(names) if is_strength(name)]
    x[weak] = np.array(problem.unknowns.box.lower)[weak]
    if MOVED in names:
        i, box = names.index(MOVED), problem.unknowns.box
        inside = FACTORS[(box.lower[i] <= FACTORS) & (box.upper[i] >= FACTORS)]
        x = _best_point(problem, _with_values(x, i, inside if len(inside) else x[[i]]), numerics)
    problem.count(x, numerics)
    if weak:
        x = _best_point(problem, np.concatenate([x[None], relaxing_points(problem, x)]), numerics)
    if VALLEY not in names:
        return x[None]
    return _valleys(problem, x, numerics)


def relaxing_points(
    problem: JointProblem, x: FloatArray, strengths: Sequence[float] = STRENGTHS, *, follow: bool = True
) -> FloatArray:
    """Points with a branch or network at several strengths and times, other unknowns fixed, shape [n, d].

    ``x``: a point without it, [d]. ``follow``: True to keep the mean stiffness by a smaller stiffness factor.
    """
    names = list(problem.unknowns.bounds)
    ratio = "prony_strength_1" if "prony_strength_1" in names else "creep_ratio"
    other, found = rate_of(ratio), []
    for strength in strengths:
        point = x.copy()
        point[names.index(ratio)] = strength
        if follow and MOVED in names:
            point[names.index(MOVED)] /= np.sqrt(1.0 + strength)
        free = other in names
        found.append(
            _with_values(point, names.index(other), second_levels(problem, other)) if free else point[None]
        )
    return np.clip(np.concatenate(found), problem.unknowns.box.lower, problem.unknowns.box.upper)


def second_levels(problem: JointProblem, name: str) -> FloatArray:
    """Relaxation times, or resistances, of a scan, evenly spaced in the logarithm over the design's range."""
    i = list(problem.unknowns.bounds).index(name)
    box = problem.unknowns.box
    return np.geomspace(box.lower[i], box.upper[i], TIME_LEVELS + 2)[1:-1]


def _with_values(x: FloatArray, i: int, values: FloatArray) -> FloatArray:
    """A point with each of some values of one unknown, shape [n, d]."""
    return np.where(np.arange(len(x)) == i, values[:, None], x)


def _best_point(problem: JointProblem, points: FloatArray, numerics: Numerics) -> FloatArray:
    deviances = [problem.deviance(v) for v in problem.predict("design", points, numerics)]
    if not np.isfinite(deviances).any():
        raise ValueError("no point of the first scan has runs of all shots that complete")
    return np.asarray(points[int(np.argmin(deviances))])


def _valleys(problem: JointProblem, x: FloatArray, numerics: Numerics) -> FloatArray:
    """The minima of the likeliest valleys of Poisson's ratio."""
    names, box = list(problem.unknowns.bounds), problem.unknowns.box
    i = names.index(VALLEY)
    prepared = problem.runs.prepared[0]
    factor = x[names.index(MOVED)] if MOVED in names else PARAMETERS[MOVED].held(prepared.shot)
    points = _with_values(x, i, valley_levels(prepared, float(factor), (box.lower[i], box.upper[i])))
    deviances = np.array([problem.deviance(v) for v in problem.predict("design", points, numerics)])
    floors = local_minima(np.where(np.isfinite(deviances), deviances, np.nan))[:MOST_VALLEYS]
    return points[floors] if floors else x[None]


@dataclass(frozen=True)
class Optimum:
    """The result of the search."""

    x: FloatArray
    """The optimum on the refined mesh, shape [d]."""
    start: FloatArray
    """The optimum on the search mesh, shape [d]."""
    vector: FloatArray
    """Prediction of all data on the refined mesh at `x`, shape [k]."""
    slopes: FloatArray
    """Derivatives at `x`, shape [k, d]."""
    scatter: Scatter | None
    """Scatter between the shots; None if not requested."""
    confirmed: bool
    """True if the last run on the refined mesh confirmed the optimum."""

    @property
    def scatter_size(self) -> float:
        """Relative scatter between the shots [-]; 0 if not requested."""
        return 0.0 if self.scatter is None else self.scatter.value


MOST_RUNS = 12
"""Maximum number of runs on the refined mesh, not counting those for slopes."""
COARSE_SLOPE_RUNS = 3
"""Number of runs on the refined mesh that use the slopes of the search mesh."""
CONFIRMED = 0.25
"""An optimum is confirmed if the last step to it is shorter than this, in standard deviations."""
WORSE_STEP = 1.0
"""A step was too long if the deviance rises by more than this."""


@dataclass(frozen=True)
class _RefinedRun:
    """A run on the refined mesh, and the step to the optimum of its linear model."""

    x: FloatArray
    """The point, shape [d]."""
    vector: FloatArray
    """All data as predicted at this point, shape [k]."""
    cost: float
    step: FloatArray
    """Step to the optimum of the linear model inside the bounds, shape [d]."""
    sigma: FloatArray
    """Standard deviations of the unknowns in the linear model, shape [d]."""

    @property
    def confirmed(self) -> bool:
        """True if the run confirms the optimum."""
        return bool((np.abs(self.step) <= CONFIRMED * self.sigma).all())


def refined_optimum(problem: JointProblem, x: FloatArray, slopes: FloatArray) -> Optimum:
    """The optimum on the refined mesh, from the optimum, [d], and slopes, [k, d], on the search mesh.

    Raises ValueError if a run on the refined mesh, or a neighbouring run, does not complete.
    """
    fine = problem.refined
    lower, upper = np.array(problem.unknowns.box.lower), np.array(problem.unknowns.box.upper)
    start, best, least, own = x, None, None, False
    gained = np.inf
    for made in range(1, MOST_RUNS + 1):
        vector = problem.predict("check", x[None], fine)[0]
        if np.isnan(vector).any():
            raise ValueError(
                f"a run at the optimum on the refined mesh of {fine.mesh[0]} x {fine.mesh[1]} elements did "
                "not complete: take another --refined-mesh"
            )
        cost = problem.deviance(vector)
        astray = best is not None and cost > best.cost + WORSE_STEP
        if not astray:
            if best is not None:
                slopes = secant(slopes, best.x, best.vector, best.sigma, x, vector)
                gained = best.cost - cost
            best = _judge_run(problem, x, vector, cost, slopes)
            if least is None or cost < least.cost:
                least = best
            if best.confirmed:
                break
        assert best is not None  # the first run is the best so far
        if own and astray:
            x = 0.5 * (best.x + x)  # the step was too long for a linear model
            continue
        if not own and (astray or made >= COARSE_SLOPE_RUNS):
            slopes, own, gained = problem.slopes(best.x, best.sigma, fine)[1], True, np.inf
            best = _judge_run(problem, best.x, best.vector, best.cost, slopes)
            if best.confirmed:
                break
        # If a step hardly reduces the misfit, the next one is halved, because the steps oscillate.
        x = np.clip(best.x + (best.step if gained > WORSE_STEP else 0.5 * best.step), lower, upper)
    assert best is not None
    assert least is not None
    if best.cost > least.cost + WORSE_STEP:
        best = least  # steps with small rises have moved away from the optimum
    return Optimum(best.x, start, best.vector, slopes, None, best.confirmed)


def _judge_run(
    problem: JointProblem, x: FloatArray, vector: FloatArray, cost: float, slopes: FloatArray
) -> _RefinedRun:
    lower, upper = np.array(problem.unknowns.box.lower), np.array(problem.unknowns.box.upper)
    residual = vector - problem.stack.data
    whitening = problem.stack.weighting(residual)
    rows = whitening.apply(slopes.T)
    # A parameter at its bound does not require further steps.
    width = upper - lower  # unknowns of different units
    scaled = (rows * width[:, None]).T
    step = width * bounded_step(scaled, whitening.apply(residual), (lower - x) / width, (upper - x) / width)
    sigma = np.sqrt(np.diag(np.linalg.inv(information(rows, width))))
    return _RefinedRun(x, vector, cost, step, sigma)


def with_refined_patterns(problem: JointProblem, found: Optimum) -> Optimum:
    """The optimum on the refined mesh, with noise patterns computed on a fine mesh.

    It is unchanged if a surface slides (single runs jump), the search has not converged, or the run on the
    graded mesh fails, which is reported with the mesh's part of the interval.
    """
    if not (problem.settings.replicates and found.confirmed) or problem.slides:
        return found
    numerics = coarser_graded(problem.mesh, problem.settings.refined_mesh)
    if np.isnan(problem.predict("noise", found.x[None], numerics)).any():
        return found
    problem.learn_noise(found.x, numerics)
    return replace(refined_optimum(problem, found.x, found.slopes), start=found.start)


LARGEST = 0.5
"""Largest relative scatter searched [-]."""
SMALLEST = 1e-5
"""A smaller scatter counts as zero [-]."""
RISE = 3.84
"""Rise of the deviance at the ends of a 95 % interval of one parameter [-]."""
COVERAGE = 2.0
"""Coverage factor k of intervals [-]."""


def restricted_deviance(residual: FloatArray, slopes: FloatArray, whitening: Whitening) -> float:
    """-2 ln of the restricted likelihood up to a constant [-]."""
    r, rows = whitening.apply(residual), whitening.apply(slopes.T)
    normal = rows @ rows.T
    followed = rows @ r
    taken = float(followed @ np.linalg.solve(normal, followed))
    return whitening.log_determinant + float(np.linalg.slogdet(normal)[1]) + float(r @ r) - taken


def restricted_scatter(
    residual: FloatArray, slopes: FloatArray, patterns: FloatArray, weights: Callable[[FloatArray], Whitening]
) -> Scatter:
    """The scatter and its 95 % interval."""

    def deviance(s: float) -> float:
        return restricted_deviance(residual, slopes, weights(s * patterns))

    def at(log: float) -> float:
        return deviance(float(np.exp(log)))

    ends = np.log(SMALLEST), np.log(LARGEST)
    grid = np.linspace(*ends, 25)
    values = np.array([at(g) for g in grid])
    best = int(np.argmin(values))
    inner = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    found = minimize_scalar(at, bounds=inner, method="bounded", options={"xatol": 1e-4})
    none = deviance(0.0)
    value, least = (float(np.exp(found.x)), float(found.fun))
    if none <= least or value <= 2.0 * SMALLEST:
        value, least = 0.0, min(none, least)

    def above(log: float) -> float:
        return at(log) - least - RISE

    low = 0.0
    if none - least > RISE and above(ends[0]) > 0.0:
        low = float(np.exp(brentq(above, ends[0], np.log(value))))
    start = np.log(value) if value > 0.0 else ends[0]
    high = float(np.exp(brentq(above, start, ends[1]))) if above(ends[1]) > 0.0 else LARGEST
    return Scatter(value=value, interval=(low, high))


def expanded_scatter(sigma: float, between: float, shots: int) -> float:
    """Half width of a 95 % interval (k = 2). Part of the variance is a scatter between few shots.

    Student's t has the degrees of freedom of Welch and Satterthwaite: n - 1 of the part ``between`` n shots,
    infinitely many of the rest. The coverage is 95.45 %, as for k = 2.
    """
    if between <= 0.0 or sigma <= 0.0:
        return COVERAGE * sigma
    freedom = (shots - 1) * (sigma / min(between, sigma)) ** 4
    return float(stdtrit(freedom, ndtr(COVERAGE))) * sigma


def between_variance(
    whole: FloatArray, plain: FloatArray, without: FloatArray, no_scatter: FloatArray
) -> FloatArray:
    """Variance by the scatter, shape [d]; with it, the total is not below that of weights without scatter.

    ``whole``: variances with the scatter in the weights. ``plain``, ``without``: those of independent
    residuals with the same discrepancies, with and without the scatter. ``no_scatter``: those if the
    discrepancies explain the residuals instead.
    """
    return np.asarray(np.maximum(plain - without, 0.0) + np.maximum(no_scatter - whole, 0.0))


COARSE_PATTERNS = (
    "the weights contain the flyers' noise as computed on the mesh of the search, because the search on "
    "the refined mesh did not converge with that of a graded mesh: the errors of Poisson's ratio and "
    "damping may exceed their intervals; refine both meshes"
)
"""Warning if the old patterns are kept."""


def with_patterns_and_scatter(problem: JointProblem, found: Optimum, said: list[str]) -> Optimum:
    """The optimum with recomputed patterns, and with the scatter between the shots.

    If the search converges only with the old patterns, they are kept, with a sentence in ``said``. On coarse
    meshes, the new patterns may ring at another frequency than the slopes.
    """
    before = problem.stack
    last = with_scatter(problem, with_refined_patterns(problem, found))
    if last.confirmed or not found.confirmed:
        return last
    anew, problem.stack = problem.stack, before
    old = with_scatter(problem, found)
    if not old.confirmed:
        problem.stack = anew
        return last
    said.append(COARSE_PATTERNS)
    return old


def with_scatter(problem: JointProblem, found: Optimum) -> Optimum:
    """The optimum with the scatter between the shots, which is added to the weights."""
    if not problem.settings.scatter or len(problem.stack.shots) < 2:
        return found
    scatter = _estimate_scatter(problem, found)
    if scatter.value > 0.0:
        found = replace(refined_optimum(problem, found.x, found.slopes), start=found.start)
    return replace(found, scatter=scatter)


def _estimate_scatter(problem: JointProblem, found: Optimum) -> Scatter:
    """Estimate the scatter between the shots on the refined mesh, and add it to the weights."""
    stack, residual = problem.stack, found.vector - problem.stack.data
    change = problem.unknowns.relative_stiffness(found.slopes, found.x)
    slow = slow_stiffness(change, [part for _, part in problem.slow_parts()])
    patterns = np.concatenate([stack.of_each(change), slow])
    # The discrepancy of each shot is estimated after its stiffness is fitted.
    objectives = stack.weighed_beside(residual, patterns)
    # Unconstrained unknowns do not reduce the degrees of freedom.
    seen = np.linalg.norm(stack.whitening(objectives).apply(found.slopes.T), axis=1)
    slopes = found.slopes[:, seen * problem.unknowns.widths >= BLIND]
    between = restricted_scatter(residual, slopes, patterns, lambda more: stack.whitening(objectives, more))
    if between.value > 0.0:
        shots = []
        for one, row in zip(stack.shots, stack.parts(between.value * change), strict=True):
            whole = np.zeros(len(one.kept))
            whole[one.kept] = row
            shots.append(replace(one, own={**one.own, SCATTER: whole}))
        of_slow = between.value * slow if len(slow) else None
        problem.stack = replace(stack, shots=tuple(shots), slow_scatter=of_slow)
    return between


def slow_stiffness(change: FloatArray, parts: Sequence[slice]) -> FloatArray:
    """Changes of the data by the stiffness, one row per slow test that depends on it, [n, k]."""
    rows = np.zeros((len(parts), len(change)))
    for row, part in zip(rows, parts, strict=True):
        row[part] = change[part]
    return rows[np.abs(rows).any(axis=1)]
