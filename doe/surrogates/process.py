"""A surrogate of the response with its standard deviation. It uses principal components with a Gaussian
process each.

A process has an anisotropic correlation function over the unit box. Its variance and its leave-one-out errors
have closed forms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.optimize import minimize

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.protocol import ComponentSurrogate, SurrogateError, checked_runs, unit_points

Correlation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Correlation c and its slope -2 dc/d(r^2) for squared distances r^2 [squared correlation lengths]."""


def _squared_exponential(r2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """exp(-r^2 / 2): for responses with all derivatives."""
    c = np.exp(-0.5 * r2)
    return c, c


def _matern52(r2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(1 + a + a^2 / 3) exp(-a), a = sqrt(5) r: for responses with two derivatives."""
    a = np.sqrt(5.0 * r2)
    decay = np.exp(-a)
    return (1.0 + a + a**2 / 3.0) * decay, 5.0 / 3.0 * (1.0 + a) * decay


CORRELATIONS: dict[str, Correlation] = {"squared exponential": _squared_exponential, "matern 5/2": _matern52}
"""Correlation functions by name; the likelihood of the runs selects one."""


def squared_differences(a: FloatArray, b: FloatArray) -> FloatArray:
    """(a_i - b_j)^2 by coordinate, shape [d, n, m]."""
    return np.asarray((a.T[:, :, None] - b.T[:, None, :]) ** 2)


def with_lengths(kind: str, squares: FloatArray, lengths: FloatArray) -> FloatArray:
    """Correlation matrix of squared differences [d, n, m] and lengths [d], shape [n, m]."""
    return CORRELATIONS[kind](np.tensordot(1.0 / lengths**2, squares, axes=1))[0]


def with_slopes(kind: str, squares: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same and its derivatives by ln(length), shapes [n, m] and [d, n, m]."""
    scaled = squares / (lengths**2)[:, None, None]
    c, slope = CORRELATIONS[kind](scaled.sum(axis=0))
    return c, scaled * slope


SHORTEST, LONGEST = 0.02, 30.0
"""Range of the correlation lengths in the unit box. Runs do not determine a length below their spacing. With
a length far beyond the box the response is a polynomial."""
LEAST_NUGGET, LARGEST_NUGGET = 1e-10, 1.0
"""Range of the nugget over the process's variance. The smallest value limits the condition number to n 1e10;
the interpolant then has six correct digits."""
STARTS = (0.4, 1.5)
"""Correlation lengths at the start of the search for the maximum of the likelihood."""
DETERMINED = 1e-10
"""Smallest ratio of the smallest to the largest singular value of the trend's terms at the runs."""


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters, chosen by the likelihood of the runs."""

    kind: str
    lengths: FloatArray
    """Correlation lengths in the unit box [-], shape [d]."""
    nugget: float
    """Variance of the part of a response that is not a smooth function of the point, over the process's
    variance [-]."""

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
    """Columns of values. Each is a linear trend with a Gaussian process around it; all have the same
    correlation."""

    hyperparameters: Hyperparameters
    unit_points: FloatArray
    """The runs in the unit box [-], shape [n, d]."""
    values: FloatArray
    """Their values, shape [n, q]."""
    variance: FloatArray
    """Variance of each column's process, in squared units of the values, shape [q]."""
    log_likelihood: float
    """Restricted log-likelihood of all columns, up to a constant of the design."""
    loo_residuals: FloatArray
    """Value of each run minus its prediction from the other runs, shape [n, q]."""
    loo_sigma: FloatArray
    """Standard deviation of that prediction, shape [n, q]."""
    weights: FloatArray
    """Weights of the correlations with the runs, shape [n, q]."""
    trend: FloatArray
    """Coefficients of 1, u_1, ... u_d, shape [d + 1, q]."""
    factor: FloatArray
    """Lower Cholesky factor of the correlation matrix, shape [n, n]."""
    trend_factor: FloatArray
    """Lower Cholesky factor of P^T R^-1 P, shape [d + 1, d + 1]."""

    @classmethod
    def fit(
        cls, unit_points: FloatArray, values: FloatArray, *, start: Hyperparameters | None = None
    ) -> GaussianProcess:
        """Choose the hyperparameters by the restricted likelihood of values, [n, q], at runs in the unit box,
        [n, d].

        ``start``: first hyperparameters, e.g. those of fewer runs. Default: two starts for each kind of
        correlation. Raises SurrogateError if there are too few runs, or if they do not determine the linear
        trend.
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
            [(kind, np.log([length] * d + [1e-8])) for kind in CORRELATIONS for length in STARTS]
            if start is None
            else [(start.kind, start.logarithms)]
        )
        best: tuple[float, Hyperparameters] | None = None
        for kind, first in starts:
            optimum = minimize(
                _loss, first, args=(kind, squares, tail, values), jac=True, bounds=bounds, method="L-BFGS-B",
                options={"maxiter": 100, "ftol": 1e-7},
            )  # fmt: skip
            if best is None or optimum.fun < best[0]:
                best = float(optimum.fun), Hyperparameters.of(kind, optimum.x)
        assert best is not None  # there is at least one start
        return cls.with_hyperparameters(unit_points, values, best[1])

    @classmethod
    def with_hyperparameters(
        cls,
        unit_points: FloatArray,
        values: FloatArray,
        hyperparameters: Hyperparameters,
        *,
        variance: FloatArray | None = None,
    ) -> GaussianProcess:
        """The process with these hyperparameters through the runs. Its variance is given or the most
        likely."""
        tail = _tail(unit_points)
        squares = squared_differences(unit_points, unit_points)
        correlation = with_lengths(hyperparameters.kind, squares, hyperparameters.lengths)
        correlation[np.diag_indices_from(correlation)] += hyperparameters.nugget
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
            hyperparameters=hyperparameters, unit_points=unit_points, values=values, variance=variance,
            log_likelihood=-_minus_log(variance, freedom, factor, trend_factor),
            loo_residuals=change / diagonal[:, None], loo_sigma=np.sqrt(variance / diagonal[:, None]),
            weights=change, trend=coefficients, factor=factor, trend_factor=trend_factor,
        )  # fmt: skip

    def predict(self, unit_points: FloatArray) -> FloatArray:
        """The mean at points of the unit box, shape [m, d] -> [m, q]."""
        return np.asarray(
            self._correlation(unit_points) @ self.weights + _tail(unit_points) @ self.trend, dtype=np.float64
        )

    def sigma(self, unit_points: FloatArray) -> FloatArray:
        """Standard deviation of the mean at points of the unit box, shape [m, d] -> [m, q]."""
        near = linalg.solve_triangular(self.factor, self._correlation(unit_points).T, lower=True)
        carried = linalg.solve_triangular(self.factor, _tail(self.unit_points), lower=True)
        trend_part = linalg.solve_triangular(
            self.trend_factor, (_tail(unit_points) - near.T @ carried).T, lower=True
        )
        share = 1.0 - (near**2).sum(axis=0) + (trend_part**2).sum(axis=0)
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
    """Minus the restricted log-likelihood with profiled variance, and its gradient (docs: howto/doe)."""
    h = Hyperparameters.of(kind, logarithms)
    correlation, slopes = with_slopes(kind, squares, h.lengths)
    correlation[np.diag_indices_from(correlation)] += h.nugget
    factor, trend_factor, operator = _operator(correlation, tail)
    change = operator @ values
    freedom = len(values) - tail.shape[1]
    power = np.maximum((values * change).sum(axis=0), np.finfo(float).tiny)
    q, weighted = values.shape[1], freedom * (change / power) @ change.T
    gradient = [0.5 * float(((q * operator - weighted) * slope).sum()) for slope in slopes]
    by_nugget = 0.5 * h.nugget * float(q * np.trace(operator) - np.trace(weighted))
    return _minus_log(power / freedom, freedom, factor, trend_factor), np.array([*gradient, by_nugget])


SEPARATE_COMPONENTS = 4
"""Number of leading components with individual hyperparameters. The other components are many and small and
share one set."""


@dataclass(frozen=True)
class ProcessSurrogate(ComponentSurrogate):
    """Predicts the response vector and its standard deviation, entry by entry. The standard deviation is that
    of the interpolation between the runs with the most likely hyperparameters. It does not include the error
    of truncation."""

    box: Box
    """Range of validity."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    components: PrincipalComponents
    processes: tuple[GaussianProcess, ...]
    """Processes of the scores: one for each of the first components, one for all others together."""

    @classmethod
    def fit(
        cls,
        box: Box,
        points: ArrayLike,
        responses: ArrayLike,
        *,
        scale: ArrayLike = 1.0,
        variance: float = 1.0 - 1e-8,
        like: ProcessSurrogate | None = None,
    ) -> ProcessSurrogate:
        """Build it from runs, shapes [n, d] and [n, k], with the most likely hyperparameters.

        ``scale``, ``variance``: as in `PrincipalComponents.fit`. ``like``: a surrogate of fewer runs. The
        search for the hyperparameters starts from its values. Raises ValueError if a point is outside the
        box, shapes do not match, or an option is outside its range. Raises SurrogateError if a response is
        not finite, if there are too few runs, or if they do not determine a linear trend.
        """
        x, y = checked_runs(box, points, responses)
        if not len(x):
            raise SurrogateError("a surrogate needs runs, got none")
        components = PrincipalComponents.fit(y, scale=scale, variance=variance)
        u, groups = box.unit(x), _groups(components.scores(y))
        comparable = like is not None and len(like.processes) == len(groups)
        starts = _rescaled(like, box) if like is not None and comparable else [None] * len(groups)
        processes = [GaussianProcess.fit(u, f, start=h) for f, h in zip(groups, starts, strict=True)]
        return cls(box, x, components, tuple(processes))

    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Means of the components' scores at points [-], shape [m, d] -> [m, q]."""
        u = unit_points(self.box, points, extrapolate=extrapolate)
        return np.concatenate([process.predict(u) for process in self.processes], axis=1)

    def score_sigma(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Standard deviations of the components' scores at points [-], shape [m, d] -> [m, q]."""
        u = unit_points(self.box, points, extrapolate=extrapolate)
        return np.concatenate([process.sigma(u) for process in self.processes], axis=1)

    def believing(self, points: ArrayLike) -> ProcessSurrogate:
        """The surrogate with additional runs at points, shape [m, d]. The results of these runs are its
        predictions. Its mean does not change (except for the nugget). Its standard deviation decreases near
        the points."""
        x = self.box.require(points, what="point")
        u, groups = self.box.unit(np.concatenate([self.points, x])), []
        for process in self.processes:
            predicted = process.predict(np.concatenate([process.unit_points, self.box.unit(x)]))
            # The values of the runs; with a nugget the mean differs from them.
            predicted[: len(process.unit_points)] = process.values
            groups.append(
                GaussianProcess.with_hyperparameters(
                    u, predicted, process.hyperparameters, variance=process.variance
                )
            )
        return ProcessSurrogate(self.box, np.concatenate([self.points, x]), self.components, tuple(groups))

    @property
    def nugget_error(self) -> FloatArray:
        """Largest |mean - run| of each score over the runs, converted to response units, shape [k]."""
        missed = np.concatenate([p.values - p.predict(p.unit_points) for p in self.processes], axis=1)
        return np.asarray(np.abs(self.components.deviation(missed)).max(axis=0))

    @property
    def loo_residuals(self) -> FloatArray:
        """See `ComponentSurrogate`; in response units, shape [n, k]."""
        scores = np.concatenate([process.loo_residuals for process in self.processes], axis=1)
        return self.components.deviation(scores) + self.components.truncation


def _rescaled(surrogate: ProcessSurrogate, box: Box) -> list[Hyperparameters | None]:
    """Its hyperparameters with the lengths in edges of another box."""
    edges = np.diff(surrogate.box.unit(np.array([box.lower, box.upper])), axis=0)[0]
    old = [process.hyperparameters for process in surrogate.processes]
    return [replace(h, lengths=np.clip(h.lengths / edges, SHORTEST, LONGEST)) for h in old]


def _groups(scores: FloatArray) -> list[FloatArray]:
    separate = min(SEPARATE_COMPONENTS, scores.shape[1])
    groups = [scores[:, p : p + 1] for p in range(separate)]
    return groups if separate == scores.shape[1] else [*groups, scores[:, separate:]]
