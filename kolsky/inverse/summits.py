"""The summit of the likelihood beside the floor of a valley along Poisson's ratio.

Least squares that do not know the noise of the flyer's motion have a minimum wherever the model's ringing
falls in step with a ringing that this noise has put off by half an oscillation or a whole one. The likelihood
that knows the noise has one summit within some oscillations. It is climbed from a floor in steps of half an
oscillation over the whole test, each place with the patterns of the noise that ring at its own frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    return Summit(x, patterns_of(stages, prediction), best)


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
