"""Repeated tests on one axis: mean, scatter, confidence band (Type A), uncertainty common to all tests."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from dic.basics import check_interval, check_shape
from dic.views import ResultViews
from kolsky.bars.records import Reduction
from kolsky.base.arrays import FloatArray

Curve = tuple[FloatArray, FloatArray, FloatArray]
"""Strain, increasing, stress [Pa], and its uncertainty that all tests have in common [Pa], shape [n] each."""


@dataclass(frozen=True)
class RepeatedTests(ResultViews):
    """Nominal stress of repeated tests over their strain, with the uncertainty of its mean."""

    axis: FloatArray
    """Common strains [-], shape [n]."""
    values: FloatArray
    """Stress of every test at them [Pa], shape [n_tests, n]."""
    shared: FloatArray
    """Standard uncertainty of all that the tests have in common: moduli, gauge factors, ... [Pa], shape [n].
    Repetition does not reduce it."""
    remarks: tuple[str, ...]
    """Parts that were cut off, in words."""

    @property
    def count(self) -> int:
        """Number of tests."""
        return len(self.values)

    @property
    def mean(self) -> FloatArray:
        """Mean over the tests [Pa], shape [n]."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def scatter(self) -> FloatArray:
        """Experimental standard deviation between tests, n - 1, Eq. (U.14) [Pa], shape [n]."""
        return np.asarray(self.values.std(axis=0, ddof=1))

    @property
    def sigma(self) -> FloatArray:
        """Type A standard uncertainty of the mean, Eq. (U.15) [Pa], shape [n]."""
        return self.scatter / np.sqrt(self.count)

    def combined(self) -> tuple[FloatArray, FloatArray]:
        """Standard uncertainty of the mean with the shared part, Eq. (U.16) [Pa], and its degrees of freedom.

        The shared part has infinitely many of them. The effective number is by Welch and Satterthwaite, shape
        [n] both.
        """
        u = np.hypot(self.sigma, self.shared)
        with np.errstate(divide="ignore", invalid="ignore"):
            return u, np.where(self.sigma > 0.0, (self.count - 1) * (u / self.sigma) ** 4, np.inf)

    def band(self) -> tuple[FloatArray, FloatArray]:
        """Confidence band of the mean, 95 %, pointwise: mean -+ t u [Pa], shape [n] both ends."""
        u, nu = self.combined()
        half = stdtrit(nu, 0.975) * u
        return self.mean - half, self.mean + half


def average(curves: Mapping[str, Curve]) -> RepeatedTests:
    """Mean and scatter of repeated tests over their common range, by the names of the tests.

    Curves are interpolated linearly to a uniform axis, from the latest start to the earliest end, with as
    many points as the test with the fewest has there. Parts outside are cut off and reported in a remark.
    Raises ValueError if there are fewer than two tests, if they have no range in common, or if a curve has a
    value that is not finite, a negative sigma or a strain that does not increase.
    """
    if len(curves) < 2:
        raise ValueError(f"a scatter needs at least 2 tests, got {len(curves)}")
    for name, (x, y, sigma) in curves.items():
        check_shape(x.shape, **{f"strain of {name}": x, f"stress of {name}": y})
        check_interval("(0, inf)", **{f"step of the strain of {name}": np.diff(x)})
        check_interval("[0, inf)", **{f"sigma of {name}": sigma})
    axes = {name: x for name, (x, _, _) in curves.items()}
    first, last = max(axes, key=lambda name: axes[name][0]), min(axes, key=lambda name: axes[name][-1])
    low, high = axes[first][0], axes[last][-1]
    if not low < high:
        raise ValueError(
            f"the tests have no range in common: {first} starts at {low:.6g}, {last} ends at {high:.6g}"
        )
    axis = np.linspace(low, high, max(2, min(int(((x >= low) & (x <= high)).sum()) for x in axes.values())))
    sigmas = [np.interp(axis, x, sigma) for x, _, sigma in curves.values()]
    remarks = [
        f"{name}: {x[0]:.4g} to {x[-1]:.4g} cut to the common range {low:.4g} to {high:.4g}"
        for name, x in axes.items()
        if x[0] < low or x[-1] > high
    ]
    values = np.stack([np.interp(axis, x, y) for x, y, _ in curves.values()])
    return RepeatedTests(axis, values, np.sqrt(np.mean(np.square(sigmas), axis=0)), tuple(remarks))


WAY = "three waves"
"""The analysis used for the average."""


def repeated_tests(reductions: Mapping[str, Reduction]) -> RepeatedTests:
    """Average the nominal stress of several tests over their strain.

    Only the loading is used: the longest part of each test with increasing strain. A remark gives its ends.
    The tests use the same bars, gauges and instruments. Their standard uncertainties, with noise, are
    therefore taken as common to all. This makes the band slightly too wide.

    ``reductions``: reductions by the names of the tests, with their full bands
    (`kolsky.bars.reduction.analyse`). Raises ValueError for the reasons of `average`.
    """
    curves, remarks = {}, []
    for name, reduction in reductions.items():
        history, axis = reduction.stress[WAY], reduction.strain[WAY].value
        inside = rising(axis)
        first, last = axis[inside][0], axis[inside][-1]
        if inside.start or inside.stop < axis.size:
            remarks.append(f"{name}: loading from strain {first:.4g} to {last:.4g}, the rest is cut off")
        curves[name] = axis[inside], history.value[inside], history.sigma[inside]
    found = average(curves)
    return replace(found, remarks=(*remarks, *found.remarks))


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
