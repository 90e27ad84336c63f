"""What is known of the free parameters beside the test: Gaussian priors from declared uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Prior:
    """Independent Gaussian priors of the free parameters, in their order and units.

    Raises
    ------
    ValueError
        If the shapes differ, a mean is not finite or a standard deviation is not > 0.
    """

    mean: FloatArray
    """Most likely values before the test, shape [d]; of no account where sigma is infinite."""
    sigma: FloatArray
    """Standard deviations, shape [d]; infinite where nothing is known."""

    def __post_init__(self) -> None:
        if self.mean.shape != self.sigma.shape or self.mean.ndim != 1:
            raise ValueError(
                f"mean and sigma must be of one shape [d], got {self.mean.shape}, {self.sigma.shape}"
            )
        if not (np.isfinite(self.mean).all() and (self.sigma > 0.0).all()):
            raise ValueError(f"a prior needs finite means and sigmas > 0, got {self.mean} and {self.sigma}")

    @classmethod
    def of(cls, names: Sequence[str], declared: Mapping[str, tuple[float, float]]) -> Prior | None:
        """From declared values with their standard uncertainties; None if no parameter has one.

        Parameters
        ----------
        names
            Free parameters, in their order.
        declared
            Value and standard uncertainty by name; names that are not free are left alone.
        """
        known = [declared.get(name, (0.0, np.inf)) for name in names]
        if not any(np.isfinite(sigma) for _, sigma in known):
            return None
        mean, sigma = np.array(known, dtype=np.float64).T
        return cls(mean, sigma)

    @property
    def precision(self) -> FloatArray:
        """Inverse covariance, shape [d, d]."""
        return np.diag(self.sigma**-2.0)

    def residuals(self, points: FloatArray) -> FloatArray:
        """(x - mean) / sigma of the parameters that have a prior, shape [..., d] -> [..., p]."""
        known = np.isfinite(self.sigma)
        residuals: FloatArray = ((points - self.mean) / self.sigma)[..., known]
        return residuals

    def rows(self) -> FloatArray:
        """Derivatives of `residuals` by the parameters, shape [p, d]."""
        return np.diag(1.0 / self.sigma)[np.isfinite(self.sigma)]

    def chi2(self, points: FloatArray) -> FloatArray:
        """Sum of squared residuals, -2 ln of the density up to a constant, shape [..., d] -> [...]."""
        return np.asarray((self.residuals(points) ** 2).sum(axis=-1))
