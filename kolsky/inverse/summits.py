"""The summit of the likelihood beside the floor of a valley along Poisson's ratio.

Least squares that do not know the noise of the flyer's motion have a minimum wherever the model's ringing
falls in step with a ringing that this noise has put off by half an oscillation or a whole one. The likelihood
that knows the noise has one summit within some oscillations. It is climbed from a floor in steps of half an
oscillation over the whole test, each place with the patterns of the noise that ring at its own frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.observations import Prediction
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.valleys import MOTIONS, VALLEY, judged, oscillation_table, patterns_of

STRIDE = 0.5
"""Distance of neighbouring places, in oscillations over the whole test: minima of least squares are half an
oscillation apart or more."""
AHEAD = 2
"""Places that are run at once to a side: one oscillation."""
OTHER = 2.0
"""Oscillations from a summit beyond which a floor is of another valley [-]."""
FARTHEST = 8
"""Most places from the floor: the next valleys that the scan has found lie about there."""


@dataclass(frozen=True)
class Summit:
    """The likeliest place about a floor."""

    x: FloatArray
    """In parameter units, shape [d]."""
    patterns: FloatArray
    """Of the flyer's noise there, one standard deviation a mode, shape [q, n_bins + n_points]."""
    strides: int
    """Places from the floor, positive toward a higher Poisson's ratio."""
    runs: Prediction
    """Under other motions there, the fitted one's first."""
    margin: float = np.inf
    """-2 ln of likelihood and prior of the next valley's floor less that of the summit [-]; infinite where
    the scan found no other valley."""


def climb(
    stages: StagedRuns, floor: FloatArray, runs: Prediction, numerics: Numerics, inside: BoolArray
) -> Summit:
    """The summit that is reached from a floor, all other parameters as they are there.

    Parameters
    ----------
    stages
        The identification's simulations.
    floor
        Where to begin, in parameter units, shape [d].
    runs
        What `MOTIONS` other motions of the flyer do there, the fitted one's first.
    numerics
        Of the runs.
    inside
        Outline points that count, shape [n_points].
    """
    box = stages.box
    i = box.names.index(VALLEY)
    factor = float(floor[box.names.index(MOVED)]) if MOVED in box.names else 1.0
    table, number = oscillation_table(stages, factor, (box.lower[i], box.upper[i]))
    middle = float(np.interp(floor[i], table, number))
    places: dict[int, tuple[FloatArray, Prediction | None]] = {0: (floor, runs)}
    deviations = stages.front_deviations(MOTIONS)
    best, new = 0, strides_beside(0, {0})
    while True:
        new = [k for k in new if number[0] <= middle + STRIDE * k <= number[-1]]
        if not new:
            break
        points = np.tile(floor, (len(new), 1))
        points[:, i] = np.interp(middle + STRIDE * np.array(new), number, table)
        found = stages.under_other_motions(points, deviations, numerics)
        places |= dict(zip(new, zip(points, found, strict=True), strict=True))
        order = sorted(places)
        at = np.array([places[k][0] for k in order])
        best = order[int(np.argmin(judged(stages, at, [places[k][1] for k in order], inside)))]
        new = strides_beside(best, set(places))
    x, prediction = places[best]
    assert prediction is not None  # a lost run is infinitely unlikely, and the floor's is not lost
    return Summit(x, patterns_of(stages, prediction), best, prediction)


def likeliest(stages: StagedRuns, floors: FloatArray, numerics: Numerics, inside: BoolArray) -> Summit:
    """The summit from the likeliest of some valleys' floors, and what the next is short of it.

    Parameters
    ----------
    stages, numerics, inside
        As of `climb`.
    floors
        In parameter units, shape [n, d].

    Raises
    ------
    ValueError
        If the run at no floor completes.
    """
    runs = stages.under_other_motions(floors, stages.front_deviations(MOTIONS), numerics)
    first = int(np.argmin(judged(stages, floors, runs, inside)))
    found = runs[first]
    if found is None:
        raise ValueError("no run at a floor of the valleys of Poisson's ratio completed")
    summit = climb(stages, floors[first], found, numerics, inside)
    at = np.vstack([summit.x, floors])
    values = judged(stages, at, [summit.runs, *runs], inside)
    apart = np.abs(turns_of(stages, at) - turns_of(stages, summit.x[None]))
    return replace(summit, margin=margin(values, apart))


def margin(values: FloatArray, apart: FloatArray) -> float:
    """By how much the likeliest of other valleys is short of a summit [-].

    Parameters
    ----------
    values
        -2 ln of likelihood and prior, the summit's first, shape [n].
    apart
        Oscillations from the summit [-], shape [n]; within `OTHER` of it a floor is on its slope.
    """
    others = values[apart > OTHER]
    return float(np.min(others, initial=np.inf) - values[0])


def turns_of(stages: StagedRuns, points: FloatArray) -> FloatArray:
    """Oscillations over the whole test at points of shape [n, d], shape [n]; all with the first one's
    stiffness."""
    box = stages.box
    i = box.names.index(VALLEY)
    factor = float(points[0, box.names.index(MOVED)]) if MOVED in box.names else 1.0
    table, number = oscillation_table(stages, factor, (box.lower[i], box.upper[i]))
    return np.asarray(np.interp(points[:, i], table, number))


def strides_beside(best: int, known: set[int]) -> list[int]:
    """Places to run next: `AHEAD` of them on each side of the best one where nothing is known next to it.

    Parameters
    ----------
    best
        The likeliest place so far.
    known
        Places that have been run.
    """
    found = []
    for side in (-1, 1):
        if best + side not in known:
            found += [best + side * step for step in range(1, AHEAD + 1)]
    return sorted(k for k in found if k not in known and abs(k) <= FARTHEST)
