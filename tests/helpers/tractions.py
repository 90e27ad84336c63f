"""Force of a sheet on its pad from the elements' stress (Sutula and others 2020, Eq. K.5)."""

from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.bodies.sheet import Sheet, SheetState, sheet_state
from kolsky.bodies.specimen_constants import Constants
from kolsky.equilibrium.meshes import Mesh


@dataclass(frozen=True)
class BoundaryEdges:
    """Edges of a set of points, with the triangle of each edge."""

    cells: IntArray  # triangle of each edge, shape [n]
    normals: FloatArray  # outward normal times length [m], shape [n, 2]
    gradients: FloatArray  # gradients of the triangles' shape functions [1/m], shape [n, 3, 2]


def boundary_edges(mesh: Mesh, where: str) -> BoundaryEdges:
    """Find the boundary edges of triangles with both points in a set."""
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
    mesh: Mesh, edges: BoundaryEdges, lame: tuple[float, float], u: FloatArray, du: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force on the body's boundary for a thickness of 1 m, and its slopes by (mu, lambda)."""
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


def state_with_tractions(
    sheet: Sheet, constants: Constants, free: FloatArray, pad: FloatArray, near: SheetState | None = None
) -> SheetState:
    """A simulated sheet with the force of the tractions, for the coupled law in plane strain."""
    state = sheet_state(sheet, constants, free, pad, near)
    edges, chain = boundary_edges(sheet.mesh, sheet.moving), constants.chain(free)
    mu, lam = (float(value) for value in state.solution.parameters[0])
    force, by = [], []
    for u, du in zip(state.displacements, state.slopes.displacements[:, : len(chain)], strict=True):
        whole, parts = traction_force(sheet.mesh, edges, (mu, lam), u, du)
        force.append(sheet.thickness * whole[sheet.axis])
        by.append(sheet.thickness * parts[:, sheet.axis])
    return replace(state, force=np.array(force), force_by_constants=np.array(by) @ chain)
