"""Faces that may touch: their element, their points of integration, their normals and areas."""

import numpy as np

from explicit.arrays import BoolArray, FloatArray, IntArray
from implicit.elements.reference import Element, complete, tensor
from implicit.loads.surface import faces_on
from implicit.model import Model

OUTSIDE = 0.01
"""How far a closest point may lie outside of a face, in its coordinates [-]."""


def face_element(element: Element) -> Element:
    """The Lagrange element of a face, its nodes in the order of their coordinates."""
    face = element.faces[0]
    place = (element.nodes[element.nodes_on(face)] - np.asarray(face.origin)) @ np.linalg.pinv(
        np.asarray(face.tangents)
    )
    place = np.round(place[_order(place)], 9)
    degree = int(element.exponents.max())
    space = (tensor if element.shape == "hypercube" else complete)(degree, place.shape[1])
    return Element(f"face of {element.name}", element.shape, place, space, (), element.gauss, None, 0)


def contact_rule(item: Element) -> tuple[FloatArray, FloatArray]:
    """Points [g, d - 1] and weights [g] on a face, its corners among them: walls may touch in an edge first.

    Four points of Lobatto's rule in each coordinate (degree 5); on a triangle corners, middles of the edges
    and centre (degree 3; Zienkiewicz and Taylor 2000, table 5.3).
    """
    if item.shape == "simplex" and item.dimension == 2:
        points = [[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5], [1 / 3, 1 / 3]]
        return np.array(points, dtype=float), 0.5 * np.repeat([1 / 20, 2 / 15, 9 / 20], [3, 3, 1])
    inner = 1.0 / np.sqrt(5.0)
    line, of_line = np.array([-1.0, -inner, inner, 1.0]), np.array([1.0, 5.0, 5.0, 1.0]) / 6.0
    if item.shape == "simplex":
        return 0.5 * (line[:, None] + 1.0), 0.5 * of_line
    lines = np.stack(np.meshgrid(*[line] * item.dimension, indexing="ij"), axis=-1)
    weights = np.stack(np.meshgrid(*[of_line] * item.dimension, indexing="ij"), axis=-1)
    return lines.reshape(-1, item.dimension), weights.reshape(-1, item.dimension).prod(axis=1)


def _order(places: FloatArray) -> IntArray:
    return np.lexsort(np.round(places, 6).T)


def face_nodes(model: Model, where: str, item: Element) -> IntArray:
    """Points of each face of a set in the order of the face's element, shape [f, k]."""
    mesh, found = model.mesh, []
    for faces in faces_on(mesh, where):
        local = mesh.element.nodes_on(faces.face)
        place = (mesh.element.nodes[local] - np.asarray(faces.face.origin)) @ np.linalg.pinv(
            np.asarray(faces.face.tangents)
        )
        found.append(mesh.cells[faces.cells][:, local[_order(place)]])
    return np.concatenate(found)


def normals(tangents: FloatArray) -> FloatArray:
    """Outward unit normals of tangents [t, d - 1, d]."""
    if tangents.shape[-1] == 3:
        n = np.cross(tangents[:, 0], tangents[:, 1])
    else:
        n = np.stack([tangents[:, 0, 1], -tangents[:, 0, 0]], axis=-1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))


def sizes(tangents: FloatArray) -> FloatArray:
    """Areas (lengths) of tangents [..., d - 1, d]."""
    if tangents.shape[-1] == 3:
        return np.asarray(np.linalg.norm(np.cross(tangents[..., 0, :], tangents[..., 1, :]), axis=-1))
    return np.asarray(np.linalg.norm(tangents[..., 0, :], axis=-1))


def areas(
    model: Model, X: FloatArray, values: FloatArray, slopes: FloatArray, weights: FloatArray
) -> FloatArray:
    """Undeformed area of each point [m2], shape [f, g]."""
    area = weights * sizes(np.einsum("gkt,fkd->fgtd", slopes, X))
    if model.kinematics == "axisymmetric":
        return np.asarray(area * 2.0 * np.pi * np.einsum("gk,fk->fg", values, X[..., 0]))
    return np.asarray(area if model.dimension == 3 else area * model.thickness)


def inside_face(item: Element, places: FloatArray) -> BoolArray:
    """Whether places lie in a face, or no more than `OUTSIDE` beside it, shape [t]."""
    if item.shape == "hypercube" or item.dimension == 1:
        low, high = item.nodes.min(), item.nodes.max()
        return np.asarray(((places >= low - OUTSIDE) & (places <= high + OUTSIDE)).all(axis=1))
    return np.asarray((places >= -OUTSIDE).all(axis=1) & (places.sum(axis=1) <= 1.0 + OUTSIDE))
