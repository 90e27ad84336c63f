"""Triangles with 3 and 6 nodes and tetrahedra with 4 and 10, in the order of VTK."""

import numpy as np

from explicit.arrays import FloatArray
from implicit.elements.reference import Element, Face, complete

_TRIANGLE_EDGES = (
    Face((0.0, 0.0), ((1.0, 0.0),)),
    Face((1.0, 0.0), ((-1.0, 1.0),)),
    Face((0.0, 1.0), ((0.0, -1.0),)),
)
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_ORIGIN = (0.0, 0.0, 0.0)
_TET_FACES = (
    Face(_ORIGIN, (_Y, _X)),
    Face(_ORIGIN, (_X, _Z)),
    Face(_ORIGIN, (_Z, _Y)),
    Face(_X, ((-1.0, 1.0, 0.0), (-1.0, 0.0, 1.0))),
)


def _with_middles(corners: FloatArray, edges: tuple[tuple[int, int], ...]) -> FloatArray:
    return np.vstack([corners, [0.5 * (corners[a] + corners[b]) for a, b in edges]])


_TRIANGLE = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
_TET = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)

TRI3 = Element("tri3", "simplex", _TRIANGLE, complete(1, 2), _TRIANGLE_EDGES, 1, None, 5)
TRI6 = Element(
    "tri6",
    "simplex",
    _with_middles(_TRIANGLE, ((0, 1), (1, 2), (2, 0))),
    complete(2, 2),
    _TRIANGLE_EDGES,
    2,
    0,
    22,
)
TET4 = Element("tet4", "simplex", _TET, complete(1, 3), _TET_FACES, 1, None, 10)
TET10 = Element(
    "tet10",
    "simplex",
    _with_middles(_TET, ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))),
    complete(2, 3),
    _TET_FACES,
    2,
    None,  # a constant pressure fails the inf-sup condition in 3-D: its faces have no point of their own
    24,
)
