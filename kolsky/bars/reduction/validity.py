"""Validity of a test: force equilibrium, plateau of stress and rate, validity window."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.basics import check_interval, check_shape
from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.arrays import BoolArray, FloatArray

ALLOWANCE = 0.05
"""|R| up to which a specimen is in equilibrium (Ravichandran and Subhash 1994)."""
LEAST_FORCE = 5.0
"""Multiple of its averaged noise. Below it, a mean force does not determine R."""


def imbalance(
    front: FloatArray, back: FloatArray, sigma_front: float, sigma_back: float, *, width: int = 1
) -> FloatArray:
    """R(t) = 2 (F1 - F2) / (F1 + F2), Eq. (R.10), of forces averaged over `width` samples.

    ``front``, ``back``: forces at the two faces [N], shape [n]. ``sigma_front``, ``sigma_back``: standard
    deviations of one sample's noise [N]. ``width``: samples over which the forces are averaged first, >= 1.
    Returns: R [-], shape [n]; inf if the mean force is below `LEAST_FORCE` times its own noise.
    """
    first, second = moving_mean(front, width), moving_mean(back, width)
    mean = 0.5 * (first + second)
    noise = 0.5 * hypot(sigma_front, sigma_back) / sqrt(width)
    least = max(LEAST_FORCE * noise, 1e-9 * float(np.abs(mean).max(initial=0.0)))
    heard = np.abs(mean) > least
    result = np.full(front.size, np.inf)
    result[heard] = (first[heard] - second[heard]) / mean[heard]
    return result


def balanced_span(
    time: FloatArray, ratio: FloatArray, *, allowance: float = ALLOWANCE, bridge: float = 0.0
) -> tuple[float, float] | None:
    """Longest span in which |R| does not exceed the allowance.

    ``time``: times [s], shape [n]. ``ratio``: R [-], shape [n]. ``allowance``: largest |R| [-], > 0.
    ``bridge``: longest excursion that does not end a span [s]. Raises ValueError if the allowance is not
    greater than 0. Returns: first and last time [s].
    """
    if not allowance > 0.0:
        raise ValueError(f"the allowance of R = {allowance} must be greater than 0")
    runs = _runs(np.abs(ratio) <= allowance)
    merged: list[list[int]] = []
    for first, last in runs:
        if merged and time[first] - time[merged[-1][1]] <= bridge:
            merged[-1][1] = last
        else:
            merged.append([first, last])
    if not merged:
        return None
    first, last = max(merged, key=lambda run: run[1] - run[0])
    return (float(time[first]), float(time[last])) if last > first else None


def _runs(flag: BoolArray) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


LEVEL = 0.8
"""Share of the typical stress at which the plateau begins and ends [-]. The typical stress is the median of
all stresses above half the largest."""
PLATEAU_SHARE = 0.3
"""Smallest balanced length of a plateau [-]. It is a share of the incident pulse's length at half its
height."""
LARGEST_CHANGE = 0.2
"""Largest change of a history along the plateau by its best line, divided by its mean [-]."""
LARGEST_SCATTER = 0.1
"""Largest root mean square residual of that line, divided by the mean [-]."""
INSET = 0.1
"""Share of the length between those two times that is omitted at either end [-], because the corners are
rounded."""
END_SIGMA = 0.05
"""Standard uncertainty of the choice of either end, as a share of the plateau's length [-]."""
ENDS = ("plateau, beginning", "plateau, end")
"""Names of the budget's inputs that shift the ends of the plateau [s]."""


@dataclass(frozen=True)
class Span:
    """A time span and the weight of each sample in its means."""

    first: float
    """Its beginning [s]."""
    last: float
    """Its end [s]."""
    weight: FloatArray
    """Weight of each sample in [0, 1], shape [n]: the share of its interval within the span, times its
    balance."""


@dataclass(frozen=True)
class Flatness:
    """Flatness of a history along a span."""

    change: float
    """Change along the span by the best line, divided by the mean [-]."""
    scatter: float
    """Root mean square residual of the line, divided by the magnitude of the mean [-]."""

    @property
    def fault(self) -> str | None:
        """The value that exceeds its limit, in words; None if all are within their limits."""
        if not abs(self.change) <= LARGEST_CHANGE:
            return f"changes by {100 * self.change:+.0f} % (allowed are {100 * LARGEST_CHANGE:g} %)"
        if not self.scatter <= LARGEST_SCATTER:
            return f"scatters by {100 * self.scatter:.0f} % (allowed are {100 * LARGEST_SCATTER:g} %)"
        return None


@dataclass(frozen=True)
class Plateau:
    """The plateau of a test, or the reasons why its means are not reported."""

    span: Span | None
    """The span; None if there is no plateau."""
    balanced: float
    """Balanced length of the span that was checked [s]."""
    pulse: float
    """Length of the incident pulse at half its height [s]."""
    reason: str
    """The plateau in words, or the reason why there is none."""
    stress_fault: str | None = None
    """Reason why no mean stress is reported; None if it is reported."""
    rate_fault: str | None = None
    """Reason why no mean rate is reported; None if it is reported."""


def averaging_width(faces: FaceWaves) -> int:
    """Number of samples in the time of a wave across the thicker bar, at least 1."""
    step = float(faces.time[1] - faces.time[0])
    bars = (faces.incident_bar, faces.transmission_bar)
    return max(1, round(max(bar.diameter / bar.wave_speed for bar in bars) / step))


def find_span(
    reduction: Reduction,
    *,
    analysis: str = "three waves",
    allowance: float = ALLOWANCE,
    width: int = 1,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Span | None:
    """The part of the loading with nearly constant stress. Each sample is weighted by its balance.

    This part begins when the stress, averaged over `width` samples, first exceeds `LEVEL` of its typical
    value. It ends when the stress last exceeds it, and no later than at the largest strain. `INSET` of its
    length is omitted at either end. The weight of a sample is 1 while |R| is within the allowance, 0 beyond
    twice the allowance, and linear between. Ends and weights are continuous in all inputs. A small change of
    an input therefore changes the means only slightly. None if no sample has a weight. ``shift``: time shifts
    of beginning and end [s].
    """
    time, strain, stress = reduction.time, reduction.strain[analysis].value, reduction.stress[analysis].value
    last = int(np.abs(strain).argmax())
    size = moving_mean(stress, width)[: last + 1]
    size = size * np.sign(size[np.abs(size).argmax()])
    if not size.max(initial=0.0) > 0.0:
        return None
    level = LEVEL * float(np.median(size[size > 0.5 * size.max()]))
    above = np.flatnonzero(size >= level)
    begin = _crossing(time, size, int(above[0]), -1, level)
    stop = _crossing(time, size, int(above[-1]), 1, level)
    inset = INSET * (stop - begin)
    first, end = begin + inset + shift[0], stop - inset + shift[1]
    step = float(time[1] - time[0])
    inside = np.clip((np.minimum(time + 0.5 * step, end) - np.maximum(time - 0.5 * step, first)) / step, 0, 1)
    weight = inside * np.clip(2.0 - np.abs(reduction.imbalance) / allowance, 0.0, 1.0)
    return Span(first, end, weight) if weight.sum() > 0.0 else None


def judge_plateau(
    reduction: Reduction,
    faces: FaceWaves,
    *,
    analysis: str = "three waves",
    allowance: float = ALLOWANCE,
    share: float = PLATEAU_SHARE,
) -> Plateau:
    """The plateau of a test, if it is long enough, and the flatness of stress and rate on it.

    ``share``: least balanced length, as a share of the incident pulse's length [-].
    """
    width = averaging_width(faces)
    span = find_span(reduction, analysis=analysis, allowance=allowance, width=width)
    pulse = pulse_length(faces, width)
    step = float(reduction.time[1] - reduction.time[0])
    balanced = 0.0 if span is None else step * float(span.weight.sum())
    if span is None or balanced < share * pulse:
        reason = (
            f"no plateau: while the stress stands the forces are balanced for {1e6 * balanced:.3g} us, "
            f"{100 * balanced / pulse:.0f} % of the pulse of {1e6 * pulse:.4g} us; the least is "
            f"{100 * share:g} %"
        )
        return Plateau(None, balanced, pulse, reason, reason, reason)
    faults = {}
    for name, history in (("stress", reduction.stress[analysis]), ("rate", reduction.rate[analysis])):
        fault = flatness(moving_mean(history.value, width), reduction.time, span).fault
        faults[name] = None if fault is None else f"no plateau: the {name} {fault} along the span"
    reason = (
        f"from {1e6 * span.first:.4g} to {1e6 * span.last:.4g} us, balanced for {1e6 * balanced:.4g} us, "
        f"{100 * balanced / pulse:.0f} % of the pulse"
    )
    if faults["stress"] is not None and faults["rate"] is not None:
        return Plateau(None, balanced, pulse, faults["stress"], faults["stress"], faults["rate"])
    return Plateau(span, balanced, pulse, reason, faults["stress"], faults["rate"])


def flatness(value: FloatArray, time: FloatArray, span: Span) -> Flatness:
    """Change and scatter of a history by the weighted least-squares line along a span."""
    w = span.weight / span.weight.sum()
    mean, middle = float(w @ value), float(w @ time)
    centred = time - middle
    slope = float((w * centred) @ value) / float(w @ centred**2)
    left = value - mean - slope * centred
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.float64(slope * (span.last - span.first)) / np.float64(mean)
        scatter = np.float64(np.sqrt(w @ left**2)) / np.float64(abs(mean))
    return Flatness(float(change), float(scatter))


def weighted_mean(history: History, span: Span, *, alike: float = 1.0) -> tuple[float, float]:
    """Weighted mean of a history and the sigma of its noise, sqrt(alike sum (w s)^2) / sum w.

    ``history``: the history; `alike` successive samples share one independent noise value. ``span``: the
    samples' weights. ``alike``: number of samples per independent one [-], >= 1.
    """
    w, total = span.weight, float(span.weight.sum())
    sigma = float(np.sqrt(alike * ((w * history.sigma) ** 2).sum())) / total
    return float(w @ history.value) / total, sigma


def pulse_length(faces: FaceWaves, width: int) -> float:
    """Time from the first to the last sample of the incident wave above half its largest value [s]."""
    size = np.abs(moving_mean(faces.incident, width))
    above = np.flatnonzero(size > 0.5 * size.max())
    return float(faces.time[above[-1]] - faces.time[above[0]])


def _crossing(time: FloatArray, value: FloatArray, index: int, toward: int, level: float) -> float:
    """Time at which the line from sample `index` to its outer neighbour falls to the level [s]."""
    other = index + toward
    if not 0 <= other < value.size:
        return float(time[index])
    share = (value[index] - level) / (value[index] - value[other])
    return float(time[index] + share * (time[other] - time[index]))


VALIDITY_SHARE = 0.05
"""Default for the largest share of the stress that inertia, or the difference of the faces, may have [-]."""
COVERAGE = 2.0
"""Number of standard uncertainties that must also be within the share [-]."""
NEARLY_EMPTY = 0.2
"""Share of the strain below which a window is nearly empty [-]."""


class Reason(StrEnum):
    """Validity of a time: the reason why it is excluded, or that it is valid."""

    VALID = "within the share"
    BALANCE = "the forces on the two faces differ"
    INERTIA = "inertia"
    NOISE = "the stress does not stand out of its noise"
    RECORD = "the record"


@dataclass(frozen=True)
class Validity:
    """The longest span of a shot in which a classical reduction is valid."""

    window: tuple[float, float] | None
    """First and last time [s]; None if no time is valid."""
    strain: tuple[float, float] | None
    """Smallest and largest nominal compression in the window [-]."""
    start_reason: Reason
    """Reason that excludes the times before the window. Without a window, the reason that excludes all
    times."""
    end_reason: Reason
    """Reason that excludes the times after it."""
    share: float
    """Share of the stress that was allowed [-]."""
    covered: float
    """Strain in the window divided by the strain of the test [-]."""
    counts: Mapping[Reason, float]
    """Share of the averaged times by reason [-]."""
    time: FloatArray
    """Middles of the averaging intervals [s], shape [n]."""
    imbalance: FloatArray
    """|F1 - F2| divided by the mean force at each of these times [-], shape [n]; inf if the mean is zero."""
    inertia: FloatArray
    """Inertial part of the mean stress, divided by the mean stress [-], shape [n]; inf if the mean is
    zero."""
    reasons: tuple[Reason, ...]
    """The reason at each of these times, length n."""

    @property
    def nearly_empty(self) -> bool:
        """True if the window excludes most of the test's strain."""
        return self.covered < NEARLY_EMPTY

    @property
    def sentence(self) -> str:
        """The window in words, with a remedy for an empty one."""
        limit = f"{100.0 * self.share:g} % of the stress"
        if self.window is None or self.strain is None or self.window[0] == self.window[1]:
            text = f"at no time are inertia and the faces' difference within {limit} ({self.start_reason})"
        else:
            (start, end), (low, high) = self.window, self.strain
            text = (
                f"within {limit} from {1e6 * start:.1f} us to {1e6 * end:.1f} us, strain {low:.3f} to "
                f"{high:.3f}, {100.0 * self.covered:.0f} % of the test's; before it: {self.start_reason}; "
                f"after it: {self.end_reason}"
            )
        if self.nearly_empty:
            text += (
                "; a classical curve of this shot would show waves and inertia more than the material: use "
                "the inverse method (kolsky identify), which takes both into account"
            )
        return text


def validity(
    time: ArrayLike,
    front_force: History,
    back_force: History,
    strain: History,
    *,
    inertial_stress: ArrayLike,
    area: float,
    share: float = VALIDITY_SHARE,
    average: float = 0.0,
) -> Validity:
    """The validity window of a shot.

    The histories are averaged over intervals, because noise would otherwise divide the window. An interval is
    valid if two ratios are within `share`, with `COVERAGE` sigmas on both sides. The first ratio is the
    difference of the forces over their mean. The second is the inertial stress over the mean stress.

    Raises ValueError if shapes differ, if an option is outside its range, or if the averaging gives fewer
    than 3 intervals.

    ``time``: times [s], uniform, shape [n]. ``front_force``, ``back_force``: forces on the specimen's faces,
    the front one after mass compensation [N]. ``strain``: nominal compression [-]. ``inertial_stress``:
    contribution of radial and axial inertia to the nominal stress [Pa], shape [n]; see
    `kolsky.bars.reduction.inertia`. ``area``: cross-section of the specimen before the test [m^2]. ``share``:
    largest share of the stress that inertia, or the difference of the forces, may have [-], in (0, 1).
    ``average``: length of the averaging intervals [s]; 0: no averaging. Noise is taken as white.
    """
    t, extra = np.asarray(time, dtype=np.float64), np.asarray(inertial_stress, dtype=np.float64)
    values = {"front_force": front_force.value, "back_force": back_force.value, "strain": strain.value}
    check_shape((t.size,), time=t, **values, inertial_stress=extra)
    check_interval("(0, inf) m^2", area=area)
    check_interval("(0, 1)", share=share)
    check_interval("[0, inf) s", average=average)
    n = 1 if average == 0.0 else max(1, round(average / float(np.median(np.diff(t)))))
    if t.size // n < 3:
        raise ValueError(
            f"averaging over {average:.3g} s leaves {t.size // n} intervals, at least 3 are needed: average "
            "over less"
        )
    middle, front, back, e, added = (
        _mean(x, n) for x in (t, front_force.value, back_force.value, strain.value, extra * area)
    )
    noise = np.hypot(_sigma(front_force.sigma, n), _sigma(back_force.sigma, n))
    mean, apart = 0.5 * (front + back), np.abs(front - back)
    unsure, allowed = COVERAGE * noise, share * np.maximum(mean, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        imbalance = np.where(mean > 0.0, apart / mean, np.inf)
        inertia = np.where(mean > 0.0, np.abs(added) / mean, np.inf)
    differs = (apart > allowed) & (apart > unsure)
    heavy = (np.abs(added) > allowed) & (np.abs(added) > unsure)
    # The larger of the two is reported. The noise is reported only if neither exceeds the share.
    which = np.select(
        [differs & ~(heavy & (inertia > imbalance)), heavy, (unsure > allowed) | (mean <= 0.0)], [0, 1, 2], 3
    )
    names = [Reason.BALANCE, Reason.INERTIA, Reason.NOISE, Reason.VALID]
    return _window(middle, e, imbalance, inertia, which, names, share)


def _window(
    time: FloatArray,
    strain: FloatArray,
    imbalance: FloatArray,
    inertia: FloatArray,
    which: NDArray[np.int64],
    names: list[Reason],
    share: float,
) -> Validity:
    valid = which == 3
    reasons = tuple(names[i] for i in which)
    span = max(_runs(valid), key=lambda run: run[1] - run[0], default=None)
    counts = {name: float(np.mean(which == i)) for i, name in enumerate(names)}
    if span is None:
        worst = max(names[:3], key=lambda name: counts[name])
        return Validity(None, None, worst, worst, share, 0.0, counts, time, imbalance, inertia, reasons)
    first, last = span
    low, high = float(strain[first : last + 1].min()), float(strain[first : last + 1].max())
    return Validity(
        window=(float(time[first]), float(time[last])),
        strain=(low, high),
        start_reason=reasons[first - 1] if first else Reason.RECORD,
        end_reason=reasons[last + 1] if last + 1 < time.size else Reason.RECORD,
        share=share,
        covered=(high - low) / float(strain.max()) if strain.max() > 0.0 else 0.0,
        counts=counts,
        time=time,
        imbalance=imbalance,
        inertia=inertia,
        reasons=reasons,
    )


def _mean(x: FloatArray, n: int) -> FloatArray:
    return np.asarray(x[: x.size // n * n].reshape(-1, n).mean(axis=1))


def _sigma(x: FloatArray, n: int) -> FloatArray:
    return np.asarray(np.sqrt(_mean(x**2, n) / n))
