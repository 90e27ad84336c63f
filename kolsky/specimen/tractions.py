r"""Force on a boundary from the stress of its elements: what the source paper does, and why it is not done
here.

Eq. (K.5) integrates the traction of the elements at the pad. The stress of a linear triangle at a re-entrant
corner of the pad grows without limit as the mesh gets finer, so this force depends on the mesh; the sum of
the nodal reactions, which is the force that did work in the model, does not. This file exists to show both.
It knows the linear triangle in plane strain and the coupled neo-Hookean law,

    P = mu (F - F^-T) + lambda ln J F^-T.
"""

from dataclasses import dataclass

import numpy as np

from implicit.meshes import Mesh
from kolsky.base.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class BoundaryEdges:
    """Edges of a set of points, with the triangle behind each."""

    cells: IntArray
    """Triangle of each edge, shape [n]."""
    normals: FloatArray
    """Outward normal times length [m], shape [n, 2]."""
    gradients: FloatArray
    """Gradients of the triangles' shape functions [1/m], shape [n, 3, 2]."""


def boundary_edges(mesh: Mesh, where: str) -> BoundaryEdges:
    """Find the edges on the boundary whose points both belong to a set.

    Raises
    ------
    ValueError
        If the mesh has other cells than linear triangles.
    """
    if mesh.kind != "tri3":
        raise ValueError(f"tractions are known of tri3 only, got {mesh.kind}: take the reactions")
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[mesh.nodes(where)] = True
    pairs = mesh.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, first, counts = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True, return_counts=True)
    found = first[(counts == 1) & inside[pairs[first]].all(axis=1)]
    cells, edges = found // 3, pairs[found]
    corners = mesh.points[mesh.cells[cells]]
    along = mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    outward = np.einsum("ni,ni->n", normals, mesh.points[edges].mean(axis=1) - corners.mean(axis=1))
    normals *= np.sign(outward)[:, None]
    jacobian = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    reference = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    return BoundaryEdges(cells, normals, reference @ np.linalg.inv(jacobian))


def traction_force(
    mesh: Mesh,
    edges: BoundaryEdges,
    lame: tuple[float, float],
    u: FloatArray,
    du: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Force on the body's boundary for a thickness of 1 m, and its slopes by (mu, lambda).

    Parameters
    ----------
    mesh, edges
        The mesh and the edges of the boundary.
    lame
        mu and lambda [Pa].
    u
        Displacements [m], shape [n_points, 2].
    du
        Their derivatives by mu and lambda [m/Pa], shape [2, n_points, 2].

    Returns
    -------
    force
        [N/m], shape [2].
    slopes
        By mu and lambda, shape [2, 2].
    """
    mu, lam = lame
    nodes = mesh.cells[edges.cells]
    F = np.eye(2) + np.einsum("nai,naj->nij", u[nodes], edges.gradients)
    inverse = np.linalg.inv(F)
    transposed = np.swapaxes(inverse, 1, 2)
    log = np.log(np.linalg.det(F))[:, None, None]
    P = mu * (F - transposed) + lam * log * transposed
    slopes = []
    for own, change in zip((F - transposed, log * transposed), du, strict=True):
        dF = np.einsum("nai,naj->nij", change[nodes], edges.gradients)
        dP = mu * dF + (mu - lam * log) * transposed @ np.swapaxes(dF, 1, 2) @ transposed
        dP += lam * np.einsum("nij,nji->n", inverse, dF)[:, None, None] * transposed
        slopes.append(np.einsum("nij,nj->i", own + dP, edges.normals))
    return np.einsum("nij,nj->i", P, edges.normals), np.array(slopes)
