"""Axisymmetric quadrilateral mesh of sections bonded one behind the other."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from explicit.arrays import FloatArray, IntArray
from explicit.bars.sections import Section


@dataclass(frozen=True)
class ElasticMesh:
    """Rectangles in the half-plane (r, x); x is the distance from the loaded face, into the parts."""

    sections: tuple[Section, ...]
    """The parts, the loaded one first."""
    nodes: FloatArray
    """Positions (r, x) [m], shape [n_nodes, 2]."""
    quads: IntArray
    """Corner nodes of each element, counter-clockwise, shape [n_elements, 4]."""
    part: IntArray
    """Index of each element's section, shape [n_elements]."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def face(self) -> IntArray:
        """Nodes of the loaded face, axis first."""
        return self.plane(0.0)

    def plane(self, depth: float) -> IntArray:
        """Nodes of the cross-section nearest to a distance from the loaded face [m], axis first."""
        depths = np.unique(self.nodes[:, 1])
        if not depths[0] <= depth <= depths[-1]:
            raise ValueError(f"depth must be in [0, {depths[-1]:.6g}] m, got {depth}")
        nearest = depths[np.argmin(np.abs(depths - depth))]
        found = np.flatnonzero(self.nodes[:, 1] == nearest)
        return found[np.argsort(self.nodes[found, 0])]


def mesh_of(sections: Sequence[Section], *, size: float) -> ElasticMesh:
    """Mesh sections with rectangles.

    Every radius that occurs is a line of the mesh, so a step of the radius is sharp; neighbours are bonded
    over the smaller of their faces.

    Parameters
    ----------
    sections : sequence
        The parts, the loaded one first.
    size : float
        Largest side of an element [m]. A section has at least two elements along its axis, so that its
        mid-section is a plane of nodes, and an even number of them.

    Raises
    ------
    ValueError
        If there is no section or `size` is not positive.
    """
    if not sections:
        raise ValueError("a mesh needs at least one section, got none")
    if not size > 0.0:
        raise ValueError(f"size must be > 0 m, got {size}")
    radial = _lines(np.unique([0.0, *(section.radius for section in sections)]), size)
    ends = np.concatenate([[0.0], np.cumsum([section.length for section in sections])])
    axial, layers = [np.zeros(1)], []
    for k, section in enumerate(sections):
        n = 2 * max(1, int(np.ceil(0.5 * section.length / size * (1.0 - 1e-9))))
        axial.append(np.linspace(ends[k], ends[k + 1], n + 1)[1:])
        layers += [k] * n
    x, part = np.concatenate(axial), np.array(layers)
    index = np.arange(len(x) * len(radial)).reshape(len(x), len(radial))
    # (r, x) with x along the parts: counter-clockwise is out, along, in.
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    outer = np.array([section.radius for section in sections])[part]
    solid = radial[None, 1:] <= outer[:, None] * (1.0 + 1e-12)
    quads, of_element = quads[solid], np.broadcast_to(part[:, None], solid.shape)[solid]
    used, renumbered = np.unique(quads, return_inverse=True)
    places = np.stack(np.broadcast_arrays(radial[None, :], x[:, None]), axis=-1).reshape(-1, 2)
    return ElasticMesh(tuple(sections), places[used], renumbered.reshape(-1, 4), of_element.copy())


def _lines(fixed: FloatArray, size: float) -> FloatArray:
    """Lines through fixed places, equally spaced between neighbours, not more than `size` apart."""
    spans = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / size * (1.0 - 1e-9)))) + 1)[1:]
        for a, b in pairwise(fixed)
    ]
    return np.concatenate([[0.0], *spans])


def pressed_share(mesh: ElasticMesh, radius: FloatArray) -> FloatArray:
    """Share of a force that each node of the face takes when it presses evenly within a radius.

    The consistent loads (2 / a^2) * integral of N_i r dr from 0 to a, integrated exactly.

    Parameters
    ----------
    radius : shape [n]
        Radius a of the pressed patch [m], in (0, radius of the face].

    Returns
    -------
    shape [n, n_face_nodes]
        Rows sum to 1.

    Raises
    ------
    ValueError
        If a radius is outside its range.
    """
    lines = mesh.nodes[mesh.face, 0]
    a = np.asarray(radius, dtype=float)
    wrong = ~((a > 0.0) & (a <= lines[-1] * (1.0 + 1e-12)))
    if wrong.any():
        raise ValueError(f"pressed radius must be in (0, {lines[-1]:.6g}] m, got {a[wrong][0]:.6g}")
    share = np.zeros((len(a), len(lines)))
    for i, (inner, outer) in enumerate(pairwise(lines)):
        end = np.clip(a, inner, outer)
        square, cube = 0.5 * (end**2 - inner**2), (end**3 - inner**3) / 3.0
        share[:, i] += (outer * square - cube) / (outer - inner)
        share[:, i + 1] += (cube - inner * square) / (outer - inner)
    return 2.0 * share / a[:, None] ** 2
