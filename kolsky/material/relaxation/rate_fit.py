"""A fitted rate model, and the verdict how many branches the evidence asks for."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.relaxation.evidence import RateModel

SIGNIFICANT = 0.01
"""Probability below which chance does not explain what a branch improves."""


@dataclass(frozen=True)
class RateFit:
    """A fitted rate model."""

    model: RateModel
    """The best model; branches in order of ascending relaxation time."""
    names: tuple[str, ...]
    """Names of the free parameters: "factor", "strength 1" and so on."""
    values: FloatArray
    """Their values, shape [n_parameters]."""
    covariance: FloatArray
    """Covariance of their logarithms, already widened by `scatter` [-], shape [n_parameters] * 2."""
    chi_square: float
    """Weighted sum of squared residuals [-]."""
    n_data: int
    """Values with a finite sigma."""
    residuals: tuple[FloatArray, ...]
    """(predicted - measured) / sigma of each evidence [-]."""
    at_bound: tuple[str, ...]
    """Parameters that ended at the end of their range: the evidence does not determine them."""

    @property
    def scatter(self) -> float:
        """max(1, chi_square / degrees of freedom) [-]: what the covariance is widened by (Birge)."""
        free = self.n_data - len(self.values)
        return max(1.0, self.chi_square / free) if free > 0 else 1.0

    @property
    def aic(self) -> float:
        """Akaike's criterion, chi_square + 2 n_parameters [-]."""
        return self.chi_square + 2.0 * len(self.values)

    @property
    def bic(self) -> float:
        """Bayesian criterion, chi_square + n_parameters log(n_data) [-]."""
        return self.chi_square + len(self.values) * float(np.log(self.n_data))

    def interval(self, name: str, *, coverage_factor: float = 2.0) -> tuple[float, float]:
        """Interval of a parameter, from the covariance of the logarithms.

        Raises
        ------
        ValueError
            If the fit has no such parameter.
        """
        if name not in self.names:
            raise ValueError(f"parameter must be one of {', '.join(self.names)}, got {name!r}")
        k = self.names.index(name)
        spread = float(np.exp(coverage_factor * np.sqrt(self.covariance[k, k])))
        return float(self.values[k] / spread), float(self.values[k] * spread)


@dataclass(frozen=True)
class RateVerdict:
    """Number of branches that the evidence requires."""

    fits: tuple[RateFit, ...]
    """The fits with 0, 1, 2, ... branches."""
    probabilities: tuple[float, ...]
    """Of each further branch: the probability that noise alone improves chi-square by so much [-].
    Two parameters come with a branch and the time means nothing without the strength, so chi-square with two
    degrees of freedom is used; improvements are divided by the scatter of the richest fit."""

    @property
    def branches(self) -> int:
        """Branches that are asked for one after the other: each significant, with a lower AIC, and none of
        its parameters at the end of its range."""
        count = 0
        for k, probability in enumerate(self.probabilities, start=1):
            fit, before = self.fits[k], self.fits[k - 1]
            if probability >= SIGNIFICANT or fit.aic >= before.aic or fit.at_bound:
                break
            count = k
        return count

    @property
    def fit(self) -> RateFit:
        """The fit with as many branches."""
        return self.fits[self.branches]

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        if len(self.fits) == 1:
            return "no branch was tried"
        k = self.branches
        if k == 0:
            fit, p = self.fits[1], self.probabilities[0]
            why = f"at the end of its range: {', '.join(fit.at_bound)}" if fit.at_bound else _chance(p)
            return f"the data do not ask for rate dependence ({why}, AIC {fit.aic - self.fits[0].aic:+.1f})"
        p, gain = self.probabilities[k - 1], self.fits[k].aic - self.fits[k - 1].aic
        return f"the data ask for {k} branch{'es' if k > 1 else ''} ({_chance(p)}, AIC {gain:+.1f})"


def _chance(probability: float) -> str:
    return "p < 1e-99" if probability < 1e-99 else f"p = {probability:.2g}"
