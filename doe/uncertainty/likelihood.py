"""Gaussian likelihood of a data vector, its maximum over any of the parameters, and the noise of a channel.

The noise is estimated from samples of nothing but noise: its size and, up to two lags, its correlation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular, toeplitz
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import chdtrc

from doe.arrays import FloatArray
from doe.box import Box

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


Model = Callable[[FloatArray], FloatArray]
"""Predicted data vectors, shape [n, k], at points in parameter units, shape [n, d]."""

STEP = 1e-4
"""Half the distance of central differences in the unit box: their error is 1e-8 of a smooth model's
third derivative, far above the round-off of a surrogate."""
ROUNDS = 100
"""Most alternations between parameters and discrepancies."""


@dataclass(frozen=True)
class Channel:
    """A stretch of the data vector with one kind of noise.

    Raises
    ------
    ValueError
        If a standard deviation is not finite and > 0, or the discrepancy is negative.
    """

    name: str
    """What it is, e.g. "force"."""
    sigma: FloatArray
    """Standard deviation of each entry, in the entries' units, shape [k_c]."""
    correlation: AutoRegression = WHITE
    """Correlation of neighbouring entries; white if left out."""
    discrepancy: float | Literal["profiled"] = 0.0
    """tau of what the model leaves out, sigma_eff^2 = sigma^2 + tau^2, in the entries' units: fixed, or
    "profiled": the most likely one at every point."""

    def __post_init__(self) -> None:
        sigma = np.atleast_1d(np.asarray(self.sigma, dtype=np.float64))
        object.__setattr__(self, "sigma", sigma)
        if sigma.ndim != 1 or not sigma.size or not np.all(np.isfinite(sigma) & (sigma > 0.0)):
            raise ValueError(f"sigma of channel {self.name!r} must be finite and > 0, one for each entry")
        if self.discrepancy != "profiled" and not 0.0 <= float(self.discrepancy) < np.inf:
            raise ValueError(
                f'discrepancy of channel {self.name!r} must be >= 0 or "profiled", got {self.discrepancy}'
            )

    def whitened(self, residual: FloatArray, tau: float) -> FloatArray:
        """Residuals as uncorrelated variables of unit variance, shape [..., k_c].

        The discrepancy is taken to be correlated like the noise.
        """
        return self.correlation.whiten(residual / np.sqrt(self.sigma**2 + tau**2))

    def deviance(self, residual: FloatArray, tau: float) -> float:
        """-2 ln L of a residual, shape [k_c], less its value for residual 0 and tau 0."""
        spread = float(np.log1p((tau / self.sigma) ** 2).sum())
        return float((self.whitened(residual, tau) ** 2).sum()) + spread

    def best_discrepancy(self, residual: FloatArray) -> float:
        """The fixed tau, or the most likely one for a residual, shape [k_c]."""
        if self.discrepancy != "profiled":
            return float(self.discrepancy)
        typical = float(np.median(self.sigma))
        if np.ptp(self.sigma) <= 1e-12 * typical:
            excess = float((self.whitened(residual, 0.0) ** 2).mean()) - 1.0
            return typical * float(np.sqrt(max(excess, 0.0)))
        # In the logarithm, so that a tau of any size is found to the same relative error.
        largest = 10.0 * float(np.max(np.abs(residual))) + typical
        found = minimize_scalar(
            lambda s: self.deviance(residual, typical * float(np.expm1(s))),
            bounds=(0.0, float(np.log1p(largest / typical))),
            method="bounded",
            options={"xatol": 1e-9},
        )
        return typical * float(np.expm1(found.x)) if found.fun < self.deviance(residual, 0.0) else 0.0


@dataclass(frozen=True)
class Fit:
    """A maximum of the likelihood over some parameters, the others held."""

    unit_point: FloatArray
    """Where, in the unit box [-], shape [d]."""
    point: FloatArray
    """Where, in parameter units, shape [d]."""
    discrepancies: FloatArray
    """tau of each channel, in its units, shape [n_channels]."""
    deviance: float
    """-2 ln L there, up to a constant of the problem."""
    converged: bool
    """False if the search was cut short; the deviance is then an upper bound."""


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of data at the points of a box.

    Raises
    ------
    ValueError
        If the data are not finite or the channels' entries do not add up to them.
    """

    box: Box
    """Where the model holds; it is not asked outside."""
    model: Model
    """Predicts data vectors, e.g. a verified surrogate."""
    data: FloatArray
    """What was measured, shape [k]."""
    channels: Sequence[Channel]
    """What the data vector is made of, in its order."""
    slices: tuple[slice, ...] = field(init=False, repr=False)
    """Where each channel's entries stand."""

    def __post_init__(self) -> None:
        data = np.asarray(self.data, dtype=np.float64)
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "channels", tuple(self.channels))
        ends = np.cumsum([0, *(len(channel.sigma) for channel in self.channels)])
        if data.shape != (ends[-1],) or not data.size:
            raise ValueError(f"the channels hold {ends[-1]} entries, but the data have shape {data.shape}")
        if not np.all(np.isfinite(data)):
            raise ValueError(f"entry {int(np.argmin(np.isfinite(data)))} of the data is not finite")
        slices = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        object.__setattr__(self, "slices", slices)

    def residuals(self, unit_points: ArrayLike) -> FloatArray:
        """Prediction minus data at points of the unit box, shape [n, d] -> [n, k].

        Raises
        ------
        ValueError
            If the model's answer has a wrong shape or is not finite; the message names the point.
        """
        u = np.clip(np.atleast_2d(np.asarray(unit_points, dtype=np.float64)), 0.0, 1.0)
        x = self.box.scale(u)
        predicted = np.asarray(self.model(x), dtype=np.float64)
        if predicted.shape != (len(x), len(self.data)):
            raise ValueError(f"the model must return shape {(len(x), len(self.data))}, got {predicted.shape}")
        bad = np.flatnonzero(~np.isfinite(predicted).all(axis=1))
        if len(bad):
            raise ValueError(f"the model is not finite at {self.box.as_dict(x[bad[0]])}")
        return np.asarray(predicted - self.data)

    def discrepancies(self, residual: FloatArray) -> FloatArray:
        """tau of each channel for a residual of shape [k], shape [n_channels]."""
        pairs = zip(self.channels, self.slices, strict=True)
        return np.array([channel.best_discrepancy(residual[part]) for channel, part in pairs])

    def whitened(self, residuals: FloatArray, discrepancies: FloatArray) -> FloatArray:
        """Residuals (or columns of a Jacobian) as uncorrelated variables of unit variance, shape [..., k]."""
        pairs = zip(self.channels, self.slices, discrepancies, strict=True)
        return np.concatenate(
            [channel.whitened(residuals[..., part], tau) for channel, part, tau in pairs], axis=-1
        )

    def deviance(self, residual: FloatArray, discrepancies: FloatArray) -> float:
        """-2 ln L of a residual of shape [k], up to a constant of the problem."""
        pairs = zip(self.channels, self.slices, discrepancies, strict=True)
        return sum(channel.deviance(residual[part], tau) for channel, part, tau in pairs)

    def jacobian(self, unit_point: FloatArray, discrepancies: FloatArray) -> FloatArray:
        """Whitened derivatives by unit coordinates, central (one-sided at a face), shape [k, d]."""
        d = self.box.dimension
        up = np.minimum(unit_point + STEP * np.eye(d), 1.0)
        down = np.maximum(unit_point - STEP * np.eye(d), 0.0)
        r = self.residuals(np.concatenate([up, down]))
        change = (r[:d] - r[d:]) / (up - down).sum(axis=1)[:, None]
        return self.whitened(change, discrepancies).T

    def maximise(self, start: ArrayLike, *, held: Sequence[int] = ()) -> Fit:
        """Most likely point from a start, with some coordinates held where the start has them.

        Parameters (by bounded least squares) and profiled discrepancies are improved in turns; the
        deviance never rises.

        Parameters
        ----------
        start
            In the unit box [-], shape [d].
        held
            Indices of the coordinates that do not move.
        """
        u = np.clip(np.asarray(start, dtype=np.float64), 0.0, 1.0)
        free = np.array([j for j in range(self.box.dimension) if j not in held], dtype=int)
        residual = self.residuals(u)[0]
        tau = self.discrepancies(residual)
        value = self.deviance(residual, tau)
        moving = any(channel.discrepancy == "profiled" for channel in self.channels)
        converged = not len(free)
        for _ in range(ROUNDS if len(free) else 0):
            trial, ok = self._least_squares(u, free, tau)
            residual = self.residuals(trial)[0]
            trial_tau = self.discrepancies(residual)
            lower = self.deviance(residual, trial_tau)
            gain = value - lower
            if gain > 0.0:
                u, tau, value = trial, trial_tau, lower
            # 1e-6 of the deviance is nothing beside the 3.84 of an interval.
            if not moving or gain < 1e-6:
                converged = ok
                break
        return Fit(u, self.box.scale(u), tau, value, converged)

    def _least_squares(
        self, u: FloatArray, free: NDArray[np.int_], tau: FloatArray
    ) -> tuple[FloatArray, bool]:
        def full(v: FloatArray) -> FloatArray:
            w = u.copy()
            w[free] = v
            return w

        found = least_squares(
            lambda v: self.whitened(self.residuals(full(v))[0], tau),
            u[free],
            jac=lambda v: self.jacobian(full(v), tau)[:, free],
            bounds=(0.0, 1.0),
            x_scale="jac",
            ftol=1e-8,
            xtol=1e-8,
            gtol=1e-12,
            max_nfev=200,
        )
        # The interior method stops short of a face; the face itself is tried too.
        best, cost = full(found.x), float(found.cost)
        snapped = np.where(best < STEP, 0.0, np.where(best > 1.0 - STEP, 1.0, best))
        snapped = np.where(np.isin(np.arange(len(u)), free), snapped, u)
        if np.any(snapped != best):
            at_face = 0.5 * float((self.whitened(self.residuals(snapped)[0], tau) ** 2).sum())
            best = snapped if at_face <= cost else best
        return best, found.status > 0
