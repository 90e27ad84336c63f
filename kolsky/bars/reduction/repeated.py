"""Reductions of repeated tests to one curve: stress or rate over strain, or any history over time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kolsky.bars.records import History, Reduction
from kolsky.bars.reduction.repeats import Curve, Repeats, average
from kolsky.base.arrays import FloatArray

QUANTITIES = ("stress", "rate", "strain")
AXES = ("strain", "time")


@dataclass(frozen=True)
class RepeatedTests:
    """The mean of repeated tests, its scatter, and what the tests have in common."""

    quantity: str
    """"stress", "rate" or "strain"."""
    over: str
    """"strain" or "time"."""
    unit: str
    """Unit of the quantity."""
    repeats: Repeats
    """Mean, scatter and single tests on the common axis."""
    shared: FloatArray
    """Standard uncertainty that repeating does not lower, shape [n]."""

    def history(self) -> History:
        """The mean with its combined standard uncertainty, Eq. (U.16)."""
        return History(self.repeats.mean, self.repeats.combined(self.shared)[0], self.unit)

    def band(self, probability: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Confidence band of the mean, scatter and shared parts together, shape [n] both ends."""
        return self.repeats.band(probability, shared=self.shared)


def repeated_tests(
    reductions: Mapping[str, Reduction],
    *,
    quantity: str = "stress",
    over: str = "strain",
    way: str = "three waves",
    points: int | None = None,
) -> RepeatedTests:
    """Average a history of several tests.

    Over strain only the loading counts, the longest stretch of each test in which its strain increases; a
    remark says from where to where. The standard uncertainties of the single tests, which all rest on the
    same bars, gauges and instruments, are taken as shared, their noise with them: where it matters, the band
    is on the safe side by it.

    Parameters
    ----------
    reductions
        Reductions by the names of the tests, with their full bands (`kolsky.bars.reduction.analyse`).
    quantity
        A key of `QUANTITIES`.
    over
        "strain" or "time"; "strain" not for the strain itself.
    way
        "one wave", "two waves" or "three waves".
    points
        Points of the common axis; see `kolsky.bars.reduction.repeats.average`.

    Raises
    ------
    ValueError
        If an option is unknown, or as `kolsky.bars.reduction.repeats.average`.
    """
    if quantity not in QUANTITIES or over not in AXES or quantity == over:
        raise ValueError(
            f"quantity must be one of {', '.join(QUANTITIES)} over one of {', '.join(AXES)} and not over"
            f" itself, got {quantity!r} over {over!r}"
        )
    curves, remarks, unit = [], [], ""
    for name, reduction in reductions.items():
        kinds = getattr(reduction, quantity)
        if way not in kinds:
            raise ValueError(f"{name}: no analysis is called {way!r}; there are {', '.join(kinds)}")
        history: History = kinds[way]
        unit = history.unit
        inside = slice(None)
        axis = reduction.time
        if over == "strain":
            axis = reduction.strain[way].value
            inside = rising(axis)
            first, last = axis[inside][0], axis[inside][-1]
            if inside.start or inside.stop < axis.size:
                remarks.append(f"{name}: loading from strain {first:.4g} to {last:.4g}, the rest is cut off")
        curves.append(Curve(name, axis[inside], history.value[inside], history.sigma[inside]))
    found = average(curves, points=points)
    assert found.within is not None  # every curve has its sigma
    return RepeatedTests(
        quantity=quantity,
        over=over,
        unit=unit,
        repeats=Repeats(
            axis=found.axis,
            values=found.values,
            mean=found.mean,
            scatter=found.scatter,
            within=None,  # it is what is shared here, not what differs from test to test
            remarks=(*remarks, *found.remarks),
        ),
        shared=found.within,
    )


def rising(value: FloatArray) -> slice:
    """The longest stretch of samples in which each is larger than the one before; of equals the first.

    Raises
    ------
    ValueError
        If no sample is larger than the one before.
    """
    up = np.concatenate([[False], np.diff(value) > 0.0, [False]])
    starts = np.flatnonzero(~up[:-1] & up[1:])
    stops = np.flatnonzero(up[:-1] & ~up[1:])
    if not starts.size:
        raise ValueError("the strain does not increase anywhere")
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]) + 1)
