"""Weights of data whose errors are independent but for a few patterns that they have in common.

The covariance is C = D + M' M: a diagonal of variances, and rows M that move many data together by one
standard deviation each. Least squares with it are those with C^(-1/2) applied to residuals and slopes. With
B = M D^(-1/2), its products B B' = U L U', A = U' B and R = (1 + L)^(1/2),

    C^(-1/2) = (1 - A' (R (1 + R))^-1 A) D^(-1/2),    ln det C = ln det D + sum ln(1 + L),

so that nothing larger than the patterns' products is decomposed. No small L is divided by: what rounding
leaves of patterns that depend on each other does no harm.
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
        """1 + L and rows A of the patterns in units of sigma, shapes [n] and [n, k]."""
        if self.patterns is None:
            return np.ones(0), np.zeros((0, len(self.sigma)))
        scaled = self.patterns / self.sigma
        squares, turned = np.linalg.eigh(scaled @ scaled.T)
        return 1.0 + np.maximum(squares, 0.0), np.asarray(turned.T @ scaled)

    def apply(self, rows: FloatArray) -> FloatArray:
        """C^(-1/2) applied to rows of shape [..., k]: of residuals, their squares sum up to chi-square."""
        total, common = self._common
        root, scaled = np.sqrt(total), rows / self.sigma
        return np.asarray(scaled - ((scaled @ common.T) / (root * (1.0 + root))) @ common)

    def precision(self, rows: FloatArray) -> FloatArray:
        """C^-1 applied to rows of shape [..., k]."""
        total, common = self._common
        scaled = rows / self.sigma
        return np.asarray((scaled - ((scaled @ common.T) / total) @ common) / self.sigma)

    @property
    def log_determinant(self) -> float:
        """ln det C [-]."""
        total, _ = self._common
        return float(2.0 * np.log(self.sigma).sum() + np.log(total).sum())
