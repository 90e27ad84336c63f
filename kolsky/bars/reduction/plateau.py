"""Plateau of a test: the span whose mean stress and mean rate may be quoted, or why there is none."""

from dataclasses import dataclass

import numpy as np

from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.bars.reduction.equilibrium import ALLOWANCE
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.arrays import FloatArray

LEVEL = 0.8
"""Share of the typical stress, the median of what exceeds half the largest, at which the plateau begins and
ends [-]."""
SHARE = 0.3
"""Least balanced length of a plateau as a share of the incident pulse's, at half its height [-]."""
LARGEST_CHANGE = 0.2
"""Largest change of a history along the plateau, by its best line, over its mean [-]."""
LARGEST_SCATTER = 0.1
"""Largest root mean square of what that line leaves, over the mean [-]."""
INSET = 0.1
"""Share of the length between those two times that is left out at either end [-]: the rounded corners."""
END_SIGMA = 0.05
"""Standard uncertainty of the choice of either end, as a share of the plateau's length [-]."""
ENDS = ("plateau, beginning", "plateau, end")
"""Names of the budget's inputs that move the ends [s]."""


@dataclass(frozen=True)
class Span:
    """A time span and what each sample counts in its means."""

    first: float
    """Its beginning [s]."""
    last: float
    """Its end [s]."""
    weight: FloatArray
    """Weight of each sample in [0, 1]: the share of its interval within the span, times its balance; shape
    [n]."""


@dataclass(frozen=True)
class Flatness:
    """How flat a history is along a span."""

    change: float
    """Change along the span by the best line, over the mean [-]."""
    scatter: float
    """Root mean square of what the line leaves, over the mean's size [-]."""

    @property
    def fault(self) -> str | None:
        """What is beyond its limit, in words; None if nothing is."""
        if not abs(self.change) <= LARGEST_CHANGE:
            return f"changes by {100 * self.change:+.0f} % (allowed are {100 * LARGEST_CHANGE:g} %)"
        if not self.scatter <= LARGEST_SCATTER:
            return f"scatters by {100 * self.scatter:.0f} % (allowed are {100 * LARGEST_SCATTER:g} %)"
        return None


@dataclass(frozen=True)
class Plateau:
    """The plateau of a test, or the reasons why its means are not quoted."""

    span: Span | None
    """The span; None if there is no plateau."""
    balanced: float
    """Balanced length of the span that was judged [s]."""
    pulse: float
    """Length of the incident pulse at half its height [s]."""
    reason: str
    """The plateau in words, or why there is none."""
    stress_fault: str | None = None
    """Why no mean stress is quoted; None if one is."""
    rate_fault: str | None = None
    """Why no mean rate is quoted; None if one is."""


def averaging_width(faces: FaceWaves) -> int:
    """Samples in the time that a wave needs to cross the thicker bar, at least 1."""
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
    """The part of the loading in which the stress stands, each sample weighted by its balance.

    The stress, averaged over `width` samples, stands from where it first exceeds `LEVEL` of its typical value
    to where it last does, at the latest to the largest strain; `INSET` of that is left out at either end. A
    sample counts in full while
    |R| is within the allowance, not at all beyond twice the allowance, and in proportion between. Ends and
    weights are continuous in all inputs, so that a small change of an input moves the means a little.

    Parameters
    ----------
    reduction
        The reduction.
    analysis
        "one wave", "two waves" or "three waves".
    allowance
        |R| up to which the forces count as balanced [-].
    width
        Samples over which the stress is averaged.
    shift
        Times by which beginning and end are moved [s].

    Returns
    -------
    Span or None
        None if no sample has a weight.
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
    share: float = SHARE,
) -> Plateau:
    """The plateau of a test, if it is long enough, and whether stress and rate are flat on it.

    Parameters
    ----------
    reduction, analysis, allowance
        As for `find_span`.
    faces
        The waves it was made from.
    share
        Least balanced length as a share of the incident pulse's [-].

    Returns
    -------
    Plateau
    """
    width = averaging_width(faces)
    span = find_span(reduction, analysis=analysis, allowance=allowance, width=width)
    pulse = pulse_length(faces, width)
    step = float(reduction.time[1] - reduction.time[0])
    balanced = 0.0 if span is None else step * float(span.weight.sum())
    if span is None or balanced < share * pulse:
        reason = (
            f"no plateau: while the stress stands the forces are balanced for {1e6 * balanced:.3g} us, "
            f"{100 * balanced / pulse:.0f} % of the pulse of {1e6 * pulse:.4g} us; it takes {100 * share:g} %"
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
    """Change and scatter of a history by the weighted least-squares line along a span.

    Parameters
    ----------
    value
        The history, shape [n].
    time
        Its times [s], shape [n].
    span
        The span with the samples' weights.
    """
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

    Parameters
    ----------
    history
        The history; its noise is independent from one of `alike` samples to the next.
    span
        The samples' weights.
    alike
        Samples for each independent one [-], >= 1.
    """
    w, total = span.weight, float(span.weight.sum())
    sigma = float(np.sqrt(alike * ((w * history.sigma) ** 2).sum())) / total
    return float(w @ history.value) / total, sigma


def pulse_length(faces: FaceWaves, width: int) -> float:
    """Time from the first to the last sample of the incident wave beyond half its largest value [s]."""
    size = np.abs(moving_mean(faces.incident, width))
    above = np.flatnonzero(size > 0.5 * size.max())
    return float(faces.time[above[-1]] - faces.time[above[0]])


def _crossing(time: FloatArray, value: FloatArray, index: int, toward: int, level: float) -> float:
    """Time at which a line from sample `index` to the next one toward the outside falls to the level [s]."""
    other = index + toward
    if not 0 <= other < value.size:
        return float(time[index])
    share = (value[index] - level) / (value[index] - value[other])
    return float(time[index] + share * (time[other] - time[index]))
