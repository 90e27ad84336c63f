"""Least squares with one input changed, weighted by the residual of a correct model.

No simulations are made.

The results are value, uncertainty, significance and evidence of a change. The covariance of the expected
residual is the sum of a diagonal matrix and patterns. Woodbury's identity inverts it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear
from scipy.special import fdtrc

from kolsky.base.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class ExpectedResidual:
    """The expected residual of a correct model."""

    sigma: FloatArray
    """Standard deviation of the independent errors, shape [k]."""
    patterns: FloatArray
    """Changes of the data vector by one standard deviation of each common cause, shape [k, q]."""
    channel: IntArray
    """Channel of each entry, 0 for force and 1 for outline, shape [k]."""
    block: IntArray
    """Number of the time of each entry, common to both channels, shape [k]."""
    tau: FloatArray
    """Discrepancy of each channel, the residual beyond these errors, in its unit, shape [2]."""

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of the independent errors, with tau, shape [k]."""
        return np.asarray(self.sigma**2 + self.tau[self.channel] ** 2)

    @cached_property
    def _weights(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """1 / (sigma^2 + tau^2) [k], the patterns times this factor [k, q], and their matrix [q, q]."""
        inverse = 1.0 / self.variance
        VN = self.patterns * inverse[:, None]
        core = np.eye(self.patterns.shape[1]) + self.patterns.T @ VN
        return inverse, VN, core

    def weighted(self, x: FloatArray) -> FloatArray:
        """C^-1 x, shape of x [k] or [k, n]."""
        inverse, VN, core = self._weights
        plain = inverse[:, None] * x.reshape(len(x), -1)
        return np.asarray(plain - VN @ np.linalg.solve(core, self.patterns.T @ plain)).reshape(x.shape)

    def independent(self, residual: FloatArray) -> FloatArray:
        """The residual minus its most likely part due to the patterns, shape [k]."""
        return np.asarray(self.variance * self.weighted(residual))

    def among(self, use: BoolArray) -> "ExpectedResidual":
        """A subset of the entries; shape of `use` [k]."""
        return replace(
            self,
            sigma=self.sigma[use],
            patterns=self.patterns[use],
            channel=self.channel[use],
            block=self.block[use],
        )

    @cached_property
    def _channels(self) -> tuple["ExpectedResidual", ...]:
        """Each channel separately, without tau."""
        return tuple(replace(self.among(self.channel == c), tau=np.zeros(2)) for c in range(2))

    def misfits(self, residual: FloatArray) -> FloatArray:
        """Mean of r^T C^-1 r over the entries of each channel without tau, [2]; 1 without entries."""
        found = np.ones(2)
        for channel, alone in enumerate(self._channels):
            part = residual[self.channel == channel]
            if part.size:
                found[channel] = part @ alone.weighted(part) / part.size
        return found

    def with_tau(self, residual: FloatArray) -> "ExpectedResidual":
        """These errors with each channel's tau estimated from a residual."""
        left = self.independent(residual)
        excess = [
            (left[use] ** 2 - self.sigma[use] ** 2).mean() if (use := self.channel == c).any() else 0.0
            for c in range(2)
        ]
        tau = np.sqrt(np.maximum(excess, 0.0))
        return self if (tau == self.tau).all() else replace(self, tau=tau)

    @cached_property
    def times(self) -> IntArray:
        """Number of distinct times of each channel, shape [2]."""
        return np.array([len(np.unique(self.block[self.channel == c])) for c in range(2)])


BLOCKS = (2, 4, 8, 16)
"""Block lengths, in times of a channel, over which residuals may be correlated."""
ROUNDS = 3
"""Iterations of least squares and tau, which depend on each other."""


@dataclass(frozen=True)
class Allowances:
    """Inputs that may be wrong, each within its declared uncertainty."""

    columns: FloatArray
    """B: change of the prediction by one standard uncertainty of each, shape [k, q]."""
    lower: FloatArray
    """Smallest amplitudes, in standard uncertainties, shape [q]."""
    upper: FloatArray
    """Largest amplitudes, in standard uncertainties, shape [q]."""


@dataclass(frozen=True)
class Solution:
    """The least-squares solution of r + A z + B a, without its uncertainty."""

    step: FloatArray
    """The best z, shape [p]."""
    residual: FloatArray
    """r + A z + B a, shape [k]."""


@dataclass(frozen=True)
class LinearFit(Solution):
    """The least-squares solution of r + A z + B a, with its uncertainty."""

    covariance: FloatArray
    """Covariance of z, with residuals correlated in time, shape [p, p]."""
    inflation: float
    """Variance of the last entry of z by residuals correlated in time over that by independent ones [-]."""


def fit_linear(
    residual: FloatArray, columns: FloatArray, expected: ExpectedResidual, allowed: Allowances | None = None
) -> LinearFit:
    """Minimise (r + A z + B a)^T C^-1 (r + A z + B a) + a^T a, with tau from the remaining residual.

    ``residual``: r, prediction minus data, shape [k]. ``columns``: A, change of the prediction per unit of
    each entry of z, shape [k, p]; a column of zeros gets a step of zero and an infinite variance.
    ``allowed``: B and the bounds of a, or none.
    """
    one = _System.of(columns, expected, allowed)
    z, left, weighted = one.solved(residual, expected)
    weighted = weighted.with_tau(left)
    inside = (z > one.low) & (z < one.high)
    B = one.A[:, inside]
    W = weighted.weighted(B)
    G = np.linalg.pinv(B.T @ W + np.diag(one.prior[inside]), rcond=1e-12, hermitian=True)
    own, together = _sandwich(G @ W.T, left, weighted)
    covariance = np.diag(np.where(one.seen, 0.0, np.inf))
    free = np.flatnonzero(one.seen)[inside]
    covariance[np.ix_(free, free)] = (G + together - own) / np.outer(one.scale[inside], one.scale[inside])
    p, q = columns.shape[1], len(one.seen) - columns.shape[1]
    last = float(together[-1, -1] / own[-1, -1]) if p and one.seen[-1] and own[-1, -1] > 0.0 else 1.0
    return LinearFit(one.whole(z)[q:], left, covariance[q:, q:], last)


def solve_linear(
    residual: FloatArray, columns: FloatArray, expected: ExpectedResidual, allowed: Allowances | None = None
) -> Solution:
    """The step and the residual of `fit_linear`, with the same parameters, at half its cost."""
    one = _System.of(columns, expected, allowed)
    z, left, _ = one.solved(residual, expected)
    return Solution(one.whole(z)[len(one.seen) - columns.shape[1] :], left)


@dataclass(frozen=True)
class _System:
    """The columns with an effect, scaled by their size. Those of the allowances come first."""

    A: FloatArray
    """The columns [k, n]."""
    prior: FloatArray
    """Prior precision [n]: that of an amplitude, or 0 for a parameter."""
    low: FloatArray
    """Bounds [n]."""
    high: FloatArray
    scale: FloatArray
    """Sizes of the columns [n]."""
    seen: BoolArray
    """Mask of these among all columns [q + p]."""

    @classmethod
    def of(cls, columns: FloatArray, expected: ExpectedResidual, allowed: Allowances | None) -> "_System":
        q, p = 0 if allowed is None else allowed.columns.shape[1], columns.shape[1]
        both = columns if allowed is None else np.column_stack([allowed.columns, columns])
        seen = np.abs(both).max(axis=0, initial=0.0) > 0.0
        scale = np.sqrt((both[:, seen] ** 2 / expected.variance[:, None]).sum(axis=0))
        A = both[:, seen] / scale
        prior = np.append(np.ones(q), np.zeros(p))[seen] / scale**2
        low, high = np.full(q + p, -np.inf), np.full(q + p, np.inf)
        if allowed is not None:
            low[:q], high[:q] = allowed.lower, allowed.upper
        return cls(A, prior, low[seen] * scale, high[seen] * scale, scale, seen)

    def solved(
        self, residual: FloatArray, expected: ExpectedResidual
    ) -> tuple[FloatArray, FloatArray, ExpectedResidual]:
        """The scaled step, the remaining residual, and the weights used."""
        z, left, weighted = np.zeros(self.A.shape[1]), residual, expected
        for _ in range(ROUNDS):
            weighted = weighted.with_tau(left)
            W = weighted.weighted(self.A)
            z = _bounded(self.A.T @ W + np.diag(self.prior), W.T @ residual, self.low, self.high)
            left = residual + self.A @ z
        return z, left, weighted

    def whole(self, z: FloatArray) -> FloatArray:
        """The step of all columns in their units, 0 for those without an effect, shape [q + p]."""
        step = np.zeros(len(self.seen))
        step[self.seen] = z / self.scale
        return step


def _bounded(H: FloatArray, g: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Minimum of z^T H z / 2 + g^T z between bounds, shape [p]; the shortest one if H is singular."""
    z = -np.linalg.pinv(H, rcond=1e-12, hermitian=True) @ g
    if ((low <= z) & (z <= high)).all():
        return np.asarray(z)
    values, vectors = np.linalg.eigh(H)
    kept = values > 1e-12 * values[-1]
    root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
    aim = -(vectors[:, kept].T @ g) / np.sqrt(values[kept])
    return np.asarray(lsq_linear(root, aim, bounds=(low, high), method="bvls").x)


def _sandwich(
    gain: FloatArray, residual: FloatArray, expected: ExpectedResidual
) -> tuple[FloatArray, FloatArray]:
    """Covariance for independent residuals, and for residuals correlated within time blocks."""
    own = (gain * expected.variance) @ gain.T
    score = gain * expected.independent(residual)
    best, p = own, len(gain)
    for length in BLOCKS:
        label = expected.block // length
        n = int(label.max()) + 1
        if p == 0 or n <= 4 * p:
            continue
        sums = np.array([np.bincount(label, row, minlength=n) for row in score])
        blocks = sums @ sums.T * n / (n - p)
        if np.trace(blocks / np.diag(own)) > np.trace(best / np.diag(own)):
            best = blocks
    return own, best


def evidence(before: FloatArray, after: FloatArray, times: IntArray) -> float:
    """Twice the logarithm of the likelihood ratio, with one residual per time and channel [-].

    A channel cannot improve if its misfit is at most that of a correct model. ``before``, ``after``:
    `ExpectedResidual.misfits` without and with the change, shape [2]. ``times``: distinct times of each
    channel, shape [2].
    """
    return float(times @ np.log(np.maximum(before, 1.0) / np.maximum(after, 1.0)))


def explained_share(before: FloatArray, after: FloatArray, entries: IntArray) -> float:
    """Share of the misfit beyond that of a correct model that a change removes [-].

    ``before``, ``after``: as for `evidence`. ``entries``: of each channel, shape [2].
    """
    excess = [float(entries @ np.maximum(misfit - 1.0, 0.0)) for misfit in (before, after)]
    return 1.0 - excess[1] / excess[0] if excess[0] > 0.0 else 0.0


def chance(change: float, sigma: float, *, degrees: float) -> float:
    """Probability of a change at least this large by chance, by the F-test with 1 and `degrees` [-]."""
    if not 0.0 < sigma < np.inf:
        return 1.0
    return float(fdtrc(1.0, max(degrees, 1.0), (change / sigma) ** 2))


def holm(probabilities: Sequence[float]) -> list[float]:
    """Probabilities adjusted for n tests (Holm 1979): the smallest times n, the next times n - 1, rising."""
    adjusted, largest, n = [0.0] * len(probabilities), 0.0, len(probabilities)
    for place, i in enumerate(np.argsort(probabilities, kind="stable")):
        largest = max(largest, min(1.0, (n - place) * probabilities[i]))
        adjusted[int(i)] = largest
    return adjusted
