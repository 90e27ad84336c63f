"""The result of an error budget: parts by source, shares of the variance, a planned campaign, tables."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from dic.views import ResultViews
from kolsky.base.arrays import FloatArray
from kolsky.studies.budget.realisation import Factor, RealisationOutcome

RESAMPLES = 2000
"""Number of bootstrap samples."""
PERCENT = (2.5, 97.5)
"""Ends of an interval."""

Interval = tuple[float, float]


def shares_of_squares(u: FloatArray, drawn: int, values: FloatArray) -> FloatArray:
    """95 % intervals of shares u_i^2 / sum u^2 by bootstrap, shape [k, 2]; NaN if u is NaN.

    ``drawn``: index of the u that is the standard deviation of the few `values`.
    """
    rng = np.random.default_rng(1)
    again = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].var(axis=1, ddof=1)
    squares = np.tile(u**2, (RESAMPLES, 1))
    squares[:, drawn] = again
    total = np.nansum(squares, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = squares / total[:, None]
    found = np.full((len(u), 2), np.nan)
    known = np.isfinite(u)
    found[known] = np.percentile(shares[:, known], PERCENT, axis=0).T
    return found


FEWEST = 4
"""Smallest number of realisations for a standard deviation."""
NO_INTERVAL = (float("nan"), float("nan"))


@dataclass(frozen=True)
class Source:
    """Effect of a single factor on the answer."""

    factor: Factor
    bias: float
    """Mean of the answer minus that without the error, in the answer's unit; NaN for the noise."""
    u: float
    """Standard uncertainty of the answer due to it, in the answer's unit. NaN if realisations failed."""
    slope: float
    """Change of the answer per unit of the factor's value; NaN for the noise."""
    refused: tuple[str, ...]
    share_interval: tuple[float, float] = NO_INTERVAL
    """95 % interval of its share in the sum of the squares [-]. The interval is due to the few draws of the
    noise."""


@dataclass(frozen=True)
class Budget(ResultViews):
    """Effect of each source of error on one parameter, separately and together with the others."""

    name: str
    parameter: str
    truth: float
    """Its true value; NaN if the specification does not define it."""
    reference: float
    """Its estimate without errors, with the instruments' noise of the first draw."""
    sources: tuple[Source, ...]
    """Each factor separately."""
    together: FloatArray
    """Estimates with all errors together, shape [n], for draws with an answer in the valley of the
    reference."""
    refused: tuple[str, ...]
    """Reasons why realisations with all errors together gave no answer."""
    elsewhere: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Estimates by the complete search for draws that end in another valley, shape [n_jumps]."""
    searched: int = 0
    """Number of draws of all errors for which the complete search has an answer."""
    outcomes: tuple[RealisationOutcome, ...] = ()
    """Outcome of every realisation. The first one has no errors."""
    closure: float = float("nan")
    """Re-fit minus complete search for the test without errors. It shows the agreement of both methods."""

    @property
    def u_sum(self) -> float:
        """Root of the sum of the squares of the sources: Eq. (E.10)."""
        return float(np.sqrt(np.nansum([source.u**2 for source in self.sources])))

    @property
    def u_together(self) -> float:
        """Standard deviation with all errors together; NaN with fewer than `FEWEST` answers."""
        return float(self.together.std(ddof=1)) if len(self.together) >= FEWEST else float("nan")

    @property
    def u_together_interval(self) -> tuple[float, float]:
        """95 % interval of this standard deviation, for normally distributed values. NaN with fewer than
        `FEWEST` answers."""
        n, u = len(self.together), self.u_together
        if n < FEWEST:
            return NO_INTERVAL
        low, high = np.sqrt((n - 1) / chi2.ppf([0.975, 0.025], n - 1))
        return float(u * low), float(u * high)

    @property
    def adds_up(self) -> bool | None:
        """True if the sources, added in quadrature, explain the effect of all together; None if unknown."""
        low, high = self.u_together_interval
        return None if np.isnan(low) else bool(low <= self.u_sum <= high)

    @property
    def counts(self) -> dict[str, int]:
        """Number of realisations by outcome."""
        return dict(Counter(outcome.value for outcome in self.outcomes))

    def share(self, source: Source) -> float:
        """Share of a source in the sum of the squares [-]."""
        return source.u**2 / self.u_sum**2 if self.u_sum > 0.0 else 0.0


FEWEST_SHOTS = 4
"""Smallest number of shots for a slope, as in `kolsky rate`."""
MOST_SHOTS = 1000
"""Shots beyond which no campaign is planned."""


@dataclass(frozen=True)
class Campaign:
    """A planned series of shots."""

    rates: FloatArray
    """Nominal strain rate of each shot [1/s], shape [n]. Half of them are at each end of the range."""
    sigma: float
    """Standard deviation of one shot's stiffness factor about the line [-]."""
    half_width: float
    """Expanded uncertainty U of the slope per decade, 95 % [-]."""

    @property
    def shots(self) -> int:
        """Number of shots."""
        return len(self.rates)


def shot_sigma(budget: Budget, scatter: float) -> float:
    """Standard deviation of one shot about the line [-]. It contains its independent sources and the
    specimens' scatter."""
    own = [source for source in budget.sources if not source.factor.shared]
    unknown = [source.factor.words for source in own if np.isnan(source.u)]
    if unknown:
        raise ValueError(
            f"no uncertainty is known of {', '.join(unknown)}: take smaller standard uncertainties"
        )
    return float(np.sqrt(sum(source.u**2 for source in own) + scatter**2))


def slope_half_width(rates: FloatArray, sigma: float) -> float:
    """Expanded uncertainty of the slope per decade, Eq. (E.11); infinite for fewer than three shots."""
    x = np.log10(rates)
    spread = float(((x - x.mean()) ** 2).sum())
    if len(x) < 3 or spread <= 0.0:
        return float("inf")
    return float(student.ppf(0.975, len(x) - 2) * sigma / np.sqrt(spread))


def plan_campaign(lowest: float, highest: float, wanted: float, sigma: float) -> Campaign:
    """The smallest number of shots, half at each of two rates [1/s], for a wanted U of the slope [-]."""
    if not 0.0 < lowest < highest < np.inf:
        raise ValueError(f"rates must be > 0 and ascend, got {lowest:g} and {highest:g} 1/s")
    if not wanted > 0.0:
        raise ValueError(f"the wanted uncertainty must be > 0, got {wanted:g}")
    for n in range(FEWEST_SHOTS, MOST_SHOTS + 1):
        rates = np.concatenate([np.full(n // 2, lowest), np.full(n - n // 2, highest)])
        half = slope_half_width(rates, sigma)
        if half <= wanted:
            return Campaign(rates, sigma, half)
    raise ValueError(
        f"{MOST_SHOTS} shots do not reach {wanted:g} per decade, but {half:.3g}: widen the rates, or reduce "
        f"the {sigma:.3g} of one shot"
    )


def columns(result: Budget) -> dict[str, list[Any]]:
    """One row per source: standard uncertainty of the source, its effect on the answer, its share."""
    sources = result.sources
    return {
        "source": [source.factor.words for source in sources],
        "key": [source.factor.key for source in sources],
        "standard uncertainty (SI)": [source.factor.sigma for source in sources],
        "slope (SI)": [source.slope for source in sources],
        "bias (SI)": [source.bias for source in sources],
        "u (SI)": [source.u for source in sources],
        "share (1)": [result.share(source) for source in sources],
        "share, 95 % from (1)": [source.share_interval[0] for source in sources],
        "share, 95 % to (1)": [source.share_interval[1] for source in sources],
        "common to all shots (0/1)": [int(source.factor.shared) for source in sources],
        "refused": ["; ".join(source.refused) for source in sources],
    }


def facts(result: Budget, campaign: Campaign | None = None) -> dict[str, Any]:
    """The budget in numbers, SI, with the largest source first."""
    low, high = result.u_together_interval
    ordered = sorted(result.sources, key=lambda source: -np.nan_to_num(source.u))
    planned = {} if campaign is None else {
        "campaign_shots": campaign.shots,
        "campaign_rates": [float(campaign.rates[0]), float(campaign.rates[-1])],
        "campaign_sigma": campaign.sigma,
        "campaign_half_width": campaign.half_width,
    }  # fmt: skip
    return {
        "test": result.name,
        "parameter": result.parameter,
        "truth": result.truth,
        "reference": result.reference,
        "u_sum": result.u_sum,
        "u_together": result.u_together,
        "u_together_low": low,
        "u_together_high": high,
        "sources_add_up": result.adds_up,
        "refused_together": len(result.refused),
        "together": result.together.tolist(),
        "closure": result.closure,
        "realisations": result.counts,
        "searched_whole": result.searched,
        "in_another_valley": result.elsewhere.tolist(),
        "sources": {
            source.factor.key: {
                "sigma": source.factor.sigma,
                "u": source.u,
                "bias": source.bias,
                "slope": source.slope,
                "share": result.share(source),
                "share_interval": list(source.share_interval),
                "refused": len(source.refused),
            }
            for source in ordered
        },
    } | planned
