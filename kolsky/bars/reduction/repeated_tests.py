"""Repeated tests on one axis.

Mean, scatter, confidence band (Type A), and uncertainty common to all tests.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from dic.views import ResultViews
from kolsky.bars.records import History, Reduction
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Curve:
    """One test: a quantity over strain or time."""

    name: str
    """Name of the test, for messages."""
    axis: FloatArray
    """Strain or time, increasing, shape [n]."""
    value: FloatArray
    """The quantity, shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty that is independent between tests, e.g. from noise; None if unknown."""


@dataclass(frozen=True)
class Repeats:
    """Mean of tests with its uncertainty from their scatter."""

    axis: FloatArray
    """Common axis, shape [n]."""
    values: FloatArray
    """Every test on it, shape [n_tests, n]."""
    mean: FloatArray
    """Mean over the tests, shape [n]."""
    scatter: FloatArray
    """Experimental standard deviation between tests, n - 1, Eq. (U.14), shape [n]."""
    within: FloatArray | None
    """Root mean square of the tests' sigmas, shape [n]; None if one is unknown. If the scatter is not larger
    than this, the tests differ only by noise."""
    remarks: tuple[str, ...]
    """Parts that were cut off, in words."""

    @property
    def count(self) -> int:
        """Number of tests."""
        return len(self.values)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the scatter."""
        return self.count - 1

    @property
    def sigma(self) -> FloatArray:
        """Type A standard uncertainty of the mean, Eq. (U.15), shape [n]."""
        return self.scatter / np.sqrt(self.count)

    def combined(self, shared: FloatArray | float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Standard uncertainty of the mean and its degrees of freedom.

        The part common to all tests is included.

        ``shared``: standard uncertainty of all that the tests have in common: moduli, gauge factors, ...,
        shape [n]. Repetition does not reduce it. Its degrees of freedom are infinite. Returns: Eq. (U.16) and
        the effective degrees of freedom by Welch and Satterthwaite, shape [n] both.
        """
        u = np.hypot(self.sigma, shared)
        with np.errstate(divide="ignore", invalid="ignore"):
            nu = np.where(self.sigma > 0.0, self.freedom * (u / self.sigma) ** 4, np.inf)
        return u, nu

    def band(
        self, probability: float = 0.95, *, shared: FloatArray | float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Confidence band of the mean, pointwise: mean -+ t u, shape [n] both ends.

        Raises ValueError if the probability is not inside (0, 1).
        """
        if not 0.0 < probability < 1.0:
            raise ValueError(f"a confidence must be inside (0, 1), got {probability}")
        u, nu = self.combined(shared)
        half = student.ppf(0.5 + 0.5 * probability, nu) * u
        return self.mean - half, self.mean + half


def average(curves: Sequence[Curve], *, points: int | None = None) -> Repeats:
    """Mean and scatter of repeated tests over their common range.

    Curves are interpolated linearly to a uniform axis, from the latest start to the earliest end. Parts
    outside are cut off and reported in a remark.

    ``curves``: the tests, at least two. ``points``: points of the common axis, at least 2; by default the
    smallest number of points of any test in that range. Raises ValueError if there are fewer than two tests,
    or if the tests have no range in common. The same error is raised if an axis does not increase, lengths
    differ, or a value is not finite.
    """
    if len(curves) < 2:
        raise ValueError(f"a scatter needs at least 2 tests, got {len(curves)}")
    for curve in curves:
        _check(curve)
    low, high = max(c.axis[0] for c in curves), min(c.axis[-1] for c in curves)
    if not low < high:
        first = max(curves, key=lambda c: c.axis[0]).name
        last = min(curves, key=lambda c: c.axis[-1]).name
        raise ValueError(
            f"the tests have no range in common: {first} starts at {low:.6g}, {last} ends at {high:.6g}"
        )
    count = points or max(2, min(int(((c.axis >= low) & (c.axis <= high)).sum()) for c in curves))
    if count < 2:
        raise ValueError(f"a common axis needs at least 2 points, got {count}")
    axis = np.linspace(low, high, count)
    values = np.stack([np.interp(axis, c.axis, c.value) for c in curves])
    within = None
    if all(c.sigma is not None for c in curves):
        sigmas = [np.interp(axis, c.axis, c.sigma) for c in curves if c.sigma is not None]
        within = np.sqrt(np.mean(np.square(sigmas), axis=0))
    remarks = [
        f"{c.name}: {c.axis[0]:.4g} to {c.axis[-1]:.4g} cut to the common range {low:.4g} to {high:.4g}"
        for c in curves
        if c.axis[0] < low or c.axis[-1] > high
    ]
    return Repeats(
        axis=axis,
        values=values,
        mean=values.mean(axis=0),
        scatter=values.std(axis=0, ddof=1),
        within=within,
        remarks=tuple(remarks),
    )


def _check(curve: Curve) -> None:
    x, y, sigma = curve.axis, curve.value, curve.sigma
    if x.ndim != 1 or x.size < 2 or x.shape != y.shape or (sigma is not None and sigma.shape != x.shape):
        raise ValueError(
            f"{curve.name}: axis, value and sigma need one length of 2 or more, got {x.shape}, {y.shape}"
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all() and (sigma is None or np.isfinite(sigma).all())):
        raise ValueError(f"{curve.name}: every axis value, value and sigma must be finite")
    back = np.flatnonzero(~(np.diff(x) > 0.0))
    if back.size:
        raise ValueError(
            f"{curve.name}: the axis must increase, it goes from {x[back[0]]:.6g} to {x[back[0] + 1]:.6g} at"
            f" point {back[0] + 1}; cut the curve there (a strain falls after its largest value)"
        )


WAY = "three waves"
"""The analysis used for the average."""


@dataclass(frozen=True)
class RepeatedTests(ResultViews):
    """The mean of repeated tests, its scatter, and the uncertainty common to the tests."""

    unit: str
    """Unit of the stress."""
    repeats: Repeats
    """Mean, scatter and single tests on the common axis."""
    shared: FloatArray
    """Standard uncertainty that repeated tests do not reduce, shape [n]."""

    def history(self) -> History:
        """The mean with its combined standard uncertainty, Eq. (U.16)."""
        return History(self.repeats.mean, self.repeats.combined(self.shared)[0], self.unit)

    def band(self, probability: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Confidence band of the mean, with scatter and shared parts, shape [n] both ends."""
        return self.repeats.band(probability, shared=self.shared)


def repeated_tests(reductions: Mapping[str, Reduction]) -> RepeatedTests:
    """Average the nominal stress of several tests over their strain.

    Only the loading is used: the longest part of each test with increasing strain. A remark gives its ends.
    The tests use the same bars, gauges and instruments. Their standard uncertainties, with noise, are
    therefore taken as common to all. This makes the band slightly too wide.

    ``reductions``: reductions by the names of the tests, with their full bands
    (`kolsky.bars.reduction.analyse`). Raises ValueError for the reasons of `average`.
    """
    curves, remarks, unit = [], [], ""
    for name, reduction in reductions.items():
        history, axis = reduction.stress[WAY], reduction.strain[WAY].value
        unit, inside = history.unit, rising(axis)
        first, last = axis[inside][0], axis[inside][-1]
        if inside.start or inside.stop < axis.size:
            remarks.append(f"{name}: loading from strain {first:.4g} to {last:.4g}, the rest is cut off")
        curves.append(Curve(name, axis[inside], history.value[inside], history.sigma[inside]))
    found = average(curves)
    assert found.within is not None  # every curve has its sigma
    return RepeatedTests(
        unit=unit,
        repeats=Repeats(
            axis=found.axis,
            values=found.values,
            mean=found.mean,
            scatter=found.scatter,
            within=None,  # the uncertainty is common here and does not differ between tests
            remarks=(*remarks, *found.remarks),
        ),
        shared=found.within,
    )


def rising(value: FloatArray) -> slice:
    """The longest stretch of increasing samples. If several are equally long, the first one.

    Raises ValueError if no sample exceeds the previous one.
    """
    up = np.concatenate([[False], np.diff(value) > 0.0, [False]])
    starts = np.flatnonzero(~up[:-1] & up[1:])
    stops = np.flatnonzero(up[:-1] & ~up[1:])
    if not starts.size:
        raise ValueError("the strain does not increase anywhere")
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]) + 1)
