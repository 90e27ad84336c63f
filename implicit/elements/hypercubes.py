"""Quadrilaterals with 4, 8 and 9 nodes and hexahedra with 8 and 27, in the order of VTK."""

import numpy as np

from explicit.arrays import FloatArray
from implicit.elements.reference import Element, Face, tensor

_QUAD = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]], dtype=float)
_EDGES = (
    Face((0.0, -1.0), ((1.0, 0.0),)),
    Face((1.0, 0.0), ((0.0, 1.0),)),
    Face((0.0, 1.0), ((-1.0, 0.0),)),
    Face((-1.0, 0.0), ((0.0, -1.0),)),
)
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_FACES = (
    Face((-1.0, 0.0, 0.0), (_Z, _Y)),
    Face((1.0, 0.0, 0.0), (_Y, _Z)),
    Face((0.0, -1.0, 0.0), (_X, _Z)),
    Face((0.0, 1.0, 0.0), (_Z, _X)),
    Face((0.0, 0.0, -1.0), (_Y, _X)),
    Face((0.0, 0.0, 1.0), (_X, _Y)),
)


def _hexahedron() -> FloatArray:
    corners = [[x, y, z] for z in (-1, 1) for x, y in _QUAD[:4]]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    middles = [np.mean([corners[a], corners[b]], axis=0) for a, b in edges]
    faces = [face.origin for face in _FACES]
    return np.array([*corners, *middles, *faces, [0.0, 0.0, 0.0]], dtype=float)


_HEX = _hexahedron()

QUAD4 = Element("quad4", "hypercube", _QUAD[:4], tensor(1, 2), _EDGES, 2, 0, 9)
QUAD8 = Element("quad8", "hypercube", _QUAD[:8], tensor(2, 2)[:-1], _EDGES, 3, 0, 23)
QUAD9 = Element("quad9", "hypercube", _QUAD, tensor(2, 2), _EDGES, 3, 1, 28)
HEX8 = Element("hex8", "hypercube", _HEX[:8], tensor(1, 3), _FACES, 2, 0, 12)
HEX27 = Element("hex27", "hypercube", _HEX, tensor(2, 3), _FACES, 3, 1, 29)
