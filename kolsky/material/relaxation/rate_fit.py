"""Prony series fitted to relaxation, oscillation, rates and shots together, and the branches they need.

Apparent moduli put all these tests on one axis of time. The apparent modulus is that of rubber elasticity,
E_a = 3 P / (lam - lam^-2) with the nominal stress P, Eq. (M.9). For a neo-Hookean solid it does not depend on
strain (Fig. 11 of Mates et al. 2012). The time is the mean age of the strain,

    age(t) = (1 / ln lam(t)) int_0^t (t - s) d ln lam(s),                                              (V.4)

It is the time of holding after a step, and half of the duration of a steady ramp. The time of an oscillation
is 1 / omega: E'(omega) and E(1 / omega) differ by less than the loss modulus.

An evidence has measured values with their uncertainty. It predicts them for any number of rate models in one
call. A fit therefore does not depend on the kind of test.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.special import chdtrc

from dic.basics import check_interval
from explicit.relaxation import PronySeries, prony_stress
from explicit.relaxation.prony import checked_history
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class RateModel:
    """The long-term law times a factor, with viscoelastic branches in parallel."""

    factor: float
    """Factor on the long-term law [-]. It is the m of a shot."""
    series: PronySeries


@dataclass(frozen=True)
class ScaledLaw:
    """An `explicit.materials.MaterialLaw` times a factor, for a homogeneous test."""

    law: Any
    factor: float

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """Isochoric Kirchhoff stress of the law [Pa]."""
        return np.asarray(self.factor * self.law.stress(b_bar))


class Evidence(Protocol):
    """Measured values, and their prediction by a model."""

    @property
    def label(self) -> str:
        """Name for tables."""

    @property
    def values(self) -> FloatArray:
        """Measured values, shape [n]."""

    @property
    def sigma(self) -> FloatArray:
        """Its standard uncertainty, same unit and shape, > 0."""

    @property
    def time_scales(self) -> tuple[float, float]:
        """The shortest and the longest relaxation time that the test can resolve [s]."""

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """The predicted values of each model, shape [n_models, n]."""


@dataclass(frozen=True)
class HistoryTest:
    """A homogeneous uniaxial test with any history: relaxation, creep-free ramps at several rates, cycles."""

    time: FloatArray
    """Times, not descending [s], shape [n]. The specimen is at rest before the first time."""
    stretch: FloatArray
    """Stretch [-], shape [n]."""
    stress: FloatArray
    """Nominal stress, tension-positive [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty [Pa], shape [n]. It is infinite for samples that only define the history."""
    label: str = "history"

    def __post_init__(self) -> None:
        checked_history(self.time, self.stretch)
        _checked("stress", self.stress, self.sigma, len(self.time))

    @property
    def values(self) -> FloatArray:
        """Nominal stress [Pa], shape [n]."""
        return self.stress

    @property
    def time_scales(self) -> tuple[float, float]:
        """The shortest interval between two samples and the whole duration [s]."""
        steps = np.diff(self.time)
        return float(steps[steps > 0.0].min()), float(np.ptp(self.time))

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """Nominal stress of each model [Pa], shape [n_models, n]."""
        return np.stack([m.factor * prony_stress(law, m.series, self.time, self.stretch) for m in models])

    @classmethod
    def relaxation(
        cls, time: ArrayLike, stress: ArrayLike, sigma: ArrayLike, *, stretch: float, rise: float = 0.0
    ) -> "HistoryTest":
        """A stretch that is reached within `rise` [s] at a constant rate and then held.

        ``time``: times after the beginning of the rise, ascending, all >= `rise` [s]. ``stress``, ``sigma``:
        nominal stress and its standard uncertainty [Pa]. Raises ValueError if a time lies within the rise.
        """
        t = np.asarray(time, dtype=float)
        if not rise >= 0.0 or not (t >= rise).all():
            raise ValueError(f"times must be >= the rise, {rise:g} s, got {t.min():g} s")
        n_rise = 2 if rise == 0.0 else 65
        before = np.linspace(0.0, rise, n_rise)
        stretches = np.concatenate([np.linspace(1.0, stretch, n_rise), np.full(len(t), stretch)])
        values = np.broadcast_to(np.asarray(stress, dtype=float), t.shape)
        spread = np.broadcast_to(np.asarray(sigma, dtype=float), t.shape)
        return cls(
            time=np.concatenate([before, t]),
            stretch=stretches,
            stress=np.concatenate([np.zeros(n_rise), values]),
            sigma=np.concatenate([np.full(n_rise, np.inf), spread]),
            label=f"relaxation at stretch {stretch:g}",
        )


@dataclass(frozen=True)
class DynamicTest:
    """Small oscillations about the undeformed state: storage and loss modulus in tension (DMA)."""

    angular_frequency: FloatArray
    """omega [rad/s], shape [n]."""
    storage: FloatArray
    """Young's storage modulus E' [Pa], shape [n]."""
    loss: FloatArray
    """Young's loss modulus E'' [Pa], shape [n]."""
    sigma_storage: FloatArray
    """Standard uncertainty of E' [Pa], shape [n]."""
    sigma_loss: FloatArray
    """Standard uncertainty of E'' [Pa], shape [n]."""
    label: str = "oscillation"

    def __post_init__(self) -> None:
        n = len(self.angular_frequency)
        if not (np.isfinite(self.angular_frequency) & (self.angular_frequency > 0.0)).all():
            raise ValueError(f"angular_frequency must be > 0 rad/s, got {np.min(self.angular_frequency)}")
        _checked("storage", self.storage, self.sigma_storage, n)
        check_interval("(0, inf) Pa", storage=self.storage)
        _checked("loss", self.loss, self.sigma_loss, n)

    @property
    def values(self) -> FloatArray:
        """E', then E'' [Pa], shape [2 n]."""
        return np.concatenate([self.storage, self.loss])

    @property
    def sigma(self) -> FloatArray:
        """Their standard uncertainties [Pa], shape [2 n]."""
        return np.concatenate([self.sigma_storage, self.sigma_loss])

    @property
    def time_scales(self) -> tuple[float, float]:
        """1 / omega of the fastest and of the slowest oscillation [s]."""
        return float(1.0 / self.angular_frequency.max()), float(1.0 / self.angular_frequency.min())

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """E' and E'' of each model [Pa], shape [n_models, 2 n]."""
        young, omega = 3.0 * float(law.initial_shear_modulus), self.angular_frequency
        rows = (np.concatenate([m.series.storage(omega), m.series.loss(omega)]) for m in models)
        return np.stack([m.factor * young * row for m, row in zip(models, rows, strict=True)])


def _checked(name: str, values: FloatArray, sigma: FloatArray, n: int) -> None:
    shapes = np.shape(values), np.shape(sigma)
    if shapes != ((n,), (n,)):
        raise ValueError(f"{name} and its sigma need {n} values, one per sample, got {shapes}")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} must be finite, got {values[~np.isfinite(values)][0]}")
    if not (np.asarray(sigma) > 0.0).all():
        raise ValueError(f"sigma of {name} must be > 0, got {np.min(sigma)}")
    if not np.isfinite(sigma).any():
        raise ValueError(f"sigma of {name} is infinite everywhere: nothing was measured")


SIGNIFICANT = 0.01
"""Probability of chance below which the improvement by a branch is significant."""


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
    """Covariance of their logarithms [-], shape [n_parameters] * 2. It is already widened by `scatter`."""
    chi_square: float
    """Weighted sum of squared residuals [-]."""
    n_data: int
    """Values with a finite sigma."""
    residuals: tuple[FloatArray, ...]
    """(predicted - measured) / sigma of each evidence [-]."""
    at_bound: tuple[str, ...]
    """Parameters at a bound of their range: the evidence does not determine them."""

    @property
    def scatter(self) -> float:
        """max(1, chi_square / degrees of freedom) [-]. It is the factor on the covariance (Birge)."""
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

    def interval(self, name: str) -> tuple[float, float]:
        """Interval of a parameter, k = 2, from the covariance of the logarithms.

        Raises ValueError if the fit has no such parameter.
        """
        if name not in self.names:
            raise ValueError(f"parameter must be one of {', '.join(self.names)}, got {name!r}")
        k = self.names.index(name)
        spread = float(np.exp(2.0 * np.sqrt(self.covariance[k, k])))
        return float(self.values[k] / spread), float(self.values[k] * spread)


@dataclass(frozen=True)
class RateVerdict:
    """Number of branches that the evidence requires."""

    fits: tuple[RateFit, ...]
    """The fits with 0, 1, 2, ... branches."""
    probabilities: tuple[float, ...]
    """For each further branch: probability that noise improves chi-square by at least as much [-]. A branch
    has two parameters, and its time has no effect without strength. Chi-square with two degrees of freedom is
    therefore used. Improvements are divided by the scatter of the fit with the most branches."""

    @property
    def branches(self) -> int:
        """Number of successive branches that are required: each significant, with a lower AIC, and with no
        parameter at a bound.
        """
        count = 0
        for k, probability in enumerate(self.probabilities, start=1):
            fit, before = self.fits[k], self.fits[k - 1]
            if probability >= SIGNIFICANT or fit.aic >= before.aic or fit.at_bound:
                break
            count = k
        return count

    @property
    def fit(self) -> RateFit:
        """The fit with the required number of branches."""
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
            return f"the data do not need rate dependence ({why}, AIC {fit.aic - self.fits[0].aic:+.1f})"
        p, gain = self.probabilities[k - 1], self.fits[k].aic - self.fits[k - 1].aic
        return f"the data require {k} branch{'es' if k > 1 else ''} ({_chance(p)}, AIC {gain:+.1f})"


def _chance(probability: float) -> str:
    return "p < 1e-99" if probability < 1e-99 else f"p = {probability:.2g}"


STRENGTHS = (1e-4, 1e3)
"""Allowed strengths of a branch [-]. Below the lower limit, no evidence distinguishes a strength from
zero."""
FACTORS = (1e-3, 1e3)
"""Allowed factors on the long-term law [-]."""
TIME_SCALE_MARGIN = 10.0
"""Factor by which a relaxation time may lie outside the time scales of the evidence [-]."""
_FACTOR_GRID = (0.4, 2.5, 32)
"""Grid of factors at the start of a search without branches: first, last and number."""
GRID = (0.1, 0.5, 2.0)
"""Grid of strengths in the search for a further branch [-]."""
_GRID_TIMES = 7
"""Number of relaxation times in that search."""
REFUSED = 1e6
"""Residual of every value of a model that cannot be simulated [-]."""
DIFFERENCE = 1e-2
"""Half the step of the central difference in a logarithm. Its error is of the order of the square, 1e-4. If a
node comes into contact with a platen in only one of the two runs, the response jumps. At this step, the jump
has little effect."""


@dataclass(frozen=True)
class PronyProblem:
    """Residuals of all the evidence as functions of the logarithms (factor, strengths, times)."""

    law: Any
    """The long-term law: an `explicit.materials.MaterialLaw`."""
    evidence: tuple[Evidence, ...]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Values with a finite sigma of all the evidence, in one array. Only these are used."""
        return np.concatenate([np.isfinite(e.sigma) for e in self.evidence])

    def of_many(self, points: FloatArray) -> FloatArray:
        """Residuals of each row of logarithms, shape [n_points, n_data]."""
        models = [model_of(x) for x in points]
        parts = [(e.predict(self.law, models) - e.values) / e.sigma for e in self.evidence]
        return np.concatenate(parts, axis=1)[:, self.known]

    def residuals(self, x: FloatArray) -> FloatArray:
        """Residuals at one row of logarithms, shape [n_data]."""
        rows = self.of_many(x[None])[0]
        # A model that cannot be simulated gets a larger residual than any other. The search then turns back.
        return rows if np.isfinite(rows).all() else np.full_like(rows, REFUSED)

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Central differences, all of them in one batch, shape [n_data, n_parameters].

        Raises ValueError if a simulation near `x` did not complete.
        """
        shifts = DIFFERENCE * np.eye(len(x))
        both = self.of_many(np.concatenate([x + shifts, x - shifts]))
        if not np.isfinite(both).all():
            raise ValueError(
                f"the evidence cannot be predicted with {model_of(x)}: a simulation did not complete; end "
                "its window before the specimen is crushed"
            )
        return np.asarray((both[: len(x)] - both[len(x) :]).T / (2.0 * DIFFERENCE))

    def bounds(self, n_branches: int) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest logarithms, each of shape [1 + 2 n_branches]."""
        scales = [e.time_scales for e in self.evidence]
        times = min(s[0] for s in scales) / TIME_SCALE_MARGIN, max(s[1] for s in scales) * TIME_SCALE_MARGIN
        rows = [FACTORS, *[STRENGTHS] * n_branches, *[times] * n_branches]
        lower, upper = np.log(np.array(rows)).T
        return lower, upper

    def scaled(self) -> RateModel:
        """The best factor of a grid, without branches. Waves can cause several local minima in a shot."""
        grid = np.log(np.geomspace(*_FACTOR_GRID))[:, None]
        return model_of(grid[self.best(grid)])

    def best(self, points: FloatArray) -> int:
        """Index of the row of logarithms with the smallest sum of squares; failed runs are left out."""
        squares = (self.of_many(points) ** 2).sum(axis=1)
        return int(np.argmin(np.where(np.isfinite(squares), squares, np.inf)))

    def extended(self, x: FloatArray) -> FloatArray:
        """Start with one more branch: the best of a grid."""
        n = len(x) // 2
        lower, upper = self.bounds(n + 1)
        margin = np.log(TIME_SCALE_MARGIN)
        # The long-term law is reduced by the branch, and their mean stays the same.
        grid = np.array(
            [
                [x[0] - 0.5 * np.log1p(strength), *x[1 : n + 1], np.log(strength), *x[n + 1 :], time]
                for strength in GRID
                for time in np.linspace(lower[-1] + margin, upper[-1] - margin, _GRID_TIMES)
            ]
        )
        return np.asarray(grid[self.best(grid)])

    def idle(self, x: FloatArray, n_branches: int) -> FloatArray:
        """The same parameters with more branches, of the smallest strength."""
        n = len(x) // 2
        more = n_branches - n
        lower, upper = self.bounds(n_branches)
        times = np.full(more, 0.5 * (lower[-1] + upper[-1]))
        return np.concatenate([x[: n + 1], np.full(more, np.log(STRENGTHS[0])), x[n + 1 :], times])

    def fit(self, x: FloatArray, jacobian: FloatArray, lower: FloatArray, upper: FloatArray) -> RateFit:
        """Fit at the end of a search between two bounds, its branches in order of their times."""
        n = len(x) // 2
        order = np.argsort(x[n + 1 :])
        kept = np.concatenate([[0], 1 + order, 1 + n + order]).astype(int)
        ends = (x - lower < 1e-3) | (upper - x < 1e-3)
        x, jacobian, ends = x[kept], jacobian[:, kept], ends[kept]
        names = ("factor", *(f"strength {k + 1}" for k in range(n)), *(f"time {k + 1}" for k in range(n)))
        rows = self.of_many(x[None])[0]
        chi_square, free = float(rows @ rows), len(rows) - len(x)
        covariance = np.linalg.pinv(jacobian.T @ jacobian) * max(1.0, chi_square / free)
        counts = [int(np.isfinite(e.sigma).sum()) for e in self.evidence]
        return RateFit(
            model=model_of(x),
            names=names,
            values=np.exp(x),
            covariance=np.asarray(covariance, dtype=np.float64),
            chi_square=chi_square,
            n_data=len(rows),
            residuals=tuple(np.split(rows, np.cumsum(counts)[:-1])),
            at_bound=tuple(name for name, end in zip(names, ends, strict=True) if end),
        )


def model_of(x: FloatArray) -> RateModel:
    """The rate model of a row of logarithms."""
    n = len(x) // 2
    values = np.exp(x)
    return RateModel(
        float(values[0]), PronySeries(tuple(values[1 : n + 1].tolist()), tuple(values[n + 1 :].tolist()))
    )


def _logs_of(model: RateModel) -> FloatArray:
    """The logarithms of a model, shape [1 + 2 n_branches], with the least allowed strength or more."""
    strengths = np.maximum(model.series.strengths, STRENGTHS[0])
    return np.log(np.concatenate([[model.factor], strengths, model.series.times]))


def fit_prony(
    law: Any,
    evidence: Sequence[Evidence],
    n_branches: int,
    *,
    start: RateModel | None = None,
    max_evaluations: int = 60,
) -> RateFit:
    """Fit a factor and `n_branches` branches to all the evidence at once."""
    if not evidence:
        raise ValueError("a fit needs evidence, got none")
    if n_branches < 0:
        raise ValueError(f"n_branches must be >= 0, got {n_branches}")
    problem = PronyProblem(law, tuple(evidence))
    n_data, n_free = int(problem.known.sum()), 1 + 2 * n_branches
    if n_data <= n_free:
        raise ValueError(f"{n_free} parameters need more than {n_free} measured values, got {n_data}")
    if start is None and n_branches == 0:
        start = problem.scaled()
    elif start is None:
        start = fit_prony(law, evidence, n_branches - 1, max_evaluations=max_evaluations).model
    if len(start.series) > n_branches:
        raise ValueError(f"the start has {len(start.series)} branches, {n_branches} are requested")
    x = _logs_of(start)
    while len(x) < n_free:
        x = problem.extended(x)
    lower, upper = problem.bounds(n_branches)
    starts = [x]
    if len(start.series) < n_branches:
        starts.append(problem.idle(_logs_of(start), n_branches))  # more branches are never worse than fewer
    searches = [
        least_squares(
            problem.residuals,
            np.clip(begin, lower + 1e-6, upper - 1e-6),
            jac=problem.jacobian,
            bounds=(lower, upper),
            x_scale=1.0,
            max_nfev=max_evaluations,
        )
        for begin in starts
    ]
    found = min(searches, key=lambda search: float(search.cost))
    return problem.fit(found.x, found.jac, lower, upper)


def required_branches(
    law: Any, evidence: Sequence[Evidence], *, at_most: int = 2, max_evaluations: int = 60
) -> RateVerdict:
    """Fit 0, 1, ... `at_most` branches and test the improvement by each.

    Raises ValueError if `at_most` is negative, or as `fit_prony`.
    """
    check_interval("[0, inf)", at_most=at_most)
    fits = [fit_prony(law, evidence, 0)]
    for n in range(1, at_most + 1):
        fits.append(fit_prony(law, evidence, n, start=fits[-1].model, max_evaluations=max_evaluations))
    scatter = fits[-1].scatter
    gains = [max(a.chi_square - b.chi_square, 0.0) / scatter for a, b in pairwise(fits)]
    return RateVerdict(tuple(fits), tuple(float(chdtrc(2, gain)) for gain in gains))


SETBACK = 0.01
"""Share of the largest strain by which a held strain may decrease [-]. Noise of the strain is not
unloading."""
LEAST_STRAIN = 0.02
"""Least |lam - 1| of a sample [-]. Below it, noise and contact dominate the modulus."""


@dataclass(frozen=True)
class ApparentModuli:
    """Moduli of one test."""

    label: str
    age: FloatArray
    """Mean age of the strain, Eq. (V.4) [s], shape [n]."""
    strain: FloatArray
    """Nominal strain lam - 1; 0 for an oscillation [-], shape [n]."""
    modulus: FloatArray
    """E_a, Eq. (M.9), or E' [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty from that of the stress [Pa], shape [n]."""


def apparent_moduli(test: HistoryTest | DynamicTest) -> ApparentModuli:
    """The moduli of a single slow test, relaxation or oscillation.

    Samples without a measured stress, and those strained by less than `LEAST_STRAIN`, are omitted.

    Raises ValueError if a history turns back by more than `SETBACK`, because its strain then has no age. The
    same error is raised if no sample has enough strain.
    """
    if isinstance(test, DynamicTest):
        age = 1.0 / test.angular_frequency
        return ApparentModuli(test.label, age, np.zeros(len(age)), test.storage, test.sigma_storage)
    strain = np.log(test.stretch)
    side = 1.0 if strain[np.argmax(np.abs(strain))] > 0.0 else -1.0
    most = side * np.maximum.accumulate(side * strain)
    back = np.abs(strain - most) > SETBACK * np.abs(strain).max()
    if back.any():
        k = int(np.argmax(back))
        raise ValueError(
            f"{test.label}: the stretch turns back at sample {k} ({test.time[k]:g} s); give what comes before"
        )
    strain = most
    rise = np.diff(strain, prepend=0.0)
    # Between the samples the strain increases steadily. The age of that part is therefore that of its middle.
    middle = 0.5 * (test.time + np.concatenate([test.time[:1], test.time[:-1]]))
    shown = np.isfinite(test.sigma) & (np.abs(test.stretch - 1.0) >= LEAST_STRAIN)
    if not shown.any():
        least = f"{LEAST_STRAIN:g}"
        raise ValueError(f"{test.label}: no sample has a measured stress and a strain of {least} or more")
    age = test.time - np.cumsum(rise * middle) / np.where(strain == 0.0, 1.0, strain)
    shown &= age > 0.0
    if not shown.any():
        raise ValueError(f"{test.label}: every sample was taken at the moment of a step, where age is 0")
    lam = test.stretch[shown]
    gauss = 3.0 / (lam - lam**-2)
    stress, sigma = test.stress[shown], test.sigma[shown]
    return ApparentModuli(test.label, age[shown], lam - 1.0, gauss * stress, np.abs(gauss) * sigma)


def fitted_modulus(fit: RateFit, young: float, age: FloatArray) -> tuple[FloatArray, FloatArray]:
    """E(t) of a fit over the same axis, and its standard uncertainty by the fit's covariance [Pa].

    ``young``: initial modulus of the long-term law, 3 mu_0 [Pa]. ``age``: times after a step of strain [s].
    Raises ValueError if the modulus is not positive or an age is negative.
    """
    check_interval("(0, inf) Pa", young=young)
    check_interval("[0, inf) s", age=age)
    n = len(fit.values) // 2
    factor, c, tau = fit.values[0], fit.values[1 : n + 1], fit.values[n + 1 :]
    x = age[:, None] / tau
    parts = c * np.exp(-x)
    modulus = factor * young * (1.0 + parts.sum(axis=1))
    slopes = np.column_stack([modulus, factor * young * parts, factor * young * parts * x])
    return modulus, np.sqrt(np.einsum("ki,ij,kj->k", slopes, fit.covariance, slopes))
