"""What follows the search on the refined mesh: the noise's patterns made anew, scatter between the shots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.records import Scatter
from kolsky.joint.refined_patterns import with_patterns_anew
from kolsky.joint.refined_steps import refined_optimum
from kolsky.joint.scatter import estimated
from kolsky.joint.weights import BLIND, SCATTER

COARSE_PATTERNS = (
    "the weights know the flyers' noise as the mesh of the search rings with it: with patterns of a graded "
    "mesh the search on the refined one has not come to rest, so that Poisson's ratio and damping may be off "
    "by more than is said; refine both meshes"
)
"""What is said where the old patterns stay."""


def finished(problem: JointProblem, found: Optimum, said: list[str]) -> Optimum:
    """The optimum with patterns made anew, and with the scatter between the shots.

    Where the search comes to rest with the old patterns alone, these stay, and `said` has one sentence more:
    on coarse meshes the new ones may ring at another frequency than the mesh of the slopes.
    """
    before = problem.stack
    last = scattered(problem, with_patterns_anew(problem, found))
    if last.confirmed or not found.confirmed:
        return last
    anew, problem.stack = problem.stack, before
    old = scattered(problem, found)
    if not old.confirmed:
        problem.stack = anew
        return last
    said.append(COARSE_PATTERNS)
    return old


def scattered(problem: JointProblem, found: Optimum) -> Optimum:
    """The optimum with the scatter between the shots, which the weights know from here on."""
    if not problem.settings.scatter or len(problem.stack.shots) < 2:
        return found
    scatter = _scatter(problem, found)
    if scatter.value > 0.0:
        found = replace(refined_optimum(problem, found.x, found.slopes), start=found.start)
    return replace(found, scatter=scatter)


def _scatter(problem: JointProblem, found: Optimum) -> Scatter:
    """The scatter between the shots on the refined mesh; from here on the weights know it."""
    stack, residual = problem.stack, found.vector - problem.stack.data
    change = problem.unknowns.relative_stiffness(found.slopes, found.x)
    patterns = np.array([stack.of_shot(k, change) for k in range(len(stack.shots))])
    # Each shot's discrepancy is what is left once its own stiffness has followed.
    objectives = stack.weighed_beside(residual, patterns)
    # What the data do not see takes no freedom from them.
    seen = np.linalg.norm(stack.whitening(objectives).apply(found.slopes.T), axis=1)
    slopes = found.slopes[:, seen * problem.unknowns.widths >= BLIND]
    between = estimated(residual, slopes, patterns, lambda more: stack.whitening(objectives, more))
    if between.value > 0.0:
        shots = []
        for one, row in zip(stack.shots, stack.parts(between.value * change), strict=True):
            whole = np.zeros(len(one.kept))
            whole[one.kept] = row
            shots.append(replace(one, own={**one.own, SCATTER: whole}))
        problem.stack = replace(stack, shots=tuple(shots))
    return between
