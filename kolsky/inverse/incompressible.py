"""The incompressible limit: a Poisson's ratio that stands for it, and what the data can tell from it.

The range of the search ends at K of some hundred MPa; silicone rubbers have 1 to 2 GPa. There a valley of the
misfit may lie in which the model rings in step with nothing but noise. So an optimum near the end of the
range is compared with the limit, and the limit is taken unless the data reject it. What they reject is said:
nu is raised from the limit downward in kappa = 1 - 2 nu, the other parameters follow linearly, and

    Q(kappa) = min_x |W (r + J x + c(kappa) - c(0))|^2 - min_x |W (r + J x)|^2

with the residual r and the slopes J at the limit and the data c of a coarse mesh. The least nu that the data
do not reject is where Q first stays above `RISE`.
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
"""Poisson's ratio from which on an optimum is compared with the limit [-]: below it the ringing is slow
enough to be seen in any test."""
RISE = 10.8
"""Rise of -2 ln L up to which a ratio is not rejected [-]: 2.71, one-sided 95 % of one parameter, times the
largest factor, 4, that residuals correlated in time have on a variance in right shots."""
LEAST_POISSON, LEVELS = 0.49, 24
"""Least ratio that is tried, and number of levels, even in the logarithm of 1 - 2 nu."""
STEP = 1e-3
"""Step of a slope, over the edge of the box."""


def is_at_limit(runner: Runner, x: FloatArray) -> bool:
    """Whether the data of a shot prefer the limit to an optimum on the surrogate's mesh, or do not tell.

    A frame's outline counts once: the surrogate's mesh is too coarse for its noise.

    ``runner``: under the front face's path of the optimum. ``x``: the optimum, shape [d]. An optimum below
    `NEAR_LIMIT` is not compared; nor is one that the shot declares, with an uncertainty.
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
    """What the data of a shot tell of Poisson's ratio from an answer at or near the limit."""

    value: float
    """Where it is held [-]."""
    least: float
    """The least ratio that is not rejected [-]; `LEAST_POISSON` if none is."""
    preferred: float | None
    """A ratio that the data prefer to where it is held; None if there is none."""

    @property
    def sentence(self) -> str:
        """In words."""
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
    """What the data tell of a ratio that is held near the limit; None where it is not, or a run is lost."""
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
    """Squares of whitened residuals [n, p] less the first's, after linear parameters have followed, [n].

    ``slopes``: whitened, by the parameters, shape [d, p].
    """
    followed = np.linalg.lstsq(slopes.T, residuals.T, rcond=None)[0]
    left = residuals - followed.T @ slopes
    squares = (left**2).sum(axis=1)
    return np.asarray(squares - squares[0])


def limit_of(value: float, kappa: FloatArray, rise: FloatArray) -> PoissonLimit:
    """The verdict from levels of kappa = 1 - 2 nu, ascending from where the ratio is held, and their rise."""
    if rise.min() < -RISE:
        return PoissonLimit(value, value, 0.5 * (1.0 - float(kappa[int(np.argmin(rise))])))
    allowed = np.flatnonzero(rise <= RISE)
    last = int(allowed[-1])
    if last == len(kappa) - 1:
        return PoissonLimit(value, LEAST_POISSON, None)
    # The rise goes with the square of kappa where nothing rings.
    ends = np.sqrt(np.maximum(rise[last : last + 2], 0.0))
    end = float(np.interp(np.sqrt(RISE), ends, kappa[last : last + 2]))
    return PoissonLimit(value, 0.5 * (1.0 - end), None)
