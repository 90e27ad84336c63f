"""External forces: weight and dead loads, follower pressure, contact with a rigid surface.

Pressure: with the tangents t_1, t_2 of the deformed face along its coordinates, n da = t_1 x t_2 ds and

    f_a = -p int N_a (t_1 x t_2) ds,                                                           (P.1)

The derivative of this force by the displacements is not symmetric. In two dimensions, n da is the tangent
rotated by -90 degrees, times the thickness or 2 pi r with the deformed radius r.

Contact: a point at the distance g from a plane or a sphere has the force p n, p = max(0, lam - k g). The
normal n points outward (augmented Lagrange multipliers; Simo and Laursen 1992). After each equilibrium lam is
set to p, until no point is deeper than the tolerance. At the distance r from the centre of a sphere the
stiffness is

    -d(p n)/dx = k n n' - p (1 - n n') / r,                                                    (P.2)

Its product with the direction of travel is the change of the force with the travel.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.elements import Face
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.model import Gravity, Model, NodalForce, RigidSurface, Traction, unit
from kolsky.equilibrium.points import Geometry

CONTACT_STIFFNESS = 500.0
"""Penalty stiffness of a point, divided by shear modulus times mean spacing of the body's points [-]."""
DIFFERENTIATION_STIFFNESS = 1e5
"""Factor of the stiffness that fixes points in contact if the solution is differentiated [-]."""


class RigidContact:
    """The contact of one set with one rigid surface."""

    def __init__(self, model: Model, surface: RigidSurface) -> None:
        if len(surface.normal) != model.dimension or len(surface.position) != model.dimension:
            raise ValueError(f"normal and position of {surface} must have {model.dimension} components")
        if surface.radius is not None and not surface.radius > 0.0:
            raise ValueError(f"radius of {surface} must be > 0, got {surface.radius}")
        if not 0.0 < surface.tolerance < 1.0:
            raise ValueError(f"tolerance must be in (0, 1), got {surface.tolerance}")
        self.surface, self.model = surface, model
        self.normal = unit(surface.normal)
        self.nodes = model.mesh.nodes(surface.where)
        size = np.ptp(model.mesh.points, axis=0)
        self.depth = surface.tolerance * float(size.max())
        spacing = float(size.prod() / len(model.mesh.points)) ** (1.0 / model.dimension)
        across = spacing if model.kinematics == "3d" else _across(model)
        self.stiffness = CONTACT_STIFFNESS * model.solid.shear_modulus * across
        self.cells = cell_with(model.mesh.cells, self.nodes)

    def place(self, u: FloatArray, at: Mapping[str, float]) -> "Place":
        """Gaps, normals and curvature of the surface at the points, with histories at given values."""
        of = self.surface
        travel = 0.0 if of.history is None else of.factor * at[of.history]
        x = (self.model.mesh.points + u.reshape(-1, self.model.dimension))[self.nodes]
        way = x - np.asarray(of.position) - travel * self.normal
        height = way @ self.normal
        if of.radius is None:
            return Place(height, np.broadcast_to(self.normal, x.shape), np.zeros(len(x)))
        out = way + of.radius * self.normal
        distance = np.linalg.norm(out, axis=1)
        # the difference of the squares, because distance - radius loses the digits of a small gap
        gaps = ((way**2).sum(axis=1) + 2.0 * of.radius * height) / (distance + of.radius)
        return Place(gaps, out / distance[:, None], 1.0 / distance)

    def pushes(self, place: "Place", multipliers: FloatArray) -> FloatArray:
        """Forces on the points along their normals [N], shape [p]."""
        return np.maximum(0.0, multipliers - self.stiffness * place.gaps)

    def forces(self, place: "Place", pushes: FloatArray) -> FloatArray:
        """Forces of all points [N], shape [n d]."""
        total = np.zeros(self.model.mesh.points.shape)
        np.add.at(total, self.nodes, pushes[:, None] * place.normals)
        return total.reshape(-1)

    def blocks(self, place: "Place", pushes: FloatArray, *, held: bool) -> FloatArray:
        """Stiffness of each point, 0 without contact [N/m], shape [p, d, d]: Eq. (P.2)."""
        stiffness = self.stiffness * (DIFFERENTIATION_STIFFNESS if held else 1.0)
        along = place.normals[:, :, None] * place.normals[:, None, :]
        bent = (pushes * place.curvature)[:, None, None] * (np.eye(self.model.dimension) - along)
        return np.where((pushes > 0.0)[:, None, None], stiffness * along - bent, 0.0)

    def add_stiffness(self, elements: FloatArray, blocks: FloatArray) -> None:
        """Add the stiffness of each point to that of one of its cells, in place."""
        d = self.model.dimension
        for point in np.flatnonzero(blocks.any(axis=(1, 2))):
            node, cell, block = self.nodes[point], self.cells[point], blocks[point]
            at = d * int(np.flatnonzero(self.model.mesh.cells[cell] == node)[0])
            elements[cell, at : at + d, at : at + d] += block

    def by_history(self, blocks: FloatArray) -> FloatArray:
        """Change of the forces of all points with the history [N/m], shape [n d]."""
        total = np.zeros(self.model.mesh.points.shape)
        np.add.at(total, self.nodes, self.surface.factor * (blocks @ self.normal))
        return total.reshape(-1)


@dataclass(frozen=True)
class Place:
    """The points of a contact relative to its surface."""

    gaps: FloatArray
    """Distances from the surface, negative inside [m], shape [p]."""
    normals: FloatArray
    """Outward normals of the surface [-], shape [p, d]."""
    curvature: FloatArray
    """Curvature of the surface through each point at its distance [1/m], shape [p]."""


def _across(model: Model) -> float:
    """Length in the third direction that belongs to a point [m]."""
    if model.kinematics == "axisymmetric":
        return float(np.pi * np.ptp(model.mesh.points[:, 0]))
    return model.thickness


def cell_with(cells: IntArray, nodes: IntArray) -> IntArray:
    """For each point, a cell that contains it."""
    of = np.full(int(cells.max()) + 1, -1)
    of[cells.ravel()] = np.repeat(np.arange(len(cells)), cells.shape[1])
    if (of[nodes] < 0).any():
        raise ValueError("a point of the contact belongs to no cell")
    return np.asarray(of[nodes])


@dataclass(frozen=True)
class Faces:
    """Faces of one local kind (such as all left faces)."""

    cells: IntArray
    """Their cells, shape [f]."""
    values: FloatArray
    """Shape functions at the face's Gauss points [-], shape [g, k]."""
    slopes: FloatArray
    """Their derivatives along the face's coordinates [-], shape [g, k, d - 1]."""
    weights: FloatArray
    """Weights of the Gauss points [-], shape [g]."""
    face: Face


def faces_on(mesh: Mesh, where: str, gauss: int | None = None) -> list[Faces]:
    """Faces on the boundary of the mesh that have all their points in a set.

    Raises ValueError if there are none.
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
    # a face of two cells is inside; all its points identify it, because faces with a common edge share points
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


def rim(mesh: Mesh, where: str) -> IntArray:
    """End points of the edges that bound the surface of a set, shape [n, 2]. Empty for a closed surface.
    Every edge of a closed surface belongs to an even number of its faces. ``where``: set of a
    three-dimensional mesh. Raises ValueError if no face has all its points in the set."""
    element, low = mesh.element, -1.0 if mesh.element.shape == "hypercube" else 0.0
    corners = np.flatnonzero(np.isin(element.nodes, (low, 1.0)).all(axis=1))
    edges = []
    for faces in faces_on(mesh, where):
        own = np.intersect1d(element.nodes_on(faces.face), corners)
        for a, b in combinations(own, 2):
            # the corners of a quadrilateral's diagonal differ in two coordinates
            if low == 0.0 or np.count_nonzero(element.nodes[a] != element.nodes[b]) == 1:
                edges.append(mesh.cells[faces.cells][:, [a, b]])
    unique, counts = np.unique(np.sort(np.concatenate(edges), axis=1), axis=0, return_counts=True)
    return np.asarray(unique[counts % 2 == 1])


def weight(model: Model, geometry: Geometry, at: Mapping[str, float]) -> FloatArray:
    """Weight of the points [N], shape [n d]. `at` has the value of each history."""
    total = np.zeros(model.mesh.points.shape)
    for condition in model.conditions:
        if isinstance(condition, Gravity):
            factor = 1.0 if condition.history is None else at[condition.history]
            # Eq. (11): the integral of rho g . u; every point has the weight of its shape function
            density = np.broadcast_to(condition.density, model.n_regions)[model.cell_regions]
            share = np.einsum("m,mg,gk->mk", density, geometry.volumes, geometry.values)
            mass = np.bincount(model.mesh.cells.ravel(), weights=share.ravel(), minlength=len(total))
            total += mass[:, None] * (factor * np.asarray(condition.acceleration))
    return total.reshape(-1)


def nodal_forces(model: Model, at: Mapping[str, float]) -> FloatArray:
    """Forces on points, on coupled points and on faces [N], shape [n d]."""
    total = np.zeros(model.mesh.points.shape)
    for condition in model.conditions:
        if isinstance(condition, NodalForce):
            nodes = model.mesh.nodes(condition.where)
            total[nodes, condition.axis] += at[condition.history] / len(nodes)
        elif isinstance(condition, Traction):
            total[:, condition.axis] += at[condition.history] * areas(model, condition.where)
    flat = total.reshape(-1)
    for component, name in model.unknowns.forces:
        flat[component] += at[name]
    return flat


def sizes(tangents: FloatArray) -> FloatArray:
    """Areas (lengths) of tangents [..., d - 1, d]."""
    if tangents.shape[-1] == 3:
        return np.asarray(np.linalg.norm(np.cross(tangents[..., 0, :], tangents[..., 1, :]), axis=-1))
    return np.asarray(np.linalg.norm(tangents[..., 0, :], axis=-1))


def face_areas(
    model: Model, X: FloatArray, values: FloatArray, slopes: FloatArray, weights: FloatArray
) -> FloatArray:
    """Undeformed area of each point of faces [m2], shape [f, g]."""
    area = weights * sizes(np.einsum("gkt,fkd->fgtd", slopes, X))
    if model.kinematics == "axisymmetric":
        return np.asarray(area * 2.0 * np.pi * np.einsum("gk,fk->fg", values, X[..., 0]))
    return np.asarray(area if model.dimension == 3 else area * model.thickness)


def areas(model: Model, where: str) -> FloatArray:
    """Undeformed area of each point in a set's faces: integrals of the shape functions [m2], shape [n]."""
    total = np.zeros(len(model.mesh.points))
    for faces in faces_on(model.mesh, where, model.gauss):
        nodes = model.mesh.cells[faces.cells]
        area = face_areas(model, model.mesh.points[nodes], faces.values, faces.slopes, faces.weights)
        np.add.at(total, nodes, area @ faces.values)
    return total


_SKEW = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _SKEW[_i, _j, _k], _SKEW[_i, _k, _j] = 1.0, -1.0
_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


class FollowerPressure:
    """Forces of a unit pressure on the faces of a set, and their derivative."""

    def __init__(self, model: Model, where: str) -> None:
        self.model = model
        self.faces = faces_on(model.mesh, where, model.gauss)

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, list[tuple[IntArray, FloatArray]]]:
        """Forces per unit of pressure [m2], shape [n d]. For each group of faces, its cells and the
        derivative of the cells' forces by their displacements [m], shape [f, k d, k d].
        """
        mesh, d = self.model.mesh, self.model.dimension
        x = mesh.points + u.reshape(-1, d)
        total = np.zeros(mesh.points.shape)
        derivatives = []
        for faces in self.faces:
            nodes = mesh.cells[faces.cells]
            force, by = self._of_faces(faces, x[nodes])
            np.add.at(total, nodes, force)
            k = nodes.shape[1]
            derivatives.append((faces.cells, by.reshape(len(nodes), k * d, k * d)))
        return total.reshape(-1), derivatives

    def _of_faces(self, faces: Faces, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces [f, k, d] and derivatives [f, k, d, k, d] for a unit pressure."""
        N, w = faces.values, faces.weights
        tangents = np.einsum("gkt,fkd->fgtd", faces.slopes, x)
        if x.shape[2] == 3:
            normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
            # d(t1 x t2) = [t1 x] dt2 - [t2 x] dt1 with (a x b)_i = e_ijk a_j b_k
            first = np.einsum("ijk,fgj->fgik", _SKEW, tangents[:, :, 0])
            second = np.einsum("ijk,fgj->fgik", _SKEW, tangents[:, :, 1])
            by = np.einsum("fgij,gb->fgibj", first, faces.slopes[:, :, 1])
            by -= np.einsum("fgij,gb->fgibj", second, faces.slopes[:, :, 0])
        else:
            normal = tangents[:, :, 0] @ _TURN.T
            by = np.einsum("ij,gb->gibj", _TURN, faces.slopes[:, :, 0])[None].repeat(len(x), axis=0)
            if self.model.kinematics == "axisymmetric":
                radius = np.einsum("gk,fk->fg", N, x[..., 0])
                by = by * radius[:, :, None, None, None]
                by[..., 0] += np.einsum("fgi,gb->fgib", normal, N)
                normal = normal * radius[..., None]
                scale = 2.0 * np.pi
            else:
                scale = self.model.thickness
            normal, by = scale * normal, scale * by
        force = -np.einsum("g,ga,fgi->fai", w, N, normal)
        return force, -np.einsum("g,ga,fgibj->faibj", w, N, by)
