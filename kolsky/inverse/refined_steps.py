"""Where the first run of several parameters on the refined mesh is made, and how long the next steps are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.surrogate_mesh_search import MeshOptimum

START_ORDER = 2.0
"""Order of the mesh error with which the first point is foretold: a start needs no better one."""
LONGEST = 2.5
"""Most by which a step is lengthened."""


def foretold(
    optima: Mapping[tuple[int, int], MeshOptimum], mesh: tuple[int, int], refined: tuple[int, int]
) -> FloatArray:
    """The refined mesh's optimum from that of a mesh and of a coarser one, by Richardson, shape [d].

    With errors that go as h^p, h the size of an element, the refined mesh's optimum lies beyond the finer
    one's by a share (h^p - h_r^p) / (h_c^p - h^p) of the way from the coarser one. It is that of the finer
    mesh where there is no coarser one, or one of them did not come to rest.
    """
    fine, others = optima[mesh], [one for one in optima if one[0] < mesh[0]]
    if not others or not (fine.converged and optima[others[0]].converged):
        return fine.x
    coarser, here, there = (float(one[0]) ** -START_ORDER for one in (others[0], mesh, refined))
    return np.asarray(fine.x + (fine.x - optima[others[0]].x) * (here - there) / (coarser - here))


def lengthening(before: FloatArray, now: FloatArray, taken: FloatArray) -> float:
    """By how much to lengthen a step of the chord method, 1 to `LONGEST` [-].

    Along the last move the slopes of the coarser mesh fall short by a share that the steps asked for before
    and after it tell: with ``now = before - s taken`` the step ``now / s`` would ask for no more along it.

    Parameters
    ----------
    before, now
        Steps asked for at the run before and at this one, in comparable units, shape [d].
    taken
        This run's point less that of the run before, shape [d].
    """
    share = float((before - now) @ taken) / max(float(taken @ taken), np.finfo(float).tiny)
    return 1.0 / min(max(share, 1.0 / LONGEST), 1.0)
