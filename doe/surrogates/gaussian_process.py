"""A Gaussian process over the unit box: interpolant, its variance, and leave-one-out in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.optimize import minimize

from doe.arrays import FloatArray
from doe.surrogates.correlation import CORRELATIONS, squared_differences, with_lengths, with_slopes
from doe.surrogates.kernels import SurrogateError

SHORTEST, LONGEST = 0.02, 30.0
"""Range of the correlation lengths in the unit box: below a design's spacing nothing is learnt, far beyond
the box a response is a polynomial and longer makes it no smoother."""
LEAST_NUGGET, LARGEST_NUGGET = 1e-10, 1.0
"""Range of the nugget over the process's variance. The least keeps the condition number below n 1e10, so
that six digits of the interpolant are left."""
STARTS = (0.4, 1.5)
"""Correlation lengths from which the likelihood is climbed."""
DETERMINED = 1e-10
"""Smallest singular value of the trend's terms at the runs, over the largest."""


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters, chosen by the likelihood of the runs."""

    kind: str
    """A name of `doe.surrogates.correlation.CORRELATIONS`."""
    lengths: FloatArray
    """Correlation lengths in the unit box [-], shape [d]."""
    nugget: float
    """Variance of what is no function of the point, over the process's variance [-]."""

    @property
    def logarithms(self) -> FloatArray:
        """ln of the lengths and of the nugget, shape [d + 1]."""
        return np.log(np.append(self.lengths, self.nugget))

    @classmethod
    def of(cls, kind: str, logarithms: FloatArray) -> Hyperparameters:
        """The inverse of `logarithms`."""
        values = np.exp(logarithms)
        return cls(kind, values[:-1], float(values[-1]))


@dataclass(frozen=True)
class GaussianProcess:
    """Columns of values, each a linear trend and a Gaussian process around it, of one correlation."""

    hyperparameters: Hyperparameters
    """Its correlation."""
    unit_points: FloatArray
    """The runs in the unit box [-], shape [n, d]."""
    values: FloatArray
    """Their values, shape [n, q]."""
    variance: FloatArray
    """Variance of each column's process, in squared units of the values, shape [q]."""
    log_likelihood: float
    """Restricted log-likelihood of all columns, up to a constant of the design."""
    condition: float
    """Condition number of the correlation matrix [-]."""
    loo_residuals: FloatArray
    """Value minus what the other runs predict there, shape [n, q]."""
    loo_sigma: FloatArray
    """Standard deviation that the other runs state for it, shape [n, q]."""
    weights: FloatArray
    """Of the runs' correlations, shape [n, q]."""
    trend: FloatArray
    """Coefficients of 1, u_1, ... u_d, shape [d + 1, q]."""
    factor: FloatArray
    """Lower Cholesky factor of the correlation matrix, shape [n, n]."""
    trend_factor: FloatArray
    """Lower Cholesky factor of P^T R^-1 P, shape [d + 1, d + 1]."""

    @classmethod
    def fit(
        cls,
        unit_points: FloatArray,
        values: FloatArray,
        *,
        kinds: Sequence[str] = tuple(CORRELATIONS),
        start: Hyperparameters | None = None,
    ) -> GaussianProcess:
        """Choose the hyperparameters by the restricted likelihood of the runs.

        Parameters
        ----------
        unit_points
            The runs in the unit box [-], shape [n, d].
        values
            Shape [n, q].
        kinds
            Correlation functions to choose from.
        start
            Where to begin, e.g. the hyperparameters of fewer runs; left out, two starts a kind.

        Raises
        ------
        SurrogateError
            If there are too few runs, or they do not determine the linear trend.
        """
        n, d = unit_points.shape
        if n < d + 3:
            raise SurrogateError(
                f"a Gaussian process with a linear trend needs at least {d + 3} runs for {d} parameter(s), "
                f"got {n}"
            )
        tail = _tail(unit_points)
        singular = np.linalg.svd(tail, compute_uv=False)
        if singular[-1] < DETERMINED * singular[0]:
            raise SurrogateError(
                f"the {n} runs do not determine a linear trend in {d} parameter(s): they lie in a plane; "
                "spread them"
            )
        squares = squared_differences(unit_points, unit_points)
        bounds = [(np.log(SHORTEST), np.log(LONGEST))] * d
        bounds += [(np.log(LEAST_NUGGET), np.log(LARGEST_NUGGET))]
        starts = (
            [(kind, np.log([length] * d + [1e-8])) for kind in kinds for length in STARTS]
            if start is None
            else [(start.kind, start.logarithms)]
        )
        best: tuple[float, Hyperparameters] | None = None
        for kind, first in starts:
            found = minimize(
                _loss, first, args=(kind, squares, tail, values), jac=True, bounds=bounds, method="L-BFGS-B",
                options={"maxiter": 100, "ftol": 1e-7},
            )  # fmt: skip
            if best is None or found.fun < best[0]:
                best = float(found.fun), Hyperparameters.of(kind, found.x)
        if best is None:
            raise ValueError("kinds is empty: name at least one correlation function")
        return cls.given(unit_points, values, best[1])

    @classmethod
    def given(
        cls,
        unit_points: FloatArray,
        values: FloatArray,
        hyperparameters: Hyperparameters,
        *,
        variance: FloatArray | None = None,
    ) -> GaussianProcess:
        """The process with these hyperparameters through the runs, its variance given or the most likely."""
        tail = _tail(unit_points)
        squares = squared_differences(unit_points, unit_points)
        correlation = with_lengths(hyperparameters.kind, squares, hyperparameters.lengths)
        correlation[np.diag_indices_from(correlation)] += hyperparameters.nugget
        eigenvalues = np.linalg.eigvalsh(correlation)
        factor, trend_factor, operator = _operator(correlation, tail)
        change = operator @ values
        freedom = len(values) - tail.shape[1]
        if variance is None:
            variance = np.maximum((values * change).sum(axis=0) / freedom, 0.0)
        coefficients = linalg.cho_solve(
            (trend_factor, True), tail.T @ linalg.cho_solve((factor, True), values)
        )
        diagonal = np.diag(operator)
        return cls(
            hyperparameters=hyperparameters,
            unit_points=unit_points,
            values=values,
            variance=variance,
            log_likelihood=-_minus_log(variance, freedom, factor, trend_factor),
            condition=float(eigenvalues[-1] / eigenvalues[0]),
            loo_residuals=change / diagonal[:, None],
            loo_sigma=np.sqrt(variance / diagonal[:, None]),
            weights=change,
            trend=coefficients,
            factor=factor,
            trend_factor=trend_factor,
        )

    def predict(self, unit_points: FloatArray) -> FloatArray:
        """The mean at points of the unit box, shape [m, d] -> [m, q]."""
        return np.asarray(
            self._correlation(unit_points) @ self.weights + _tail(unit_points) @ self.trend, dtype=np.float64
        )

    def sigma(self, unit_points: FloatArray) -> FloatArray:
        """Standard deviation of the mean at points of the unit box, shape [m, d] -> [m, q]."""
        near = linalg.solve_triangular(self.factor, self._correlation(unit_points).T, lower=True)
        carried = linalg.solve_triangular(self.factor, _tail(self.unit_points), lower=True)
        rest = linalg.solve_triangular(
            self.trend_factor, (_tail(unit_points) - near.T @ carried).T, lower=True
        )
        share = 1.0 - (near**2).sum(axis=0) + (rest**2).sum(axis=0)
        # Round-off of 1 - 1 at a run.
        return np.asarray(np.sqrt(np.outer(np.maximum(share, 0.0), self.variance)))

    def _correlation(self, unit_points: FloatArray) -> FloatArray:
        squares = squared_differences(unit_points, self.unit_points)
        return with_lengths(self.hyperparameters.kind, squares, self.hyperparameters.lengths)


def _tail(unit_points: FloatArray) -> FloatArray:
    return np.concatenate([np.ones((len(unit_points), 1)), unit_points], axis=1)


def _operator(correlation: FloatArray, tail: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Factors of R and P^T R^-1 P, and B = R^-1 - R^-1 P (P^T R^-1 P)^-1 P^T R^-1."""
    factor = linalg.cholesky(correlation, lower=True)
    inverse = linalg.cho_solve((factor, True), np.eye(len(correlation)))
    carried = inverse @ tail
    trend_factor = linalg.cholesky(tail.T @ carried, lower=True)
    return factor, trend_factor, inverse - carried @ linalg.cho_solve((trend_factor, True), carried.T)


def _minus_log(variance: FloatArray, freedom: int, factor: FloatArray, trend_factor: FloatArray) -> float:
    logs = np.log(np.diag(factor)).sum() + np.log(np.diag(trend_factor)).sum()
    spread = np.log(np.maximum(variance, np.finfo(float).tiny)).sum()
    return float(0.5 * freedom * spread + len(variance) * logs)


def _loss(
    logarithms: FloatArray, kind: str, squares: FloatArray, tail: FloatArray, values: FloatArray
) -> tuple[float, FloatArray]:
    """Minus the restricted log-likelihood, its variance profiled out, and its gradient (docs: doe.md)."""
    h = Hyperparameters.of(kind, logarithms)
    correlation, slopes = with_slopes(kind, squares, h.lengths)
    correlation[np.diag_indices_from(correlation)] += h.nugget
    factor, trend_factor, operator = _operator(correlation, tail)
    change = operator @ values
    freedom = len(values) - tail.shape[1]
    power = np.maximum((values * change).sum(axis=0), np.finfo(float).tiny)
    q, weighted = values.shape[1], freedom * (change / power) @ change.T
    gradient = [0.5 * float(((q * operator - weighted) * slope).sum()) for slope in slopes]
    own = 0.5 * h.nugget * float(q * np.trace(operator) - np.trace(weighted))
    return _minus_log(power / freedom, freedom, factor, trend_factor), np.array([*gradient, own])
