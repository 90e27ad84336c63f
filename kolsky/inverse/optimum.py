"""The search for the least misfit on a surrogate, and the surrogate's correction by runs of the solver.

One parameter is searched by a simplex; several by bounded least squares, whose steps know how each entry of
the data depends on them: a simplex takes some hundred predictions where that takes some twenty.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from doe import Box, Surrogate
from doe import nelder_mead as minimise
from doe.uncertainty import Channel, Likelihood
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective, Part

Model = Callable[[FloatArray], FloatArray]
"""Predicted data vectors, shape [n, k], of parameter points, shape [n, d] or [d]."""

ON_EDGE = 1e-5
"""A coordinate this close to a bound, as a share of the box's edge, lies on it."""


@dataclass(frozen=True)
class Optimum:
    """The best point of a model and the objective it is best for."""

    x: FloatArray
    """The point, shape [d]."""
    objective: Objective
    """The objective with the discrepancies of that point."""


def search(
    box: Box,
    objective: Objective,
    model: Model,
    part: Part = "joint",
    *,
    start: FloatArray | None = None,
    tolerance: float = 1e-7,
) -> Optimum:
    """Find the optimum and the discrepancies at it (they depend on each other: three rounds).

    Parameters
    ----------
    box
        Where to search.
    objective
        What to minimise; its discrepancies are replaced.
    model
        Predicts data vectors.
    part
        The joint objective, or the force's or the outline's part of it.
    start
        Where to begin, shape [d]; the middle of the box if left out.
    tolerance
        Of the simplex, in the unit box.
    """
    for _ in range(3):
        if box.dimension == 1:
            start = _by_simplex(box, objective, model, part, start, tolerance)
        else:
            start = _by_least_squares(box, objective, model, part, start)
        objective = objective.with_discrepancy(model(start)[0])
    assert start is not None
    return Optimum(start, objective)


def _by_simplex(
    box: Box, objective: Objective, model: Model, part: Part, start: FloatArray | None, tolerance: float
) -> FloatArray:
    def cost(x: FloatArray) -> float:
        return float(objective.chi2(model(x)[0], part)) + objective.prior_chi2(x, part)

    return minimise(cost, box, start=start, tolerance=tolerance).x


def _by_least_squares(
    box: Box, objective: Objective, model: Model, part: Part, start: FloatArray | None
) -> FloatArray:
    prior = objective.prior if part == "joint" else None

    def residuals(points: FloatArray) -> FloatArray:
        weighted = objective.whitened(model(points) - objective.data, part)
        return weighted if prior is None else np.hstack([weighted, prior.residuals(points)])

    middle = 0.5 * (np.array(box.lower) + np.array(box.upper))
    first = middle if start is None else np.clip(start, box.lower, box.upper)
    k = residuals(first[None]).shape[1]
    likelihood = Likelihood(box, residuals, np.zeros(k), [Channel("data and prior", np.ones(k))])
    return likelihood.maximise(box.unit(first)).point


@dataclass(frozen=True)
class CorrectedSurrogate:
    """A surrogate made to agree with runs on another mesh.

    It agrees exactly with the last of them, and in the slope between the last two (Broyden's update).
    """

    surrogate: Surrogate
    """The surrogate of the coarser mesh."""
    anchor: FloatArray | None = None
    """Point of the last run, shape [d]; None before the first."""
    shift: FloatArray | float = 0.0
    """What the last run adds to the surrogate, shape [k]."""
    slope: FloatArray | float = 0.0
    """How that changes away from the last run, shape [k, d]."""

    def predict(self, points: FloatArray) -> FloatArray:
        """Data vectors at points of shape [n, d] or [d], shape [n, k]."""
        x = np.atleast_2d(points)
        change = 0.0 if self.anchor is None else (x - self.anchor) @ np.transpose(self.slope)
        return self.surrogate.predict(x, extrapolate=True) + self.shift + change

    def through(self, point: FloatArray, vector: FloatArray) -> "CorrectedSurrogate":
        """The surrogate that also agrees with a run at `point` which gave `vector`."""
        miss = vector - self.predict(point)[0]
        if self.anchor is None:
            return replace(self, anchor=point, shift=miss, slope=np.zeros((len(vector), len(point))))
        step = point - self.anchor
        if not step.any():
            return replace(self, shift=self.shift + miss)
        slope = self.slope + np.outer(miss, step) / (step @ step)
        moved = replace(self, anchor=point, slope=slope)
        return replace(moved, shift=self.shift + vector - moved.predict(point)[0])


def jacobian(model: Model, box: Box, x: FloatArray) -> FloatArray:
    """Central differences of a model, one-sided at a bound, shape [k, d]."""
    columns = []
    for i in range(box.dimension):
        step = 1e-3 * (box.upper[i] - box.lower[i])
        up, down = x.copy(), x.copy()
        up[i], down[i] = min(x[i] + step, box.upper[i]), max(x[i] - step, box.lower[i])
        columns.append((model(up)[0] - model(down)[0]) / (up[i] - down[i]))
    return np.array(columns).T


def on_edge(x: FloatArray, box: Box) -> NDArray[np.bool_]:
    """Mask of the coordinates of a point that lie on a bound of the box, shape [d]."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    return np.asarray(np.minimum(x - lower, upper - x) < ON_EDGE * (upper - lower))


def at_inner_face(x: FloatArray, local: Box, whole: Box) -> bool:
    """True if a point lies on a face of the local box that is none of the whole one: it would go further."""
    return bool((on_edge(x, local) & ~on_edge(x, whole)).any())
