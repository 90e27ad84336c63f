"""Far values of every input, to find starts for the search: what one run or one fit tells of each.

Runs and fits take turns on two cores: while the runs of some inputs are at work, what needs no run, or has
its runs already, is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kolsky.diagnosis.candidate_input import CandidateInput
from kolsky.diagnosis.cause_fit import solve_linear
from kolsky.diagnosis.cause_model import Point
from kolsky.diagnosis.cause_search import CauseSearch
from kolsky.diagnosis.cause_trial import Trial

FINER = 6
"""Finer values tried to each side."""

Value = tuple[CandidateInput, float]
"""An input and a coordinate of it."""


def scanned(search: CauseSearch, candidates: Sequence[CandidateInput]) -> list[Trial]:
    """The best far values of every candidate, the free parameters by a linear step: starts.

    Those of narrow basins are run first, for finer values about the best of them follow. Where no core is
    idle beside runs, as on a GPU, all that do not depend on others are one launch.
    """
    narrow = _values(search, [c for c in candidates if c.finer > 0.0])
    others = [c for c in candidates if not c.finer > 0.0]
    altered = _values(search, [c for c in others if not c.simulated])
    simulated = _values(search, [c for c in others if c.simulated])
    first = narrow if search.model.beside else [*narrow, *simulated]
    with search.model.ahead(_points(search, first)):
        found = _tried(search, altered)
    with search.model.ahead(_points(search, simulated)):
        basins = least(search, _tried(search, narrow))
    steps = range(-FINER, FINER + 1)
    about = _inside([(t.candidate, t.u + n * t.candidate.finer) for t in basins for n in steps])
    with search.model.ahead(_points(search, about)):
        found += _tried(search, simulated)
    found.sort(key=lambda t: [c.key for c in others].index(t.candidate.key))
    return least(search, found) + least(search, _tried(search, about))


def _values(search: CauseSearch, candidates: Sequence[CandidateInput]) -> list[Value]:
    return _inside([(c, u) for c in candidates for u in c.scan])


def _inside(tried: Sequence[Value]) -> list[Value]:
    return [(c, u) for c, u in tried if c.lowest <= u <= c.highest]


def _points(search: CauseSearch, tried: Sequence[Value]) -> list[Point]:
    return [Point(search.x, c.changed(u)) for c, u in tried]


def _tried(search: CauseSearch, tried: Sequence[Value]) -> list[Trial]:
    """Each value with the free parameters by a linear step; those whose runs are lost are left out."""
    found = []
    for (c, u), vector in zip(tried, search.model.vectors(_points(search, tried)), strict=True):
        if not np.isfinite(vector[: search.n_force]).all():
            continue
        fit = solve_linear(search.residual(vector), search.slope, search.expected, search.allowed(c))
        x = search.clipped(search.x + fit.step)
        found.append(Trial(c, x, u, search.expected.misfits(fit.residual), fit.residual))
    return found


def least(search: CauseSearch, tried: Sequence[Trial]) -> list[Trial]:
    """Of each candidate the two values from which both neighbours are worse, as ringing has several."""
    trials: dict[str, list[Trial]] = {}
    for t in tried:
        trials.setdefault(t.candidate.key, []).append(t)
    found = []
    for row in trials.values():
        row.sort(key=lambda t: t.u)
        losses = [search.loss(t.misfits) for t in row]
        lowest = [i for i in range(len(row)) if losses[i] <= min(losses[max(i - 1, 0) : i + 2])]
        found += [row[i] for i in sorted(lowest, key=lambda i: losses[i])[:2]]
    return found
