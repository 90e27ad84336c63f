r"""Oscillations at several temperatures shifted to one temperature.

The shift factors are free, or follow the law of Williams, Landel and Ferry.

In a thermorheologically simple solid a change of temperature multiplies all relaxation times by one factor
:math:`a_T`, so that the moduli are functions of :math:`a_T \omega` alone (Ferry 1980, ch. 11),

.. math::
   \lg a_T = -\frac{C_1 (T - T_0)}{C_2 + T - T_0}.                                            \qquad (V.5)

The function is a spectrum of Maxwell elements of non-negative strength on a fixed grid of times, in parallel
with a spring. Non-negative least squares determines it for every trial of the shifts (variable projection).
Free shifts at every temperature show whether the curves superpose at all; Eq. (V.5) with its two constants is
then compared with them. Moduli are not shifted vertically.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls
from scipy.special import chdtrc

from kolsky.base.arrays import FloatArray
from kolsky.material.relaxation.rate_fit import DynamicTest

EQUAL_TEMPERATURES = 0.5
"""Temperatures are equal if they differ by less than this [K]."""
PER_DECADE = 8
"""Maxwell elements per decade of time. With 1 % of noise, 4 elements cause a visible misfit, 8 do not."""
LARGEST_SHIFT = 20.0
"""Largest shift that is tried [decades]."""
SCAN = np.linspace(-8.0, 8.0, 129)
"""Shifts between neighbouring temperatures from which a search may start [decades]."""
UNDETERMINED = 0.5
"""Standard uncertainty above which a shift is not determined [decades]."""
UNLIKELY = 0.01
"""Probability of chance below which the larger residual of a law with fewer constants is significant."""


@dataclass(frozen=True)
class TemperatureSweep:
    """Oscillations at several temperatures."""

    temperature: FloatArray
    """T [K], shape [n]."""
    test: DynamicTest
    """Moduli at these temperatures, row by row."""
    reference: float
    """Reference temperature T0 of the shifts, one of the measured temperatures [K]."""

    def __post_init__(self) -> None:
        if self.temperature.shape != self.test.angular_frequency.shape:
            raise ValueError(f"{self.test.label}: every oscillation needs a temperature")
        if not (np.isfinite(self.temperature) & (self.temperature > 0.0)).all():
            raise ValueError(f"{self.test.label}: temperatures must be above absolute zero")
        levels = self.levels
        if levels.size < 2:
            raise ValueError(f"{self.test.label}: a sweep needs two temperatures, all are {levels[0]:.2f} K")
        if np.abs(levels - self.reference).min() > EQUAL_TEMPERATURES:
            there = ", ".join(f"{t - 273.15:.1f}" for t in levels)
            raise ValueError(
                f"{self.test.label}: the reference, {self.reference - 273.15:.1f} °C, is not one of the"
                f" measured temperatures, {there} °C"
            )

    @property
    def levels(self) -> FloatArray:
        """The different temperatures, ascending [K], shape [n_levels]."""
        ordered = np.sort(self.temperature)
        steps = np.flatnonzero(np.diff(ordered) > EQUAL_TEMPERATURES)
        return np.array([group.mean() for group in np.split(ordered, steps + 1)])

    @property
    def origin(self) -> int:
        """Index of the reference among the levels."""
        return int(np.abs(self.levels - self.reference).argmin())

    @property
    def level(self) -> NDArray[np.int64]:
        """Index of the temperature of each oscillation, shape [n]."""
        return np.asarray(np.abs(self.temperature[:, None] - self.levels).argmin(axis=1))


@dataclass(frozen=True)
class Superposition:
    """Shift factors of a sweep, and the law behind them."""

    sweep: TemperatureSweep
    shifts: FloatArray
    """lg a_T of each level [-], shape [n_levels]. All are free except that of the reference, which is 0."""
    sigma: FloatArray
    """Their standard uncertainties [-], shape [n_levels]."""
    scatter: float
    """Chi-square of the free shifts divided by its degrees of freedom [-]."""
    likely: float
    """Probability of a chi-square at least as large if the curves superpose [-]."""
    C1: float | None = None
    """C1 of Eq. (V.5) [-]; None if there are too few temperatures."""
    C2: float | None = None
    """C2 [K]."""
    covariance: FloatArray | None = None
    """Covariance of C1 and C2, shape [2, 2]."""
    law_likely: float = 1.0
    """Probability that the law's chi-square exceeds that of free shifts at least as much by chance [-]."""

    @property
    def determined(self) -> bool:
        """True if every shift is determined: the moduli change with frequency, and the curves overlap."""
        return bool((self.sigma < UNDETERMINED).all())

    @property
    def one_curve(self) -> bool:
        """True if the curves superpose within their noise."""
        return self.likely >= UNLIKELY

    @property
    def law_holds(self) -> bool:
        """True if Eq. (V.5) was fitted and its residual is not significant."""
        return self.C1 is not None and self.determined and self.law_likely >= UNLIKELY

    @property
    def adopted(self) -> FloatArray:
        """lg a_T by the law if it is valid, otherwise the free shifts [-], shape [n_levels]."""
        if not self.law_holds or self.C1 is None or self.C2 is None:
            return self.shifts
        return wlf(self.sweep.levels - self.sweep.levels[self.sweep.origin], self.C1, self.C2)

    def reduced(self) -> DynamicTest:
        """The oscillations at the reference temperature, at the frequencies a_T omega.

        Raises ValueError if a shift is not determined.
        """
        if not self.determined:
            worst = int(np.argmax(self.sigma))
            raise ValueError(
                f"{self.sweep.test.label}: the shift at {self.sweep.levels[worst] - 273.15:.1f} °C is not"
                f" determined (± {min(2.0 * self.sigma[worst], 99.0):.2g} decades, k = 2): the moduli hardly"
                " change with frequency, or the curves of neighbouring temperatures do not overlap"
            )
        test = self.sweep.test
        factor = 10.0 ** self.adopted[self.sweep.level]
        return replace(test, angular_frequency=test.angular_frequency * factor)


def wlf(difference: FloatArray, C1: float, C2: float) -> FloatArray:
    """lg a_T by Eq. (V.5) [-], shape [...]. `difference` is T - T0 [K]."""
    return np.asarray(-C1 * difference / (C2 + difference))


def superpose(sweep: TemperatureSweep) -> Superposition:
    """Find the shift factors of a sweep, free and by the law of Williams, Landel and Ferry.

    Constants of Eq. (V.5) need three temperatures. With exactly three, they fit the shifts exactly, and the
    law cannot be tested.
    """
    levels, held = sweep.levels, sweep.origin
    start = _begin(sweep, held)
    problem = _Problem(sweep, start)
    free = np.delete(np.arange(levels.size), held)

    def full(s: FloatArray) -> FloatArray:
        shifts = np.zeros(levels.size)
        shifts[free] = s
        return shifts

    limits = (-LARGEST_SHIFT, LARGEST_SHIFT)
    found = least_squares(lambda s: problem.residual(full(s)), start[free], diff_step=1e-4, bounds=limits)
    rest = problem.residual(full(found.x))
    used = int((problem.strengths(full(found.x))[0] > 0.0).sum())
    freedom = max(1, rest.size - used - free.size)
    square = float(rest @ rest)
    scatter = square / freedom
    sigma = np.zeros(levels.size)
    sigma[free] = np.sqrt(np.diag(_covariance(found.jac, scatter)))
    made = Superposition(sweep, full(found.x), sigma, scatter, float(chdtrc(freedom, square)))
    if free.size < 2 or not made.determined:
        return made
    return _with_law(made, problem, square, free)


def _with_law(
    made: Superposition, problem: "_Problem", square: float, free: NDArray[np.int64]
) -> Superposition:
    """The constants of Eq. (V.5), and their residual relative to the free shifts."""
    difference = made.sweep.levels - made.sweep.levels[made.sweep.origin]
    d, lg = difference[free], made.shifts[free]
    # (T - T0) / lg a_T is a straight line in T - T0: -(C2 + T - T0) / C1.
    slope, constant = np.polyfit(d, d / np.where(lg == 0.0, 1e-12, lg), 1)
    least = max(0.0, -float(difference.min())) + 1.0
    C1 = -1.0 / slope if slope != 0.0 else 10.0
    begin = np.array([C1, max(constant / slope if slope != 0.0 else 50.0, 1.1 * least)])
    found = least_squares(
        lambda c: problem.residual(wlf(difference, *c)), begin, diff_step=1e-5,
        bounds=([-np.inf, least], [np.inf, 1e5]), x_scale=np.abs(begin),
    )  # fmt: skip
    more = max(0.0, float(found.fun @ found.fun) - square) / max(1.0, made.scatter)
    likely = float(chdtrc(free.size - 2, more)) if free.size > 2 else 1.0
    covariance = _covariance(found.jac, made.scatter)
    return replace(made, C1=float(found.x[0]), C2=float(found.x[1]), covariance=covariance, law_likely=likely)


class _Problem:
    """Residuals of the moduli for trials of the shifts."""

    def __init__(self, sweep: TemperatureSweep, start: FloatArray, levels: list[int] | None = None) -> None:
        self.level = sweep.level
        self.rows = np.isin(self.level, levels) if levels is not None else np.ones(self.level.size, bool)
        test = sweep.test
        self.omega = test.angular_frequency[self.rows]
        self.level = self.level[self.rows]
        self.data = np.concatenate([test.storage[self.rows], test.loss[self.rows]])
        self.sigma = np.concatenate([test.sigma_storage[self.rows], test.sigma_loss[self.rows]])
        lg = np.log10(self.omega) + start[self.level]
        low, high = -lg.max() - 1.0, -lg.min() + 1.0
        self.times = 10.0 ** np.linspace(low, high, max(2, round(PER_DECADE * (high - low)) + 1))

    def strengths(self, shifts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Strengths of spring and elements [Pa], and the weighted system for them."""
        x = (self.omega * 10.0 ** shifts[self.level])[:, None] * self.times
        one = np.ones((x.shape[0], 1))
        A = np.vstack([np.hstack([one, x**2 / (1.0 + x**2)]), np.hstack([0.0 * one, x / (1.0 + x**2)])])
        A = A / self.sigma[:, None]
        return nnls(A, self.data / self.sigma)[0], A

    def residual(self, shifts: FloatArray) -> FloatArray:
        """(model - measured) / sigma of E', then E'', shape [2 n]."""
        strength, A = self.strengths(shifts)
        return np.asarray(A @ strength - self.data / self.sigma)


def _begin(sweep: TemperatureSweep, held: int) -> FloatArray:
    """Shifts between neighbours by a scan, summed from the reference."""
    levels = sweep.levels.size
    steps = np.zeros(levels)
    for k in range(1, levels):
        problem, unit = _Problem(sweep, np.zeros(levels), [k - 1, k]), np.eye(levels)[k]
        steps[k] = min(SCAN, key=lambda shift: float((problem.residual(shift * unit) ** 2).sum()))
    total = np.cumsum(steps)
    return np.asarray(total - total[held])


def _covariance(jacobian: FloatArray, scatter: float) -> FloatArray:
    """Covariance of least squares, widened by the scatter; very large in directions without information."""
    size, axes = np.linalg.eigh(jacobian.T @ jacobian)
    return np.asarray((axes / np.maximum(size, 1e-12)) @ axes.T * max(1.0, scatter))
