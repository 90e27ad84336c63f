"""The patterns of the front faces' noise, made anew where the refined mesh has its optimum.

The weights have learnt on the mesh of the search how noise of a flyer's path rings through force and outline.
That mesh rings weaker and slower than the refined one, and late in a test its patterns are out of step with
the data: three shots together see that, Poisson's ratio and damping follow it. So the patterns are made once
more at the optimum on the refined mesh, on a graded mesh whose ringing is as good as its own for a third of
the cost (`kolsky.inverse.graded_mesh`), and the optimum is searched for with them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from explicit.contact import contact_law
from kolsky.inverse.graded_mesh import coarser_graded
from kolsky.inverse.parameters import any_slides
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.refined_steps import refined_optimum


def with_patterns_anew(problem: JointProblem, found: Optimum) -> Optimum:
    """The optimum on the refined mesh with weights that know the noise as a fine mesh rings with it.

    Where a surface slides, whose runs jump, where the search has not come to rest, or where the run on the
    graded mesh is lost, nothing changes; the last is said beside the mesh's part of the interval.

    Parameters
    ----------
    problem
        Shots and slow tests; its weights are the new ones from here on.
    found
        The optimum with the weights that the mesh of the search has taught.
    """
    if not (problem.settings.replicates and found.confirmed) or slides(problem):
        return found
    numerics = coarser_graded(problem.mesh, problem.settings.refined_mesh)
    if np.isnan(problem.predict("noise", found.x[None], numerics)).any():
        return found
    problem.learn_noise(found.x, numerics)
    return replace(refined_optimum(problem, found.x, found.slopes), start=found.start)


def slides(problem: JointProblem) -> bool:
    """Whether a surface of the shots slides, so that single runs jump."""
    faces = problem.first.shot.interface
    laws = [contact_law(faces.faces), contact_law(faces.side)]
    freed = any_slides([*problem.unknowns.bounds, *problem.runs.held])
    return freed or any(law.needs_friction for law in laws)
