"""The front face's path moved again, by what the refined mesh leaves of the data.

The path's modes have got their amplitudes on the surrogate's mesh (`kolsky.inverse.surrogate_mesh_search`),
whose ringing is weaker and slower than the refined one's: part of what they explain there is that mesh's own
error, and late in a test its patterns are out of step with the data. On the refined mesh such a path rings
too much, and a damping that is too large makes up for it. So the patterns are made anew at the refined mesh's
optimum, on a mesh whose ringing is as good as that one's for a third of the runs' cost; the amplitudes are
found again from the residual there, the path is moved to them, and the optimum searched for under it, until
they stay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kolsky.base.arrays import FloatArray
from kolsky.inverse.front_noise import data_change, noise_of
from kolsky.inverse.graded_mesh import coarser_graded
from kolsky.inverse.likely_path import credible, likely_amplitudes
from kolsky.inverse.objective import Objective
from kolsky.inverse.path_modes import MovedFront, PathModes, size
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
    before = stages.front
    if before is None or not last.confirmed:
        return last, slope
    front = patterns_anew(stages, before, last.x) or before
    vector = last.vector + (before.offset - front.offset)[last.step.objective.kept]
    for number in range(MOST_MOVES):
        amplitudes = _asked_for(front, last.step.objective, vector)
        if not credible(amplitudes) or (number and size(amplitudes - front.amplitudes) <= SAME):
            break
        front = replace(front, amplitudes=amplitudes)
        stages.follow(front)
        seen = replace(objective, observations=stages.observations)
        last, slope = search(stages, seen, slope, last.x)
        if not last.confirmed:
            break
        vector = last.vector
    return last, slope


def patterns_anew(stages: StagedRuns, front: MovedFront, point: FloatArray) -> MovedFront | None:
    """The same path with patterns of its noise at a point; None if one of their runs does not complete.

    Parameters
    ----------
    stages
        The identification's simulations, which run under that path.
    front
        The path, and the modes that it is moved by.
    point
        Where the patterns are made, on the coarser graded mesh, shape [d].
    """
    deviations, shares, one = front.modes.as_replicates(front.amplitudes @ front.modes.shares)
    numerics = coarser_graded(stages.settings.numerics, stages.settings.refined_mesh)
    runs = stages.under_other_motions(point[None], one * deviations, numerics, shifted=False)[0]
    if runs is None or len(runs.force_bins) <= len(deviations):
        return None
    modes = PathModes.of(data_change(runs)[1:] / one, noise_of(stages.observations), deviations)
    return MovedFront(front.fitted, modes, modes.amplitudes(shares))


def _asked_for(front: MovedFront, objective: Objective, vector: FloatArray) -> FloatArray:
    """The most likely amplitudes of a path's modes for what a vector leaves of the data, shape [q]."""
    seen = replace(objective.observations, front_noise=front.modes.patterns, front_offset=front.offset)
    weighed = replace(objective, observations=seen).with_discrepancy(vector)
    return likely_amplitudes(weighed, weighed.data - vector)
