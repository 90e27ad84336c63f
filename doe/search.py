"""Nelder-Mead in the unit box, with an outcome for every search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from doe.arrays import FloatArray
from doe.box import Box


class SearchOutcome(Enum):
    """The outcome of a search."""

    CONVERGED = "converged"
    AT_BOUND = "at a bound"
    NOT_CONVERGED = "not converged"

    @property
    def ok(self) -> bool:
        """True when an optimum was found inside the box."""
        return self is SearchOutcome.CONVERGED

    @property
    def cause(self) -> str:
        """The cause in one sentence."""
        return _CAUSES[self][0]

    @property
    def cure(self) -> str:
        """The remedy, in one sentence."""
        return _CAUSES[self][1]


_CAUSES = {
    SearchOutcome.CONVERGED: (
        "the simplex shrank to the tolerance at one point twice, and no neighbour is lower",
        "nothing to do",
    ),
    SearchOutcome.AT_BOUND: (
        "the smallest value lies on a face of the box, so the optimum may lie beyond it",
        "widen the box at the parameters and sides named in at_bound, or fix those parameters",
    ),
    SearchOutcome.NOT_CONVERGED: (
        "max_evaluations was used up before the simplex shrank to the tolerance twice at one point",
        "raise max_evaluations or tolerance; if the function is noisy, smooth it first",
    ),
}


Objective = Callable[[FloatArray], float]

FIRST_EDGE = 0.25
"""Edge of the first simplex in the unit box."""
RESTART_EDGE = 0.05
"""Edge of the simplex of a restart in the unit box."""
AGREEMENT = 10.0
"""Two results of a search count as equal if they differ by less than this many tolerances in the unit box.
The final simplex is smaller than one tolerance. Its distance from the optimum may be larger."""


@dataclass(frozen=True)
class SearchResult:
    """Result of a search."""

    x: FloatArray
    """The best point found, in parameter units, shape [d]."""
    value: float
    """The function there."""
    evaluations: int
    outcome: SearchOutcome
    at_bound: dict[str, str]
    """ "lower" or "upper" for each parameter within 10 tolerances of a face, also if the search did not
    converge."""


class _Recorder:
    """The function in unit coordinates. It records every call and rejects values that are not finite."""

    def __init__(self, function: Objective, box: Box) -> None:
        self.function, self.box = function, box
        self.unit: list[FloatArray] = []
        self.points: list[FloatArray] = []
        self.values: list[float] = []

    def __call__(self, unit_point: FloatArray) -> float:
        point = self.box.scale(unit_point)
        # A copy: a function that changes its argument must not change the simplex.
        value = float(self.function(point.copy()))
        if not np.isfinite(value):
            where = ", ".join(f"{name} = {x:.12g}" for name, x in self.box.as_dict(point).items())
            raise ValueError(f"the function is {value} at {where}; it must be finite everywhere in the box")
        self.unit.append(np.array(unit_point))
        self.points.append(point)
        self.values.append(value)
        return value

    @property
    def best(self) -> int:
        return int(np.argmin(self.values))


def nelder_mead(
    function: Objective,
    box: Box,
    *,
    start: ArrayLike | None = None,
    tolerance: float = 1e-6,
    max_evaluations: int = 2000,
) -> SearchResult:
    """The minimum of a function in a box by the simplex method, restarted until the optimum is stable.

    A small simplex is not always at an optimum: it may have collapsed early, or the bounds may have flattened
    it onto a face. After convergence, both neighbours in every coordinate are therefore tried, 10 tolerances
    away. A new simplex is set up at the best point. The search ends when the best point has moved by no more
    than 10 tolerances and no neighbour is lower.

    Parameters
    ----------
    function
        Takes a point in parameter units, shape [d], and returns a finite number.
    box
        Where to search.
    start
        First vertex, in parameter units, shape [d]; the middle of the unit box if left out.
    tolerance
        The simplex has converged if it is smaller than this in the unit box, in [1e-9, 0.1). There is no
        tolerance for the value, because its scale is not known.
    max_evaluations
        Largest number of calls of the function, at least d + 1.

    Returns
    -------
    result
        The best point found; `result.outcome` is the outcome of the search.

    Raises
    ------
    ValueError
        If the start is outside the box, an option is outside its range, or the function is not finite.
    """
    d = box.dimension
    # Below 1e-9 the round-off of the value dominates: it moves a smooth minimum by about 1e-8.
    if not 1e-9 <= tolerance < 0.1:
        raise ValueError(f"tolerance must be in [1e-9, 0.1) of the unit box, got {tolerance}")
    if max_evaluations < d + 1:
        raise ValueError(f"max_evaluations must be at least {d + 1} (one simplex), got {max_evaluations}")
    recorder = _Recorder(function, box)
    centre = np.full(d, 0.5)
    if start is not None:
        inside = box.require(np.atleast_2d(np.asarray(start, dtype=np.float64)), what="start")
        if len(inside) != 1:
            raise ValueError(f"start must be one point of shape [{d}], got {len(inside)}")
        # `require` has rejected points outside. This removes the round-off of the conversion to unit
        # coordinates.
        centre = np.clip(box.unit(inside[0]), 0.0, 1.0)
    margin = AGREEMENT * tolerance
    side, edge = np.ones(d), FIRST_EDGE
    stayed = False
    while not stayed and len(recorder.values) < max_evaluations:
        solution = minimize(
            recorder,
            centre,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * d,
            options={
                "initial_simplex": _simplex(centre, side, edge),
                "xatol": tolerance,
                "fatol": np.inf,
                "maxfev": max_evaluations - len(recorder.values),
            },
        )
        end, value = recorder.unit[recorder.best], min(recorder.values)
        if not solution.success or len(recorder.values) + 2 * d > max_evaluations:
            break
        side = _poll(recorder, end, margin)
        distance = float(np.max(np.abs(end - centre)))
        stayed = edge == RESTART_EDGE and distance <= margin and min(recorder.values) == value
        centre, edge = recorder.unit[recorder.best], RESTART_EDGE
    return _result(recorder, stayed, margin)


def _simplex(unit_point: FloatArray, side: FloatArray, edge: float) -> FloatArray:
    """A right-angled simplex at a point. Its edges are on the given sides where the box has room."""
    ends = unit_point + side * edge
    steps = np.where((ends < 0.0) | (ends > 1.0), -side, side) * edge
    return np.vstack([unit_point, unit_point + np.diag(steps)])


def _poll(recorder: _Recorder, unit_point: FloatArray, step: float) -> FloatArray:
    """Try a step to both sides in every coordinate; the side (+1 or -1) with the lower value, shape [d]."""
    sides = np.ones(len(unit_point))
    for j in range(len(unit_point)):
        lowest = np.inf
        for sign in (1.0, -1.0):
            trial = unit_point.copy()
            trial[j] += sign * step
            if 0.0 <= trial[j] <= 1.0:
                value = recorder(trial)
                if value < lowest:
                    lowest, sides[j] = value, sign
    return sides


def _result(recorder: _Recorder, converged: bool, margin: float) -> SearchResult:
    best = recorder.best
    unit_point = recorder.unit[best]
    at_bound = {
        name: "lower" if u <= margin else "upper"
        for name, u in zip(recorder.box.names, unit_point, strict=True)
        if u <= margin or u >= 1.0 - margin
    }
    outcome = SearchOutcome.NOT_CONVERGED
    if converged:
        outcome = SearchOutcome.AT_BOUND if at_bound else SearchOutcome.CONVERGED
    return SearchResult(
        x=recorder.points[best], value=recorder.values[best], evaluations=len(recorder.values),
        outcome=outcome, at_bound=at_bound,
    )  # fmt: skip
