"""Bounded least squares on the expensive function from several starts. Each step needs one batch of runs for
all starts.

The steps are Levenberg and Marquardt's. Each is a bounded linear least-squares problem (SciPy's
`lsq_linear`). Every trial point is run together with its neighbours for central differences. One step of all
searches therefore costs one batch. Short steps may use Broyden's update of the slopes instead of neighbours
(`secant`).

`Whitening` holds the weights of data whose errors are independent except for a few common patterns. The
covariance is C = D + M' M. D is a diagonal of variances; each row of M is the change of many data by one
standard deviation of a common error. With B = M D^(-1/2), its products B B' = U L U', A = U' B and R = (1 +
L)^(1/2),

    C^(-1/2) = (1 - A' (R (1 + R))^-1 A) D^(-1/2),    ln det C = ln det D + sum ln(1 + L),

The largest decomposed matrix is the one of the patterns' products. No division by a small L occurs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear

from doe.arrays import FloatArray
from doe.box import Box


@dataclass(frozen=True)
class Whitening:
    """The square root of an inverse covariance. The covariance is a diagonal with a few common patterns."""

    sigma: FloatArray
    """Standard deviations of the independent part, shape [k]."""
    patterns: FloatArray | None = None
    """Changes of the data by one standard deviation of each common error, shape [n, k]; None if there are
    none."""
    counts: FloatArray | float = 1.0
    """Number of independent values per entry in the log determinant [-], shape [k] or one number. It is below
    one where `sigma` is enlarged because entries are not independent."""

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0).all():
            raise ValueError(f"every sigma must be > 0, got {float(np.min(self.sigma)):.6g}")
        if self.patterns is not None and self.patterns.shape[1:] != self.sigma.shape:
            raise ValueError(f"patterns of shape {self.patterns.shape} do not fit {self.sigma.shape} sigmas")

    @cached_property
    def _common(self) -> tuple[FloatArray, FloatArray]:
        """1 + L and rows A of the patterns in units of sigma, shapes [n] and [n, k]."""
        if self.patterns is None:
            return np.ones(0), np.zeros((0, len(self.sigma)))
        scaled = self.patterns / self.sigma
        squares, turned = np.linalg.eigh(scaled @ scaled.T)
        return 1.0 + np.maximum(squares, 0.0), np.asarray(turned.T @ scaled)

    def apply(self, rows: FloatArray) -> FloatArray:
        """C^(-1/2) applied to rows of shape [..., k]. For residuals the sum of squares of the result is
        chi-square."""
        total, common = self._common
        root, scaled = np.sqrt(total), rows / self.sigma
        return np.asarray(scaled - ((scaled @ common.T) / (root * (1.0 + root))) @ common)

    def precision(self, rows: FloatArray) -> FloatArray:
        """C^-1 applied to rows of shape [..., k]."""
        total, common = self._common
        scaled = rows / self.sigma
        return np.asarray((scaled - ((scaled @ common.T) / total) @ common) / self.sigma)

    @property
    def log_determinant(self) -> float:
        """ln det C [-]."""
        total, _ = self._common
        return float(2.0 * (self.counts * np.log(self.sigma)).sum() + np.log(total).sum())

    def deviance(self, residual: FloatArray) -> float:
        """Chi-square of a residual of shape [k], plus ln det C [-]."""
        return float((self.apply(residual) ** 2).sum()) + self.log_determinant


BatchRun = Callable[[FloatArray], FloatArray]
"""Responses at points in parameter units, [n, d] -> [n, k]. The row of a failed run contains NaN."""
Weighting = Callable[[FloatArray], Whitening]
"""Weights of the entries for a given residual, shape [k]."""

STEP = 5e-3
"""Half the distance of central differences in the unit box."""
CONVERGED_STEP = 0.1
"""A search has converged if its next undamped step is shorter than this [standard deviations]."""
LONGEST = 0.25
"""Longest step of a coordinate in the unit box."""
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e3
"""Marquardt's damping: the first, the smallest and the largest value. Above the largest the search stops."""
FLAT = 1e-3
"""Smallest ratio of a coordinate's damping scale to the largest scale."""


@dataclass(frozen=True)
class LeastSquaresResult:
    """Result of one search on the expensive function."""

    x: FloatArray
    """The point, in parameter units, shape [d]."""
    deviance: float
    """Chi-square plus the logarithm of the covariance's determinant there [-]."""
    sigma: FloatArray
    """Standard deviations from (J^T J)^-1 there, in parameter units, shape [d]; infinite where no entry
    varies."""
    at_bound: tuple[str, ...]
    """Parameters on a face of the box."""
    converged: bool
    ended: str
    """Reason for the end of the search, in words."""
    runs: int
    steps: int
    """Number of trial points, including rejected ones."""


class _Search:
    """One search: its current point and its next trial point."""

    def __init__(
        self,
        box: Box,
        u: FloatArray,
        data: FloatArray,
        weighting: Weighting,
        step: float,
        at_rest: float,
        short: float,
    ) -> None:
        self.box, self.data, self.weighting, self.step, self.at_rest = box, data, weighting, step, at_rest
        self.short = short
        self.u, self.trial = u, u
        self.response = self.slope = np.empty(0)
        self.residual = self.jacobian = np.empty(0)
        self.weights = Whitening(np.ones(len(data)))
        # Whether the trial point has neighbours, and whether the slopes are Broyden's.
        self.with_neighbours, self.updated = True, False
        self.deviance, self.damping = np.inf, DAMPING
        self.runs = self.steps = 0
        self.converged, self.ended = False, ""

    @property
    def neighbours(self) -> tuple[FloatArray, FloatArray]:
        """The trial point shifted up and down in every coordinate, inside the box, [d, d] each."""
        h = self.step * np.eye(self.box.dimension)
        return np.minimum(self.trial + h, 1.0), np.maximum(self.trial - h, 0.0)

    def batch(self) -> FloatArray:
        """The points to run, in parameter units, shape [2 d + 1, d], or [1, d] without neighbours."""
        points = [self.trial[None], *(self.neighbours if self.with_neighbours else ())]
        return self.box.scale(np.concatenate(points))

    def take(self, responses: FloatArray) -> None:
        """Accept or reject the trial point, and choose the next one."""
        self.runs, self.steps = self.runs + len(responses), self.steps + 1
        d = self.box.dimension
        if np.isfinite(responses).all():
            residual = responses[0] - self.data
            weights = self.weighting(residual)
            weighed = weights.apply(residual)
            deviance = float((weighed**2).sum()) + weights.log_determinant
        else:
            deviance = np.inf  # a failed run is rejected; the next step is shorter
        up, down = self.neighbours
        if deviance < self.deviance:
            if self.with_neighbours:
                self.slope = central_slopes(responses, up, down)
            else:
                self.slope = secant(self.slope, self.u, self.response, np.ones(d), self.trial, responses[0])
            self.u, self.deviance, self.response = self.trial, deviance, responses[0]
            self.weights, self.residual = weights, weighed
            self.damping = max(0.2 * self.damping, LEAST_DAMPING)
            self.updated, self.with_neighbours = not self.with_neighbours, False
        elif not np.isfinite(self.deviance):
            self.ended = "the run at the start, or a neighbouring one, failed"
            return
        else:
            self.damping *= 5.0
            if self.updated and self.with_neighbours and np.isfinite(deviance):
                self.slope, self.updated = central_slopes(responses, up, down), False
            self.with_neighbours = True
        self.jacobian = self.weights.apply(self.slope.T).T
        self._propose()

    def _propose(self) -> None:
        length = float(np.linalg.norm(self.jacobian @ self._step(0.0)))
        self.with_neighbours |= length > self.short
        if length <= self.at_rest:
            self.converged = True
            self.ended = f"the next step is within {self.at_rest:g} standard deviations"
        elif self.damping > MOST_DAMPING:
            self.ended = "no step lowers the misfit, though its slope is not zero: it is rough on this scale"
        else:
            self.trial = np.clip(self.u + self._step(self.damping), 0.0, 1.0)

    @property
    def predicted_decrease(self) -> float:
        """Decrease of chi-square by the undamped step of the linear model [-]."""
        after = self.residual + self.jacobian @ self._step(0.0)
        return float((self.residual**2).sum() - (after**2).sum())

    def _step(self, damping: float) -> FloatArray:
        """The step of the linear model, inside the box and no longer than `LONGEST`, shape [d]."""
        low, high = np.maximum(-self.u, -LONGEST), np.minimum(1.0 - self.u, LONGEST)
        return bounded_step(self.jacobian, self.residual, low, high, damping=damping)

    def result(self) -> LeastSquaresResult:
        u, h = self.u, 1e-6
        up, down = np.minimum(u + h, 1.0), np.maximum(u - h, 0.0)
        edges = (self.box.scale(up) - self.box.scale(down)) / (up - down)
        faces = zip(self.box.names, u, strict=True)
        return LeastSquaresResult(
            x=self.box.scale(u),
            deviance=self.deviance,
            sigma=_sigma(self.jacobian) * edges if self.jacobian.size else np.full(len(u), np.inf),
            at_bound=tuple(name for name, v in faces if min(v, 1.0 - v) <= 1e-9),
            converged=self.converged,
            ended=self.ended or "the steps were used up",
            runs=self.runs,
            steps=self.steps,
        )


def central_slopes(responses: FloatArray, up: FloatArray, down: FloatArray) -> FloatArray:
    """Slopes from the runs at a point, those above it and those below it, [1 + 2 d, k] -> [k, d].

    ``up``, ``down``: the neighbours in the unit box, shape [d, d] each.
    """
    d = len(up)
    difference: FloatArray = responses[1 : d + 1] - responses[d + 1 :]
    return (difference / (up - down).sum(axis=1)[:, None]).T


def bounded_step(
    jacobian: FloatArray, residual: FloatArray, low: FloatArray, high: FloatArray, *, damping: float = 0.0
) -> FloatArray:
    """Damped step to the least-squares optimum of a linear model inside bounds, shape [d].

    ``jacobian``: shape [k, d]. ``residual``: prediction minus data, shape [k]. ``low`` <= 0 <= ``high``:
    bounds of the step. ``damping``: of Marquardt, added to the normal equations, times their diagonal [-].
    Elements of the diagonal below the largest times the square of `FLAT` are damped like that value.
    """
    right = -residual
    if damping:
        size = np.sqrt((jacobian**2).sum(axis=0))
        scale = np.sqrt(damping) * np.maximum(size, max(FLAT * float(size.max()), np.finfo(float).tiny))
        jacobian = np.concatenate([jacobian, np.diag(scale)])
        right = np.concatenate([right, np.zeros(len(size))])
    # A coordinate on a face can move to one side only. Its bound on the other side is zero; the two
    # bounds must differ.
    bounds = np.minimum(low, -1e-15), np.maximum(high, 1e-15)
    return np.asarray(lsq_linear(jacobian, right, bounds, method="bvls").x, dtype=np.float64)


def newton_step(hessian: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Newton's step inside bounds for a regular Hessian, shape [d]. Much faster than `bounded_step`.
    Coordinates that pass a bound stop there, and the steps of the others are found again. ``low`` <= 0 <=
    ``high``: bounds of the step."""
    step, free = np.linalg.solve(hessian, -gradient), np.ones(len(low), dtype=bool)
    while (beyond := free & ((step < low) | (step > high))).any():
        step = np.clip(step, low, high)
        free &= ~beyond
        fixed = -gradient - hessian @ np.where(free, 0.0, step)
        step[free] = np.linalg.solve(hessian[np.ix_(free, free)], fixed[free])
    return np.asarray(step)


def least_squares(
    run: BatchRun,
    box: Box,
    starts: ArrayLike,
    *,
    data: ArrayLike,
    weighting: Weighting,
    step: float = STEP,
    max_steps: int = 40,
    at_rest: float = CONVERGED_STEP,
    give_up: float = np.inf,
    short: float = 0.0,
) -> tuple[LeastSquaresResult, ...]:
    """Search a box for the response that is nearest to the data, from several starts in parallel.

    The deviance is r' C^-1 r + ln det C with the covariance C(r) from `weighting`; it never increases. With a
    constant C this is least squares. With the most likely C for each r, the result is the most likely point.

    ``starts``: in parameter units, shape [n, d]. ``data``: shape [k]. ``weighting``: weights of the entries
    for a residual. ``step``: half the distance of the differences in the unit box, in (0, 0.1].
    ``max_steps``: largest number of trial points of a search. ``at_rest``: > 0; a search has converged if its
    next undamped step is shorter than this [standard deviations]. ``give_up``: a search is given up if
    another one is better by more than this many times the predicted decrease of its next step [-], > 0.
    ``short``: after an accepted step, the next one is run without neighbours if it is shorter than this
    [standard deviations], >= 0.

    Returns one result for each start, smallest deviance first. A search may end by a failed run, by the step
    limit, or because another one is much better. Then `converged` is False, `ended` gives the reason, and the
    result is its best point. Raises ValueError if the runs at all starts failed.
    """
    if not 0.0 < step <= 0.1:
        raise ValueError(f"step must be in (0, 0.1] of the unit box, got {step}")
    if not at_rest > 0.0:
        raise ValueError(f"at_rest must be > 0 standard deviations, got {at_rest}")
    if not give_up > 0.0:
        raise ValueError(f"give_up must be > 0 predicted decreases, got {give_up}")
    if not short >= 0.0:
        raise ValueError(f"short must be >= 0 standard deviations, got {short}")
    y = np.asarray(data, dtype=np.float64)
    points = np.clip(box.unit(box.require(starts, what="start")), 0.0, 1.0)
    searches = [_Search(box, u, y, weighting, step, at_rest, short) for u in points]
    for _ in range(max_steps):
        active = [search for search in searches if not search.ended]
        if not active:
            break
        batches = [search.batch() for search in active]
        responses = np.asarray(run(np.concatenate(batches)), dtype=np.float64)
        n = sum(len(batch) for batch in batches)
        if responses.shape != (n, len(y)):
            raise ValueError(f"a batch must return shape {(n, len(y))}, got {responses.shape}")
        ends = np.cumsum([len(batch) for batch in batches])[:-1]
        for search, part in zip(active, np.split(responses, ends), strict=True):
            search.take(part)
        best = min(search.deviance for search in searches)
        for search in active:
            if not search.ended and search.deviance - give_up * search.predicted_decrease > best:
                search.ended = "another search is better than this one can become"
    if not any(np.isfinite(search.deviance) for search in searches):
        raise ValueError("no search could start: at every start the run, or a neighbouring one, failed")
    return tuple(sorted((search.result() for search in searches), key=lambda found: found.deviance))


def secant(
    slopes: FloatArray,
    before: FloatArray,
    vector_before: FloatArray,
    sigma: FloatArray,
    x: FloatArray,
    vector: FloatArray,
) -> FloatArray:
    """Broyden's update of the slopes from the change between two runs, [k, d].

    The unknowns are in units of sigma.

    ``slopes``: by the unknowns, shape [k, d]. ``before``, ``vector_before``: a point, shape [d], and its
    data, shape [k]. ``sigma``: standard deviations of the unknowns, shape [d]. ``x``, ``vector``: another
    point, and its data.
    """
    step = (x - before) / sigma
    if not step.any():
        return slopes
    missed = vector - vector_before - slopes @ (x - before)
    return slopes + np.outer(missed, step / sigma) / float(step @ step)


def _sigma(jacobian: FloatArray) -> FloatArray:
    """Standard deviations in the unit box, shape [d]. Infinite for a direction that changes no entry."""
    _, singular, right = np.linalg.svd(jacobian, full_matrices=False)
    determined = singular > 1e-12 * max(float(singular[0]), np.finfo(float).tiny)
    shares = (right[determined] / singular[determined][:, None]) ** 2
    blind = (np.abs(right[~determined]) > 1e-6).any(axis=0)
    return np.asarray(np.where(blind, np.inf, np.sqrt(shares.sum(axis=0))))
