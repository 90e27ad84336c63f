"""Gaussian likelihood of a data vector, and its maximum over any of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray
from doe.box import Box
from doe.least_squares import newton_step

Model = Callable[[FloatArray], FloatArray]
"""Predicted data vectors, shape [n, k], at points in parameter units, shape [n, d]."""

STEP = 1e-4
"""Half the distance of central differences in the unit box. Their error is 1e-8 of a smooth model's third
derivative, far above the round-off of a surrogate."""
MOST_STEPS = 100
"""Largest number of steps of a least-squares search."""
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e6
"""Smallest and largest damping of a step [-]."""


@dataclass(frozen=True)
class Channel:
    """A part of the data vector with one kind of noise.

    Raises
    ------
    ValueError
        If a standard deviation is not finite and > 0, or the discrepancy is negative.
    """

    name: str
    sigma: FloatArray
    """Standard deviation of each entry, in the entries' units, shape [k_c]."""
    discrepancy: float = 0.0
    """Model discrepancy tau, sigma_eff^2 = sigma^2 + tau^2, in the entries' units."""

    def __post_init__(self) -> None:
        sigma = np.atleast_1d(np.asarray(self.sigma, dtype=np.float64))
        object.__setattr__(self, "sigma", sigma)
        if sigma.ndim != 1 or not sigma.size or not np.all(np.isfinite(sigma) & (sigma > 0.0)):
            raise ValueError(f"sigma of channel {self.name!r} must be finite and > 0, one for each entry")
        if not 0.0 <= float(self.discrepancy) < np.inf:
            raise ValueError(f"discrepancy of channel {self.name!r} must be >= 0, got {self.discrepancy}")

    def whitened(self, residual: FloatArray, tau: float) -> FloatArray:
        """Residuals as variables of unit variance, shape [..., k_c]."""
        return np.asarray(residual / np.sqrt(self.sigma**2 + tau**2))

    def deviance(self, residual: FloatArray, tau: float) -> float:
        """-2 ln L of a residual, shape [k_c], minus its value for residual 0 and tau 0."""
        spread = float(np.log1p((tau / self.sigma) ** 2).sum())
        return float((self.whitened(residual, tau) ** 2).sum()) + spread


@dataclass(frozen=True)
class Fit:
    """A maximum of the likelihood over some parameters, with the others fixed."""

    unit_point: FloatArray
    """Point in the unit box [-], shape [d]."""
    point: FloatArray
    """Point in parameter units, shape [d]."""
    deviance: float
    """-2 ln L there, up to a constant of the problem."""
    converged: bool
    """False if the search reached its limit of steps; the deviance is then an upper bound."""


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of data at the points of a box.

    Raises
    ------
    ValueError
        If the data are not finite or the channels' entries do not add up to them.
    """

    box: Box
    """Box in which the model is valid. The model is never evaluated outside."""
    model: Model
    """Predicts data vectors, e.g. a verified surrogate."""
    data: FloatArray
    """Measured data vector, shape [k]."""
    channels: Sequence[Channel]
    slices: tuple[slice, ...] = field(init=False, repr=False)
    """Slice of the data vector for the entries of each channel."""

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

        Raises ValueError if the model's response has a wrong shape or is not finite; the message names the
        point.
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

    @property
    def discrepancies(self) -> FloatArray:
        """tau of each channel, in its units, shape [n_channels]."""
        return np.array([float(channel.discrepancy) for channel in self.channels])

    def whitened(self, residuals: FloatArray) -> FloatArray:
        """Residuals (or columns of a Jacobian) as uncorrelated variables of unit variance, shape [..., k]."""
        pairs = zip(self.channels, self.slices, self.discrepancies, strict=True)
        return np.concatenate(
            [channel.whitened(residuals[..., part], tau) for channel, part, tau in pairs], axis=-1
        )

    def deviance(self, residual: FloatArray, discrepancies: FloatArray | None = None) -> float:
        """-2 ln L of a residual of shape [k], up to a constant of the problem; also with other
        discrepancies."""
        taus = self.discrepancies if discrepancies is None else discrepancies
        pairs = zip(self.channels, self.slices, taus, strict=True)
        return sum(channel.deviance(residual[part], tau) for channel, part, tau in pairs)

    def jacobian(self, unit_point: FloatArray) -> FloatArray:
        """Whitened derivatives by unit coordinates, central (one-sided at a face), shape [k, d]."""
        d = self.box.dimension
        up = np.minimum(unit_point + STEP * np.eye(d), 1.0)
        down = np.maximum(unit_point - STEP * np.eye(d), 0.0)
        r = self.residuals(np.concatenate([up, down]))
        change = (r[:d] - r[d:]) / (up - down).sum(axis=1)[:, None]
        return self.whitened(change).T

    def maximise(self, start: ArrayLike, *, held: Sequence[int] = (), rest: float = 1e-9) -> Fit:
        """Most likely point, searched from a start in the unit box, shape [d]; coordinates in ``held`` keep
        their start values.

        The search ends if its linear model expects a smaller gain of chi-square than ``rest``. The deviance
        never increases.
        """
        u = np.clip(np.asarray(start, dtype=np.float64), 0.0, 1.0)
        free = np.array([j for j in range(self.box.dimension) if j not in held], dtype=int)
        rows = self.residuals(_neighbours(u, free))
        value = self.deviance(rows[0])
        if not len(free):
            return Fit(u, self.box.scale(u), value, converged=True)
        trial, residual, converged = self._least_squares(u, rows, free, rest)
        lower = self.deviance(residual)
        if lower < value:
            u, value = trial, lower
        return Fit(u, self.box.scale(u), value, converged)

    def _least_squares(
        self, u: FloatArray, rows: FloatArray, free: NDArray[np.int_], rest: float
    ) -> tuple[FloatArray, FloatArray, bool]:
        """Bounded Levenberg-Marquardt search: the point, its residual, and True if it converged. Each trial
        point is evaluated together with its neighbours for central differences. ``rows``: residuals at the
        start and its neighbours."""
        n = len(free)

        def linearised(points: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            apart = (points[1 : 1 + n] - points[1 + n :]).sum(axis=1)
            slope = (rows[1 : 1 + n] - rows[1 + n :]) / apart[:, None]
            return rows[0], self.whitened(rows[0]), self.whitened(slope).T

        raw, residual, slope = linearised(_neighbours(u, free), rows)
        damping = LEAST_DAMPING
        for _ in range(MOST_STEPS):
            normal = slope.T @ slope
            normal += np.diag(damping * np.diag(normal) + np.finfo(float).tiny)
            step = newton_step(normal, slope.T @ residual, -u[free], 1.0 - u[free])
            expected = residual + slope @ step
            gain = float(residual @ residual - expected @ expected)
            if gain <= rest:
                return u, raw, True
            trial = u.copy()
            trial[free] = np.clip(u[free] + step, 0.0, 1.0)
            points = _neighbours(trial, free)
            found = linearised(points, self.residuals(points))
            if float(found[1] @ found[1]) < float(residual @ residual):
                u, (raw, residual, slope) = trial, found
                damping = max(0.1 * damping, LEAST_DAMPING)
            elif damping > MOST_DAMPING:
                return u, raw, False
            else:
                damping *= 10.0
        return u, raw, False


def _neighbours(u: FloatArray, free: NDArray[np.int_]) -> FloatArray:
    """A point of the unit box, then those above and below it in each free coordinate, shape [1 + 2 n, d]."""
    step = STEP * np.eye(len(u))[free]
    return np.clip(np.concatenate([u[None], u + step, u - step]), 0.0, 1.0)
