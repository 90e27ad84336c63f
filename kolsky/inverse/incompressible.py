"""The incompressible limit: its Poisson's ratio, and a test of a ratio against the limit.

The range of the search ends at K of some hundred MPa; silicone rubbers have 1 to 2 GPa. For such a material
the search finds the deepest valley of its range, which may lie far from the limit. Every optimum is therefore
compared with the limit as with another valley, and its ratio is not called identified unless the data reject
the limit. Near the end of the range the ratio is then held at the limit, and the rejected range is reported.
To find it, kappa = 1 - 2 nu is increased from the limit and the other parameters are refitted linearly:

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
from kolsky.inverse.objective import FrontNoise
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.runner import Runner
from kolsky.inverse.valleys import LEAST_MARGIN, VALLEY

AT_LIMIT = "held at the incompressible limit, from which the data do not distinguish it"
"""Reason to hold Poisson's ratio at `INCOMPRESSIBLE`."""
NEAR_LIMIT = 0.4996
"""A larger ratio is held at the limit if the data do not distinguish them [-]. At a smaller ratio this often
has another reason: in 21 of 74 shots with a wrong input, the data do not reject the limit. The cause is found
with the ratio free."""
RISE = 10.8
"""Rise of -2 ln L up to which a ratio is not rejected [-]. It is 2.71 times 4. The first number is one-sided
95 % for one parameter. The second is the largest factor of time-correlated residuals on a variance, found in
correct shots."""
LEAST_POISSON, LEVELS = 0.49, 24
"""Smallest ratio tried, and number of levels, evenly spaced in the logarithm of 1 - 2 nu."""
STEP = 1e-3
"""Step of a slope, as a share of the box edge."""
COUNTED = 0.1
"""Share of a rise of -2 ln L at the limit that counts [-]. The error of the coarse mesh is a smooth field.
The patterns at another valley explain a part of it. Three shots made at 0.49998 by another program have rises
of -79 to 107. Four made at 0.4990 to 0.4996 have 442 to 939 (docs/validation/coverage.md)."""


def rise_at_limit(runner: Runner, x: FloatArray, patterns: FloatArray | None) -> float:
    """-2 ln L at the limit minus that at an optimum on the surrogate's mesh [-]; < 0 if preferred.

    The other parameters follow linearly, with the slopes at the optimum. The outline of a frame counts as one
    value, because the error of this mesh exceeds the outline's noise. At the limit the flyer's noise excites
    little ringing, so its patterns are left out.

    ``runner``: with the path fitted to its record; a path corrected to the data would explain a part of any
    ringing. ``x``: the optimum, shape [d]. ``patterns``: of the flyer's noise at the optimum, shape [q,
    n_bins + n_points]; None if unknown. Returns infinity if the shot declares the ratio with an uncertainty,
    the ratio is not free, or a run fails.
    """
    problem = runner.problem
    names = problem.box.names
    if VALLEY not in names or problem.shot.uncertainty.get(VALLEY, 0.0) > 0.0:
        return np.inf
    i = names.index(VALLEY)
    others = [k for k in range(len(names)) if k != i]
    steps = STEP * (np.array(problem.box.upper) - problem.box.lower)[others]
    points = np.tile(x, (len(names) + 1, 1))
    points[np.arange(len(others)), others] += steps
    points[-1, i] = INCOMPRESSIBLE
    response = runner.forward.run(problem.point(points), problem.numerics)
    if not response.completed.all():
        return np.inf
    prediction = predict(response, problem.observations)
    objective = replace(runner.objective(np.asarray(prediction.inside.all(axis=0))), prior=None)
    *beside, own, limit = objective.vectors(prediction)
    slopes = ((np.array(beside) - own) / steps[:, None]).T
    weighed = replace(objective, balanced=True).with_discrepancy(limit)
    followed = limit + slopes @ linear_step(weighed, slopes, limit, x[others])
    noisy = replace(objective, front=FrontNoise(patterns))
    return float(objective.balanced_deviance(followed[None])[0] - noisy.balanced_deviance(own[None])[0])


def is_distinguished(rise: float) -> bool:
    """True if the data distinguish an optimum from the limit; ``rise``: see `rise_at_limit`."""
    return COUNTED * rise >= LEAST_MARGIN


def limit_warning(rise: float) -> str | None:
    """Warning if the data do not distinguish an optimum from the limit by `rise_at_limit`; else None."""
    if is_distinguished(rise):
        return None
    return (
        f"the data do not distinguish nu from incompressible: -2 ln L at nu = {INCOMPRESSIBLE} is {rise:.3g} "
        f"above that of the answer, and must be {LEAST_MARGIN / COUNTED:.0f}; for a material that may be "
        "incompressible, hold it (--hold poisson=incompressible)"
    )


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
                f"{where}, but the data prefer nu = {self.preferred:.5f}: declare this value in [model] and "
                "free it (--free stiffness_factor --free poisson --free damping)"
            )
        if self.least <= LEAST_POISSON:
            return f"{where}: the data do not constrain it between {LEAST_POISSON:g} and that"
        return f"{where}: nu >= {self.least:.5f} at 95 %, not distinguished from incompressible"


def poisson_limit(runner: Runner, fine: RefinedOptimum, valley: float) -> PoissonLimit | None:
    """Bounds on a ratio held near the limit (`limit_of`); None if it is not held there, or a run fails."""
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
    return limit_of(held, 1.0 - levels, rise, valley)


def profiled_rise(residuals: FloatArray, slopes: FloatArray) -> FloatArray:
    """Sums of squares of whitened residuals [n, p] minus the first, [n], with slopes [d, p] refitted."""
    followed = np.linalg.lstsq(slopes.T, residuals.T, rcond=None)[0]
    left = residuals - followed.T @ slopes
    squares = (left**2).sum(axis=1)
    return np.asarray(squares - squares[0])


def limit_of(value: float, kappa: FloatArray, rise: FloatArray, valley: float = np.inf) -> PoissonLimit:
    """The bounds from levels of kappa = 1 - 2 nu, ascending from the held value, and their rise.

    ``valley``: the ratio that the limit replaced as not distinguished. The bound is not above it, because the
    rise does not include the ringing that the flyer's noise excites.
    """
    if rise.min() < -RISE:
        return PoissonLimit(value, value, 0.5 * (1.0 - float(kappa[int(np.argmin(rise))])))
    allowed = np.flatnonzero(rise <= RISE)
    last = int(allowed[-1])
    if last == len(kappa) - 1:
        return PoissonLimit(value, LEAST_POISSON, None)
    # Without ringing, the rise is proportional to the square of kappa.
    ends = np.sqrt(np.maximum(rise[last : last + 2], 0.0))
    end = float(np.interp(np.sqrt(RISE), ends, kappa[last : last + 2]))
    return PoissonLimit(value, min(0.5 * (1.0 - end), valley), None)
