"""What the meshes of a joint search do to the data: changes by mesh and element, as patterns of each shot.

An optimum on a mesh that errs asks for whatever makes up for the error, a branch that relaxes among it. The
change from the mesh of the search to the refined one, and from one element to the other, say what the error
looks like; its size differs from shot to shot, since a faster one bends more.
"""

from __future__ import annotations

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.graded_mesh import coarser_graded, graded
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.refined_patterns import slides
from kolsky.joint.weights import Stack
from kolsky.uncertainty.numerical import (
    ELEMENT_ORDER,
    WINDOWS,
    GradedChange,
    MeshChange,
    windows_of,
)

ELEMENT_SHARE = 1.0
"""Share of the elements' distance that is uncertain [-]: the mesh errs alike in all shots, whose noise is
small together. With half of it, as for one shot, the errors of m, nu and beta over what was said had root
mean squares of 1.26, 1.64 and 1.45 in fifty planted draws of seed 52631, whose truths are of one element."""


def mesh_change(problem: JointProblem, found: Optimum) -> MeshChange:
    """The data at an optimum on the search's mesh, with both elements, beside those on the refined mesh.

    Raises
    ------
    ValueError
        If the run with the element of the search does not complete there.
    """
    numerics = problem.mesh
    coarse = problem.predict("check", found.x[None], numerics)[0]
    if np.isnan(coarse).any():
        raise ValueError("the run at the answer on the mesh of the search did not complete: refine --mesh")
    other = numerics.with_other_element()
    element = problem.predict("check", found.x[None], other)[0]
    return MeshChange(
        graded=_graded(problem, found),
        coarser=coarse - found.vector,
        element=None if np.isnan(element).any() else element - coarse,
        ratio=problem.settings.refined_mesh[0] / numerics.mesh[0],
        windows=_windows(problem.stack),
        element_share=ELEMENT_SHARE,
    )


def _graded(problem: JointProblem, found: Optimum) -> GradedChange | None:
    """The data at an optimum on two graded meshes; None where a surface slides, or a run is lost."""
    if slides(problem) or problem.mesh.compressible is not None:
        return None
    few, many = (mesh(problem.mesh, problem.settings.refined_mesh) for mesh in (coarser_graded, graded))
    coarse, same = (problem.predict("check", found.x[None], numerics)[0] for numerics in (few, many))
    if np.isnan(coarse).any() or np.isnan(same).any():
        return None
    return GradedChange(same - found.vector, coarse - same, many.mesh[0] / few.mesh[0])


def _windows(stack: Stack) -> IntArray:
    """Windows of every shot; slow tests and prior knowledge, which no mesh moves, stand in the first, [k]."""
    each = [WINDOWS * i + windows_of(shot.objective.times) for i, shot in enumerate(stack.shots)]
    found = np.zeros(len(stack.data), int)
    found[: stack.ends[-1]] = np.concatenate(each)
    return found


def mesh_patterns(stack: Stack, change: MeshChange) -> FloatArray:
    """Error of the refined mesh as patterns of each shot: by Richardson and by the element, shape [n, k].

    Rows of one standard deviation: what is extrapolated may be missing altogether or be there twice; the two
    elements come together as q^-1.5 with the ratio q of the meshes.

    Parameters
    ----------
    stack
        Whose entries.
    change
        Changes of the data vector.
    """
    rows = [change.error]
    if change.element is not None:
        rows.append(change.element / change.ratio**ELEMENT_ORDER)
    return np.array([stack.of_shot(k, row) for row in rows for k in range(len(stack.shots))])
