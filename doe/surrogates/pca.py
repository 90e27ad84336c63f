"""Principal components of a set of response vectors, with the error of truncation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray


@dataclass(frozen=True)
class PrincipalComponents:
    """A response as mean + scale * (scores @ basis). The scores are uncorrelated over the runs."""

    mean: FloatArray
    """Mean response over the runs, in response units, shape [k]."""
    scale: FloatArray
    """Scale of each entry, in response units, shape [k]: each entry is divided by its scale."""
    basis: FloatArray
    """Orthonormal components of the scaled response [-], shape [q, k]."""
    truncation: FloatArray
    """Response minus its reduction, run by run, in response units, shape [n, k]."""

    @classmethod
    def fit(
        cls, responses: FloatArray, *, scale: ArrayLike = 1.0, variance: float = 1.0 - 1e-8
    ) -> PrincipalComponents:
        """The smallest number of components that keep a share of the scaled variance of responses, [n, k],
        one row per run.

        ``scale``: scale of each entry, > 0, in response units, a number or shape [k]. Forces and lengths need
        different scales, e.g. their noise. Otherwise the larger numbers dominate. Raises ValueError if an
        argument is outside its range.
        """
        k = responses.shape[1]
        weights = np.array(np.broadcast_to(np.asarray(scale, dtype=np.float64), (k,)))
        if not np.all(np.isfinite(weights) & (weights > 0.0)):
            j = int(np.flatnonzero(~(np.isfinite(weights) & (weights > 0.0)))[0])
            raise ValueError(f"scale must be finite and > 0, got {weights[j]} for entry {j}")
        if not 0.0 < variance <= 1.0:
            raise ValueError(f"variance must be in (0, 1], got {variance}")
        mean = responses.mean(axis=0)
        scaled = (responses - mean) / weights
        _, singular, right = np.linalg.svd(scaled, full_matrices=False)
        q = _count_by_variance(singular, variance)
        remainder = (scaled - (scaled @ right[:q].T) @ right[:q]) * weights
        return cls(mean, weights, right[:q], remainder)

    @property
    def n_components(self) -> int:
        """Number of components kept, q."""
        return len(self.basis)

    @property
    def truncation_error(self) -> FloatArray:
        """Largest |response - reduction| over the runs, in response units, shape [k]."""
        return np.asarray(np.abs(self.truncation).max(axis=0))

    def scores(self, responses: FloatArray) -> FloatArray:
        """Coordinates of responses in the basis [-], shape [n, k] -> [n, q]."""
        return ((responses - self.mean) / self.scale) @ self.basis.T

    def expand(self, scores: FloatArray) -> FloatArray:
        """Responses from coordinates, in response units, shape [m, q] -> [m, k]."""
        return self.mean + self.deviation(scores)

    def deviation(self, scores: FloatArray) -> FloatArray:
        """Differences of responses from differences of coordinates, shape [m, q] -> [m, k]."""
        return (scores @ self.basis) * self.scale


def _count_by_variance(singular: FloatArray, variance: float) -> int:
    # lost[q] = variance lost with q components. It is summed from the small end, because 1 - share has
    # round-off.
    remainder = np.append(np.cumsum(singular[::-1] ** 2)[::-1], 0.0)
    enough = np.flatnonzero(remainder <= (1.0 - variance) * remainder[0])
    # At least one component: a constant response then needs no special case.
    return max(1, int(enough[0]))
