"""Slope of the stiffness over the rate, with the conditions that the shots' rates must meet."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray
from kolsky.studies.rates.mixed import MixedFit, mixed_fit

FEWEST = 4
"""Fewest shots of a slope: two coefficients, and two degrees of freedom for the scatter."""
LEAST_SPAN = 0.5
"""Least span of the shots' rates [decade]: "per decade" then extrapolates at most twofold."""
LEAST_RATIO = 4.0
"""Least span over the rate's spread inside one test: the k = 2 ranges of the slowest and the fastest part."""
LARGEST_LEVERAGE = 0.9
"""Largest leverage of one shot: nine tenths of its error go into the line, one tenth shows beside it."""
LARGEST_HALF_WIDTH = 1.0
"""Largest half width of the slope's interval per decade, over the mean stiffness."""


class SlopeVerdict(StrEnum):
    """The verdict on a slope."""

    REFUSED = "no slope: the rates do not carry one"
    NONE_SEEN = "no rate sensitivity seen; the interval bounds it"
    SENSITIVE = "rate sensitive over the rates tested"


@dataclass(frozen=True)
class Criterion:
    """One condition of a slope."""

    name: str
    """What is asked."""
    value: float
    """What the shots have; infinite where nothing limits it."""
    limit: float
    """What is needed."""
    unit: str
    """Unit of both, "1" if none."""
    at_least: bool
    """Whether the value must reach the limit; else it must not exceed it."""
    why: str
    """What goes wrong otherwise."""

    @property
    def met(self) -> bool:
        """True if the condition holds."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit


@dataclass(frozen=True)
class Slope:
    """Stiffness factor against the decimal logarithm of the rate, Eq. (S.8)."""

    fit: MixedFit | None
    """Coefficients: stiffness factor at the reference rate, and slope per decade; None if no line has a
    scatter about it: fewer than three shots, or one rate."""
    reference: float
    """Geometric mean of the shots' rates [1/s]."""
    span: float
    """Decades between the slowest and the fastest shot."""
    criteria: tuple[Criterion, ...]
    """Every condition, in order."""
    leave_one_out: tuple[MixedFit | None, ...]
    """The line without each shot in turn."""

    @property
    def verdict(self) -> SlopeVerdict:
        """The verdict on the slope."""
        if self.fit is None or not all(c.met for c in self.criteria):
            return SlopeVerdict.REFUSED
        low, high = self.fit.interval(1)
        return SlopeVerdict.NONE_SEEN if low <= 0.0 <= high else SlopeVerdict.SENSITIVE

    def band(self, log_rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The 95 % band of the line, pointwise, at decimal logarithms of rates: low and high, shape [k] both.

        Raises
        ------
        ValueError
            If there is no line.
        """
        if self.fit is None:
            raise ValueError("there is no line through fewer than three shots, or through one rate")
        columns = np.column_stack([np.ones(np.size(log_rates)), log_rates - np.log10(self.reference)])
        own = np.einsum("ip,pq,iq->i", columns, self.fit.covariance * max(1.0, self.fit.scale), columns)
        both = own + np.einsum("ip,pq,iq->i", columns, self.fit.common, columns)
        half = student.ppf(0.975, self.fit.freedom * (both / own) ** 2) * np.sqrt(both)
        middle = columns @ self.fit.coefficients
        return middle - half, middle + half

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why a slope is refused, one sentence each."""
        return tuple(c.why for c in self.criteria if not c.met)


def slope(
    rates: FloatArray,
    spreads: FloatArray,
    values: FloatArray,
    sigma: FloatArray,
    *,
    common: FloatArray | None = None,
) -> Slope:
    """Meta-regression on log10 rate, with the conditions that a claim must meet.

    Parameters
    ----------
    rates
        Nominal strain rate of each shot [1/s], shape [n].
    spreads
        Standard uncertainty of log10 rate as the rate of a whole test: its spread inside the test, and the
        noise of its mean [decade], shape [n].
    values, sigma, common
        As in `kolsky.studies.rates.pooled.pool`.

    Raises
    ------
    ValueError
        If a rate is not positive, or a number cannot be used.
    """
    v, spread, y, s = (np.asarray(a, dtype=float) for a in (rates, spreads, values, sigma))
    if v.size == 0 or not ((v > 0.0) & np.isfinite(v)).all():
        raise ValueError("every strain rate must be finite and > 0 1/s, and there must be one")
    shared = np.zeros((0, y.size)) if common is None else np.asarray(common, dtype=float)
    x = np.log10(v) - np.log10(v).mean()
    span = float(x.max() - x.min())
    fit = _line(x, y, s, shared)
    without = []
    for i in range(y.size):
        kept = np.arange(y.size) != i
        without.append(_line(x[kept], y[kept], s[kept], shared[:, kept]))
    return Slope(
        fit=fit,
        reference=float(10.0 ** np.log10(v).mean()),
        span=span,
        criteria=_criteria(fit, span, float(np.sqrt(np.mean(spread**2))), y),
        leave_one_out=tuple(without),
    )


def _line(x: FloatArray, y: FloatArray, s: FloatArray, shared: FloatArray) -> MixedFit | None:
    if y.size < 3 or float(np.ptp(x)) < 1e-9:
        return None
    return mixed_fit(y, s, np.column_stack([np.ones(y.size), x]), common=shared)


def _criteria(fit: MixedFit | None, span: float, spread: float, y: FloatArray) -> tuple[Criterion, ...]:
    ratio = span / spread if spread > 0.0 else np.inf
    found = [
        Criterion(
            "shots", float(y.size), float(FEWEST), "1", True, f"there are {y.size} shots, {FEWEST} needed"
        ),
        Criterion(
            "span of the rates",
            span,
            LEAST_SPAN,
            "decade",
            True,
            f"the shots' rates span {span:.2f} decade, {LEAST_SPAN:g} are needed: a slope per decade would"
            " extrapolate them more than twofold",
        ),
        Criterion(
            "span over the spread of the rate inside a test",
            ratio,
            LEAST_RATIO,
            "1",
            True,
            f"the span is {ratio:.1f} times the {spread:.2f} decade by which the rate spreads inside a test,"
            f" {LEAST_RATIO:g} times are needed: the shots are not tests at different rates",
        ),
    ]
    if fit is None:
        return tuple(found)
    low, high = fit.interval(1)
    width = 0.5 * (high - low) / abs(float(y.mean()))
    leverage = float(fit.leverage.max())
    return (
        *found,
        Criterion(
            "largest leverage of one shot",
            leverage,
            LARGEST_LEVERAGE,
            "1",
            False,
            f"one shot has a leverage of {leverage:.2f}, at most {LARGEST_LEVERAGE:g} is allowed: its error"
            " would go into the line and not show beside it: repeat the test at that rate",
        ),
        Criterion(
            "half width of the slope's interval over the mean",
            width,
            LARGEST_HALF_WIDTH,
            "1/decade",
            False,
            f"the scatter leaves the slope uncertain by {100.0 * width:.0f} % of the stiffness per decade, at"
            f" most {100.0 * LARGEST_HALF_WIDTH:.0f} % is allowed: nothing would be excluded",
        ),
    )
