"""Noise of a channel from samples of nothing but noise: its size and, up to two lags, its correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular, toeplitz
from scipy.special import chdtrc

from doe.arrays import FloatArray

LARGEST_ORDER = 2
"""Highest order of the autoregression."""
SAMPLES_PER_TERM = 20
"""Fewest samples for every term that is estimated, the mean of each record among them."""


@dataclass(frozen=True)
class AutoRegression:
    """Correlation of a stationary noise of unit variance, z_t = sum_l a_l z_(t-l) + e_t.

    Raises
    ------
    ValueError
        If there are more than two coefficients, or they belong to no stationary noise.
    """

    coefficients: tuple[float, ...] = ()
    """a_l [-], length 0 (white), 1 or 2."""

    def __post_init__(self) -> None:
        a = tuple(float(value) for value in self.coefficients)
        object.__setattr__(self, "coefficients", a)
        if len(a) > LARGEST_ORDER:
            raise ValueError(f"an autoregression has at most {LARGEST_ORDER} coefficients, got {len(a)}")
        a1, a2 = (*a, 0.0, 0.0)[:2]
        if not (abs(a2) < 1.0 and abs(a1) < 1.0 - a2):
            raise ValueError(
                f"coefficients {a} belong to no stationary noise: AR(1) needs |a1| < 1, "
                "AR(2) |a2| < 1 and |a1| < 1 - a2"
            )

    @property
    def order(self) -> int:
        """Number of lags."""
        return len(self.coefficients)

    def correlation(self, n: int) -> FloatArray:
        """Correlation at lags 0 to n - 1 [-], shape [n]."""
        rho = np.zeros(max(n, 3))
        rho[0] = 1.0
        if self.order == 0:
            return rho[:n]
        a1, a2 = (*self.coefficients, 0.0)[:2]
        rho[1] = a1 / (1.0 - a2)  # Yule-Walker at lag 1
        for lag in range(2, len(rho)):
            rho[lag] = a1 * rho[lag - 1] + a2 * rho[lag - 2]
        return rho[:n]

    @property
    def innovation(self) -> float:
        """Standard deviation of e_t over that of z_t [-]."""
        rho = self.correlation(self.order + 1)
        return float(np.sqrt(1.0 - sum(a * r for a, r in zip(self.coefficients, rho[1:], strict=True))))

    def whiten(self, standardised: ArrayLike) -> FloatArray:
        """Uncorrelated variables of unit variance from samples of this noise, along the last axis.

        The first samples, which have no full past, are whitened by the Cholesky factor of their own
        covariance, so that the sum of squares is exactly z^T R^-1 z.

        Parameters
        ----------
        standardised
            Samples over their standard deviation [-], equally spaced in time, shape [..., n].
        """
        z = np.asarray(standardised, dtype=np.float64)
        p, n = self.order, z.shape[-1]
        if p == 0:
            return z.copy()
        white = np.empty_like(z)
        head = min(p, n)
        factor = np.linalg.cholesky(toeplitz(self.correlation(head)))
        start = z[..., :head].reshape(-1, head).T
        white[..., :head] = solve_triangular(factor, start, lower=True).T.reshape(z[..., :head].shape)
        past = sum(a * z[..., p - lag : n - lag] for lag, a in enumerate(self.coefficients, start=1))
        white[..., p:] = (z[..., p:] - past) / self.innovation
        return white


WHITE = AutoRegression()
"""No correlation."""


@dataclass(frozen=True)
class Noise:
    """A noise that was fitted to samples."""

    sigma: float
    """Standard deviation of one sample, in the samples' units."""
    correlation: AutoRegression
    """Its correlation in time."""
    n_samples: int
    """Samples it was fitted to."""
    information: tuple[float, ...]
    """Bayes' information criterion of order 0, 1, 2 as far as tried; NaN for an order that was not."""
    whiteness: float
    """p-value of Ljung and Box's test of the whitened samples at ten lags [-]: small if more is
    correlated than two lags explain; then intervals from blocks (`sandwich`) count."""


def fit_noise(records: ArrayLike, *, order: int | None = None) -> Noise:
    """Fit white noise or an autoregression of order one or two.

    Reflection coefficients are Burg's over all records together, so that the result is always
    stationary; the order is the one with the smallest Bayes' information criterion.

    Parameters
    ----------
    records
        Equally spaced samples without signal (static frames, before the trigger), one record a row,
        shape [n] or [n_records, n]; each record's mean is removed.
    order
        0, 1 or 2; left out, it is chosen.

    Raises
    ------
    ValueError
        If a sample is not finite, there are fewer than 20 for each term, the samples do not vary, or the
        order is outside its range.
    """
    y = np.atleast_2d(np.asarray(records, dtype=np.float64))
    if order is not None and order not in range(LARGEST_ORDER + 1):
        raise ValueError(f"order must be 0, 1 or 2, or left out, got {order}")
    if y.ndim != 2 or not np.all(np.isfinite(y)):
        raise ValueError(f"records must be finite, of shape [n_records, n]; got shape {list(y.shape)}")
    highest = LARGEST_ORDER if order is None else order
    needed = SAMPLES_PER_TERM * (len(y) + 1 + highest)
    if y.size < needed or y.shape[1] < highest + 2:
        raise ValueError(
            f"{y.size} samples in {len(y)} record(s) are too few for order {highest}: at least {needed} "
            f"are needed and {highest + 2} a record; take a longer record before the trigger"
        )
    z = y - y.mean(axis=1, keepdims=True)
    freedom = y.size - len(y)
    variance = float((z**2).sum() / freedom)
    # Round-off of the mean leaves 1e-16 of the level.
    if variance <= (1e-13 * float(np.max(np.abs(y)))) ** 2:
        raise ValueError("the samples do not vary: a clipped, stuck or averaged record has no noise to fit")
    fits = _burg(z, highest)
    information = [np.nan] * (LARGEST_ORDER + 1)
    for p, (_, share) in enumerate(fits):
        information[p] = y.size * np.log(variance * share) + p * np.log(y.size)
    chosen = int(np.nanargmin(information)) if order is None else order
    model = AutoRegression(fits[chosen][0])
    return Noise(
        sigma=float(np.sqrt(variance)),
        correlation=model,
        n_samples=y.size,
        information=tuple(float(value) for value in information),
        whiteness=_ljung_box(model.whiten(z / np.sqrt(variance)), chosen),
    )


def _burg(z: FloatArray, highest: int) -> list[tuple[tuple[float, ...], float]]:
    """Coefficients of order 0 to `highest`, each with its innovation's share of the variance."""
    forward, backward = z, z
    a: tuple[float, ...] = ()
    share = 1.0
    fits = [(a, share)]
    for _ in range(highest):
        f, b = forward[:, 1:], backward[:, :-1]
        k = float(2.0 * (f * b).sum() / ((f**2).sum() + (b**2).sum()))
        a = (*(old - k * mirrored for old, mirrored in zip(a, reversed(a), strict=True)), k)
        share *= 1.0 - k**2
        forward, backward = f - k * b, b - k * f
        fits.append((a, share))
    return fits


def _ljung_box(white: FloatArray, order: int) -> float:
    """p-value of Ljung and Box's portmanteau test over all records together."""
    n = white.shape[1]
    lags = min(10, n // 4)
    if lags <= order:
        return float("nan")
    power = float((white**2).sum())
    r = np.array([(white[:, lag:] * white[:, :-lag]).sum() / power for lag in range(1, lags + 1)])
    total = white.size
    statistic = total * (total + 2) * float((r**2 / (total - len(white) * np.arange(1, lags + 1))).sum())
    return float(chdtrc(lags - order, statistic))
