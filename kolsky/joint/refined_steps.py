"""From the optimum on the search's mesh to that on the refined one.

The first steps take the slopes of the search's mesh, which each run corrects (Broyden's update). Where one
leads astray, or `BORROWED` runs have not come to rest, the slopes are taken on the refined mesh itself: a
batch of differences, which costs less than a dozen runs that grope.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.weights import bounded_step, information

STEPS = 12
"""Most runs on the refined mesh, those beside an optimum for its slopes not among them."""
BORROWED = 3
"""Runs on the refined mesh that make do with the slopes of the search's mesh."""
CONFIRMED = 0.25
"""Length of the last step there, in standard deviations, at which it is confirmed."""
WORSE = 1.0
"""Rise of the deviance beyond which a step was too long."""


@dataclass(frozen=True)
class _Run:
    """A run on the refined mesh, and where its linear model asks to go."""

    x: FloatArray
    """The point, shape [d]."""
    vector: FloatArray
    """All data as predicted there, shape [k]."""
    cost: float
    """The deviance."""
    step: FloatArray
    """To the optimum of the linear model inside the bounds, shape [d]."""
    sigma: FloatArray
    """Standard deviations of the unknowns by it, shape [d]."""

    @property
    def confirmed(self) -> bool:
        """Whether the optimum is where the run was made."""
        return bool((np.abs(self.step) <= CONFIRMED * self.sigma).all())


def refined_optimum(problem: JointProblem, x: FloatArray, slopes: FloatArray) -> Optimum:
    """The optimum on the refined mesh.

    Parameters
    ----------
    problem
        Shots and slow tests.
    x
        The optimum on the search's mesh, shape [d].
    slopes
        Derivatives of all data there, shape [k, d].

    Raises
    ------
    ValueError
        If a run there, or one beside it, does not complete.
    """
    fine = problem.refined
    lower, upper = np.array(problem.unknowns.box.lower), np.array(problem.unknowns.box.upper)
    start, best, least, own = x, None, None, False
    gained = np.inf
    for made in range(1, STEPS + 1):
        vector = problem.predict("check", x[None], fine)[0]
        if np.isnan(vector).any():
            raise ValueError(
                f"a run at the optimum on the refined mesh of {fine.mesh[0]} x {fine.mesh[1]} elements did "
                "not complete: take another --refined-mesh"
            )
        cost = problem.deviance(vector)
        astray = best is not None and cost > best.cost + WORSE
        if not astray:
            if best is not None:
                slopes = secant(slopes, best.x, best.vector, best.sigma, x, vector)
                gained = best.cost - cost
            best = _run(problem, x, vector, cost, slopes)
            if least is None or cost < least.cost:
                least = best
            if best.confirmed:
                break
        assert best is not None  # the first run is the best so far
        if own and astray:
            x = 0.5 * (best.x + x)  # the step was too long for a linear model
            continue
        if not own and (astray or made >= BORROWED):
            slopes, own, gained = problem.slopes(best.x, best.sigma, fine)[1], True, np.inf
            best = _run(problem, best.x, best.vector, best.cost, slopes)
            if best.confirmed:
                break
        # Where a step has hardly gained anything the next one is half as long: they go to and fro.
        x = np.clip(best.x + (best.step if gained > WORSE else 0.5 * best.step), lower, upper)
    assert best is not None
    assert least is not None
    if best.cost > least.cost + WORSE:
        best = least  # steps that each rise a little have led away
    return Optimum(best.x, start, best.vector, slopes, None, best.confirmed)


def _run(problem: JointProblem, x: FloatArray, vector: FloatArray, cost: float, slopes: FloatArray) -> _Run:
    lower, upper = np.array(problem.unknowns.box.lower), np.array(problem.unknowns.box.upper)
    residual = vector - problem.stack.data
    whitening = problem.whitening(residual)
    rows = whitening.apply(slopes.T)
    # A bound that is reached is no reason to go on.
    step = bounded_step(rows, whitening.apply(residual), lower - x, upper - x)
    sigma = np.sqrt(np.diag(np.linalg.inv(information(rows, upper - lower))))
    return _Run(x, vector, cost, step, sigma)


def secant(
    slopes: FloatArray,
    before: FloatArray,
    vector_before: FloatArray,
    sigma: FloatArray,
    x: FloatArray,
    vector: FloatArray,
) -> FloatArray:
    """The slopes that also explain a change between two runs: Broyden's, the unknowns in sigmas, [k, d].

    Parameters
    ----------
    slopes
        By the unknowns, shape [k, d].
    before, vector_before
        A point, shape [d], and the data there, shape [k].
    sigma
        Standard deviations of the unknowns, shape [d].
    x, vector
        Another point, and the data there.
    """
    step = (x - before) / sigma
    if not step.any():
        return slopes
    missed = vector - vector_before - slopes @ (x - before)
    return slopes + np.outer(missed, step / sigma) / float(step @ step)
