"""What the meshes of a joint search do to the data: changes by mesh and element, as patterns of each shot.

An optimum on a mesh that errs asks for whatever makes up for the error, a branch that relaxes among it. The
change from the mesh of the search to the refined one, and from one element to the other, say what the error
looks like; its size differs from shot to shot, since a faster one bends more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.graded_mesh import coarser_graded, graded
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.refined_patterns import slides
from kolsky.joint.weights import Stack
from kolsky.uncertainty.numerical import (
    ELEMENT_ORDER,
    WINDOWS,
    GradedChange,
    LostRun,
    MeshChange,
    windows_of,
)

ELEMENT_SHARE = 1.0
"""Share of the elements' distance that is uncertain [-]: the mesh errs alike in all shots, whose noise is
small together. With half of it, as for one shot, the errors of m, nu and beta over what was said had root
mean squares of 1.26, 1.64 and 1.45 in fifty planted draws of seed 52631. With the whole of it, and what was
cured since, they have 0.94, 1.17 and 0.69 in fifty of seed 90731, which it was judged on
(docs/validation/planted_shots.md)."""


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
    lost = [] if not np.isnan(element).any() else [_lost(problem, other, element, is_graded=False)]
    change = MeshChange(
        coarser=coarse - found.vector,
        element=None if np.isnan(element).any() else element - coarse,
        ratio=problem.settings.refined_mesh[0] / numerics.mesh[0],
        windows=_windows(problem.stack),
        element_share=ELEMENT_SHARE,
    )
    graded_change, more = _graded(problem, found)
    return replace(change, graded=graded_change, lost=(*lost, *more))


def _graded(problem: JointProblem, found: Optimum) -> tuple[GradedChange | None, list[LostRun]]:
    """The data at an optimum on two graded meshes, and which of them were lost.

    None where one is, and on purpose where a surface slides, since single runs jump, or where runs are
    corrected for Poisson's ratio, since that correction has meshes of its own.
    """
    if slides(problem) or problem.mesh.compressible is not None:
        return None, []
    few, many = (mesh(problem.mesh, problem.settings.refined_mesh) for mesh in (coarser_graded, graded))
    coarse, same = (problem.predict("check", found.x[None], numerics)[0] for numerics in (few, many))
    lost = [
        _lost(problem, numerics, vector, is_graded=True)
        for numerics, vector in ((few, coarse), (many, same))
        if np.isnan(vector).any()
    ]
    if lost:
        return None, lost
    return GradedChange(same - found.vector, coarse - same, many.mesh[0] / few.mesh[0]), []


def _lost(problem: JointProblem, numerics: Numerics, vector: FloatArray, *, is_graded: bool) -> LostRun:
    """A run of which a shot's part is lost, with the shots' names: the ledger keeps no endings."""
    parts = zip(problem.runs.prepared, problem.stack.parts(vector), strict=True)
    names = [prepared.forward.shot.name for prepared, part in parts if np.isnan(part).any()]
    return LostRun(numerics, f"of {', '.join(names)}", is_graded)


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
