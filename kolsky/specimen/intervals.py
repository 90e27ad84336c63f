r"""Intervals and correlations of fitted constants, and whether the law explains the data.

From the whitened Jacobian J of the problem in the constants alone, with those at a bound held,

    C = s^2 a (J^T J)^-1,   s^2 = max(1, chi^2 / (n - p)),   a = max(1, (1 + rho) / (1 - rho)),

s^2 where the residual is larger than the declared noise (Birge 1932), and a where neighbouring residuals are
alike: with the correlation rho of neighbours n residuals tell as much as n / a independent ones
(Bartlett 1946).
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import t as student

from doe.uncertainty.covariance import SingularInformationError, inverse_information
from kolsky.base.arrays import FloatArray
from kolsky.specimen.errors_in_variables import Reduced

LEVEL = 0.95
"""Probability of the intervals."""
TOGETHER = 0.95
"""Size of a correlation from which two constants are known together and not each."""
NARROW = 0.1
"""Half width of an interval over the value up to which a constant is known by itself all the same."""
BROAD = 0.5
"""Half width of an interval over the value from which a constant counts as hardly determined."""
EXPLAINED = 1e-3
"""Probability of a larger chi-square below which the law does not explain the data."""
LARGEST_NEIGHBOUR = 0.9
"""Largest correlation of neighbours that is taken: beyond it the factor has no bound."""


class ConstantVerdict(Enum):
    """What the data say of a constant."""

    IDENTIFIED = "identified"
    """An interval inside the bounds."""
    TOGETHER = "known together with another"
    """Correlated so much with another constant that only a combination of both is known."""
    HARDLY = "hardly determined"
    """The interval is wider than the constant."""
    AT_BOUND = "at its bound"
    """The least chi-square lies on a bound: the data ask for a value outside, and there is no interval."""
    NOT_SEEN = "not seen"
    """Some combination of the constants moves no force of these tests."""


@dataclass(frozen=True)
class ConstantEstimate:
    """A fitted constant with its interval."""

    name: str
    """Name, as in the specification."""
    value: float
    """SI."""
    sigma: float | None
    """Standard uncertainty, SI; None where there is none."""
    low: float | None
    """Lower end of the interval, SI; not below the bound."""
    high: float | None
    """Upper end, SI."""
    verdict: ConstantVerdict
    """What the data say of it."""
    partner: str
    """The constant that it is correlated with most; empty if it is alone."""
    correlation: float
    """Correlation with that one [-]."""

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        if self.verdict is ConstantVerdict.TOGETHER:
            return (
                f"{self.name} is known only together with {self.partner} (correlation "
                f"{self.correlation:.3f}): these tests hide one against the other; add another kind of "
                "test, or hold one"
            )
        cures = {
            ConstantVerdict.HARDLY: "its interval is wide: strain further, or add another kind of test",
            ConstantVerdict.AT_BOUND: "the data ask for a value outside its bounds: try another law",
            ConstantVerdict.NOT_SEEN: "a combination of the constants moves no force: hold one of them",
        }
        said = f"{self.name} is {self.verdict.value}"
        return f"{said}: {cures[self.verdict]}" if self.verdict in cures else said


@dataclass(frozen=True)
class Intervals:
    """Estimates of all free constants."""

    estimates: tuple[ConstantEstimate, ...]
    """In the order of the free constants."""
    covariance: FloatArray
    """SI, shape [p, p]; rows of constants at a bound are zero, NaN throughout if some are not seen."""
    scale: float
    """s^2 a: variance of the residual over that of the declared noise, as the intervals take it [-]."""
    neighbours: float
    """Correlation of neighbouring residuals [-]."""
    degrees: int
    """Degrees of freedom."""
    probability: float
    """Probability of a chi-square as large or larger if law and declared noise were right [-]."""

    @property
    def explained(self) -> bool:
        """Whether the law explains the data within the declared noise."""
        return self.probability >= EXPLAINED

    @property
    def correlation(self) -> FloatArray:
        """Of the constants, shape [p, p]; 0 with a constant at a bound."""
        return correlation_of(self.covariance)


def correlation_of(covariance: FloatArray) -> FloatArray:
    """Correlations of a covariance; rows of zero variance have 0 off the diagonal, shape [p, p]."""
    sigma = np.sqrt(np.diag(covariance))
    outer = np.outer(sigma, sigma)
    found = np.divide(covariance, outer, out=np.zeros_like(covariance), where=outer > 0.0)
    np.fill_diagonal(found, 1.0)
    return np.asarray(found)


def neighbour_correlation(residual: FloatArray) -> float:
    """Correlation of neighbours in one series of residuals about zero [-]."""
    total = float(residual @ residual)
    return float(residual[1:] @ residual[:-1]) / total if total > 0.0 and len(residual) > 2 else 0.0


def intervals(
    names: tuple[str, ...],
    values: FloatArray,
    reduced: Reduced,
    series: tuple[FloatArray, ...],
    *,
    at_bound: tuple[bool, ...],
    bounds: tuple[FloatArray, FloatArray],
) -> Intervals:
    """Intervals at the end of a search.

    Parameters
    ----------
    names, values
        The free constants, shape [p].
    reduced
        The whitened problem there.
    series
        The same residuals, one series for each moving end of each test, neighbours beside each other.
    at_bound
        Constants at a bound.
    bounds
        Least and largest values.
    """
    free = np.flatnonzero(~np.asarray(at_bound))
    degrees = len(reduced.residual) - len(free)
    if degrees < 1:
        raise ValueError(f"{len(reduced.residual)} samples do not determine {len(free)} constants")
    chi2 = float(reduced.residual @ reduced.residual)
    weights = [len(own) for own in series]
    alike = float(np.average([neighbour_correlation(own) for own in series], weights=weights))
    scale = max(1.0, chi2 / degrees) * inflation(alike)
    p = len(names)
    covariance = np.zeros((p, p))
    if len(free):
        size = np.sqrt((reduced.jacobian[:, free] ** 2).sum(axis=0))
        try:
            if not (size > 0.0).all():
                raise SingularInformationError("no force depends on a constant")
            inverse = inverse_information(reduced.jacobian[:, free] / size) / np.outer(size, size)
            covariance[np.ix_(free, free)] = scale * inverse
        except SingularInformationError:
            covariance[:] = np.nan
    factor = float(student.ppf(0.5 + 0.5 * LEVEL, degrees))
    probability = float(chi2_distribution.sf(chi2, degrees))
    estimates = tuple(
        _estimate(j, names, values, covariance, factor, at_bound[j], (bounds[0][j], bounds[1][j]))
        for j in range(p)
    )
    return Intervals(estimates, covariance, scale, alike, degrees, probability)


def inflation(alike: float) -> float:
    """Variance of an estimate with correlated residuals over that with independent ones, >= 1 [-]."""
    rho = min(max(alike, 0.0), LARGEST_NEIGHBOUR)
    return (1.0 + rho) / (1.0 - rho)


def _estimate(
    j: int,
    names: tuple[str, ...],
    values: FloatArray,
    covariance: FloatArray,
    factor: float,
    at_bound: bool,
    bounds: tuple[float, float],
) -> ConstantEstimate:
    value = float(values[j])
    if at_bound or not np.isfinite(covariance).all():
        verdict = ConstantVerdict.AT_BOUND if at_bound else ConstantVerdict.NOT_SEEN
        return ConstantEstimate(names[j], value, None, None, None, verdict, "", 0.0)
    row = correlation_of(covariance)[j].copy()
    row[j] = 0.0
    most = int(np.abs(row).argmax())
    partner, correlation = (names[most], float(row[most])) if len(row) > 1 else ("", 0.0)
    sigma = float(np.sqrt(covariance[j, j]))
    half = factor * sigma
    verdict = ConstantVerdict.IDENTIFIED
    if half > BROAD * abs(value):
        verdict = ConstantVerdict.HARDLY
    if abs(correlation) >= TOGETHER and half > NARROW * abs(value):
        verdict = ConstantVerdict.TOGETHER
    low, high = max(value - half, bounds[0]), min(value + half, bounds[1])
    return ConstantEstimate(names[j], value, sigma, low, high, verdict, partner, correlation)
