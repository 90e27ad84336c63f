"""The data of several shots and slow tests in one vector, and the covariance of what a model leaves.

Every shot keeps the weights that it has alone: noise, a discrepancy of each channel, the patterns of its
front face's noise (`kolsky.inverse.objective`). What one shot alone may be off by, the clock of its force
record, the scale of its force, its own stiffness, is a pattern more with its standard deviation: a linear
unknown with a Gaussian prior, taken out of the likelihood in closed form instead of being searched for. A
calibration that shots share is one pattern through all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from doe.whitening import Whitening
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.inverse.block_covariance import BLOCKS
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Observations

GAIN, CLOCK, SCATTER = "gain", "clock", "scatter"
"""Shot-wise unknowns."""


@dataclass(frozen=True)
class ShotData:
    """One shot's data, and the patterns of what it may be off by."""

    observations: Observations
    """What was measured."""
    counted: BoolArray
    """Outline points that count, shape [Q]."""
    front: FloatArray
    """Patterns of the front face's noise over bins and all points, shape [n, n_bins + Q]."""
    own: Mapping[str, FloatArray] = field(default_factory=dict)
    """Change of bins and all points by one standard deviation of each shot-wise unknown, [n_bins + Q]."""

    @cached_property
    def objective(self) -> Objective:
        """Weights without discrepancies."""
        rows = [self.front, *(row[None] for row in self.own.values())]
        return Objective(replace(self.observations, front_noise=np.concatenate(rows)), self.counted)

    @property
    def kept(self) -> BoolArray:
        """Entries of bins and all points that count, shape [n_bins + Q]."""
        return np.concatenate([np.ones(self.observations.n_force, bool), self.counted])

    def taken(self, vectors: FloatArray) -> FloatArray:
        """The counted entries of vectors; an outline point that a run does not reach adds nothing."""
        seen = vectors[..., self.kept]
        lost = np.isnan(seen).all(axis=-1, keepdims=True)
        return np.asarray(np.where(np.isnan(seen) & ~lost, self.objective.data, seen))


@dataclass(frozen=True)
class Stack:
    """All data in one vector: the shots in their order, slow tests, what is known beforehand."""

    shots: tuple[ShotData, ...]
    """The shots."""
    slow: FloatArray
    """Measured values of the slow tests, shape [s]."""
    slow_sigma: FloatArray
    """Their standard uncertainties, shape [s]."""
    known: int
    """Rows of prior knowledge, residuals of unit variance, at the end."""
    common: FloatArray | None = None
    """Changes of the shots' counted entries by one standard deviation of what several share, [n, K]."""
    curve: FloatArray | None = None
    """The same of the slow curves' noise, slow tests behind the shots, [n, K + s]."""

    @cached_property
    def ends(self) -> tuple[int, ...]:
        """Where each shot ends in the vector."""
        return tuple(np.cumsum([len(one.objective.data) for one in self.shots]).tolist())

    @cached_property
    def data(self) -> FloatArray:
        """The vector of all data, shape [k]."""
        parts = [one.objective.data for one in self.shots]
        return np.concatenate([*parts, self.slow, np.zeros(self.known)])

    def parts(self, vector: FloatArray) -> list[FloatArray]:
        """The shots' parts of a vector."""
        return np.split(vector[: self.ends[-1]], self.ends[:-1])

    def joined(self, vectors: Sequence[FloatArray], slow: FloatArray, known: FloatArray) -> FloatArray:
        """One vector of all predictions, shape [n, k], from the shots' own [n, n_bins + Q] each."""
        taken = [one.taken(v) for one, v in zip(self.shots, vectors, strict=True)]
        return np.concatenate([*taken, slow, known], axis=1)

    def weighed(self, residual: FloatArray) -> list[Objective]:
        """Every shot's weights, with the discrepancies that explain its part of a residual."""
        parts = zip(self.shots, self.parts(residual), strict=True)
        return [one.objective.with_discrepancy(one.objective.data + r) for one, r in parts]

    def whitening(self, objectives: Sequence[Objective], more: FloatArray | None = None) -> Whitening:
        """The weights of the whole vector.

        Parameters
        ----------
        objectives
            Of the shots, with their discrepancies.
        more
            Further patterns through the vector, shape [n, k].
        """
        sigma = np.concatenate([*(o.own_sigma for o in objectives), self.slow_sigma, np.ones(self.known)])
        rows = [np.zeros((0, len(sigma)))]
        start = 0
        for objective, end in zip(objectives, self.ends, strict=True):
            rows.append(np.zeros((len(objective.common), len(sigma))))
            rows[-1][:, start:end] = objective.common
            start = end
        for shared in (self.common, self.curve):
            if shared is not None:
                rows.append(np.pad(shared, ((0, 0), (0, len(sigma) - shared.shape[1]))))
        if more is not None:
            rows.append(more)
        return Whitening(sigma, np.concatenate(rows))

    def weighting(self, residual: FloatArray) -> Whitening:
        """Weights with the discrepancies that explain a residual."""
        return self.whitening(self.weighed(residual))

    def weighed_beside(self, residual: FloatArray, patterns: FloatArray) -> list[Objective]:
        """Every shot's weights, with the discrepancies of what some patterns leave of a residual.

        Parameters
        ----------
        residual
            Prediction less data, shape [k].
        patterns
            Changes that are free in size, shape [n, k].
        """
        whitening = self.weighting(residual)
        u, r = whitening.apply(patterns), whitening.apply(residual)
        return self.weighed(residual - np.linalg.lstsq(u.T, r, rcond=None)[0] @ patterns)

    def of_shot(self, k: int, row: FloatArray) -> FloatArray:
        """A row of all data with what belongs to one shot alone, shape [k]."""
        found = np.zeros_like(row)
        start = self.ends[k - 1] if k else 0
        found[start : self.ends[k]] = row[start : self.ends[k]]
        return found

    @cached_property
    def blocks(self) -> list[IntArray]:
        """Of each length of `BLOCKS`, a label for every entry: residuals of one label may be correlated."""
        found = []
        for length in BLOCKS:
            labels, first = [], 0
            for one in self.shots:
                times = one.objective.times
                width = float(np.diff(one.observations.bins.edges).mean())
                own = ((times - times.min()) / width).astype(int) // length
                labels.append(first + own)
                first += int(own.max()) + 1
            rest = len(self.slow) + self.known
            labels.append(first + np.arange(rest))
            found.append(np.concatenate(labels))
        return found


BLIND = 0.1
"""Change of all data by the whole range of an unknown, in standard deviations, below which they do not see
it."""


def information(rows: FloatArray, widths: FloatArray) -> FloatArray:
    """Information on the unknowns, shape [d, d]; one that the data do not see keeps the width of its range.

    Where a branch has no strength its time moves nothing. The variance of a range of the width w that is
    evenly likely is w^2 / 12.

    Parameters
    ----------
    rows
        Whitened slopes, shape [d, k].
    widths
        Of the unknowns' ranges, shape [d].
    """
    blind = np.linalg.norm(rows, axis=1) * widths < BLIND
    return np.asarray(rows @ rows.T + np.diag(np.where(blind, 12.0 / widths**2, 0.0)))


def bounded_step(rows: FloatArray, residual: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The step to the least-squares optimum of a linear model inside bounds, shape [d].

    Parameters
    ----------
    rows
        Whitened slopes, shape [d, k].
    residual
        Prediction less data, whitened, shape [k].
    lower, upper
        Bounds of the step, around 0, shape [d].
    """
    width = upper - lower  # unknowns of different units
    bounds = np.minimum(lower / width, -1e-15), np.maximum(upper / width, 1e-15)
    found = lsq_linear((rows * width[:, None]).T, -residual, bounds, method="bvls")
    return np.asarray(found.x * width, dtype=np.float64)


def covariance(
    slopes: FloatArray, residual: FloatArray, whitening: Whitening, stack: Stack, widths: FloatArray
) -> FloatArray:
    """Covariance of the unknowns, residuals correlated in time or not, shape [d, d].

    The larger of the Gauss-Newton covariance and of the block "sandwich" in which the residuals of a block of
    time of one shot may be correlated in any way; every variance is the largest that any block length gives.
    What the patterns explain of the residual is not in the blocks: it is in the weights.

    Parameters
    ----------
    slopes
        By the unknowns, shape [k, d].
    residual
        Prediction less data, shape [k].
    whitening
        The weights.
    stack
        Whose blocks.
    widths
        Of the unknowns' ranges, shape [d].
    """
    rows = whitening.apply(slopes.T)
    plain = np.linalg.inv(information(rows, widths))
    score = (plain @ rows) * whitening.apply(residual)
    best, d = plain, len(plain)
    for label in stack.blocks:
        n = int(label.max()) + 1
        sums = np.array([np.bincount(label, row, minlength=n) for row in score])
        sandwich = sums @ sums.T * n / max(n - d, 1)
        short = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(best), 1.0))
        best = short[:, None] * best * short
    return np.asarray(best)
