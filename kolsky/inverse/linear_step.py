"""Steps to the optimum of a response that is linear in the parameters, inside a box or freely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from a run on the refined mesh."""

    change: FloatArray
    """To the optimum of the linear model, inside the box, shape [d]."""
    sigma: FloatArray
    """Standard deviation of the optimum from the residuals and the prior, shape [d]."""
    objective: Objective
    """With the discrepancies of the run."""

    @property
    def moved(self) -> float:
        """The longest of its coordinates over their standard deviations [-]."""
        return float(np.max(np.abs(self.change) / self.sigma))


def gauss_newton_step(
    objective: Objective, slope: FloatArray, vector: FloatArray, x: FloatArray, box: Box
) -> Step:
    """Solve the linear least-squares problem of data and prior inside a box.

    Parameters
    ----------
    objective
        Its discrepancies are replaced by those of the run.
    slope
        Jacobian of the data vector, shape [k, d].
    vector
        The run's data vector, shape [k].
    x
        Where it was run, shape [d].
    box
        Where the optimum may lie.
    """
    weighed = objective.with_discrepancy(vector)
    sigma = np.sqrt(np.diag(weighed.covariance(slope, vector)))
    rows, right = weighed.whitened(slope.T).T, weighed.whitened(weighed.data - vector)
    if weighed.prior is not None:
        rows = np.vstack([rows, weighed.prior.rows()])
        right = np.concatenate([right, -weighed.prior.residuals(x)])
    low, high = (np.array(box.lower) - x) / sigma, (np.array(box.upper) - x) / sigma
    # On a face there is one side; a bound of zero must not meet the other.
    bounds = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    found = lsq_linear(rows * sigma, right, bounds, method="bvls").x
    return Step(np.clip(found, low, high) * sigma, sigma, weighed)


def linear_step(objective: Objective, slope: FloatArray, vector: FloatArray, x: FloatArray) -> FloatArray:
    """Step to the optimum of the linear model with the objective's own weights, no box, shape [d]."""
    gain = objective.gain(slope)
    step: FloatArray = gain @ (objective.data - vector)
    if objective.prior is None:
        return step
    normal = objective.information(slope) + objective.prior.precision
    pull = objective.prior.precision @ (objective.prior.mean - x)
    return step + np.linalg.solve(normal, pull)
