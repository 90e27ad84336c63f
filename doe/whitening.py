"""Weights of data whose errors are independent but for a few patterns that they have in common.

The covariance is C = D + M' M: a diagonal of variances, and rows M that move many data together by one
standard deviation each. Least squares with it are those with C^(-1/2) applied to residuals and slopes. With
M D^(-1/2) = U S V',

    C^(-1/2) = (1 + V ((1 + S^2)^(-1/2) - 1) V') D^(-1/2),    ln det C = ln det D + sum ln(1 + S^2),

so that nothing larger than the patterns is decomposed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from doe.arrays import FloatArray


@dataclass(frozen=True)
class Whitening:
    """The square root of an inverse covariance, a diagonal with a few common patterns.

    Raises
    ------
    ValueError
        If a standard deviation is not > 0 or the patterns are of another length.
    """

    sigma: FloatArray
    """Standard deviations of the independent part, shape [k]."""
    patterns: FloatArray | None = None
    """Changes of the data by one standard deviation of each common error, shape [n, k]; None if there are
    none."""

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0).all():
            raise ValueError(f"every sigma must be > 0, got {float(np.min(self.sigma)):.6g}")
        if self.patterns is not None and self.patterns.shape[1:] != self.sigma.shape:
            raise ValueError(f"patterns of shape {self.patterns.shape} do not fit {self.sigma.shape} sigmas")

    @cached_property
    def _common(self) -> tuple[FloatArray, FloatArray]:
        """Sizes S and directions V' of the patterns in units of sigma, shapes [n] and [n, k]."""
        patterns = np.zeros((0, len(self.sigma))) if self.patterns is None else self.patterns
        _, size, directions = np.linalg.svd(patterns / self.sigma, full_matrices=False)
        return size, directions

    def apply(self, rows: FloatArray) -> FloatArray:
        """C^(-1/2) applied to rows of shape [..., k]: of residuals, their squares sum up to chi-square."""
        size, directions = self._common
        scaled = rows / self.sigma
        shrunk = (scaled @ directions.T) * (1.0 / np.sqrt(1.0 + size**2) - 1.0)
        return np.asarray(scaled + shrunk @ directions)

    def precision(self, rows: FloatArray) -> FloatArray:
        """C^-1 applied to rows of shape [..., k]."""
        size, directions = self._common
        scaled = rows / self.sigma
        shrunk = (scaled @ directions.T) * (size**2 / (1.0 + size**2))
        return np.asarray((scaled - shrunk @ directions) / self.sigma)

    @property
    def log_determinant(self) -> float:
        """ln det C [-]."""
        size, _ = self._common
        return float(2.0 * np.log(self.sigma).sum() + np.log1p(size**2).sum())
