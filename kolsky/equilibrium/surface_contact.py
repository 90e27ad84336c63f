"""Frictionless contact of two surfaces of a body.

A penalty acts at integration points of the first.

A point x of the first surface has its closest point X(s) on the second. There (x - X) . X,a = 0, and the gap
is g = n . (x - X) with the outward normal n. The potential

    Pi = sum_g w_g eps/2 <-g>^2                                                                (C.1)

with the undeformed areas w gives a pressure t = eps <-g>. The forces are therefore equal and opposite,
without a moment, and derive from a potential. Let dg = D^T n and D = [N_a, -N_b] of both surfaces. With the
metric m_ab = X,a . X,b, the curvature k_ab = n . X,ab, H = m - g k and P_a = (0, n N_b,a), the tangent is

    sum_g w_g (eps dg dg^T - t d2g),
    d2g = -D^T X,a (m^-1 k H^-1)^ab X,b^T D - (D^T X,a H^ab P_b^T + transposed) - g P_a H^ab P_b^T   (C.2)

exactly (Laursen and Simo 1993; the closest point's Hessian by the implicit function theorem). A contact is
evaluated in both directions, each with half of the penalty. Edges of both surfaces may penetrate.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from explicit.arrays import BoolArray, FloatArray, IntArray
from kolsky.equilibrium.elements import Element, complete, lattice, tensor
from kolsky.equilibrium.loads import face_areas, faces_on, sizes
from kolsky.equilibrium.meshes import components
from kolsky.equilibrium.model import Model, SelfContact

OUTSIDE = 0.01
"""Largest distance of a closest point outside a face, in its coordinates [-]."""


def _face_element(element: Element) -> Element:
    """The Lagrange element of a face, its nodes in the order of their coordinates."""
    face = element.faces[0]
    place = face.coordinates(element.nodes[element.nodes_on(face)])
    place = np.round(place[_order(place)], 9)
    degree = int(element.exponents.max())
    space = (tensor if element.shape == "hypercube" else complete)(degree, place.shape[1])
    return Element(f"face of {element.name}", element.shape, place, space, (), element.gauss, None, 0)


def _contact_rule(item: Element) -> tuple[FloatArray, FloatArray]:
    """Points [g, d - 1] and weights [g] on a face, with its corners, because walls may touch there first."""
    if item.shape == "simplex" and item.dimension == 2:  # degree 3 (Zienkiewicz and Taylor 2000, table 5.3)
        points = [[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5], [1 / 3, 1 / 3]]
        return np.array(points, dtype=float), 0.5 * np.repeat([1 / 20, 2 / 15, 9 / 20], [3, 3, 1])
    inner = 1.0 / np.sqrt(5.0)  # Lobatto's rule of degree 5
    line, of_line = np.array([-1.0, -inner, inner, 1.0]), np.array([1.0, 5.0, 5.0, 1.0]) / 6.0
    if item.shape == "simplex":
        return 0.5 * (line[:, None] + 1.0), 0.5 * of_line
    return lattice([line] * item.dimension), lattice([of_line] * item.dimension).prod(axis=1)


def _order(places: FloatArray) -> IntArray:
    return np.lexsort(np.round(places, 6).T)


def _face_nodes(model: Model, where: str, item: Element) -> IntArray:
    """Points of each face of a set in the order of the face's element, shape [f, k]."""
    mesh, found = model.mesh, []
    for faces in faces_on(mesh, where):
        local = mesh.element.nodes_on(faces.face)
        places = faces.face.coordinates(mesh.element.nodes[local])
        found.append(mesh.cells[faces.cells][:, local[_order(places)]])
    return np.concatenate(found)


def normals(tangents: FloatArray) -> FloatArray:
    """Outward unit normals of tangents [t, d - 1, d]."""
    if tangents.shape[-1] == 3:
        n = np.cross(tangents[:, 0], tangents[:, 1])
    else:
        n = np.stack([tangents[:, 0, 1], -tangents[:, 0, 0]], axis=-1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))


def _inside_face(item: Element, places: FloatArray) -> BoolArray:
    """True for positions in a face, or at most `OUTSIDE` outside it, shape [t]."""
    if item.shape == "hypercube" or item.dimension == 1:
        low, high = item.nodes.min(), item.nodes.max()
        return np.asarray(((places >= low - OUTSIDE) & (places <= high + OUTSIDE)).all(axis=1))
    return np.asarray((places >= -OUTSIDE).all(axis=1) & (places.sum(axis=1) <= 1.0 + OUTSIDE))


STIFFNESS = 500.0
"""Penalty of a point, in shear moduli over the size of a face."""
DEPTH = 0.01
"""Default of the largest penetration at equilibrium, as a share of the size of a face [-]."""
NEAREST = 12
"""Number of trial faces for a closest point."""
PROJECTIONS = 12
"""Maximum number of iterations for a closest point."""


@dataclass(frozen=True)
class Touch:
    """Points of the first surface within the search distance of the second, in a state."""

    points: IntArray
    """Their numbers, face by face, shape [t]."""
    faces: IntArray
    """Faces of the second surface with their closest points, shape [t]."""
    gaps: FloatArray
    """Gaps [m], negative for penetration, shape [t]."""
    places: FloatArray
    """Coordinates of the closest points in the faces [-], shape [t, d - 1]."""


class SurfaceContact:
    """The points of one set of a model that touch another set."""

    def __init__(self, model: Model, condition: SelfContact) -> None:
        self.model, self.condition = model, condition
        self.element = _face_element(model.mesh.element)
        self.first = _face_nodes(model, condition.where, self.element)
        self.second = _face_nodes(model, condition.other, self.element)
        if np.intersect1d(self.first, self.second).size:
            raise ValueError(f"the surfaces of {condition} share points: they cannot touch there")
        d = model.dimension
        held = [dofs for dofs, *_ in model.unknowns.prescribed]
        own = components(np.unique([*self.first.ravel(), *self.second.ravel()])[:, None], d)
        if held and np.intersect1d(np.concatenate(held), own).size:
            raise ValueError(f"a surface of {condition} has prescribed displacements: hold another set")
        points, weights = _contact_rule(self.element)
        self.values = self.element.values(points)
        slopes = self.element.gradients(points)
        X = model.mesh.points[self.first]
        self.areas = face_areas(model, X, self.values, slopes, weights).ravel()
        lengths = sizes(np.einsum("gkt,fkd->fgtd", slopes, X)) @ weights
        self.size = float(np.mean(lengths)) ** (1.0 / (d - 1))
        self.stiffness = 0.5 * condition.penalty * model.solid.shear_modulus / self.size
        self.depth = DEPTH * self.size if condition.depth is None else condition.depth
        self._last: tuple[FloatArray, Touch] | None = None

    def touch(self, u: FloatArray) -> Touch:
        """Closest points at displacements [m] of shape [n d]."""
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), self._search(u)
        return self._last[1]

    def pressures(self, u: FloatArray) -> FloatArray:
        """Contact pressure on every point of the first surface [Pa], shape [f g]."""
        found = np.zeros(len(self.areas))
        near = self.touch(u)
        found[near.points] = self.stiffness * np.maximum(0.0, -near.gaps)
        return found

    def deepest(self, u: FloatArray) -> float:
        """Largest depth of a point [m]."""
        return float(np.maximum(0.0, -self.touch(u).gaps).max(initial=0.0))

    def force(self, u: FloatArray) -> float:
        """Sum of the pressures over the undeformed area [N]."""
        return float(self.areas @ self.pressures(u))

    def potential(self, u: FloatArray) -> float:
        """Eq. (C.1) [J]."""
        return float(self.areas @ self.pressures(u) ** 2) / (2.0 * self.stiffness)

    def forces(self, u: FloatArray) -> FloatArray:
        """Forces on all points [N], shape [n d]."""
        total = np.zeros(self.model.mesh.points.shape)
        near = self._active(u)
        nodes, D, n, *_ = self._geometry(u, near)
        push = self.areas[near.points] * self.stiffness * -near.gaps
        np.add.at(total, nodes, push[:, None, None] * D[..., None] * n[:, None])
        return total.reshape(-1)

    def blocks(self, u: FloatArray) -> tuple[IntArray, FloatArray]:
        """Pairs of faces in contact, numbered by first and second, shape [p, 2]. The stiffness of the points
        of both faces [N/m], shape [p, 2 k d, 2 k d], is also returned."""
        near, d, k = self._active(u), self.model.dimension, self.first.shape[1]
        pairs = np.stack([near.points // len(self.values), near.faces], axis=-1)
        unique, which = np.unique(pairs, axis=0, return_inverse=True)
        total = np.zeros((len(unique), 2 * k * d, 2 * k * d))
        np.add.at(total, which.ravel(), self._tangents(u, near))
        return unique.reshape(-1, 2), total

    def nodes_of(self, pairs: IntArray) -> IntArray:
        """Points of both faces of pairs, shape [p, 2 k]."""
        return np.concatenate([self.first[pairs[:, 0]], self.second[pairs[:, 1]]], axis=1)

    def _active(self, u: FloatArray) -> Touch:
        near = self.touch(u)
        deep = near.gaps < 0.0
        return replace(
            near,
            points=near.points[deep], faces=near.faces[deep],
            gaps=near.gaps[deep], places=near.places[deep],
        )  # fmt: skip

    def _geometry(
        self, u: FloatArray, near: Touch
    ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """X [t, 2 k], D [t, 2 k], normals [t, d], tangents [t, d - 1, d], n . X,ab, slopes [t, k, d - 1]."""
        x = self.model.mesh.points + u.reshape(-1, self.model.dimension)
        own, g = np.divmod(near.points, len(self.values))
        second = self.second[near.faces]
        slopes = self.element.gradients(near.places)
        tangents = np.einsum("tka,tkd->tad", slopes, x[second])
        n = normals(tangents)
        bent = np.einsum("tkab,tkd->tabd", self.element.curvatures(near.places), x[second])
        D = np.concatenate([self.values[g], -self.element.values(near.places)], axis=1)
        nodes = np.concatenate([self.first[own], second], axis=1)
        return nodes, D, n, tangents, np.einsum("tabd,td->tab", bent, n), slopes

    def _tangents(self, u: FloatArray, near: Touch) -> FloatArray:
        """Eq. (C.2) of each point, shape [t, 2 k d, 2 k d]."""
        nodes, D, n, tangents, curvature, slopes = self._geometry(u, near)
        t, count = nodes.shape
        size = count * self.model.dimension
        normal = np.einsum("tj,td->tjd", D, n).reshape(t, size)
        along = np.einsum("tj,tad->tajd", D, tangents).reshape(t, tangents.shape[1], size)
        turned = np.zeros((t, tangents.shape[1], count, self.model.dimension))
        turned[:, :, count // 2 :] = np.einsum("tka,td->takd", slopes, n)
        turned = turned.reshape(along.shape)
        metric = np.einsum("tad,tbd->tab", tangents, tangents)
        g = near.gaps[:, None, None]
        inverse = np.linalg.inv(metric - g * curvature)
        bend = np.linalg.inv(metric) @ curvature @ inverse
        mixed = np.einsum("tai,tab,tbj->tij", along, inverse, turned)
        second = -np.einsum("tai,tab,tbj->tij", along, bend, along) - mixed - np.swapaxes(mixed, 1, 2)
        second -= g * np.einsum("tai,tab,tbj->tij", turned, inverse, turned)
        stiff = self.stiffness * (normal[:, :, None] * normal[:, None] + g * second)  # -t = eps g
        return self.areas[near.points, None, None] * stiff

    def _search(self, u: FloatArray) -> Touch:
        x = self.model.mesh.points + u.reshape(-1, self.model.dimension)
        own = np.einsum("gk,fkd->fgd", self.values, x[self.first]).reshape(-1, x.shape[1])
        if not np.isfinite(x).all():
            return Touch(*(np.zeros(0, dtype=np.int64),) * 2, np.zeros(0), np.zeros((0, x.shape[1] - 1)))
        corners = x[self.second]
        tried = min(NEAREST, len(corners))
        centres = corners.mean(axis=1)
        away, faces = cKDTree(centres).query(own, k=[*range(1, tried + 1)])
        radius = np.linalg.norm(corners - centres[:, None], axis=-1).max(axis=1)
        near = away <= radius[faces] + self.size
        points, flat = np.repeat(np.arange(len(own)), tried)[near.ravel()], faces[near]
        places, ended = self._closest(own[points], corners[flat])
        tangents = np.einsum("tka,tkd->tad", self.element.gradients(places), corners[flat])
        at = np.einsum("tk,tkd->td", self.element.values(places), corners[flat])
        gaps = np.einsum("td,td->t", own[points] - at, normals(tangents))
        good = ended & _inside_face(self.element, places) & (np.abs(gaps) <= self.size)
        kept = np.flatnonzero(good)
        kept = kept[np.lexsort((np.abs(gaps[kept]), points[kept]))]
        best = kept[np.unique(points[kept], return_index=True)[1]]  # the nearest of each point
        return Touch(points[best], flat[best], gaps[best], places[best])

    def _closest(self, own: FloatArray, corners: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Coordinates in faces of the points nearest to points, and True if the iteration ended."""
        item = self.element
        middle = item.nodes.mean(axis=0)
        places = np.repeat(middle[None], len(own), axis=0)
        left = np.arange(len(own))  # those whose iteration has not ended
        for _ in range(PROJECTIONS):
            if len(left) == 0:
                break
            at, nodes = places[left], corners[left]
            away = own[left] - np.einsum("tk,tkd->td", item.values(at), nodes)
            tangents = np.einsum("tka,tkd->tad", item.gradients(at), nodes)
            metric = np.einsum("tad,tbd->tab", tangents, tangents)
            hessian = metric - np.einsum(
                "tkab,tk->tab", item.curvatures(at), (nodes @ away[..., None])[..., 0]
            )
            # far from a curved face the Hessian may be indefinite: then only the metric is used
            wrong = np.linalg.det(hessian) <= 1e-3 * np.linalg.det(metric)
            hessian[wrong] = metric[wrong]
            step = np.linalg.solve(hessian, np.einsum("tad,td->ta", tangents, away)[..., None])[..., 0]
            moved = np.clip(at + np.clip(step, -1.0, 1.0), middle - 2.0, middle + 2.0)
            places[left] = moved
            left = left[np.abs(moved - at).max(axis=1) > 1e-9]
        ended = np.ones(len(own), dtype=bool)
        ended[left] = False
        return places, ended


def surface_contacts(model: Model) -> list[SurfaceContact]:
    """The contacts of a model's surfaces, in both directions."""
    found = []
    for c in model.conditions:
        if isinstance(c, SelfContact):
            turned = replace(c, where=c.other, other=c.where)
            found += [SurfaceContact(model, one) for one in (c, turned)]
    return found
