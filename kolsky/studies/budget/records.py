"""An error budget as records: what each source does alone, and what all of them do together."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from kolsky.base.arrays import FloatArray
from kolsky.studies.budget.factors import Factor
from kolsky.studies.budget.refit import RealisationOutcome
from kolsky.studies.budget.sampling import JointShares

FEWEST = 4
"""Fewest realisations that a standard deviation is taken from."""
NO_INTERVAL = (float("nan"), float("nan"))


@dataclass(frozen=True)
class Source:
    """What one factor alone does to the answer."""

    factor: Factor
    """The factor."""
    bias: float
    """Mean of the answer less that without the error, in the answer's unit; NaN for the noise."""
    u: float
    """Standard uncertainty that it gives the answer, in the answer's unit; NaN if realisations failed."""
    slope: float
    """Change of the answer per unit of the factor's value; NaN for the noise."""
    refused: tuple[str, ...]
    """Why realisations gave no answer, a sentence each."""
    share_interval: tuple[float, float] = NO_INTERVAL
    """95 % interval of its share in the sum of the squares, from the noise's few draws [-]."""
    joint_share: float = float("nan")
    """Its share in the variance of the draws of all errors at once, by a straight line through them [-]."""
    joint_interval: tuple[float, float] = NO_INTERVAL
    """95 % interval of that, by bootstrap [-]."""


@dataclass(frozen=True)
class Budget:
    """What each source of error does to one parameter, alone and together with the others."""

    name: str
    """Of the test."""
    parameter: str
    """The parameter."""
    truth: float
    """Its true value; NaN if it is none of a specification's."""
    reference: float
    """Its estimate without errors, with the instruments' noise of the first draw."""
    sources: tuple[Source, ...]
    """Each factor alone."""
    together: FloatArray
    """Estimates with all errors at once, shape [n]; those that gave an answer, each in the valley of the
    reference."""
    refused: tuple[str, ...]
    """Why realisations with all errors at once gave no answer."""
    elsewhere: FloatArray = field(default_factory=lambda: np.zeros(0))
    """What the whole search says of draws that it takes to another valley, shape [n_jumps]."""
    searched: int = 0
    """Draws of all errors at once that were searched whole, with an answer."""
    outcomes: tuple[RealisationOutcome, ...] = ()
    """How every realisation ended, the first of them that without errors."""
    closure: float = float("nan")
    """Re-fit less whole search of the test without errors: how alike both find one optimum."""
    joint: JointShares | None = None
    """The straight line through the draws of all errors at once; None if they are too few."""

    @property
    def u_sum(self) -> float:
        """Root of the sum of the squares of the sources: Eq. (E.10)."""
        return float(np.sqrt(np.nansum([source.u**2 for source in self.sources])))

    @property
    def u_together(self) -> float:
        """Standard deviation with all errors at once; NaN below `FEWEST` answers."""
        return float(self.together.std(ddof=1)) if len(self.together) >= FEWEST else float("nan")

    @property
    def u_together_interval(self) -> tuple[float, float]:
        """95 % interval of that standard deviation, as of normal values; NaN below `FEWEST` answers."""
        n, u = len(self.together), self.u_together
        if n < FEWEST:
            return NO_INTERVAL
        low, high = np.sqrt((n - 1) / chi2.ppf([0.975, 0.025], n - 1))
        return float(u * low), float(u * high)

    @property
    def adds_up(self) -> bool | None:
        """Whether the sources, added in quadrature, explain what all together do; None if nobody knows."""
        low, high = self.u_together_interval
        return None if np.isnan(low) else bool(low <= self.u_sum <= high)

    @property
    def jumps(self) -> float:
        """Share of the draws of all errors at once whose whole search ends in another valley [-]; NaN if none
        was searched."""
        return len(self.elsewhere) / self.searched if self.searched else float("nan")

    @property
    def counts(self) -> dict[str, int]:
        """How many realisations ended how."""
        return dict(Counter(outcome.value for outcome in self.outcomes))

    def share(self, source: Source) -> float:
        """Share of a source in the sum of the squares [-]."""
        return source.u**2 / self.u_sum**2 if self.u_sum > 0.0 else 0.0
