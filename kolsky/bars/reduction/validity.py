"""Validity window of a shot: the times at which a classical stress-strain curve holds.

A classical reduction takes the forces on the two faces as one stress of one homogeneous strain. Two things
spoil it: the forces differ, because waves are still running through the specimen, and part of them is its
inertia. The window is where both stay below a stated share of the stress and the noise allows to say so.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kolsky.bars.records import History
from kolsky.base.arrays import BoolArray, FloatArray

SHARE = 0.05
"""Default share of the stress that inertia, or the difference of the faces, may have [-]."""
COVERAGE = 2.0
"""Standard uncertainties of the stress that must fit into the share [-]."""
NEARLY_EMPTY = 0.2
"""Share of the strain below which a window is called nearly empty [-]."""


class Reason(StrEnum):
    """Why a time does not count, or that it does."""

    VALID = "within the share"
    BALANCE = "the forces on the two faces differ"
    INERTIA = "inertia"
    NOISE = "the stress does not stand out of its noise"
    RECORD = "the record"


@dataclass(frozen=True)
class Validity:
    """The longest span of a shot in which a classical reduction holds."""

    window: tuple[float, float] | None
    """First and last time [s]; None if no time counts."""
    strain: tuple[float, float] | None
    """Smallest and largest nominal compression there [-]."""
    start_reason: Reason
    """Reason that excludes the times before the window, or all of them if there is no window."""
    end_reason: Reason
    """Reason that excludes the times after it."""
    share: float
    """Share of the stress that was allowed [-]."""
    covered: float
    """Strain in the window over the strain of the test [-]."""
    counts: Mapping[Reason, float]
    """Share of the averaged times by reason [-]."""
    time: FloatArray
    """Middles of the averaging intervals [s], shape [n]."""
    imbalance: FloatArray
    """|F1 - F2| over the mean force there [-], shape [n]; inf where that is zero."""
    inertia: FloatArray
    """Inertial part of the mean stress over it [-], shape [n]; inf where that is zero."""
    reasons: tuple[Reason, ...]
    """The reason at each of these times, length n."""

    @property
    def nearly_empty(self) -> bool:
        """True if the window leaves out most of the test's strain."""
        return self.covered < NEARLY_EMPTY

    @property
    def sentence(self) -> str:
        """The window in words, with what to do about an empty one."""
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
    share: float = SHARE,
    average: float = 0.0,
) -> Validity:
    """The validity window of a shot.

    The histories are averaged over intervals, so that noise which a reader's eye would average over does
    not cut the window. An interval counts if the difference of the forces over their mean, and the inertial
    stress over the mean stress, are within `share`, and `COVERAGE` sigmas of both sides are too.

    Parameters
    ----------
    time
        Times [s], uniform, shape [n].
    front_force, back_force
        Forces on the specimen's faces, the front one after mass compensation [N].
    strain
        Nominal compression [-].
    inertial_stress
        What inertia adds to the nominal stress, radial and axial together [Pa], shape [n]: see
        `kolsky.bars.reduction.inertia`.
    area
        Cross-section of the specimen before the test [m^2].
    share
        Share of the stress that may be inertia, and that the forces may differ by [-], in (0, 1).
    average
        Length of the averaging intervals [s]; each sample by itself if 0. Noise is taken as white.

    Raises
    ------
    ValueError
        If shapes differ, an option is outside its range, or the averaging leaves fewer than 3 intervals.
    """
    t, extra = np.asarray(time, dtype=np.float64), np.asarray(inertial_stress, dtype=np.float64)
    _check(t, (front_force.value, back_force.value, strain.value, extra), area, share, average)
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
    # Of the two the larger is named, and the noise only where neither stands out of it.
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
    span = _longest(valid)
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


def _longest(valid: BoolArray) -> tuple[int, int] | None:
    """First and last index of the longest run of True."""
    edges = np.diff(np.concatenate([[0], valid.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not starts.size:
        return None
    best = int(np.argmax(ends - starts))
    return int(starts[best]), int(ends[best]) - 1


def _mean(x: FloatArray, n: int) -> FloatArray:
    return np.asarray(x[: x.size // n * n].reshape(-1, n).mean(axis=1))


def _sigma(x: FloatArray, n: int) -> FloatArray:
    return np.asarray(np.sqrt(_mean(x**2, n) / n))


def _check(
    time: FloatArray, values: tuple[FloatArray, ...], area: float, share: float, average: float
) -> None:
    if any(value.shape != time.shape for value in values) or time.ndim != 1 or time.size < 3:
        raise ValueError(
            f"every history needs one value at each of {time.size} times, 3 or more; got"
            f" {', '.join(str(value.size) for value in values)}"
        )
    if not (area > 0.0 and 0.0 < share < 1.0 and average >= 0.0):
        raise ValueError(
            f"area must be > 0 m^2, share in (0, 1) and average >= 0 s, got {area:g}, {share:g}, {average:g}"
        )
