"""Where a joint search starts: a scan of the stiffness, of Poisson's valleys, and of what relaxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.parameters import MOVED, PARAMETERS
from kolsky.inverse.settings import Settings
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.valleys import VALLEY, local_minima, valley_levels
from kolsky.joint.problem import JointProblem, started

FACTORS = np.geomspace(0.6, 2.2, 10)
"""Stiffness factors of the first scan."""
STRENGTHS = (0.1, 0.5)
"""Strengths of a branch, or ratios of a network, of the scan [-]."""
TIMES = 6
"""Relaxation times of the scan, or resistances."""
VALLEYS = 3
"""Valleys of Poisson's ratio that are searched from."""


def starts(problem: JointProblem, numerics: Numerics) -> FloatArray:
    """Points to search from, the likeliest first, shape [n, d].

    Raises
    ------
    ValueError
        If no point of a scan has runs that complete.
    """
    x = started(problem.unknowns, problem)
    names = list(problem.unknowns.bounds)
    weak = [i for i, name in enumerate(names) if name.startswith(("prony_strength", "creep_ratio"))]
    x[weak] = np.array(problem.unknowns.box.lower)[weak]
    if MOVED in names:
        x = _best(problem, _levels(problem, x, MOVED, FACTORS), numerics)
    problem.count(x, numerics)
    if weak:
        x = _best(problem, np.concatenate([x[None], relaxing_points(problem, x)]), numerics)
    if VALLEY not in names:
        return x[None]
    return _valleys(problem, x, numerics)


def relaxing_points(
    problem: JointProblem, x: FloatArray, strengths: Sequence[float] = STRENGTHS, *, follow: bool = True
) -> FloatArray:
    """Points with a branch or a network of some strengths and times beside others, shape [n, d].

    Parameters
    ----------
    problem
        Whose unknowns.
    x
        A point without, shape [d].
    strengths
        Strengths [-].
    follow
        Whether the stiffness factor gives way, so that the specimen is as stiff in the mean.
    """
    names = list(problem.unknowns.bounds)
    ratio = "prony_strength_1" if "prony_strength_1" in names else "creep_ratio"
    other = "prony_time_1" if ratio.startswith("prony") else "creep_resistance"
    i, found = names.index(ratio), []
    j = names.index(other) if other in names else None
    for strength in strengths:
        for value in second_levels(problem, other) if j is not None else [np.nan]:
            point = x.copy()
            point[i] = strength
            if j is not None:
                point[j] = value
            if follow and MOVED in names:
                point[names.index(MOVED)] /= np.sqrt(1.0 + strength)
            found.append(point)
    return np.clip(np.array(found), problem.unknowns.box.lower, problem.unknowns.box.upper)


def second_levels(problem: JointProblem, name: str) -> FloatArray:
    """Relaxation times, or resistances, of a scan: even in the logarithm over the design's range."""
    i = list(problem.unknowns.bounds).index(name)
    box = problem.unknowns.box
    return np.geomspace(box.lower[i], box.upper[i], TIMES + 2)[1:-1]


def _levels(problem: JointProblem, x: FloatArray, name: str, levels: FloatArray) -> FloatArray:
    i = list(problem.unknowns.bounds).index(name)
    box = problem.unknowns.box
    inside = levels[(levels >= box.lower[i]) & (levels <= box.upper[i])]
    values = inside if len(inside) else np.array([x[i]])
    points = np.tile(x, (len(values), 1))
    points[:, i] = values
    return points


def _best(problem: JointProblem, points: FloatArray, numerics: Numerics) -> FloatArray:
    deviances = [problem.deviance(v) for v in problem.predict("design", points, numerics)]
    if not np.isfinite(deviances).any():
        raise ValueError("no point of the first scan has runs of all shots that complete")
    return np.asarray(points[int(np.argmin(deviances))])


def _valleys(problem: JointProblem, x: FloatArray, numerics: Numerics) -> FloatArray:
    """The floors of the likeliest valleys of Poisson's ratio."""
    names, box = list(problem.unknowns.bounds), problem.unknowns.box
    i = names.index(VALLEY)
    prepared = problem.runs.prepared[0]
    stages = StagedRuns(prepared, Settings(), Box.of({MOVED: (0.5, 2.5)}), lambda stage, done, total: None)
    factor = x[names.index(MOVED)] if MOVED in names else PARAMETERS[MOVED].held(prepared.forward.shot)
    levels = valley_levels(stages, float(factor), (box.lower[i], box.upper[i]))
    points = np.tile(x, (len(levels), 1))
    points[:, i] = levels
    vectors = problem.predict("design", points, numerics)
    deviances = np.array([problem.deviance(v) for v in vectors])
    floors = local_minima(np.where(np.isfinite(deviances), deviances, np.nan))[:VALLEYS]
    return points[floors] if floors else x[None]
