"""The mesh's constants as the time loop reads them on a device: an argument that is made once."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.arrays import FloatArray, IntArray
from explicit.elements import element
from explicit.geometry import element_geometry
from explicit.mesh import Mesh
from explicit.model import Model
from explicit.precision import Precision
from explicit.time_loop.boundary import INTERIOR, LOWER, SIDE, UPPER
from explicit.time_loop.chip_layout import apart, fits_on_chips, spread_corners, spread_nodes
from explicit.time_loop.grouped_tables import GROUP, LOADED_BYTES, grouped
from explicit.time_loop.kernel import TimeLoopKernel
from explicit.time_loop.lanes import BLOCK
from explicit.time_loop.node_sweeps import VALENCE
from explicit.time_loop.state_layout import fits, on_chip_elements

SPARE = 16
"""Entries behind every row that a pack may read: the most lanes there are."""


_BODIES: WeakKeyDictionary[Mesh, dict[Any, Any]] = WeakKeyDictionary()


def body_of(
    kernel: TimeLoopKernel, model: Model, numbers: Precision, where: Any, on_chip: bool = False
) -> Any:
    """The mesh's constants on a device, every node in its place of `node_order`; made once."""
    known = _BODIES.setdefault(model.mesh, {})
    made_for = (str(where), on_chip, kernel.cluster)
    key = (kernel.structs.Body, model.density, model.element, numbers.name, *made_for)
    if key not in known:
        known[key] = _new_body(kernel, model, numbers, where, on_chip)
    return known[key]


def _new_body(kernel: TimeLoopKernel, model: Model, numbers: Precision, where: Any, on_chip: bool) -> Any:
    mesh, mass = model.mesh, nodal_mass(model.mesh, model.density)
    shapes = element(model.element).shapes(mesh, model.density, kernel.element.Shape.numpy_dtype())
    place, n_inner, first_boundary = node_order(mesh)
    boundary = np.argsort(place)[n_inner:]
    kind = node_kinds(mesh)[boundary]
    body = kernel.structs.Body()
    body.n_elements, body.n_nodes, body.length = mesh.n_elements, first_boundary + len(boundary), mesh.length
    body.n_inner, body.first_boundary, body.n_boundary = n_inner, first_boundary, len(boundary)

    def placed(values: NDArray[Any]) -> NDArray[Any]:
        row = np.zeros((*values.shape[:-1], body.n_nodes), dtype=values.dtype)
        row[..., place] = values
        return row

    area = mesh.contact_area
    surface_mass = np.divide(mass, area, out=np.full(mesh.n_nodes, np.inf), where=area > 0.0)
    masses = np.stack([mass, np.where(mesh.on_axis, 0.0, 1.0 / mass), 1.0 / mass, np.zeros(mesh.n_nodes)])
    height = mesh.nodes[:, 1] - mesh.nodes[:, 1].min()
    spread = on_chip and kernel.cluster > 1
    slots = on_chip_elements(numbers) if on_chip and not spread else mesh.n_elements
    corners = _corner_table(mesh, slots, place, 1 if where.is_cuda else SPARE)
    quads = place[mesh.quads.T]
    if spread:
        corners = _corners_on_chips(corners, slots, place, first_boundary, kernel.cluster, numbers)
        quads = spread_nodes(quads, first_boundary, kernel.cluster, numbers)

    def table(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
        return grouped(values.astype(dtype), loaded=LOADED_BYTES if where.is_cuda else 0)

    for name, values, dtype in (
        ("shapes", table(_side_by_side(shapes, numbers.dtype), numbers.dtype), numbers.real),
        ("quads", table(quads, np.int32), int),
        ("corners", table(placed(corners), np.int32), int),
        ("masses", table(placed(masses), numbers.dtype), numbers.real),
        ("reference_r", placed(mesh.nodes[:, 0]), wp.float64),
        ("reference_y", placed(height), wp.float64),
        ("surface_mass", surface_mass[boundary], numbers.real),
        ("kind", kind, int),
        ("at_rest", kind != SIDE, int),
    ):
        setattr(body, name, wp.array(padded(values), dtype=dtype, device=where))
    return body


def _corners_on_chips(
    corners: IntArray, slots: int, place: IntArray, first_boundary: int, blocks: int, numbers: Precision
) -> IntArray:
    """The table of corner forces for blocks that keep them in their shared memories; what holds zero is in a
    node's own."""
    spread = spread_corners(corners % slots, corners // slots, numbers)
    mine = spread_nodes(place, first_boundary, blocks, numbers) // apart(numbers) * apart(numbers)
    return np.where(corners < 4 * slots, spread, mine + 4 * BLOCK)


def nodal_mass(mesh: Mesh, density: float) -> FloatArray:
    """The lumped mass of every node [kg]."""
    shares = density * element_geometry(mesh).corner_volume
    mass = np.zeros(mesh.n_nodes)
    np.add.at(mass, mesh.quads.ravel(), shares.ravel())
    return mass


def fits_on_chip(mesh: Mesh, numbers: Precision) -> bool:
    """True if the state of one simulation fits into a GPU's shared memory."""
    _, n_inner, first_boundary = node_order(mesh)
    n_boundary = mesh.n_nodes - n_inner
    return fits(first_boundary + n_boundary, mesh.n_elements, n_boundary, numbers)


def fits_on_several(mesh: Mesh, blocks: int) -> bool:
    """True if it fits into the shared memories of so many blocks."""
    _, n_inner, first_boundary = node_order(mesh)
    return fits_on_chips(mesh.n_elements, first_boundary, mesh.n_nodes - n_inner, blocks)


def node_order(mesh: Mesh) -> tuple[IntArray, int, int]:
    """Place of every node in the time loop's fields, number of interior nodes, first place of the boundary
    nodes, which begin a group of their own."""
    inner = node_kinds(mesh) == INTERIOR
    first_boundary = -(-int(inner.sum()) // GROUP) * GROUP
    place = np.where(inner, np.cumsum(inner) - 1, first_boundary + np.cumsum(~inner) - 1)
    return place, int(inner.sum()), first_boundary


def node_kinds(mesh: Mesh) -> IntArray:
    """Kind of each node: the platen it can meet, see `explicit.time_loop.boundary`."""
    kind = np.full(mesh.n_nodes, INTERIOR)
    kind[mesh.side] = SIDE
    kind[mesh.lower_face] = LOWER
    kind[mesh.upper_face] = UPPER
    return kind


def _corner_table(mesh: Mesh, slots: int, place: IntArray, zeros: int) -> IntArray:
    """Places of each node's corner forces, shape [VALENCE, n_nodes].

    Corner by corner with so many slots each, elements side by side; so many entries past the last one hold
    zero, and neighbours read neighbouring ones.

    A node finds the element whose k-th corner it is at its k-th place, if no other element took that place,
    so that neighbours find neighbours.
    """
    start, corner = mesh.corners_of_node
    count = np.diff(start)
    if count.max() > VALENCE:
        raise ValueError(
            f"at most {VALENCE} elements may meet at a node, {count.max()} do at node {count.argmax()}"
        )
    node = np.repeat(np.arange(mesh.n_nodes), count)
    nothing = 4 * slots + place % zeros
    table = np.tile(nothing, (VALENCE, 1))
    table[np.arange(len(corner)) - start[node], node] = corner % 4 * slots + corner // 4
    taken = np.bincount(4 * node + corner % 4, minlength=4 * mesh.n_nodes).reshape(-1, 4)
    regular = np.asarray(taken.max(axis=1) <= 1)
    here = np.asarray(regular[node])
    table[:, regular] = nothing[regular]
    table[(corner % 4)[here], node[here]] = (corner % 4 * slots + corner // 4)[here]
    return table


def padded(values: NDArray[Any]) -> NDArray[Any]:
    """An array with room behind every row: a pack that begins inside may reach past the end."""
    kind = np.int32 if values.dtype.kind in "ib" else np.float64
    return np.pad(values.astype(kind), [(0, 0)] * (values.ndim - 1) + [(0, SPARE)])


def _side_by_side(shapes: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The numbers of structs, shape [numbers of a struct, n_elements]."""
    numbers = shapes.view(dtype).reshape(len(shapes), -1)
    if shapes.dtype.itemsize != numbers.shape[1] * numbers.dtype.itemsize:
        raise TypeError("an element's shape must consist of real numbers alone")
    return numbers.T
