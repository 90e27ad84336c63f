"""The likelihood of a shot's data on a surrogate, with the data vector reduced to what can move.

A surrogate by principal components is affine in its scores s(x): with weights W, W (R(x) - data) =
A s(x) + b. With the triangular factor T of [A b], |A s + b|^2 = |T [s 1]|^2 to round-off: a few dozen
numbers take the place of some thousand.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from doe import Box
from doe.surrogates import ComponentSurrogate
from doe.uncertainty import Channel, Likelihood
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import CorrectedSurrogate


@dataclass(frozen=True)
class ReducedResiduals:
    """T and the scores."""

    coordinates: Callable[[FloatArray], FloatArray]
    """s(x), shape [n, d] -> [n, q]."""
    triangle: FloatArray
    """T, shape [p, q + 1]."""

    def residuals(self, points: FloatArray) -> FloatArray:
        """Residuals with the same sum of squares as the weighted data vector's, shape [n, d] -> [n, p]."""
        s = self.coordinates(points)
        return s @ self.triangle[:, :-1].T + self.triangle[:, -1]


def reduce_residuals(model: CorrectedSurrogate, objective: Objective) -> ReducedResiduals:
    """Reduce a corrected surrogate and an objective with fixed discrepancies.

    Raises
    ------
    TypeError
        If the surrogate is not one by principal components.
    """
    surrogate = model.surrogate
    if not isinstance(surrogate, ComponentSurrogate):
        raise TypeError(f"a surrogate by principal components is needed, got {type(surrogate).__name__}")
    q = surrogate.n_components
    slope = np.zeros((len(objective.data), 0)) if np.isscalar(model.slope) else np.asarray(model.slope)
    anchor = 0.0 if model.anchor is None else model.anchor

    def coordinates(points: FloatArray) -> FloatArray:
        scores = surrogate.scores(points, extrapolate=True)
        return np.hstack([scores, points - anchor]) if slope.size else scores

    zero = surrogate.components.expand(np.zeros((1, q)))[0] + model.shift - objective.data
    columns = np.column_stack([surrogate.components.deviation(np.eye(q)).T, slope, zero])
    _, triangle = np.linalg.qr(objective.whitened(columns.T).T)
    return ReducedResiduals(coordinates, triangle)


def reduced_likelihood(model: CorrectedSurrogate, objective: Objective, box: Box) -> Likelihood:
    """The likelihood with the objective's weights, its noise and discrepancies, fixed."""
    short, prior = reduce_residuals(model, objective), objective.prior
    p = len(short.triangle)
    if prior is None:
        return Likelihood(box, short.residuals, np.zeros(p), [Channel("force and shape", np.ones(p))])

    def residuals(points: FloatArray) -> FloatArray:
        return np.hstack([short.residuals(points), prior.residuals(points)])

    p += len(prior.rows())
    return Likelihood(box, residuals, np.zeros(p), [Channel("force, shape and prior", np.ones(p))])


def full_likelihood(
    model: CorrectedSurrogate, objective: Objective, box: Box, *, taus: tuple[float, float] | None = None
) -> Likelihood:
    """The likelihood of the whole data vector, a channel for the force and one for the outline.

    Parameters
    ----------
    model, objective, box
        As of `reduced_likelihood`.
    taus
        Discrepancies of force [N] and outline [m] instead of the objective's.
    """
    force, shape = taus or (objective.force_discrepancy, objective.shape_discrepancy)
    n = objective.n_force
    channels = [Channel("force", objective.noise[:n], discrepancy=force)]
    if len(objective.data) > n:
        channels.append(Channel("outline", objective.noise[n:], discrepancy=shape))
    prior = objective.prior
    if prior is None:
        return Likelihood(box, model.predict, objective.data, channels)
    known = np.zeros(len(prior.rows()))

    def predict(points: FloatArray) -> FloatArray:
        return np.hstack([model.predict(points), prior.residuals(points)])

    channels.append(Channel("prior", np.ones(len(known))))
    return Likelihood(box, predict, np.concatenate([objective.data, known]), channels)
