"""Other valleys of a free Poisson's ratio, for a changed input and for none.

The force rings, and its misfit along a free Poisson's ratio has a valley wherever the model's oscillations
fall in step with the measured ones (`kolsky.inverse.valleys`). A clock that is put right shifts the measured
ones against the model's: the ratio in step with them lies in another valley than before, and no Gauss-Newton
step leads from one to the other. So Poisson's ratio is scanned about the starts of the search, with the input
as changed there. What is left without a change has the same freedom: else an input would be given what
another valley alone explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.candidate_input import DECLARED, CandidateInput
from kolsky.diagnosis.cause_fit import solve_linear
from kolsky.diagnosis.cause_model import Point
from kolsky.diagnosis.cause_search import CauseSearch
from kolsky.diagnosis.cause_trial import Trial
from kolsky.inverse.valleys import VALLEY, local_minima, oscillation_table

REACH = 1.0
"""Oscillations over the whole test to each side of a start: to the next valley of the whole force, between
which those of its harmonics lie."""
PHASE = 0.05
"""Step of the scan, in oscillations: those of a harmonic of the fourth order are in step over a quarter."""
FLOORS = 2
"""Most floors of valleys that are followed from a start."""

NOTHING = CandidateInput(
    key="",
    words="no input changed",
    check="",
    scan=(),
    step=1.0,
    typical=1.0,
    changed=lambda _: DECLARED,
)
"""The free parameters alone."""


def valley_is_free(search: CauseSearch) -> bool:
    """True if Poisson's ratio is free, so that a change may need another valley."""
    return VALLEY in search.stages.box.names


def in_valleys(search: CauseSearch, starts: Sequence[Trial]) -> list[Trial]:
    """The starts, the best of each input at the floor of another valley where a run finds that lower.

    Parameters
    ----------
    search
        The data and the model.
    starts
        Inputs at values, with the free parameters that suit them.

    Returns
    -------
    list of Trial
        As many; those that were scanned about as a run at their point finds them.
    """
    best: dict[str, int] = {}
    for n in sorted(range(len(starts)), key=lambda n: search.loss(starts[n].misfits)):
        best.setdefault(starts[n].candidate.key, n)
    found = list(starts)
    scanned = [starts[n] for n in best.values()]
    for n, start, floors in zip(best.values(), scanned, _floors(search, scanned), strict=True):
        measured = search.measured([start, *floors])
        if measured:
            found[n] = min(measured, key=lambda t: search.loss(t.misfits))
    return found


def _floors(search: CauseSearch, starts: Sequence[Trial]) -> list[list[Trial]]:
    """At most `FLOORS` floors about each start, the lowest first, the other parameters by a linear step."""
    i = search.stages.box.names.index(VALLEY)
    rows = [(n, x) for n, t in enumerate(starts) for x in _along(search, t.x, i)]
    vectors = search.model.vectors([Point(x, starts[n].candidate.changed(starts[n].u)) for n, x in rows])
    others = np.arange(len(search.x)) != i
    trials: list[list[Trial]] = [[] for _ in starts]
    for (n, x), vector in zip(rows, vectors, strict=True):
        if not np.isfinite(vector[: search.n_force]).all():
            continue
        c, step = starts[n].candidate, np.zeros(len(x))
        fit = solve_linear(
            search.residual(vector), search.slope[:, others], search.expected, search.allowed(c)
        )
        step[others] = fit.step
        misfits = search.expected.misfits(fit.residual)
        x = search.clipped(x + step)
        trials[n].append(replace(starts[n], x=x, misfits=misfits, residual=fit.residual))
    return [
        [row[j] for j in local_minima(np.array([search.loss(t.misfits) for t in row]))[:FLOORS]]
        for row in trials
    ]


def _along(search: CauseSearch, x: FloatArray, i: int) -> list[FloatArray]:
    """A point with Poisson's ratio, its entry i, at equal steps of the oscillations' number about it."""
    names, low, high = search.stages.box.names, search.model.lower[i], search.model.upper[i]
    factor = float(x[names.index("stiffness_factor")]) if "stiffness_factor" in names else 1.0
    values, number = oscillation_table(search.stages, factor, (low, high))
    steps = np.arange(-round(REACH / PHASE), round(REACH / PHASE) + 1)
    wanted = np.interp(x[i], values, number) + PHASE * steps
    inside = wanted[(wanted >= number[0]) & (wanted <= number[-1])]
    return [np.where(np.arange(len(x)) == i, one, x) for one in np.interp(inside, number, values)]


def without_change(search: CauseSearch) -> None:
    """Let evidence count against the best valley that the free parameters reach with no input changed."""
    start = Trial(NOTHING, search.at, 0.0, search.before, search.left)
    for found in search.followed(in_valleys(search, [start])):
        search.against(found)
