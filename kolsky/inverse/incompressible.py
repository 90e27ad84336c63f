"""The incompressible limit: its Poisson's ratio, and a test of a ratio against the limit.

The range of the search ends at K of some hundred MPa; silicone rubbers have 1 to 2 GPa. In this range the
misfit may have a valley where the model's ringing fits only noise. An optimum near the end of the range is
therefore compared with the limit. The limit is used unless the data reject it. The rejected range is
reported. To find it, kappa = 1 - 2 nu is increased from the limit and the other parameters are refitted
linearly:

    Q(kappa) = min_x |W (r + J x + c(kappa) - c(0))|^2 - min_x |W (r + J x)|^2

Here r is the residual and J are the slopes, both at the limit; c are the data of a coarse mesh. The least nu
that the data do not reject is where Q first rises above `RISE` and stays above it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.apparatus import INCOMPRESSIBLE
from kolsky.base.arrays import FloatArray
from kolsky.inverse.gauss_newton import linear_step
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.runner import Runner
from kolsky.inverse.valleys import VALLEY

AT_LIMIT = "held at the incompressible limit, from which the data do not distinguish it"
"""Reason to hold Poisson's ratio at `INCOMPRESSIBLE`."""
NEAR_LIMIT = 0.4996
"""An optimum with a larger Poisson's ratio is compared with the limit [-]. At smaller ratios, the ringing is
slow enough to be resolved in any test."""
RISE = 10.8
"""Rise of -2 ln L up to which a ratio is not rejected [-]. It is 2.71 times 4. The first number is one-sided
95 % for one parameter. The second is the largest factor of time-correlated residuals on a variance, found in
correct shots."""
LEAST_POISSON, LEVELS = 0.49, 24
"""Smallest ratio tried, and number of levels, evenly spaced in the logarithm of 1 - 2 nu."""
STEP = 1e-3
"""Step of a slope, as a share of the box edge."""


def is_at_limit(runner: Runner, x: FloatArray) -> bool:
    """True if the data prefer the limit to an optimum on the surrogate's mesh, or distinguish neither.

    The outline of a frame counts as one value, because the error of the surrogate's mesh exceeds the
    outline's noise.

    ``runner``: with the front face's path fitted to its record. A path corrected to the data would explain a
    part of any ringing. ``x``: the optimum, shape [d].

    Returns False for an optimum below `NEAR_LIMIT`, and for a shot that declares the ratio with an
    uncertainty.
    """
    problem = runner.problem
    names = problem.box.names
    if VALLEY not in names or problem.shot.uncertainty.get(VALLEY, 0.0) > 0.0:
        return False
    i = names.index(VALLEY)
    if x[i] < NEAR_LIMIT:
        return False
    others = [k for k in range(len(names)) if k != i]
    steps = STEP * (np.array(problem.box.upper) - problem.box.lower)
    points = np.tile(x, (len(names) + 1, 1))
    points[1:, i] = INCOMPRESSIBLE
    for row, k in enumerate(others, start=2):
        points[row, k] += steps[k]
    response = runner.forward.run(problem.point(points), problem.numerics)
    if not response.completed.all():
        return False
    prediction = predict(response, problem.observations)
    objective = replace(runner.objective(np.asarray(prediction.inside.all(axis=0))), prior=None)
    own, limit, *beside = objective.vectors(prediction)
    slopes = np.stack([(v - limit) / steps[k] for v, k in zip(beside, others, strict=True)], axis=1)
    weighed = objective.with_discrepancy(limit)
    followed = limit + slopes @ linear_step(weighed, slopes, limit, x[others])
    above = float(np.diff(objective.balanced_deviance(np.stack([own, followed])))[0])
    return above < RISE


@dataclass(frozen=True)
class PoissonLimit:
    """Bounds on Poisson's ratio from the data of a shot. Its answer is at the limit or near it."""

    value: float
    """The held value [-]."""
    least: float
    """The smallest ratio that is not rejected [-]; `LEAST_POISSON` if no ratio is rejected."""
    preferred: float | None
    """A ratio that fits the data better than the held ratio; None if there is none."""

    @property
    def sentence(self) -> str:
        """The limit as a sentence."""
        where = f"nu is held at {self.value:g}"
        if self.preferred is not None:
            return (
                f"{where}, but the data prefer nu = {self.preferred:.5f}: leave --hold poisson out, or "
                "declare this value in [model]"
            )
        if self.least <= LEAST_POISSON:
            return f"{where}: the data do not constrain it between {LEAST_POISSON:g} and that"
        return f"{where}: nu >= {self.least:.5f} at 95 %, not distinguished from incompressible"


def poisson_limit(runner: Runner, fine: RefinedOptimum) -> PoissonLimit | None:
    """Bounds on a ratio held near the limit. None if the ratio is not held there, or if a run fails."""
    problem = runner.problem
    held = problem.settings.held.get(VALLEY, PARAMETERS[VALLEY].held(problem.shot))
    if VALLEY in problem.box.names or held <= PARAMETERS[VALLEY].upper:
        return None
    levels = 1.0 - np.geomspace(1.0 - 2.0 * held, 1.0 - 2.0 * LEAST_POISSON, LEVELS)
    values = {**problem.point(np.tile(fine.x, (LEVELS, 1))), VALLEY: 0.5 * levels}
    response = runner.forward.run(values, problem.numerics)
    if not response.completed.all():
        return None
    vectors = fine.objective.reached(predict(response, problem.observations))
    objective = fine.objective.with_discrepancy(fine.model(fine.x)[0])
    residual = fine.model(fine.x)[0] - objective.data
    rows = objective.whitened(residual + vectors - vectors[0])
    rise = profiled_rise(rows, objective.whitened(fine.jacobian.T))
    return limit_of(held, 1.0 - levels, rise)


def profiled_rise(residuals: FloatArray, slopes: FloatArray) -> FloatArray:
    """Sums of squares of whitened residuals [n, p] with linear parameters refitted, minus the first sum, [n].

    ``slopes``: whitened, by the parameters, shape [d, p].
    """
    followed = np.linalg.lstsq(slopes.T, residuals.T, rcond=None)[0]
    left = residuals - followed.T @ slopes
    squares = (left**2).sum(axis=1)
    return np.asarray(squares - squares[0])


def limit_of(value: float, kappa: FloatArray, rise: FloatArray) -> PoissonLimit:
    """The bounds from levels of kappa = 1 - 2 nu, ascending from the held value, and their rise."""
    if rise.min() < -RISE:
        return PoissonLimit(value, value, 0.5 * (1.0 - float(kappa[int(np.argmin(rise))])))
    allowed = np.flatnonzero(rise <= RISE)
    last = int(allowed[-1])
    if last == len(kappa) - 1:
        return PoissonLimit(value, LEAST_POISSON, None)
    # Without ringing, the rise is proportional to the square of kappa.
    ends = np.sqrt(np.maximum(rise[last : last + 2], 0.0))
    end = float(np.interp(np.sqrt(RISE), ends, kappa[last : last + 2]))
    return PoissonLimit(value, 0.5 * (1.0 - end), None)
