"""Mean and rate slope of several values with known uncertainties and an unknown scatter between them.

The model is y_i = x_i . b + t_i + e_i, Eq. (S.2). Here e_i has the known standard uncertainty s_i, and t_i ~
(0, tau^2). A slope needs a minimum number of shots and a minimum span of their rates. No single shot may have
a large leverage.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, chdtri, ndtr, stdtrit

from kolsky.base.arrays import FloatArray

POWER = 0.9
"""Probability of detecting a slope of the size `MixedFit.noticeable`."""
QUANTILES = 400
"""Number of quantiles of an estimated uncertainty. The power is then accurate to 0.001."""
MOST_FREEDOM = 1e4
"""Above this number of degrees of freedom, Student's t is normal to four digits of its quantiles."""


@dataclass(frozen=True)
class MixedFit:
    """A weighted least-squares fit with weights that include the scatter between the values."""

    coefficients: FloatArray
    """b, in the unit of the values over that of the column, shape [p]."""
    gain: FloatArray
    """Derivative of each coefficient by each value, shape [p, n]."""
    covariance: FloatArray
    """(X' W X)^-1 with W = 1 / (s^2 + tau^2), shape [p, p]."""
    common: FloatArray
    """Covariance of the coefficients from shared errors, shape [p, p]."""
    between: float
    """tau, the standard deviation between the values beyond their own uncertainties, in their unit."""
    q: float
    """Cochran's Q: residual sum of squares in units of s, without tau [-]."""
    freedom: int
    scale: float
    """Knapp and Hartung's factor on the covariance, Eq. (S.5) [-]."""
    leverage: FloatArray
    """Diagonal of the hat matrix, shape [n]. It is the influence of a value on its own fitted value, from 0
    to 1."""

    @property
    def i_squared(self) -> float:
        """I^2 = (Q - f) / Q, not below zero: the share of the scatter that s does not explain [-]."""
        return max(0.0, (self.q - self.freedom) / self.q) if self.q > 0.0 else 0.0

    def sigma(self, index: int) -> float:
        """Standard uncertainty of a coefficient with shared errors."""
        return float(np.sqrt(self._own(index) + self.common[index, index]))

    def effective_freedom(self, index: int) -> float:
        """Degrees of freedom by Welch and Satterthwaite. The shared variance is taken as exactly known."""
        own = self._own(index)
        return float(self.freedom * ((own + self.common[index, index]) / own) ** 2)

    def interval(self, index: int, probability: float = 0.95) -> tuple[float, float]:
        """Interval of a coefficient by Student's t with Knapp and Hartung's variance, Eq. (S.6)."""
        half = float(stdtrit(self.effective_freedom(index), 0.5 + 0.5 * probability)) * self.sigma(index)
        return float(self.coefficients[index] - half), float(self.coefficients[index] + half)

    def noticeable(self, index: int) -> float:
        """Size of a coefficient that its interval distinguishes from 0 with probability `POWER`, Eq. (S.10).

        The estimate divided by its standard uncertainty has a noncentral t distribution. It is the mean of
        two normal probabilities over the estimated uncertainty. Quantiles represent the distribution of this
        uncertainty.
        """
        freedom = min(self.effective_freedom(index), MOST_FREEDOM)
        limit = float(stdtrit(freedom, 0.975))
        levels = (np.arange(QUANTILES) + 0.5) / QUANTILES
        ends = limit * np.sqrt(chdtri(freedom, 1.0 - levels) / freedom)

        def excess(size: float) -> float:
            return float(np.mean(ndtr(size - ends) + ndtr(-size - ends))) - POWER

        return float(brentq(excess, 0.0, 4.0 * (1.0 + limit))) * self.sigma(index)

    def _own(self, index: int) -> float:
        # A factor below 1 would narrow the interval because of accidental agreement.
        return float(self.covariance[index, index] * max(1.0, self.scale))


def mixed_fit(
    values: FloatArray, sigma: FloatArray, columns: FloatArray, *, common: FloatArray | None = None
) -> MixedFit:
    """Fit y = X b, and estimate the scatter between the values."""
    y, s, X = (np.asarray(a, dtype=float) for a in (values, sigma, columns))
    shared = np.zeros((0, y.size)) if common is None else np.asarray(common, dtype=float)
    if X.ndim != 2 or y.shape != s.shape or y.shape != X.shape[:1] or shared.shape[1:] != y.shape:
        raise ValueError(f"got {y.shape} values, {s.shape} sigmas, {X.shape} columns, {shared.shape} shared")
    if not all(np.isfinite(a).all() for a in (y, s, X, shared)):
        raise ValueError("every value, sigma and column must be finite")
    if not (s > 0.0).all():
        raise ValueError(f"every sigma must be > 0, the smallest is {s.min():.3g}")
    n, p = X.shape
    if n <= p:
        raise ValueError(f"{p} coefficients with a scatter need at least {p + 1} values, got {n}")
    if np.linalg.matrix_rank(X) < p:
        raise ValueError(f"the {p} columns do not determine {p} coefficients: two of them go together")
    variance = _between(y, s, X)
    b, gain, covariance = _least_squares(y, s**2 + variance, X)
    return MixedFit(
        coefficients=b, gain=gain, covariance=covariance, common=gain @ shared.T @ shared @ gain.T,
        between=float(np.sqrt(variance)), q=_generalised_q(y, s**2, X), freedom=n - p,
        scale=_generalised_q(y, s**2 + variance, X) / (n - p), leverage=np.einsum("ip,pi->i", X, gain),
    )  # fmt: skip


def _least_squares(
    y: FloatArray, variance: FloatArray, X: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted least squares: coefficients, gain and covariance."""
    covariance = np.linalg.inv(X.T @ (X / variance[:, None]))
    gain = covariance @ (X.T / variance)
    return np.asarray(gain @ y), np.asarray(gain), np.asarray(covariance, dtype=np.float64)


def _generalised_q(y: FloatArray, variance: FloatArray, X: FloatArray) -> float:
    residual = y - X @ _least_squares(y, variance, X)[0]
    return float(np.sum(residual**2 / variance))


def _between(y: FloatArray, s: FloatArray, X: FloatArray) -> float:
    """tau^2 of Paule and Mandel, not below zero: Q at the final weights is its expected value, Eq. (S.4)."""

    def excess(variance: float) -> float:
        return _generalised_q(y, s**2 + variance, X) - (X.shape[0] - X.shape[1])

    if excess(0.0) <= 0.0:
        return 0.0
    upper = float(np.var(y) + (s**2).max())
    while excess(upper) > 0.0:
        upper *= 4.0
    return float(brentq(excess, 0.0, upper, xtol=1e-14 * upper, rtol=1e-13))


FEWEST_POOLED = 2


@dataclass(frozen=True)
class Pooled:
    """The mean of some shots."""

    fit: MixedFit
    """The fit with Paule and Mandel's scatter."""
    scatter: float
    """Experimental standard deviation s of the shots, n - 1."""
    leave_one_out: tuple[MixedFit | None, ...]
    """The fit without each shot in turn. None if fewer than two would remain."""

    @property
    def mean(self) -> float:
        """The random-effects mean."""
        return float(self.fit.coefficients[0])

    @property
    def sigma(self) -> float:
        """Its standard uncertainty, shared errors included."""
        return self.fit.sigma(0)

    @property
    def sigma_common(self) -> float:
        """The part from shared errors. More shots do not reduce it."""
        return float(np.sqrt(self.fit.common[0, 0]))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the mean, Eq. (S.6)."""
        return self.fit.interval(0)

    @property
    def probability(self) -> float:
        """Probability of at least this Q if the shots differ only by their independent uncertainties."""
        return float(chdtrc(self.fit.freedom, self.fit.q))

    @property
    def prediction(self) -> tuple[float, float]:
        """The 95 % prediction interval of one more shot, Eq. (S.7). It is wider than that of the mean."""
        half = float(stdtrit(self.fit.freedom, 0.975)) * float(np.hypot(self.fit.between, self.sigma))
        return self.mean - half, self.mean + half


def pool(values: FloatArray, sigma: FloatArray, *, common: FloatArray | None = None) -> Pooled:
    """Mean of n shots with their scatter, from estimates and their independent standard uncertainties, [n].

    ``common``: shared errors, see `mixed_fit`, shape [n_shared, n]. Raises ValueError if there are fewer than
    two estimates, or if a number cannot be used.
    """
    y, s = np.asarray(values, dtype=float), np.asarray(sigma, dtype=float)
    if y.size < FEWEST_POOLED:
        raise ValueError(f"a scatter between shots needs at least {FEWEST_POOLED} of them, got {y.size}")
    shared = np.zeros((0, y.size)) if common is None else np.asarray(common, dtype=float)
    ones = np.ones((y.size, 1))
    without: list[MixedFit | None] = []
    for i in range(y.size):
        kept = np.arange(y.size) != i
        enough = int(kept.sum()) >= FEWEST_POOLED
        without.append(mixed_fit(y[kept], s[kept], ones[kept], common=shared[:, kept]) if enough else None)
    return Pooled(
        fit=mixed_fit(y, s, ones, common=shared), scatter=float(y.std(ddof=1)), leave_one_out=tuple(without)
    )


FEWEST_FOR_SLOPE = 4
"""Smallest number of shots for a slope: two coefficients, and two degrees of freedom for the scatter."""
LEAST_SPAN = 0.5
"""Smallest span of the shots' rates [decade]. The slope per decade is then extrapolated at most twofold."""
LEAST_RATIO = 4.0
"""Smallest span divided by the spread of the rate inside one test. It covers the k = 2 ranges of the slowest
and the fastest part."""
LARGEST_LEVERAGE = 0.9
"""Largest leverage of one shot. Nine tenths of its error then affect the line, one tenth the residual."""
LARGEST_HALF_WIDTH = 1.0
"""Largest half width of the slope's interval per decade, divided by the mean stiffness."""
TREND_SHARE = 0.5
"""Share of the variance of a shot's mesh error that is proportional to the logarithm of its rate. The error
is a smooth function of the rate: a constant, which all shots have, and a trend. Simulations of one test do
not separate the two. Each therefore has half."""


class SlopeVerdict(StrEnum):
    """The verdict on a slope."""

    REFUSED = "not testable"
    NONE_SEEN = "no rate sensitivity"
    SENSITIVE = "rate sensitive"


@dataclass(frozen=True)
class Criterion:
    """One condition of a slope."""

    name: str
    value: float
    """Value of the shots; infinite without a limit."""
    limit: float
    unit: str
    """Unit of both, "1" if none."""
    at_least: bool
    """True if the value must reach the limit; otherwise it must not exceed it."""
    why: str
    """Consequence if it is not met."""

    @property
    def met(self) -> bool:
        """True if the condition holds."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit


@dataclass(frozen=True)
class Slope:
    """Stiffness factor against the decimal logarithm of the rate, Eq. (S.8)."""

    fit: MixedFit | None
    """Coefficients: stiffness factor at the reference rate, and slope per decade. None if a scatter about the
    line is not defined, with fewer than three shots or one rate."""
    reference: float
    """Geometric mean of the shots' rates [1/s]."""
    span: float
    """Decades between the rates of the slowest and the fastest shot."""
    criteria: tuple[Criterion, ...]
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
        """The pointwise 95 % band of the line at decimal logarithms of rates: low and high, shape [k] both.

        Raises ValueError if there is no line.
        """
        if self.fit is None:
            raise ValueError("there is no line through fewer than three shots, or through one rate")
        columns = np.column_stack([np.ones(np.size(log_rates)), log_rates - np.log10(self.reference)])
        own = np.einsum("ip,pq,iq->i", columns, self.fit.covariance * max(1.0, self.fit.scale), columns)
        both = own + np.einsum("ip,pq,iq->i", columns, self.fit.common, columns)
        half = stdtrit(self.fit.freedom * (both / own) ** 2, 0.975) * np.sqrt(both)
        middle = columns @ self.fit.coefficients
        return middle - half, middle + half

    @property
    def sentence(self) -> str:
        """The verdict in words, with the slope or its bound, and the smallest detectable slope."""
        if self.fit is None or self.verdict is SlopeVerdict.REFUSED:
            return f"{SlopeVerdict.REFUSED}: {'; '.join(self.reasons)}"
        low, high = self.fit.interval(1)
        found = (
            f"{self.verdict.value}: {self.fit.coefficients[1]:+.2g} per decade, 95 % {low:.2g} to {high:.2g}"
        )
        if self.verdict is SlopeVerdict.NONE_SEEN:
            found = f"{self.verdict.value} beyond ± {max(-low, high):.2g} per decade"
        return f"{found}; a slope above {self.fit.noticeable(1):.2g} per decade would be detected"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why a slope is rejected, one sentence each."""
        return tuple(c.why for c in self.criteria if not c.met)


def rate_trend(part: FloatArray, rates: FloatArray) -> FloatArray:
    """The part of an error proportional to the logarithm of the rate [1/s], shape [n].

    ``part``: error of each value if it is completely common. The trend has a root mean square of one.
    """
    x = np.log10(rates) - np.log10(rates).mean()
    size = float(np.sqrt(np.mean(x**2)))
    return part * (x / size) if size > 0.0 else np.zeros_like(part)


def slope(
    rates: FloatArray,
    spreads: FloatArray,
    values: FloatArray,
    sigma: FloatArray,
    *,
    common: FloatArray | None = None,
) -> Slope:
    """Meta-regression on log10 rate, with the conditions for a reported slope.

    ``rates``: nominal strain rate of each shot [1/s], shape [n]. ``spreads``: standard uncertainty of log10
    rate of a test [decade], shape [n]. It contains the spread of the rate inside the test and the noise of
    its mean. ``values``, ``sigma``, ``common``: as in `pool`. Raises ValueError if a rate is not positive, or
    if a number cannot be used.
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
        Criterion("shots", float(y.size), float(FEWEST_FOR_SLOPE), "1", True,
                  f"there are {y.size} shots, {FEWEST_FOR_SLOPE} needed"),
        Criterion("span of the rates", span, LEAST_SPAN, "decade", True,
                  f"the shots' rates span {span:.2f} decade, {LEAST_SPAN:g} are needed: a slope per decade "
                  "would extrapolate them more than twofold"),
        Criterion("span over the spread of the rate inside a test", ratio, LEAST_RATIO, "1", True,
                  f"the span is {ratio:.1f} times the {spread:.2f} decade by which the rate spreads inside a "
                  f"test, {LEAST_RATIO:g} times are needed: the shots are not tests at different rates"),
    ]  # fmt: skip
    if fit is None:
        return tuple(found)
    low, high = fit.interval(1)
    width = 0.5 * (high - low) / abs(float(y.mean()))
    leverage = float(fit.leverage.max())
    found += [
        Criterion("largest leverage of one shot", leverage, LARGEST_LEVERAGE, "1", False,
                  f"one shot has a leverage of {leverage:.2f}, at most {LARGEST_LEVERAGE:g} is allowed: its "
                  "error would change the line without a visible residual: repeat the test at that rate"),
        Criterion("half width of the slope's interval over the mean", width, LARGEST_HALF_WIDTH, "1/decade",
                  False, f"the scatter leaves the slope uncertain by {100.0 * width:.0f} % of the stiffness "
                  f"per decade, at most {100.0 * LARGEST_HALF_WIDTH:.0f} % is allowed: nothing would be "
                  "excluded"),
    ]  # fmt: skip
    return tuple(found)
