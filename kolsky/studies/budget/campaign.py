"""Planning of a campaign: how many shots, at which rates, for a wanted uncertainty of the rate slope.

The stiffness factor of n shots is fitted by a straight line over the decimal logarithm of the strain rate.
Errors that are the same in all shots move the line as a whole and leave its slope; those of each shot alone
scatter about it, together with what differs from specimen to specimen. With standard deviation s of one shot,

    u(slope) = s / sqrt(sum_i (x_i - mean x)^2),   U = t_0.975(n - 2) u(slope).                      (E.11)
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray
from kolsky.studies.budget.records import Budget

FEWEST_SHOTS = 4
"""Fewest shots of a slope, as `kolsky rate` asks for."""
MOST_SHOTS = 1000
"""Shots beyond which no campaign is planned."""
Layout = Literal["ends", "even"]


@dataclass(frozen=True)
class Campaign:
    """A planned series of shots."""

    rates: FloatArray
    """Nominal strain rate of each shot [1/s], ascending, shape [n]."""
    layout: Layout
    """Half of the shots at either end of the range, or evenly spread in the logarithm."""
    sigma: float
    """Standard deviation of one shot's stiffness factor about the line [-]."""
    half_width: float
    """Expanded uncertainty U of the slope per decade, 95 % [-]."""

    @property
    def shots(self) -> int:
        """Number of shots."""
        return len(self.rates)


def shot_sigma(budget: Budget, scatter: float) -> float:
    """Standard deviation of one shot about the line: its own sources, and the specimens' scatter [-].

    Raises
    ------
    ValueError
        If a source of each shot alone has no uncertainty, since its realisations failed.
    """
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


def plan_campaign(
    lowest: float, highest: float, wanted: float, sigma: float, *, layout: Layout = "ends"
) -> Campaign:
    """The fewest shots between two rates whose slope is known to a wanted expanded uncertainty.

    Parameters
    ----------
    lowest, highest
        Nominal strain rates [1/s].
    wanted
        Expanded uncertainty of the slope per decade, 95 % [-].
    sigma
        As `shot_sigma` gives it [-].
    layout
        Where the shots are.

    Raises
    ------
    ValueError
        If the rates or the wanted uncertainty cannot be, or more than `MOST_SHOTS` would be needed.
    """
    if not 0.0 < lowest < highest < np.inf:
        raise ValueError(f"rates must be > 0 and ascend, got {lowest:g} and {highest:g} 1/s")
    if not wanted > 0.0:
        raise ValueError(f"the wanted uncertainty must be > 0, got {wanted:g}")
    for n in range(FEWEST_SHOTS, MOST_SHOTS + 1):
        rates = _rates(lowest, highest, n, layout)
        half = slope_half_width(rates, sigma)
        if half <= wanted:
            return Campaign(rates, layout, sigma, half)
    raise ValueError(
        f"{MOST_SHOTS} shots do not reach {wanted:g} per decade, but {half:.3g}: widen the rates, or reduce "
        f"the {sigma:.3g} of one shot"
    )


def _rates(lowest: float, highest: float, n: int, layout: Layout) -> FloatArray:
    if layout == "even":
        return np.asarray(np.geomspace(lowest, highest, n))
    return np.concatenate([np.full(n // 2, lowest), np.full(n - n // 2, highest)])
