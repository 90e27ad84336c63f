"""Meshes: points, cells and sets; structured meshes of boxes, crosses and dog-bones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np

from explicit.arrays import BoolArray, FloatArray, IntArray
from kolsky.equilibrium.elements import Element, element, lattice

SIDES = (("left", "right"), ("bottom", "top"), ("back", "front"))
"""Names of the node sets at the smallest and the largest coordinate of each axis."""


@dataclass(frozen=True)
class Mesh:
    """Points, cells of one kind, and named sets of points."""

    points: FloatArray
    """Coordinates [m], shape [n, d]; (r, z) in an axisymmetric model."""
    cells: IntArray
    """Points of each cell, in the order of VTK, shape [m, k]."""
    kind: str
    """The element, a name in `kolsky.equilibrium.elements.ELEMENTS`."""
    sets: Mapping[str, IntArray] = field(default_factory=dict)
    """Points by name, each of shape [...]."""
    numbers: IntArray | None = None
    """Number of each cell in its source file, for messages, shape [m]. None: its row."""

    def __post_init__(self) -> None:
        shape = self.element.n_nodes, self.element.dimension
        if self.cells.ndim != 2 or self.cells.shape[1] != shape[0]:
            raise ValueError(f"cells of {self.kind} have {shape[0]} points, got shape {self.cells.shape}")
        if self.points.ndim != 2 or self.points.shape[1] != shape[1]:
            raise ValueError(f"points of {self.kind} have shape [n, {shape[1]}], got {self.points.shape}")
        if not np.isfinite(self.points).all():
            raise ValueError("points must be finite")
        if self.cells.min(initial=0) < 0 or self.cells.max(initial=-1) >= len(self.points):
            raise ValueError(f"cells must name points in [0, {len(self.points) - 1}]")

    @property
    def element(self) -> Element:
        """The element of the cells."""
        return element(self.kind)

    @property
    def dimension(self) -> int:
        """Number of coordinates d."""
        return int(self.points.shape[1])

    def nodes(self, name: str) -> IntArray:
        """Points of a set.

        Raises ValueError if there is no such set. The message lists the sets.
        """
        if name not in self.sets:
            raise ValueError(f"the mesh has no set {name!r}; it has {sorted(self.sets)}")
        return np.asarray(self.sets[name], dtype=np.int64)

    def with_set(self, name: str, where: Callable[[FloatArray], BoolArray] | IntArray) -> "Mesh":
        """The mesh with one more set, given by indices or by a function of the points."""
        found = np.flatnonzero(where(self.points)) if callable(where) else np.asarray(where, dtype=np.int64)
        if len(found) == 0:
            raise ValueError(f"the set {name!r} would be empty")
        return replace(self, sets={**self.sets, name: found})


def components(nodes: IntArray, dimension: int) -> IntArray:
    """Components of the displacement of points [m, k], point by point, shape [m, k d]."""
    return (nodes[..., None] * dimension + np.arange(dimension)).reshape(len(nodes), -1)


def box(size: Sequence[float], cells: Sequence[int], *, kind: str = "hex27") -> Mesh:
    """A box (a rectangle in two dimensions) with its corner at the origin.

    ``size``: edge lengths [m], d of them. ``cells``: number of hexahedra or quadrilaterals along each edge.
    For simplices, each is divided into six tetrahedra or two triangles. ``kind``: the element.
    """
    return _structured(size, cells, kind, None)


def rectangle(size: Sequence[float], cells: Sequence[int], *, kind: str = "quad9") -> Mesh:
    """A rectangle; see `box`."""
    return _structured(size, cells, kind, None)


def cross(size: Sequence[float], cells: Sequence[int], corner: Sequence[int], *, kind: str = "hex27") -> Mesh:
    """A box (or rectangle) without its four corners in x and y, each of ``corner`` cells."""
    nx, ny = cells[0], cells[1]
    if not (0 < 2 * corner[0] < nx and 0 < 2 * corner[1] < ny):
        raise ValueError(f"corner must leave cells of {tuple(cells[:2])} in both axes, got {tuple(corner)}")
    inside = np.ones((nx, ny), dtype=bool)
    for i in (slice(None, corner[0]), slice(nx - corner[0], None)):
        for j in (slice(None, corner[1]), slice(ny - corner[1], None)):
            inside[i, j] = False
    keep = inside if len(cells) == 2 else np.repeat(inside[..., None], cells[2], axis=2)
    return _structured(size, cells, kind, keep)


def dog_bone(
    size: Sequence[float], cells: Sequence[int], *, waist: float, straight: float, kind: str = "hex27"
) -> Mesh:
    """A bar along x with a waist: its width (along y) is ``waist`` [m] over the length ``straight`` [m]. The
    waist is in the middle. Toward the ends, the width increases by a cosine."""
    if not 0.0 < waist <= size[1]:
        raise ValueError(f"waist must be in (0, {size[1]}] m, got {waist}")
    if not 0.0 <= straight < size[0]:
        raise ValueError(f"straight must be in [0, {size[0]}) m, got {straight}")
    mesh = _structured(size, cells, kind, None)
    ramp = 0.5 * (size[0] - straight)
    away = np.clip((np.abs(mesh.points[:, 0] - 0.5 * size[0]) - 0.5 * straight) / ramp, 0.0, 1.0)
    width = waist + (size[1] - waist) * 0.5 * (1.0 - np.cos(np.pi * away))
    points = mesh.points.copy()
    middle = 0.5 * size[1]
    points[:, 1] = middle + (points[:, 1] - middle) * width / size[1]
    return replace(mesh, points=points)


def grid(lines: Sequence[FloatArray], keep: BoolArray, *, kind: str = "hex27") -> Mesh:
    """Cells of a rectangular grid with any spacing. Some cells may be left out.

    ``lines``: increasing coordinates of the grid lines along each axis [m], d of them. ``keep``: mask of the
    existing cells, shape [n_0, .., n_(d-1)] with n_i one less than the number of lines. ``kind``: the
    element; with simplices, a cell is divided into six tetrahedra or two triangles. Raises ValueError if
    lines do not increase, or if `keep` has another shape or no cell.
    """
    shape = tuple(len(line) - 1 for line in lines)
    if keep.shape != shape or not keep.any():
        raise ValueError(f"keep must have shape {shape} and a cell in it, got {keep.shape}")
    if any((np.diff(line) <= 0.0).any() for line in lines):
        raise ValueError("the lines of a grid must rise")
    unit = _structured([float(n) for n in shape], shape, kind, keep)
    placed = [np.interp(unit.points[:, i], np.arange(len(line)), line) for i, line in enumerate(lines)]
    return replace(unit, points=np.stack(placed, axis=-1))


def _structured(size: Sequence[float], cells: Sequence[int], kind: str, keep: BoolArray | None) -> Mesh:
    item = element(kind)
    d = item.dimension
    if len(size) != d or len(cells) != d:
        raise ValueError(f"{kind} needs {d} edge lengths and numbers of cells, got {len(size)}, {len(cells)}")
    if min(size) <= 0.0 or min(cells) < 1:
        raise ValueError(f"size must be > 0 m and cells >= 1, got {tuple(size)} and {tuple(cells)}")
    order = int(item.exponents.max())
    patterns = _patterns(item) * order  # nodes in the unit cell, in steps of the lattice
    counts = np.asarray(cells)
    corners = lattice([np.arange(n) for n in cells])
    chosen = corners if keep is None else corners[keep.ravel()]
    nodes = order * counts + 1
    index = np.rint(order * chosen[:, None, None, :] + patterns[None]).astype(np.int64)
    flat = np.ravel_multi_index(tuple(np.moveaxis(index, -1, 0)), tuple(nodes)).reshape(-1, item.n_nodes)
    axes = [np.linspace(0.0, length, n) for length, n in zip(size, nodes, strict=True)]
    mesh = _used(Mesh(lattice(axes), flat, kind))
    sets = {}
    for axis, names in enumerate(SIDES[:d]):
        for name, end in zip(names, (0.0, size[axis]), strict=True):
            sets[name] = np.flatnonzero(np.abs(mesh.points[:, axis] - end) < 1e-9 * size[axis])
    return replace(mesh, sets=sets)


def _patterns(item: Element) -> FloatArray:
    """Node coordinates of the elements that fill the unit cell, shape [parts, k, d]."""
    if item.shape == "hypercube":
        return 0.5 * (item.nodes[None] + 1.0)
    d, parts = item.dimension, []
    for order in permutations(range(d)):  # Kuhn's simplices: from (0..0) to (1..1), an axis after the other
        corners = np.zeros((d + 1, d))
        for step, axis in enumerate(order):
            corners[step + 1 :, axis] = 1.0
        edges = corners[1:] - corners[0]
        if np.linalg.det(edges) < 0.0:
            corners[[1, 2]] = corners[[2, 1]]
            edges = corners[1:] - corners[0]
        parts.append(corners[0] + item.nodes @ edges)
    return np.array(parts)


def _used(mesh: Mesh) -> Mesh:
    """The mesh without points that belong to no cell."""
    used, cells = np.unique(mesh.cells, return_inverse=True)
    return Mesh(mesh.points[used], cells.reshape(mesh.cells.shape).astype(np.int64), mesh.kind)
