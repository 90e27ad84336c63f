"""Axisymmetric quadrilateral meshes of a cylindrical specimen: nodes, element constants, deformation.

The element is the uniform-strain quadrilateral of Flanagan and Belytschko (1981), in an axisymmetric form
with volume-averaged gradients. The deformation gradient of an element is the volume average of that of the
bilinear field. It is exact for every homogeneous deformation. Its nodal forces pass the patch test to
round-off, also on the axis. All integrals are over a full turn (2 pi R dA).
"""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from explicit.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Quadrilaterals in the half-plane (r, y), r >= 0, with the sets of nodes that a platen can touch.

    Meshes are compared by identity. Quantities computed from a mesh are cached for its lifetime.
    """

    nodes: FloatArray
    """Reference positions (R, Y) [m], shape [n_nodes, 2]."""
    quads: IntArray
    """Corner nodes of each element, counter-clockwise, shape [n_elements, 4]."""
    lower_face: IntArray
    """Nodes of the face on the transmission platen, axis first, corner included."""
    upper_face: IntArray
    """Nodes of the face on the flyer, axis first, corner included."""
    side: IntArray
    """Nodes of the side surface, transmission end first, both corners included."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return len(self.quads)

    @property
    def length(self) -> float:
        """Distance between the faces [m]."""
        return float(self.nodes[:, 1].max() - self.nodes[:, 1].min())

    @cached_property
    def volume(self) -> float:
        """Volume over a full turn, 2 pi times the integral of R over the straight-sided quads [m^3]."""
        R, Y = np.moveaxis(self.nodes[self.quads], -1, 0)
        R_next, Y_next = np.roll(R, -1, axis=1), np.roll(Y, -1, axis=1)
        return float(np.pi / 3.0 * ((R + R_next) * (R * Y_next - R_next * Y)).sum())

    @cached_property
    def centres(self) -> FloatArray:
        """Mean of each element's corners (R, Y), Y above the lower face [m], shape [n_elements, 2]."""
        corners = self.nodes[self.quads]
        return np.asarray(corners.mean(axis=1) - [0.0, self.nodes[:, 1].min()])

    @cached_property
    def on_axis(self) -> NDArray[np.bool_]:
        """Mask of the nodes on the axis of symmetry, shape [n_nodes]."""
        radius = self.nodes[:, 0]
        return radius <= 1e-12 * radius.max()

    @cached_property
    def contact_area(self) -> FloatArray:
        """Undeformed contact area of each node [m^2], shape [n_nodes].

        The row sum 2 pi times the integral of N R along the surface; 0 inside. A corner has its share of the
        end face, not of the side.
        """
        area = np.zeros(self.n_nodes)
        for chain in (self.side, self.lower_face, self.upper_face):
            start, end = self.nodes[chain[:-1]], self.nodes[chain[1:]]
            ring = np.pi / 3.0 * np.hypot(*(end - start).T)
            share = np.zeros(len(chain))
            share[:-1] += ring * (2.0 * start[:, 0] + end[:, 0])
            share[1:] += ring * (start[:, 0] + 2.0 * end[:, 0])
            area[chain] = share
        return area

    @cached_property
    def corners_of_node(self) -> tuple[IntArray, IntArray]:
        """Element corners that meet at each node. The first array has the first entry of each node, shape
        [n_nodes + 1]. The second has the flat corner index 4 * element + position, shape [4 n_elements]. The
        index is ascending for each node; a gather therefore adds the corner forces in a fixed order."""
        flat = self.quads.ravel()
        corner = np.argsort(flat, kind="stable")
        start = np.searchsorted(flat[corner], np.arange(self.n_nodes + 1))
        return start, corner


def cylinder(
    radius: float, length: float, *, n_radial: int = 16, n_axial: int = 22, grading: float = 1.0
) -> Mesh:
    """Mesh a right circular cylinder with rectangles.

    Parameters
    ----------
    radius, length : float
        Size of the specimen [m], positive.
    n_radial, n_axial : int
        Elements across the radius and along the length; 16 x 22 is the mesh of Mates et al. (2012).
    grading : float
        Size of the largest element over the smallest. Above 1 the size decreases geometrically toward the
        side surface and both faces, where the specimen rolls onto the platens.

    Raises
    ------
    ValueError
        If a size is not positive, there are fewer than 2 elements in a direction, or grading < 1.

    Examples
    --------
    >>> from explicit import cylinder
    >>> cylinder(5e-3, 6e-3, n_radial=4, n_axial=6).n_elements
    24
    """
    if not (radius > 0.0 and length > 0.0):
        raise ValueError(f"radius and length must be > 0 m, got {radius} and {length}")
    if n_radial < 2 or n_axial < 2:
        raise ValueError(f"n_radial and n_axial must be >= 2, got {n_radial} and {n_axial}")
    if not grading >= 1.0:
        raise ValueError(f"grading must be >= 1, got {grading}")
    across = _graded(np.linspace(0.0, 1.0, n_radial), grading)
    along = _graded(np.abs(np.linspace(-1.0, 1.0, n_axial)), grading)
    r, y = np.meshgrid(radius * across, length * along)
    index = np.arange(r.size).reshape(n_axial + 1, n_radial + 1)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    return Mesh(
        nodes=np.column_stack([r.ravel(), y.ravel()]),
        quads=quads.reshape(-1, 4),
        lower_face=index[0].copy(),
        upper_face=index[-1].copy(),
        side=index[:, -1].copy(),
    )


def _graded(place: FloatArray, grading: float) -> FloatArray:
    """Node positions in [0, 1] of elements whose sizes decrease geometrically from 0 to 1."""
    edges = np.concatenate([[0.0], np.cumsum(grading ** (-place))])
    return edges / edges[-1]


_HOURGLASS = np.array([1.0, -1.0, 1.0, -1.0])
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners of the reference square of all elements [-]."""


def bilinear(xi: float, eta: float) -> tuple[FloatArray, FloatArray]:
    """Shape functions of the corners at a point of the square, and their slopes, shapes [4] and [4, 2]."""
    x, y = CORNERS.T
    along, across = 1.0 + xi * x, 1.0 + eta * y
    return 0.25 * along * across, 0.25 * np.column_stack([x * across, y * along])


@dataclass(frozen=True)
class ElementGeometry:
    """Reference-configuration constants of every element."""

    volume: FloatArray
    """Volume of the ring [m^3], shape [n_elements]."""
    gradient_r: FloatArray
    """Volume-averaged dN/dR of each corner [1/m], shape [n_elements, 4]."""
    gradient_y: FloatArray
    """Volume-averaged dN/dY of each corner [1/m], shape [n_elements, 4]."""
    hoop: FloatArray
    """Volume-averaged N/R of each corner [1/m], shape [n_elements, 4]."""
    gamma: FloatArray
    """Hourglass vector: orthogonal to every linear field, 1 on the pattern (1, -1, 1, -1) [-],
    shape [n_elements, 4]."""
    hourglass_r: FloatArray
    """Hourglass stiffness of radial motion per unit shear modulus [m], shape [n_elements]."""
    hourglass_y: FloatArray
    """Hourglass stiffness of axial motion per unit shear modulus [m], shape [n_elements]."""
    corner_volume: FloatArray
    """Row-sum share of the volume at each corner [m^3], shape [n_elements, 4]."""


_GEOMETRIES: WeakKeyDictionary[Mesh, ElementGeometry] = WeakKeyDictionary()


def element_geometry(mesh: Mesh) -> ElementGeometry:
    """Integrate the element constants of a mesh with 3 x 3 Gauss points, once.

    Raises ValueError if an element has a non-positive Jacobian; the message names it.
    """
    if mesh not in _GEOMETRIES:
        _GEOMETRIES[mesh] = _integrate(mesh)
    return _GEOMETRIES[mesh]


def _integrate(mesh: Mesh) -> ElementGeometry:
    points, weights = np.polynomial.legendre.leggauss(3)
    corners = mesh.nodes[mesh.quads]
    n = mesh.n_elements
    volume = np.zeros(n)
    gradient = np.zeros((n, 4, 2))
    hoop = np.zeros((n, 4))
    corner_volume = np.zeros((n, 4))
    pattern_r = np.zeros(n)
    pattern_y = np.zeros(n)
    for xi, w_xi in zip(points, weights, strict=True):
        for eta, w_eta in zip(points, weights, strict=True):
            shape, local = bilinear(xi, eta)
            jacobian = np.einsum("ai,eaj->eij", local, corners)
            det = np.linalg.det(jacobian)
            if (det <= 0.0).any():
                bad = int(np.argmax(det <= 0.0))
                raise ValueError(
                    f"element {bad} has Jacobian {det[bad]:.3g} <= 0: number its corners counter-clockwise"
                )
            slope = np.einsum("eij,aj->eai", np.linalg.inv(jacobian), local)
            radius = corners[:, :, 0] @ shape
            dv = 2.0 * np.pi * radius * det * w_xi * w_eta
            volume += dv
            gradient += slope * dv[:, None, None]
            hoop += shape / radius[:, None] * dv[:, None]
            corner_volume += shape * dv[:, None]
            # The bilinear field of the pattern (1, -1, 1, -1): one-point integration misses its gradient
            # energy.
            pattern = np.einsum("a,eai->ei", _HOURGLASS, slope)
            value = float(_HOURGLASS @ shape)
            squared = (pattern**2).sum(axis=1)
            pattern_y += squared * dv
            pattern_r += (squared + (value / radius) ** 2) * dv
    gradient /= volume[:, None, None]
    hoop /= volume[:, None]
    drift = np.einsum("a,eai->ei", _HOURGLASS, corners)
    gamma = 0.25 * (_HOURGLASS - np.einsum("ei,eai->ea", drift, gradient))
    return ElementGeometry(
        volume=volume,
        gradient_r=gradient[:, :, 0],
        gradient_y=gradient[:, :, 1],
        hoop=hoop,
        gamma=gamma,
        hourglass_r=pattern_r,
        hourglass_y=pattern_y,
        corner_volume=corner_volume,
    )


def deformation_gradient(mesh: Mesh, nodes: ArrayLike) -> FloatArray:
    """Volume-averaged deformation gradient of each element, i.e. that of the stress point of "one_point".

    ``nodes``: positions (r, y) of its nodes [m], shape [..., n_nodes, 2]. Returns: in (r, y, hoop) [-], shape
    [..., n_elements, 3, 3].
    """
    x = np.asarray(nodes, dtype=float)
    if x.shape[-2:] != (mesh.n_nodes, 2):
        raise ValueError(f"nodes must have shape [..., {mesh.n_nodes}, 2], got {list(x.shape)}")
    shape = element_geometry(mesh)
    corners = x[..., mesh.quads, :]
    F = np.zeros((*corners.shape[:-2], 3, 3))
    for column, gradient in enumerate((shape.gradient_r, shape.gradient_y)):
        F[..., :2, column] = np.einsum("...eai,ea->...ei", corners, gradient)
    F[..., 2, 2] = np.einsum("...ea,ea->...e", corners[..., 0], shape.hoop)
    return F


def corner_areas(mesh: Mesh, nodes: FloatArray) -> FloatArray:
    """Area that the sides of an element span at each corner, over the undeformed area [-].

    A simulation ends when a stress point is turned inside out. A corner can be turned inside out long before.
    The one-point element has no stress point at a corner, and those of full integration lie inside.

    ``nodes``: positions (r, y) [m], shape [..., n_nodes, 2]. Returns: below 0 where a corner is turned inside
    out, shape [..., n_elements, 4].
    """
    return np.asarray(_spanned(mesh, nodes) / _spanned(mesh, mesh.nodes))


def _spanned(mesh: Mesh, nodes: FloatArray) -> FloatArray:
    corner = nodes[..., mesh.quads, :]
    ahead = np.roll(corner, -1, axis=-2) - corner
    behind = np.roll(corner, 1, axis=-2) - corner
    return np.asarray(ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0])
