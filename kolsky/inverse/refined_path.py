"""The front face's path moved again, by what the refined mesh leaves of the data.

The path's modes have got their amplitudes on the surrogate's mesh (`kolsky.inverse.surrogate_mesh_search`),
whose ringing is weaker and slower than the refined one's: part of what they explain there is that mesh's own
error. On the refined mesh such a path rings too much, and a damping that is too large makes up for it. So the
amplitudes are found again from the residual of the refined mesh's optimum, the path is moved to them, and the
optimum searched for under it, until they stay. No new patterns are needed: at the end the path is right
whatever their size is, for the most likely amplitudes are then those that the model is run with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kolsky.base.arrays import FloatArray
from kolsky.inverse.likely_path import credible, likely_amplitudes
from kolsky.inverse.objective import Objective
from kolsky.inverse.path_modes import size
from kolsky.inverse.refined_run import RefinedRun
from kolsky.inverse.staged_runs import StagedRuns

MOST_MOVES = 2
"""Most moves of the path: each leaves of its error the share by which the patterns are wrong."""
SAME = 0.2
"""Root mean square of the amplitudes' changes, each standard normal beforehand, that are left [-]."""


Search = Callable[[StagedRuns, Objective, FloatArray, FloatArray], tuple[RefinedRun, FloatArray]]
"""From slopes, shape [k, d], and a start, shape [d], to the optimum on the refined mesh and its slopes."""


def follow_on_refined(
    stages: StagedRuns, objective: Objective, slope: FloatArray, last: RefinedRun, search: Search
) -> tuple[RefinedRun, FloatArray]:
    """The optimum on the refined mesh under the path that its own residual asks for, and its slopes, [k, d].

    Where the surrogate's mesh has not moved the path, or the search has not come to rest, nothing changes.

    Parameters
    ----------
    stages
        The identification's simulations.
    objective
        Which outline points count, and the prior.
    slope
        Shape [k, d].
    last
        The optimum on the refined mesh under the path as the surrogate's mesh has left it.
    search
        How the optimum is found again under another path.
    """
    for _ in range(MOST_MOVES):
        front, weighed = stages.front, last.step.objective
        if front is None or not last.confirmed:
            break
        amplitudes = likely_amplitudes(weighed, weighed.data - last.vector)
        if not credible(amplitudes) or size(amplitudes - front.amplitudes) <= SAME:
            break
        stages.follow(replace(front, amplitudes=amplitudes))
        seen = replace(objective, observations=stages.observations)
        last, slope = search(stages, seen, slope, last.x)
    return last, slope
