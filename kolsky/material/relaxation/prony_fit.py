"""Fit a Prony series to relaxation, oscillation, rates and shots together, and say whether it is asked for.

Weighted least squares in the logarithms of the factor, the strengths and the times: all are positive, and
their uncertainty is a factor. Every branch is searched for from a grid of strengths and times that is
evaluated in one batch, which suits evidence that is expensive one by one, such as shots.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from kolsky.material.relaxation.evidence import Evidence, RateModel
from kolsky.material.relaxation.prony_problem import PronyProblem, logs_of
from kolsky.material.relaxation.rate_fit import RateFit, RateVerdict


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


def branches_asked_for(
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
