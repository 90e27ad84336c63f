"""Fit a Prony series to relaxation, oscillation, rates and shots together, and say whether it is asked for.

Weighted least squares in the logarithms of the factor, the strengths and the times: all are positive, and
their uncertainty is a factor. Every branch is searched for from a grid of strengths and times that is
evaluated in one batch, which suits evidence that is expensive one by one, such as shots.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from explicit.relaxation import PronySeries
from kolsky.base.arrays import FloatArray
from kolsky.material.relaxation.evidence import Evidence, RateModel
from kolsky.material.relaxation.rate_fit import RateFit, RateVerdict

STRENGTHS = (1e-4, 1e3)
"""Allowed strengths of a branch [-]: below, no evidence knows it from none."""
FACTORS = (1e-3, 1e3)
"""Allowed factors on the long-term law [-]."""
BEYOND = 10.0
"""Factor by which a relaxation time may lie outside the evidence's own time scales [-]."""
FACTOR_GRID = (0.4, 2.5, 32)
"""Factors that a search without branches begins among: first, last and how many."""
GRID = (0.1, 0.5, 2.0)
"""Strengths a further branch is looked for with [-]."""
GRID_TIMES = 7
"""Relaxation times it is looked for at."""
REFUSED = 1e6
"""Residual of every value of a model that cannot be simulated [-]."""
DIFFERENCE = 1e-2
"""Half of the central difference in a logarithm: its error is of the square, 1e-4, and a node that lands on a
platen on one side of it alone, which is a jump, weighs little."""


@dataclass(frozen=True)
class PronyProblem:
    """Residuals of all the evidence as functions of the logarithms (factor, strengths, times)."""

    law: Any
    """The long-term law: an `explicit.materials.MaterialLaw`."""
    evidence: tuple[Evidence, ...]
    """Measured tests."""

    @property
    def known(self) -> NDArray[np.bool_]:
        """Values with a finite sigma, which alone count, of all the evidence in a row."""
        return np.concatenate([np.isfinite(e.sigma) for e in self.evidence])

    def of_many(self, points: FloatArray) -> FloatArray:
        """Residuals of each row of logarithms, shape [n_points, n_data]."""
        models = [model_of(x) for x in points]
        parts = [(e.predict(self.law, models) - e.values) / e.sigma for e in self.evidence]
        return np.concatenate(parts, axis=1)[:, self.known]

    def residuals(self, x: FloatArray) -> FloatArray:
        """Residuals at one row of logarithms, shape [n_data]."""
        rows = self.of_many(x[None])[0]
        # A model that cannot be simulated is worse than any that can: the search turns back.
        return rows if np.isfinite(rows).all() else np.full_like(rows, REFUSED)

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Central differences, all of them in one batch, shape [n_data, n_parameters].

        Raises
        ------
        ValueError
            If a simulation beside `x` did not complete.
        """
        shifts = DIFFERENCE * np.eye(len(x))
        both = self.of_many(np.concatenate([x + shifts, x - shifts]))
        if not np.isfinite(both).all():
            raise ValueError(
                f"the evidence cannot be predicted beside {model_of(x)}: a simulation did not complete; end "
                "its window before the specimen is crushed"
            )
        return np.asarray((both[: len(x)] - both[len(x) :]).T / (2.0 * DIFFERENCE))

    def bounds(self, n_branches: int) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest logarithms, each of shape [1 + 2 n_branches]."""
        scales = [e.time_scales for e in self.evidence]
        times = min(s[0] for s in scales) / BEYOND, max(s[1] for s in scales) * BEYOND
        rows = [FACTORS, *[STRENGTHS] * n_branches, *[times] * n_branches]
        lower, upper = np.log(np.array(rows)).T
        return lower, upper

    def scaled(self) -> RateModel:
        """The best factor of a grid, without branches: waves give a shot more than one valley."""
        grid = np.log(np.geomspace(*FACTOR_GRID))[:, None]
        return model_of(grid[self.best(grid)])

    def best(self, points: FloatArray) -> int:
        """Index of the row of logarithms with the least sum of squares, of those that can be simulated."""
        squares = (self.of_many(points) ** 2).sum(axis=1)
        return int(np.argmin(np.where(np.isfinite(squares), squares, np.inf)))

    def extended(self, x: FloatArray) -> FloatArray:
        """With one more branch: the best of a grid."""
        n = len(x) // 2
        lower, upper = self.bounds(n + 1)
        times = np.linspace(lower[-1] + np.log(BEYOND), upper[-1] - np.log(BEYOND), GRID_TIMES)
        points = []
        for strength in GRID:
            for time in times:
                # the long-term law gives way to the branch, so that their mean stays
                factor = x[0] - 0.5 * np.log1p(strength)
                points.append([factor, *x[1 : n + 1], np.log(strength), *x[n + 1 :], time])
        grid = np.array(points)
        return np.asarray(grid[self.best(grid)])

    def idle(self, x: FloatArray, n_branches: int) -> FloatArray:
        """With more branches, of the least strength."""
        n = len(x) // 2
        more = n_branches - n
        lower, upper = self.bounds(n_branches)
        times = np.full(more, 0.5 * (lower[-1] + upper[-1]))
        return np.concatenate([x[: n + 1], np.full(more, np.log(STRENGTHS[0])), x[n + 1 :], times])

    def fit(self, x: FloatArray, jacobian: FloatArray, lower: FloatArray, upper: FloatArray) -> RateFit:
        """Fit at the end of a search between two bounds, its branches in order of their times."""
        n = len(x) // 2
        order = np.argsort(x[n + 1 :])
        kept = np.concatenate([[0], 1 + order, 1 + n + order]).astype(int)
        ends = (x - lower < 1e-3) | (upper - x < 1e-3)
        x, jacobian, ends = x[kept], jacobian[:, kept], ends[kept]
        names = ("factor", *(f"strength {k + 1}" for k in range(n)), *(f"time {k + 1}" for k in range(n)))
        rows = self.of_many(x[None])[0]
        chi_square, free = float(rows @ rows), len(rows) - len(x)
        covariance = np.linalg.pinv(jacobian.T @ jacobian) * max(1.0, chi_square / free)
        counts = [int(np.isfinite(e.sigma).sum()) for e in self.evidence]
        return RateFit(
            model=model_of(x),
            names=names,
            values=np.exp(x),
            covariance=np.asarray(covariance, dtype=np.float64),
            chi_square=chi_square,
            n_data=len(rows),
            residuals=tuple(np.split(rows, np.cumsum(counts)[:-1])),
            at_bound=tuple(name for name, end in zip(names, ends, strict=True) if end),
        )


def model_of(x: FloatArray) -> RateModel:
    """The rate model of a row of logarithms."""
    n = len(x) // 2
    values = np.exp(x)
    return RateModel(
        float(values[0]), PronySeries(tuple(values[1 : n + 1].tolist()), tuple(values[n + 1 :].tolist()))
    )


def logs_of(model: RateModel) -> FloatArray:
    """The logarithms of a model, shape [1 + 2 n_branches]; a weaker branch has the least allowed strength."""
    strengths = np.maximum(model.series.strengths, STRENGTHS[0])
    return np.log(np.concatenate([[model.factor], strengths, model.series.times]))


def fit_prony(
    law: Any,
    evidence: Sequence[Evidence],
    n_branches: int,
    *,
    start: RateModel | None = None,
    max_evaluations: int = 60,
) -> RateFit:
    """Fit a factor and `n_branches` branches to all the evidence at once.

    Parameters
    ----------
    law
        The long-term law: an `explicit.materials.MaterialLaw`.
    evidence : sequence of Evidence
        What was measured.
    n_branches : int
        Branches; 0 fits the factor alone.
    start : RateModel, optional
        A model with as many branches, or fewer, to begin at; further branches come from the grid. By default
        the fit with one branch fewer.
    max_evaluations : int
        Evaluations of the least squares.

    Returns
    -------
    RateFit
        The best of the searches.

    Raises
    ------
    ValueError
        If there is no evidence, fewer values than parameters, or more branches in `start` than asked for.
    """
    if not evidence:
        raise ValueError("a fit needs evidence, got none")
    if n_branches < 0:
        raise ValueError(f"n_branches must be >= 0, got {n_branches}")
    problem = PronyProblem(law, tuple(evidence))
    n_data, n_free = int(problem.known.sum()), 1 + 2 * n_branches
    if n_data <= n_free:
        raise ValueError(f"{n_free} parameters need more than {n_free} measured values, got {n_data}")
    if start is None:
        start = (
            problem.scaled()
            if n_branches == 0
            else fit_prony(law, evidence, n_branches - 1, max_evaluations=max_evaluations).model
        )
    if len(start.series) > n_branches:
        raise ValueError(f"the start has {len(start.series)} branches, {n_branches} are asked for")
    x = logs_of(start)
    while len(x) < n_free:
        x = problem.extended(x)
    lower, upper = problem.bounds(n_branches)
    starts = [x]
    if len(start.series) < n_branches:
        starts.append(problem.idle(logs_of(start), n_branches))  # more branches are never worse than fewer
    searches = [
        least_squares(
            problem.residuals,
            np.clip(begin, lower + 1e-6, upper - 1e-6),
            jac=problem.jacobian,
            bounds=(lower, upper),
            x_scale=1.0,
            max_nfev=max_evaluations,
        )
        for begin in starts
    ]
    found = min(searches, key=lambda search: float(search.cost))
    return problem.fit(found.x, found.jac, lower, upper)


def required_branches(
    law: Any, evidence: Sequence[Evidence], *, at_most: int = 2, max_evaluations: int = 60
) -> RateVerdict:
    """Fit 0, 1, ... `at_most` branches and judge each by what it improves.

    Raises
    ------
    ValueError
        As of `fit_prony`.
    """
    fits = [fit_prony(law, evidence, 0)]
    for n in range(1, at_most + 1):
        fits.append(fit_prony(law, evidence, n, start=fits[-1].model, max_evaluations=max_evaluations))
    scatter = fits[-1].scatter
    gains = [max(a.chi_square - b.chi_square, 0.0) / scatter for a, b in pairwise(fits)]
    return RateVerdict(tuple(fits), tuple(float(chi2.sf(gain, 2)) for gain in gains))
