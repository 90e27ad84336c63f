"""Faces of a mesh whose points all belong to a set."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray, IntArray
from implicit.elements.reference import Face
from implicit.meshes import Mesh


@dataclass(frozen=True)
class Faces:
    """Faces of one local kind (such as all left ones)."""

    cells: IntArray
    """Their cells, shape [f]."""
    values: FloatArray
    """Shape functions at the face's Gauss points [-], shape [g, k]."""
    slopes: FloatArray
    """Their derivatives along the face's coordinates [-], shape [g, k, d - 1]."""
    weights: FloatArray
    """Weights of the Gauss points [-], shape [g]."""
    face: Face
    """The local face."""


def faces_on(mesh: Mesh, where: str, gauss: int | None = None) -> list[Faces]:
    """Faces on the boundary of the mesh whose points all belong to a set.

    Raises
    ------
    ValueError
        If there are none.
    """
    element = mesh.element
    member = np.zeros(len(mesh.points), dtype=bool)
    member[mesh.nodes(where)] = True
    points, weights = element.face_rule(element.gauss if gauss is None else gauss)
    found, keys = [], []
    for face in element.faces:
        nodes = mesh.cells[:, element.nodes_on(face)]
        keys.append(np.sort(nodes, axis=1))
        found.append(np.flatnonzero(member[nodes].all(axis=1)))
    # a face of two cells is inside; all its points name it: faces that meet in an edge share its points
    _, inverse, counts = np.unique(np.concatenate(keys), axis=0, return_inverse=True, return_counts=True)
    outer = (counts[inverse.ravel()] == 1).reshape(len(element.faces), len(mesh.cells))
    result = []
    for number, face in enumerate(element.faces):
        cells = found[number][outer[number, found[number]]]
        if len(cells) == 0:
            continue
        tangents = np.asarray(face.tangents)
        places = np.asarray(face.origin) + points @ tangents
        slopes = element.gradients(places) @ tangents.T
        result.append(Faces(cells, element.values(places), slopes, weights, face))
    if not result:
        raise ValueError(f"no face of the mesh has all its points in the set {where!r}")
    return result
