"""Fit constants to whole specimens: one or several tests, with intervals, checks, and plans of tests.

There are two checks: whether the law explains the data, and whether a bond peels. If a bond peels, the force
falls as if the bonded length became shorter.

The covariance comes from the whitened Jacobian J of the problem of the constants. Constants at a bound are
fixed:

    C = s^2 a (J^T J)^-1,   s^2 = max(1, chi^2 / (n - p)),   a = max(1, (1 + rho) / (1 - rho)),

The factor s^2 applies if the residual is larger than the declared noise (Birge 1932). The factor a applies if
neighbouring residuals are correlated. With the correlation rho of neighbours, n residuals have the
information of n / a independent ones (Bartlett 1946).

Before a test, the derivatives of the forces at expected constants give the covariance of a fit,
C = (sum_tests J^T J)^-1, with J whitened by the noise of the instruments. No data are needed. Shapes are
compared by the relative deviation of the constants of interest. If all constants are of interest, the
criterion is the determinant of the relative covariance (D-optimality, Kiefer and Wolfowitz 1960).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from scipy.special import chdtrc, stdtrit
from scipy.stats import qmc

from dic.views import ResultViews
from doe.information import SingularInformationError, inverse_information
from kolsky.base.arrays import FloatArray
from kolsky.bodies.errors_in_variables import Linearised, Reduced, Samples, SearchOptimum, reduce, search
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_model import SpecimenModel
from kolsky.material.fits.fit import inflation, neighbour_correlation

LEVEL = 0.95
"""Probability of the intervals."""
TOGETHER = 0.95
"""Magnitude of a correlation above which only a combination of two constants is constrained [-]."""
NARROW = 0.1
"""Such a constant is still identified if the half width of its interval, divided by its value, is at most
this [-]."""
_BROAD = 0.5
"""A constant is hardly determined if the half width of its interval, divided by its value, exceeds this
[-]."""
EXPLAINED = 1e-3
"""Below this probability of a larger chi-square, the law does not explain the data."""


class ConstantVerdict(Enum):
    """How well the data determine a constant."""

    IDENTIFIED = "identified"
    """An interval inside the bounds."""
    TOGETHER = "known together with another"
    """The constant is strongly correlated with another one. Only a combination of both is determined."""
    HARDLY = "hardly determined"
    """The interval is wider than the constant."""
    AT_BOUND = "at its bound"
    """The smallest chi-square is at a bound. The data need a value beyond it, and there is no interval."""
    NOT_SEEN = "not seen"
    """A combination of the constants affects no force of these tests."""


@dataclass(frozen=True)
class ConstantEstimate:
    """A fitted constant with its interval."""

    name: str
    value: float
    sigma: float | None
    """Standard uncertainty, SI; None if it does not exist."""
    low: float | None
    """Lower end of the interval, SI, limited by the bound."""
    high: float | None
    """Upper end, SI."""
    verdict: ConstantVerdict
    """Result of the fit for this constant: how well the data determine it."""
    partner: str
    """The constant with the strongest correlation to it; empty if there is no other constant."""
    correlation: float
    """Correlation with that constant [-]."""

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        if self.verdict is ConstantVerdict.TOGETHER:
            return (
                f"{self.name} is known only together with {self.partner} (correlation "
                f"{self.correlation:.3f}): these tests do not separate the two; add another kind of test, "
                "or hold one"
            )
        cures = {
            ConstantVerdict.HARDLY: "its interval is wide: strain further, or add another kind of test",
            ConstantVerdict.AT_BOUND: "the data need a value outside its bounds: try another law",
            ConstantVerdict.NOT_SEEN: "a combination of the constants moves no force: hold one of them",
        }
        sentence = f"{self.name} is {self.verdict.value}"
        return f"{sentence}: {cures[self.verdict]}" if self.verdict in cures else sentence


@dataclass(frozen=True)
class Intervals:
    """Estimates of all free constants."""

    estimates: tuple[ConstantEstimate, ...]
    """In the order of the free constants."""
    covariance: FloatArray
    """Covariance, SI, shape [p, p]. Rows of constants at a bound are zero. All entries are NaN if the data do
    not depend on some constants."""
    scale: float
    """s^2 a: variance of the residual divided by that of the declared noise, used in the intervals [-]."""
    neighbours: float
    """Correlation of neighbouring residuals [-]."""
    degrees: int
    probability: float
    """Probability of an equal or larger chi-square if law and declared noise are correct [-]."""

    @property
    def explained(self) -> bool:
        """True if the law explains the data within the declared noise."""
        return self.probability >= EXPLAINED

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the constants, shape [p, p]; 0 for a constant at a bound."""
        return correlation_of(self.covariance)


def correlation_of(covariance: FloatArray) -> FloatArray:
    """Correlations of a covariance, shape [p, p]. Rows of zero variance have 0 off the diagonal."""
    sigma = np.sqrt(np.diag(covariance))
    outer = np.outer(sigma, sigma)
    correlation = np.divide(covariance, outer, out=np.zeros_like(covariance), where=outer > 0.0)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation)


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

    ``names``, ``values``: the free constants, shape [p]. ``series``: the same residuals, one series for each
    moving end of each test, in their order. ``at_bound``: constants at a bound.
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
    factor = float(stdtrit(degrees, 0.5 + 0.5 * LEVEL))
    probability = float(chdtrc(degrees, chi2))

    def estimate(j: int) -> ConstantEstimate:
        value = float(values[j])
        if at_bound[j] or not np.isfinite(covariance).all():
            verdict = ConstantVerdict.AT_BOUND if at_bound[j] else ConstantVerdict.NOT_SEEN
            return ConstantEstimate(names[j], value, None, None, None, verdict, "", 0.0)
        row = correlation_of(covariance)[j].copy()
        row[j] = 0.0
        most = int(np.abs(row).argmax())
        partner, correlation = (names[most], float(row[most])) if p > 1 else ("", 0.0)
        sigma = float(np.sqrt(covariance[j, j]))
        half, verdict = factor * sigma, ConstantVerdict.IDENTIFIED
        if half > _BROAD * abs(value):
            verdict = ConstantVerdict.HARDLY
        if abs(correlation) >= TOGETHER and half > NARROW * abs(value):
            verdict = ConstantVerdict.TOGETHER
        low, high = max(value - half, bounds[0][j]), min(value + half, bounds[1][j])
        return ConstantEstimate(names[j], value, sigma, low, high, verdict, partner, correlation)

    return Intervals(tuple(map(estimate, range(p))), covariance, scale, alike, degrees, probability)


LIMIT = 5.0
"""Smallest z, over all samples, that indicates a peeling bond."""
LEAST_SHARE = 1e-6
"""Smallest share of a template that the constants cannot reproduce. Below it, the check is inconclusive."""
FIRST, LAST = 0.15, 0.85
"""Range of the series in which the start of peeling is searched, as shares of its length."""


@dataclass(frozen=True)
class Debonding:
    """The strongest indication of a peeling bond."""

    sample: int
    """First sample after the opening."""
    length: float
    """Peeled length of each bond [m]. It is negative if the bond seems longer than declared."""
    sigma: float
    """Its standard deviation [m]."""
    z: float
    """Their ratio [-]."""
    searched: int
    """Number of samples tried as the start of peeling."""

    @property
    def suspected(self) -> bool:
        """True if a bond seems to peel."""
        return self.z > LIMIT


def debonding(
    residual: FloatArray, jacobian: FloatArray, shortened: FloatArray, *, amount: float, scale: float
) -> Debonding | None:
    """Search a series of residuals for the peeling of a bond.

    Returns: None if the constants can reproduce the effect of peeling at every sample. The check is then
    inconclusive.

    ``residual``: measured minus simulated force of one end, over sigma [-], shape [n]. ``jacobian``: its
    derivatives by the fitted constants over sigma, shape [n, p]. ``shortened``: force with a bond shorter by
    `amount`, minus the force with the full bond, over sigma, shape [n]. ``amount``: peeled length of each
    bond in `shortened` [m]. ``scale``: variance of the residuals divided by that of the declared noise, >= 1.
    """
    n = len(residual)
    basis, _ = np.linalg.qr(jacobian)
    left = residual - basis @ (basis.T @ residual)
    best, searched = None, 0
    for j in range(max(1, round(FIRST * n)), max(2, round(LAST * n))):
        template = np.where(np.arange(n) >= j, shortened, 0.0)
        seen = template - basis @ (basis.T @ template)
        information = float(seen @ seen)
        if information <= LEAST_SHARE * float(template @ template) or information == 0.0:
            continue
        searched += 1
        length = float(seen @ left) / information
        sigma = float(np.sqrt(scale / information))
        candidate = Debonding(j, amount * length, amount * sigma, length / sigma, 0)
        if best is None or abs(candidate.z) > abs(best.z):
            best = candidate
    return None if best is None else Debonding(best.sample, best.length, best.sigma, best.z, searched)


DECADES = 1.0
"""Further starts of a modulus are drawn over this many decades on each side of the declared start."""


@dataclass(frozen=True)
class SlowTest:
    """A specimen and its measurements."""

    model: SpecimenModel
    samples: Samples

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.model.name


@dataclass(frozen=True)
class TestFit:
    """A test and its simulation with the fitted constants."""

    test: SlowTest
    displacement: FloatArray
    """Displacements of the simulation: the measured ones within their noise [m], shape [n, ends]."""
    force: FloatArray
    """Simulated force at the measured displacements, to first order [N], shape [n, ends]."""
    band: FloatArray
    """Half width of its interval from the constants [N], shape [n, ends]."""
    fitted: bool
    """True if the test was fitted, False if it is predicted."""
    debonding: tuple[Debonding | None, ...] = ()
    """Strongest indication of a peeling bond at each end. Empty without this check."""

    @property
    def rmse(self) -> float:
        """Root mean square of simulated minus measured force [N]."""
        return float(np.sqrt(np.mean((self.force - self.test.samples.force) ** 2)))


@dataclass(frozen=True)
class SpecimenFit(ResultViews):
    """One set of constants for some tests."""

    name: str
    constants: Constants
    """The law with the fitted values."""
    intervals: Intervals
    tests: tuple[TestFit, ...]
    found: SearchOptimum
    starts: tuple[FloatArray, ...]
    """End points of the other starts, best first, each of shape [p]."""

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the tests that were fitted."""
        return tuple(one.test.name for one in self.tests if one.fitted)

    @property
    def warnings(self) -> list[str]:
        """Warnings about the constants."""
        warnings = []
        if not self.found.converged:
            warnings.append(f"{self.name}: the search did not come to rest: {self.found.ended}")
        warnings += [
            f"{self.name}: {one.sentence}"
            for one in self.intervals.estimates
            if one.verdict.value != "identified"
        ]
        if not self.intervals.explained:
            warnings.append(
                f"{self.name}: the law does not explain the forces within their declared noise (probability "
                f"{self.intervals.probability:.2g}): its misfit is {np.sqrt(self.intervals.scale):.3g} "
                "times as large, and the intervals are widened by that; try another law, or check sigma_force"
            )
        for one in self.tests:
            for end, peel in zip("xy", one.debonding, strict=False):
                if peel is not None and peel.suspected:
                    at = 1e3 * one.test.samples.displacement[peel.sample, "xy".index(end)]
                    warnings.append(
                        f"{self.name}: a bond of {one.test.name} seems to peel from {at:.3g} mm on (as if it "
                        f"were {1e3 * peel.length:.2g} ± {2e3 * peel.sigma:.2g} mm shorter): look at the "
                        "specimen, or end the data before it"
                    )
        return warnings


def fit(
    name: str,
    tests: Sequence[SlowTest],
    constants: Constants,
    *,
    predicted: Sequence[SlowTest] = (),
    starts: int = 1,
    seed: int = 1,
    bonds: bool = True,
) -> SpecimenFit:
    """Fit one set of constants to tests.

    Raises ValueError if the simulation at the start fails, or if there are not more samples than constants.

    ``name``: of the fit. ``tests``: the tests. ``constants``: the law, its initial constants, and the free
    ones. ``predicted``: tests that are simulated with the result for comparison. ``starts``, ``seed``: number
    of starts, and the seed of the draws. The first start is the declared one, the others are drawn around it.
    ``bonds``: True to check for peeling bonds, with one more simulation per test.
    """

    def respond(values: FloatArray, at: tuple[FloatArray, ...]) -> tuple[Linearised, ...]:
        return tuple(test.model.linearised(constants, values, x) for test, x in zip(tests, at, strict=True))

    samples = tuple(test.samples for test in tests)
    ends, refused, limits = [], "", constants.bounds
    for start in _remote_starts(constants, starts, seed):
        try:
            ends.append(search(respond, samples, start, bounds=limits, scales=constants.scales))
        except ValueError as error:
            refused = str(error)
    if not ends:
        raise ValueError(refused)
    ends.sort(key=lambda one: one.chi2)
    best = ends[0]
    series: list[FloatArray] = []
    for own, x, response in zip(samples, best.displacements, best.linearised, strict=True):
        series += list(reduce(own, x, response).residual.reshape(x.shape).T)
    uncertainty = intervals(
        constants.free,
        best.constants,
        best.reduced,
        tuple(series),
        at_bound=best.at_bound,
        bounds=constants.bounds,
    )
    values = Constants(constants.law, constants.all(best.constants), constants.free)
    test_fits = []
    for test, x, response in zip(tests, best.displacements, best.linearised, strict=True):
        one = _test_fit(test, x, response, uncertainty, fitted=True)
        test_fits.append(_with_bonds(one, values, response, uncertainty) if bonds else one)
    for test in predicted:
        answer = test.model.linearised(constants, best.constants, test.samples.displacement)
        test_fits.append(_test_fit(test, test.samples.displacement, answer, uncertainty, fitted=False))
    optima = tuple(one.constants for one in ends)
    return SpecimenFit(name, values, uncertainty, tuple(test_fits), best, optima)


def _remote_starts(constants: Constants, count: int, seed: int) -> list[FloatArray]:
    """The declared start and random others: moduli within `DECADES`, numbers within their bounds."""
    first = constants.start
    if count == 1:
        return [first]
    cube = qmc.LatinHypercube(len(first), rng=np.random.default_rng(seed)).random(count - 1)
    low, high = constants.bounds
    units = np.array([spec.unit == "Pa" for spec in constants.free_specs])
    size = np.maximum(np.abs(first), 0.05 * constants.scales)
    drawn = np.where(
        units,
        size * 10.0 ** (DECADES * (2.0 * cube - 1.0)),
        low + (np.where(np.isfinite(high), high, first + 1.0) - low) * cube,
    )
    return [first, *np.clip(drawn, low, high)]


def _test_fit(
    test: SlowTest, x: FloatArray, response: Linearised, uncertainty: Intervals, *, fitted: bool
) -> TestFit:
    moved = x - test.samples.displacement
    force = response.force - np.einsum("nij,nj->ni", response.by_displacement, moved)
    slopes = response.by_constants
    variance = np.einsum("nip,pq,niq->ni", slopes, np.nan_to_num(uncertainty.covariance), slopes)
    factor = float(stdtrit(uncertainty.degrees, 0.5 + 0.5 * LEVEL))
    return TestFit(test, x, force, factor * np.sqrt(np.maximum(variance, 0.0)), fitted)


def _with_bonds(one: TestFit, constants: Constants, response: Linearised, uncertainty: Intervals) -> TestFit:
    """The test with its bonds checked, if they can be shortened and simulated."""
    test = one.test
    try:
        shorter = replace(test.model, shape=test.model.shape.shortened())
        answer = shorter.linearised(constants, constants.start, one.displacement)
    except ValueError:
        return one
    amount = test.model.shape.size[0] / test.model.shape.elements[0]
    sigma = test.samples.sigma_force
    bonds = tuple(
        debonding(
            (test.samples.force[:, end] - one.force[:, end]) / sigma,
            response.by_constants[:, end] / sigma,
            (answer.force[:, end] - response.force[:, end]) / sigma,
            amount=amount,
            scale=uncertainty.scale,
        )
        for end in range(test.model.shape.ends)
    )
    return replace(one, debonding=bonds)


def cross_table(fits: Sequence[SpecimenFit], tests: Sequence[str]) -> FloatArray:
    """RMSE of each test (column) with the constants of each fit (row) [N], shape [fits, tests]."""
    table = np.full((len(fits), len(tests)), np.nan)
    for row, result in enumerate(fits):
        for one in result.tests:
            if one.test.name in tests:
                table[row, list(tests).index(one.test.name)] = one.rmse
    return table


_LEAST_COLUMN = 1e-6
"""Smallest slope by a relative constant that is not rounding, as a share of the largest [-]."""


@dataclass(frozen=True)
class Expected:
    """Expected uncertainties from a choice of tests."""

    tests: tuple[str, ...]
    relative: FloatArray
    """Expected standard deviation of each constant divided by its size [-], shape [p]. Infinite if the data
    do not depend on it."""
    correlation: FloatArray
    """Expected correlations [-], shape [p, p]."""
    criterion: float
    """Criterion of the comparison, smaller is better [-]. It is the largest relative deviation of the
    constants of interest. Without such constants it is the geometric mean of all principal deviations."""
    peak_force: float
    """Largest force in the tests [N]."""


def expected(
    tests: Sequence[str],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    wanted: Sequence[str],
) -> Expected:
    """Expected deviations of the constants from tests together.

    ``tests``: their names. ``whitened``: L^-1 df/dp of each test, shape [m, p]. ``forces``: largest force of
    each test [N]. ``constants``: the constants at which the tests are planned. ``wanted``: names of the
    constants of interest. Empty means all.
    """
    sizes = np.maximum(np.abs(constants.start), 1e-3 * constants.scales)
    jacobian = np.concatenate([whitened[name] for name in tests]) * sizes
    peak = max(forces[name] for name in tests)
    p = len(sizes)
    relative, correlation = np.full(p, np.inf), np.eye(p)
    columns = np.sqrt((jacobian**2).sum(axis=0))
    seen = np.flatnonzero(columns > _LEAST_COLUMN * columns.max())
    criterion = np.inf
    try:
        if len(seen) == 0 or len(jacobian) < len(seen):
            raise SingularInformationError("a constant moves nothing")
        scaled = jacobian[:, seen] / columns[seen]
        covariance = inverse_information(scaled) / np.outer(columns[seen], columns[seen])
    except SingularInformationError:
        return Expected(tuple(tests), relative, correlation, criterion, peak)
    relative[seen] = np.sqrt(np.diag(covariance))
    correlation[np.ix_(seen, seen)] = correlation_of(covariance)
    if wanted:
        criterion = float(max(relative[constants.free.index(name)] for name in wanted))
    elif len(seen) == p:
        criterion = float(np.linalg.det(covariance) ** (0.5 / p))
    return Expected(tuple(tests), relative, correlation, criterion, peak)


def slopes(
    models: Mapping[str, SpecimenModel],
    schedules: Mapping[str, FloatArray],
    noise: Mapping[str, tuple[float, float]],
    constants: Constants,
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Simulate every planned test once, for the whitened slopes and the largest force of `plan`.

    ``models``: specimens by name. ``schedules``: displacements of their ends [m], shape [n, ends]. ``noise``:
    sigma of displacement [m] and of force [N]. ``constants``: the constants at which the tests are planned.
    Raises ValueError if a simulation fails.
    """
    whitened, forces = {}, {}
    for name, model in models.items():
        answer = model.linearised(constants, constants.start, schedules[name])
        samples = Samples(schedules[name], answer.force, *noise[name])
        whitened[name] = reduce(samples, schedules[name], answer).jacobian
        forces[name] = float(np.abs(answer.force).max())
    return whitened, forces


def plan(
    choices: Sequence[Sequence[str]],
    whitened: Mapping[str, FloatArray],
    forces: Mapping[str, float],
    constants: Constants,
    *,
    wanted: Sequence[str] = (),
) -> list[Expected]:
    """Compare choices of tests, the most informative first; see `expected`."""
    expectations = [expected(tests, whitened, forces, constants, wanted) for tests in choices]
    return sorted(expectations, key=lambda one: one.criterion)
