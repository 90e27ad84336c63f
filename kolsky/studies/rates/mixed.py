"""Linear models of a few values with known uncertainties and an unknown scatter between them.

y_i = x_i . b + t_i + e_i with e_i of the known standard uncertainty s_i and t_i ~ (0, tau^2), Eq. (S.2). One
column of ones is a random-effects mean, a second one with the logarithm of the rate a meta-regression.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray

Between = Literal["paule-mandel", "dersimonian-laird", "reml"]
METHODS: tuple[Between, ...] = ("paule-mandel", "dersimonian-laird", "reml")
"""Estimators of the scatter between shots."""


@dataclass(frozen=True)
class MixedFit:
    """A weighted least-squares fit whose weights know the scatter between the values."""

    coefficients: FloatArray
    """b, unit of the values over that of the column, shape [p]."""
    gain: FloatArray
    """How each value moves each coefficient, shape [p, n]."""
    covariance: FloatArray
    """(X' W X)^-1 with W = 1 / (s^2 + tau^2), shape [p, p]."""
    common: FloatArray
    """Covariance of the coefficients from what the values share, shape [p, p]."""
    between: float
    """tau, the standard deviation between the values beyond their own uncertainties, in their unit."""
    q: float
    """Cochran's Q: residual sum of squares in units of s alone [-]."""
    freedom: int
    """Degrees of freedom n - p."""
    scale: float
    """Knapp and Hartung's factor on the covariance, Eq. (S.5) [-]."""
    leverage: FloatArray
    """Diagonal of the hat matrix, shape [n]: how far a value pulls the fit through itself, from 0 to 1."""

    @property
    def i_squared(self) -> float:
        """I^2 = (Q - f) / Q, not below zero: the share of the scatter that the uncertainties s leave [-]."""
        return max(0.0, (self.q - self.freedom) / self.q) if self.q > 0.0 else 0.0

    def sigma(self, index: int) -> float:
        """Standard uncertainty of a coefficient, what is shared included."""
        return float(np.sqrt(self._own(index) + self.common[index, index]))

    def effective_freedom(self, index: int) -> float:
        """Degrees of freedom by Welch and Satterthwaite; what is shared counts as known exactly."""
        own = self._own(index)
        return float(self.freedom * ((own + self.common[index, index]) / own) ** 2)

    def interval(self, index: int, probability: float = 0.95) -> tuple[float, float]:
        """Interval of a coefficient by Student's t with Knapp and Hartung's variance, Eq. (S.6)."""
        half = float(student.ppf(0.5 + 0.5 * probability, self.effective_freedom(index))) * self.sigma(index)
        return float(self.coefficients[index] - half), float(self.coefficients[index] + half)

    def _own(self, index: int) -> float:
        # Below 1 the factor would narrow the interval because the values happen to agree.
        return float(self.covariance[index, index] * max(1.0, self.scale))


def mixed_fit(
    values: FloatArray,
    sigma: FloatArray,
    columns: FloatArray,
    *,
    common: FloatArray | None = None,
    method: Between = "paule-mandel",
) -> MixedFit:
    """Fit y = X b with the scatter between the values estimated.

    Parameters
    ----------
    values
        y, shape [n].
    sigma
        Standard uncertainties s that are independent from value to value, all > 0, shape [n].
    columns
        X, shape [n, p] with p < n and of full rank.
    common
        Each row one quantity that several values share: by how much each of them moves when it moves by its
        standard uncertainty, shape [n_shared, n]. It does not enter the weights.
    method
        How tau is estimated.

    Raises
    ------
    ValueError
        If shapes disagree, a number is not finite, a sigma is not positive, there are too few values, or the
        columns do not determine the coefficients.
    """
    y, s, X = (np.asarray(a, dtype=float) for a in (values, sigma, columns))
    shared = np.zeros((0, y.size)) if common is None else np.asarray(common, dtype=float)
    if X.ndim != 2 or y.shape != s.shape or y.shape != X.shape[:1] or shared.shape[1:] != y.shape:
        raise ValueError(f"got {y.shape} values, {s.shape} sigmas, {X.shape} columns, {shared.shape} shared")
    if not all(np.isfinite(a).all() for a in (y, s, X, shared)):
        raise ValueError("every value, sigma and column must be finite")
    if not (s > 0.0).all():
        raise ValueError(f"every sigma must be > 0, the smallest is {s.min():.3g}")
    n, p = X.shape
    if n <= p:
        raise ValueError(f"{p} coefficients with a scatter need at least {p + 1} values, got {n}")
    if np.linalg.matrix_rank(X) < p:
        raise ValueError(f"the {p} columns do not determine {p} coefficients: two of them go together")
    variance = _between(y, s, X, method)
    b, gain, covariance = _least_squares(y, s**2 + variance, X)
    return MixedFit(
        coefficients=b,
        gain=gain,
        covariance=covariance,
        common=gain @ shared.T @ shared @ gain.T,
        between=float(np.sqrt(variance)),
        q=_generalised_q(y, s**2, X),
        freedom=n - p,
        scale=_generalised_q(y, s**2 + variance, X) / (n - p),
        leverage=np.einsum("ip,pi->i", X, gain),
    )


def _least_squares(
    y: FloatArray, variance: FloatArray, X: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted least squares: coefficients, gain and covariance."""
    covariance = np.linalg.inv(X.T @ (X / variance[:, None]))
    gain = covariance @ (X.T / variance)
    return np.asarray(gain @ y), np.asarray(gain), np.asarray(covariance, dtype=np.float64)


def _generalised_q(y: FloatArray, variance: FloatArray, X: FloatArray) -> float:
    residual = y - X @ _least_squares(y, variance, X)[0]
    return float(np.sum(residual**2 / variance))


def _between(y: FloatArray, s: FloatArray, X: FloatArray, method: Between) -> float:
    """tau^2, not below zero."""
    n, p = X.shape
    if method == "dersimonian-laird":
        w = s**-2.0
        inner = np.linalg.inv(X.T @ (X * w[:, None])) @ (X.T @ (X * (w**2)[:, None]))
        return max(0.0, float((_generalised_q(y, s**2, X) - (n - p)) / (w.sum() - np.trace(inner))))
    if method not in METHODS:
        raise ValueError(f"{method!r} is no estimator of the scatter; there are {', '.join(METHODS)}")

    def excess(variance: float) -> float:
        total = s**2 + variance
        if method == "paule-mandel":  # Eq. (S.4): Q at the final weights is what chance alone would give
            return _generalised_q(y, total, X) - (n - p)
        gain = _least_squares(y, total, X)[1]
        P = (np.eye(n) - X @ gain) / total[:, None]
        Py = P @ y
        return float((Py @ Py - np.trace(P)) * total.mean())  # the restricted likelihood's score

    if excess(0.0) <= 0.0:
        return 0.0
    upper = float(np.var(y) + (s**2).max())
    while excess(upper) > 0.0:
        upper *= 4.0
    return float(brentq(excess, 0.0, upper, xtol=1e-14 * upper, rtol=1e-13))
