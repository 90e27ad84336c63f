"""Events of a flyer test, found in its signals: the features of Mates et al. (2012), Fig. 5."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.bars.impact import FlightHistory


@dataclass(frozen=True)
class Events:
    """Times since the striker touched [s]; NaN for what did not happen before the end."""

    striker_parts: float
    """The striker lets go of the incident bar for good."""
    incident_rise: float
    """The compressive wave arrives: 1 % of the largest force on the joint before it opens."""
    tensile_dip: float
    """The joint's force becomes tensile."""
    separation: float
    """The joint has broken and its last force is gone."""
    arrest: float
    """The flyer stands still relative to the transmission platen: largest compression."""
    push_back: float
    """The specimen pushes the flyer back: after the arrest the transmitted force falls to half its peak."""
    second_impact: float
    """The flyer runs into the incident bar."""


def find_events(history: FlightHistory) -> Events:
    """Find the features of a flyer test in its signals."""
    t, hold, gap = history.times, history.joint_force, history.joint_gap
    opens = _first(gap > 0.0)
    peak = float(hold[:opens].max(initial=0.0))
    rise = _first(hold >= 0.01 * peak) if peak > 0.0 else None
    dip = _first(hold < 0.0, rise)
    apart = _first((hold == 0.0) & (gap > 0.0), dip)
    again = _first((gap == 0.0) & (hold > 0.0), apart)
    arrest = _summit(history.compression, apart, again)
    force = history.force_transmission[: len(t) if again is None else again]
    back = _first(force <= 0.5 * force.max(initial=0.0), arrest)
    pressed = np.flatnonzero(history.shaper_force > 0.0)
    parts = int(pressed[-1]) + 1 if pressed.size and pressed[-1] + 1 < len(t) else None

    def at(index: int | None) -> float:
        return float("nan") if index is None else float(t[index])

    return Events(at(parts), at(rise), at(dip), at(apart), at(arrest), at(back), at(again))


def _summit(signal: FloatArray, after: int | None, before: int | None) -> int | None:
    """Index of the largest value in a range; None if the signal still rises at its end."""
    if after is None:
        return None
    part = signal[after:before]
    top = int(np.argmax(part))
    return None if top == len(part) - 1 else after + top


def _first(happens: NDArray[np.bool_], after: int | None = 0) -> int | None:
    """First index not before `after` at which something happens; None if it or `after` is missing."""
    if after is None:
        return None
    found = np.flatnonzero(happens[after:])
    return after + int(found[0]) if found.size else None
