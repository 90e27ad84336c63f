"""Searches from the best points of a design, with every start's result kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.arrays import FloatArray
from doe.designs import Design
from doe.search import AGREEMENT, Objective, SearchResult, evaluate, nelder_mead


@dataclass(frozen=True)
class MultiStart:
    """Searches from several starts, none thrown away."""

    results: tuple[SearchResult, ...]
    """One result a start, best value first."""
    distances: FloatArray
    """Largest coordinate difference of each result from the best, in the unit box [-], shape [n_starts]."""
    excesses: FloatArray
    """Value of each result minus the best, shape [n_starts]."""
    agreement: float
    """Distance in the unit box below which two results are one [-]."""

    @property
    def best(self) -> SearchResult:
        """The result with the smallest value."""
        return self.results[0]

    @property
    def disagreeing(self) -> tuple[SearchResult, ...]:
        """Results that ended elsewhere than the best: other minima, or searches cut short."""
        return tuple(r for r, away in zip(self.results, self.distances, strict=True) if away > self.agreement)

    @property
    def agree(self) -> bool:
        """True when all starts ended at one point."""
        return not self.disagreeing


def multi_start(
    function: Objective,
    design: Design,
    *,
    n_starts: int = 3,
    tolerance: float = 1e-6,
    max_evaluations: int = 2000,
) -> MultiStart:
    """Searches from the best points of a design.

    Parameters
    ----------
    function
        Takes a point in parameter units, shape [d], and returns a finite number.
    design
        Where to look first; its box is searched.
    n_starts
        Number of searches, between 1 and the number of points in the design.
    tolerance, max_evaluations
        Of each search, see `doe.search.nelder_mead`; the evaluations at the design's points are not counted.

    Raises
    ------
    ValueError
        If `n_starts` is outside its range, or for what `doe.search.nelder_mead` refuses.
    """
    if not 1 <= n_starts <= len(design):
        raise ValueError(f"n_starts must be in [1, {len(design)}] (points in the design), got {n_starts}")
    box = design.box
    values = [evaluate(function, box, point) for point in design.points]
    starts = design.points[np.argsort(values, kind="stable")[:n_starts]]
    results = [
        nelder_mead(function, box, start=start, tolerance=tolerance, max_evaluations=max_evaluations)
        for start in starts
    ]
    results.sort(key=lambda result: result.value)
    ends = box.unit(np.stack([result.x for result in results]))
    distances = np.abs(ends - ends[0]).max(axis=1)
    excesses = np.array([result.value - results[0].value for result in results])
    # Two ends, each within AGREEMENT tolerances of the same optimum.
    return MultiStart(tuple(results), distances, excesses, 2.0 * AGREEMENT * tolerance)
