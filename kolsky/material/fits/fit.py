"""A law fitted to homogeneous tests by weighted least squares in nominal stress, and its goodness of fit.

With n residuals r_i, k free constants and S = sum r_i^2,

    RMSE = sqrt(S / n),  R^2 = 1 - S / sum (T_i - mean T)^2,                                   (Q.6)
    AIC = n ln(S / n) + 2 k,  BIC = n ln(S / n) + k ln n,                                      (Q.7)

Here the noise is unknown and the constant of the likelihood is omitted (Burnham and Anderson 2002). Only
differences between laws fitted to the same points have a meaning. With known noise, chi^2 replaces n ln(S /
n).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from math import log

import numpy as np

from dic.basics import check_interval
from explicit.materials import AnyLaw
from explicit.materials import bulk_modulus as bulk
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.search import EQUAL_MINIMA, EXACT, Residuals, SearchResult, Weighting, search


def rmse(residual: FloatArray) -> float:
    """Root mean square of residuals, in their unit; Eq. (Q.6)."""
    return float(np.sqrt(np.mean(residual**2)))


def r_squared(residual: FloatArray, measured: FloatArray) -> float:
    """Coefficient of determination, Eq. (Q.6); negative if the mean of the data fits better."""
    return float(1.0 - (residual @ residual) / np.sum((measured - measured.mean()) ** 2))


def durbin_watson(residual: FloatArray) -> float:
    """sum (r_i+1 - r_i)^2 / sum r_i^2: 2 for independent residuals, 0 if successive residuals are equal."""
    return float(np.sum(np.diff(residual) ** 2) / np.sum(residual**2))


def neighbour_correlation(residual: FloatArray) -> float:
    """Correlation of neighbours in one series of residuals about zero [-]."""
    total = float(residual @ residual)
    return float(residual[1:] @ residual[:-1]) / total if total > 0.0 and len(residual) > 2 else 0.0


LARGEST_LIKENESS = 0.9
"""Upper limit for the correlation of neighbours [-]. Above it, `inflation` would be unbounded."""


def inflation(alike: float) -> float:
    """Variance of an estimate divided by that with independent residuals, >= 1 [-] (Bartlett 1935).

    ``alike``: correlation of neighbouring residuals [-]. Fewer of them are therefore independent.
    """
    rho = min(max(alike, 0.0), LARGEST_LIKENESS)
    return (1.0 + rho) / (1.0 - rho)


STARTS = 12
"""Number of starts that are refined if some constants of a law are not moduli."""
WEAKEST = 1e-7
"""Smallest ratio of the least to the largest singular value of the scaled Jacobian. Below it, the data do not
distinguish the constants. It is half the digits of the residuals."""


class FitOutcome(Enum):
    """Outcome of a fit: whether the data determine the constants."""

    DETERMINED = "determined"
    """One minimum, inside the bounds, reached from two starts. With moduli alone there is a single
    minimum."""
    AT_BOUND = "at a bound"
    """The least sum of squares lies on a bound: the data prefer a constant beyond it."""
    UNCONFIRMED = "not confirmed"
    """Inside the bounds, but reached from only one start: there may be a better minimum."""
    NOT_DETERMINED = "not determined"
    """Different constants fit the data equally well. Fix some of them, or use a law with fewer."""


@dataclass(frozen=True)
class PartFit:
    """Fit of one test."""

    test: HomogeneousTest
    predicted: FloatArray
    """Nominal stress of the law at its points [Pa], shape [n]."""

    @property
    def residual(self) -> FloatArray:
        """Law minus measurement [Pa], shape [n]."""
        return self.predicted - self.test.stress

    @property
    def sse(self) -> float:
        """Sum of squared residuals [Pa^2]."""
        return float(np.sum(self.residual**2))

    @property
    def rmse(self) -> float:
        """Root mean square residual [Pa]."""
        return rmse(self.residual)

    @property
    def r_squared(self) -> float:
        """Coefficient of determination [-]."""
        return r_squared(self.residual, self.test.stress)

    @property
    def relative_rms(self) -> float:
        """Root mean square of residual divided by measured stress [-]. Stresses of zero are left out."""
        loaded = self.test.stress != 0.0
        return rmse(self.residual[loaded] / self.test.stress[loaded])


@dataclass(frozen=True)
class Fit:
    """A fitted law with the uncertainties of its constants."""

    name: str
    """The law and its fixed constants."""
    law: AnyLaw
    free: tuple[str, ...]
    """Names of the fitted constants."""
    parts: tuple[PartFit, ...]
    weighting: Weighting
    poisson: float | None
    """Poisson's ratio at rest; None for the incompressible solution."""
    chi2: float
    """Sum of the weighted squared residuals [-]."""
    n: int
    """Number of residuals with a nonzero weight."""
    covariance: FloatArray
    """Covariance of the fitted constants, SI, shape [n_free, n_free], for independent residuals. Rows of
    constants at a bound are zero. All entries are NaN if the constants are not determined."""
    outcome: FitOutcome
    at_bound: tuple[str, ...]
    """Constants at a bound."""
    ends: tuple[float, ...]
    """Weighted sum of squares of each start, least first."""
    bounds_cost: float = 1.0
    """Weighted sum of squares divided by that without the bounds of a positive energy [-]. It is 1 if no
    bound is reached."""

    @property
    def bulk_modulus(self) -> float:
        """K at rest [Pa]; infinite for the incompressible solution."""
        return float("inf") if self.poisson is None else float(bulk(self.law.shear_modulus, self.poisson))

    @property
    def D1(self) -> float:
        """2 / K [1/Pa], the compressibility in the notation of Abaqus and CalculiX; 0 if incompressible."""
        return 2.0 / self.bulk_modulus

    @property
    def values(self) -> dict[str, float]:
        """All constants in SI, by name."""
        return {s.name: float(x) for s, x in zip(self.law.PARAMETERS, self.law.constants(), strict=True)}

    @property
    def sigma(self) -> dict[str, float]:
        """Standard uncertainty of the fitted constants in SI, by name."""
        return dict(zip(self.free, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def youngs_modulus(self) -> float:
        """E_0 at rest [Pa]: 3 mu_0, or 2 mu_0 (1 + nu)."""
        return 2.0 * self.law.shear_modulus * (1.0 + (0.5 if self.poisson is None else self.poisson))

    @property
    def sse(self) -> float:
        """Sum of squared residuals of all tests, unweighted [Pa^2]."""
        return sum(part.sse for part in self.parts)

    @property
    def rmse(self) -> float:
        """Root mean square residual of all tests, unweighted [Pa]."""
        return float(np.sqrt(self.sse / sum(len(part.residual) for part in self.parts)))

    @property
    def r_squared(self) -> float:
        """Coefficient of determination of all tests together [-]."""
        whole = np.concatenate([part.residual for part in self.parts])
        return r_squared(whole, np.concatenate([part.test.stress for part in self.parts]))

    @property
    def deviance(self) -> float:
        """n ln(S / n), or chi-square if the noise is known; minus infinity without residuals [-]."""
        if self.weighting is Weighting.SIGMA:
            return self.chi2
        return self.n * log(self.chi2 / self.n) if self.chi2 > 0.0 else float("-inf")

    @property
    def aic(self) -> float:
        """Akaike's criterion, Eq. (Q.7). Compare only laws fitted to the same points and weights."""
        return self.deviance + 2.0 * len(self.free)

    @property
    def bic(self) -> float:
        """Schwarz's criterion, Eq. (Q.7); likewise."""
        return self.deviance + len(self.free) * log(self.n)

    @property
    def durbin_watson(self) -> float:
        """Smallest Durbin-Watson number of the tests [-].

        Far below 2, the law misses the curve's shape, and `covariance` (of independent points) is too small.
        """
        return min(durbin_watson(part.residual) for part in self.parts)

    @property
    def agreeing(self) -> int:
        """Number of starts that reached the least sum of squares."""
        return sum(end <= self.ends[0] * (1.0 + EQUAL_MINIMA) + EXACT for end in self.ends)


def fit_law(
    law: type[AnyLaw],
    tests: Sequence[HomogeneousTest],
    *,
    weighting: Weighting = Weighting.ABSOLUTE,
    bounded: bool = True,
    held: Mapping[str, float] | None = None,
    poisson: float | None = None,
    free_poisson: bool = False,
    starts: int = STARTS,
    seed: int = 1,
    name: str = "",
) -> Fit:
    """Fit a law to one or several homogeneous tests at once.

    Raises ValueError if an option is outside its range, or if the tests and the law do not fit together.

    Returns: the best minimum of all starts. `outcome` states whether the data determine it.

    Parameters
    ----------
    law
        One of `explicit.materials.LAWS`.
    tests
        The tests; each may carry a weight.
    weighting
        What residuals are divided by.
    bounded
        True to keep the constants within the bounds in which the energy is positive at any deformation.
        Otherwise, only the bounds in which the law exists are used.
    held
        Constants that are not fitted, in SI.
    poisson
        Poisson's ratio at rest for the compressible solution with K/2 (J - 1)^2. Default: incompressible.
    free_poisson
        True to fit this ratio too, to the tests' lateral stretches. It is among `free` as "poisson".
    starts
        Number of starts that are refined.
    seed
        Seed of the starts.
    name
        Name of the fit. Default: the law's name with the fixed constants.
    """
    if starts < 1:
        raise ValueError(f"starts must be >= 1, got {starts}")
    weighting = Weighting(weighting)
    check_interval("(-1, 0.5)", poisson=0.0 if poisson is None else poisson)
    problem = Residuals(law, tuple(tests), weighting, dict(held or {}), poisson, free_poisson)
    found = search(problem, bounded=bounded, starts=starts, seed=seed)
    made = problem.build(found.unknowns)
    covariance, told_apart = _covariance(problem, found)
    at_bound = tuple(spec.name for spec, at in zip(problem.free, found.at_bound, strict=True) if at)
    outcome = FitOutcome.AT_BOUND if at_bound else FitOutcome.DETERMINED
    if outcome is FitOutcome.DETERMINED and found.agreeing < 2 and not problem.linear:
        outcome = FitOutcome.UNCONFIRMED
    ratio = problem.ratio(found.unknowns)
    return Fit(
        name=name or law.NAME + "".join(f", {key} = {value:g}" for key, value in problem.held.items()),
        law=made,
        free=tuple(spec.name for spec in problem.free),
        parts=tuple(PartFit(*pair) for pair in zip(problem.tests, problem.stress(made, ratio), strict=True)),
        weighting=weighting,
        poisson=ratio,
        chi2=found.chi2,
        n=problem.n,
        covariance=covariance,
        outcome=outcome if told_apart else FitOutcome.NOT_DETERMINED,
        at_bound=at_bound,
        ends=found.ends,
        bounds_cost=found.chi2 / found.unbounded if found.unbounded > 0.0 else 1.0,
    )


def _covariance(problem: Residuals, found: SearchResult) -> tuple[FloatArray, bool]:
    """Covariance of the free constants in SI, and True if the data distinguish them."""
    inside = ~np.array(found.at_bound)
    k = len(inside)
    whole = np.zeros((k, k))
    J = found.jacobian[:, inside]
    length = np.sqrt(np.sum(J**2, axis=0))
    if (length == 0.0).any():
        return np.full((k, k), np.nan), False
    _, s, vt = np.linalg.svd(J / length, full_matrices=False)
    if s.size and s[-1] < WEAKEST * s[0]:
        return np.full((k, k), np.nan), False
    # Unknown noise: its variance is that of the residuals. Known noise: at least that noise, more if the
    # residuals are larger.
    variance = found.chi2 / (problem.n - int(inside.sum()))
    if problem.weighting is Weighting.SIGMA:
        variance = max(1.0, variance)
    covariance = (vt.T / s**2) @ vt * variance / np.outer(length, length)
    units = problem.units[inside]
    whole[np.ix_(inside, inside)] = covariance * np.outer(units, units)
    return whole, True
