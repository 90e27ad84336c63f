"""What the page of an actuator shows: bends, shapes seen from the side, inversions, runs of the loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from implicit.meshes import Mesh
from kolsky.actuator.inverse import Inversion
from kolsky.actuator.loop import Closed
from kolsky.actuator.marker_fit import MarkerComparison, StiffnessFit
from kolsky.actuator.reduced import Reduction
from kolsky.actuator.study import BendInTime, Direction
from kolsky.base.arrays import FloatArray, IntArray

CORNERS = {
    "hypercube": ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    "simplex": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
}
"""Corners of the faces of a cell in the order of VTK."""


@dataclass(frozen=True)
class ActuatorView:
    """Results of one command on an actuator."""

    name: str
    """Name of the SPEC."""
    directions: Sequence[Direction] = ()
    """Bends of every direction of gravity."""
    markers: Sequence[MarkerComparison] = ()
    """Measured markers beside the simulated ones."""
    stiffness: StiffnessFit | None = None
    """Factor of all moduli fitted to them."""
    motions: Sequence[BendInTime] = ()
    """Bends over time."""
    inversions: Mapping[str, Sequence[Inversion]] = field(default_factory=dict)
    """Pressures that were searched for, by direction of gravity."""
    closed: Mapping[str, Closed] = field(default_factory=dict)
    """Runs of the loop, by direction of gravity."""
    reductions: Mapping[str, Reduction] = field(default_factory=dict)
    """Their reduced models."""
    warnings: Sequence[str] = ()
    """What a reader must know."""


def outer_faces(mesh: Mesh) -> IntArray:
    """Corners of the faces on the boundary of a mesh, shape [f, 3] or [f, 4]."""
    faces = np.concatenate([mesh.cells[:, list(corners)] for corners in CORNERS[mesh.element.shape]])
    keys = np.sort(faces, axis=1)
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[counts == 1]], dtype=np.int64)


def side_view(positions: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Faces as seen along +y, the nearest last.

    Returns
    -------
    tuple of array
        Corners in x and z [m], shape [f, k, 2], and how much each face looks at the viewer, 0 to 1, of
        shape [f].
    """
    corners = positions[faces]
    order = np.argsort(-corners[..., 1].mean(axis=1), kind="stable")
    corners = corners[order]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    return corners[..., [0, 2]], np.abs(normal[:, 1]) / np.where(size > 0.0, size, 1.0)
