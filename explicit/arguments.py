"""The arguments of the time loop on a device: the mesh's constants, a batch's parameters, state and output.

The mesh's tables are made once. Small arrays share one allocation and one copy. Each operation takes about
ten microseconds for any size, and a batch has twenty arrays.
"""

from collections.abc import Mapping
from functools import cache
from math import prod
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.arrays import FloatArray, IntArray
from explicit.contact import contact_law
from explicit.elements import element
from explicit.layout.lanes import BLOCK, WARPS
from explicit.layout.state import (
    fits,
    fits_on_chips,
    numbers_between_blocks,
    on_chip_elements,
    spread_corners,
    spread_nodes,
)
from explicit.layout.structs import CONTROL_SIZE, GROUP, LOADED_BYTES, Ending, Total, grouped
from explicit.materials import bulk_modulus
from explicit.mesh import Mesh, element_geometry
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.platens import RIGID, CharacteristicBar, MovingSupport
from explicit.precision import Precision
from explicit.time_loop.element_sweeps import STRAY_ENERGY
from explicit.time_loop.kernel import TimeLoopKernel
from explicit.time_loop.node_sweeps import BAR_HISTORY, INTERIOR, LOWER, SIDE, UPPER, VALENCE

SPARE = 16
"""Number of entries behind every row that a pack may read: the largest number of lanes."""


_BODIES: WeakKeyDictionary[Mesh, dict[Any, Any]] = WeakKeyDictionary()


def body_of(
    kernel: TimeLoopKernel, model: Model, numbers: Precision, where: Any, on_chip: bool = False
) -> Any:
    """The mesh's constants on a device, with the nodes in the order of `node_order`; made once."""
    bodies = _BODIES.setdefault(model.mesh, {})
    made_for = (str(where), on_chip, kernel.cluster)
    key = (kernel.structs.Body, model.density, model.element, numbers.name, *made_for)
    if key not in bodies:
        bodies[key] = _new_body(kernel, model, numbers, where, on_chip)
    return bodies[key]


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
    """The table of corner forces in the shared memories of blocks, with the zeros in the node's own block."""
    spread = spread_corners(corners % slots, corners // slots, numbers)
    mine = (
        spread_nodes(place, first_boundary, blocks, numbers)
        // numbers_between_blocks(numbers)
        * numbers_between_blocks(numbers)
    )
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
    """True if it fits into the shared memories of this many blocks."""
    _, n_inner, first_boundary = node_order(mesh)
    return fits_on_chips(mesh.n_elements, first_boundary, mesh.n_nodes - n_inner, blocks)


def node_order(mesh: Mesh) -> tuple[IntArray, int, int]:
    """Index of every node in the time loop's fields, number of interior nodes, and first index of the
    boundary nodes. The boundary nodes begin a new group.
    """
    inner = node_kinds(mesh) == INTERIOR
    first_boundary = -(-int(inner.sum()) // GROUP) * GROUP
    place = np.where(inner, np.cumsum(inner) - 1, first_boundary + np.cumsum(~inner) - 1)
    return place, int(inner.sum()), first_boundary


def node_kinds(mesh: Mesh) -> IntArray:
    """Kind of each node: the platen that it can touch, see `explicit.time_loop.node_sweeps`."""
    kind = np.full(mesh.n_nodes, INTERIOR)
    kind[mesh.side] = SIDE
    kind[mesh.lower_face] = LOWER
    kind[mesh.upper_face] = UPPER
    return kind


def _corner_table(mesh: Mesh, slots: int, place: IntArray, zeros: int) -> IntArray:
    """Indices of each node's corner forces, shape [VALENCE, n_nodes].

    The forces are stored corner by corner, in `slots` for the elements; `zeros` entries after them are for
    nodes with fewer elements. The k-th entry of a node is the element whose k-th corner it is, if this entry
    is free: neighbouring nodes then read neighbouring elements.
    """
    start, corner = mesh.corners_of_node
    count = np.diff(start)
    if count.max() > VALENCE:
        raise ValueError(
            f"at most {VALENCE} elements may meet at a node, {count.max()} do at node {count.argmax()}"
        )
    node = np.repeat(np.arange(mesh.n_nodes), count)
    zero_place = 4 * slots + place % zeros
    table = np.tile(zero_place, (VALENCE, 1))
    table[np.arange(len(corner)) - start[node], node] = corner % 4 * slots + corner // 4
    use = np.bincount(4 * node + corner % 4, minlength=4 * mesh.n_nodes).reshape(-1, 4)
    regular = np.asarray(use.max(axis=1) <= 1)
    selected = np.asarray(regular[node])
    table[:, regular] = zero_place[regular]
    table[(corner % 4)[selected], node[selected]] = (corner % 4 * slots + corner // 4)[selected]
    return table


def padded(values: NDArray[Any]) -> NDArray[Any]:
    """An array with room behind every row: a pack that begins inside a row may reach past its end."""
    kind = np.int32 if values.dtype.kind in "ib" else np.float64
    return np.pad(values.astype(kind), [(0, 0)] * (values.ndim - 1) + [(0, SPARE)])


def _side_by_side(shapes: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The numbers of structs, shape [numbers of a struct, n_elements]."""
    numbers = shapes.view(dtype).reshape(len(shapes), -1)
    if shapes.dtype.itemsize != numbers.shape[1] * numbers.dtype.itemsize:
        raise TypeError("an element's shape must consist of real numbers alone")
    return numbers.T


APART = 256
"""Every array begins at a multiple of this number of bytes, like a separate allocation."""


def in_one_copy(values: Mapping[str, tuple[NDArray[Any], Any]], where: Any) -> dict[str, Any]:
    """Arrays on a device, by name."""
    converted = {name: (_as(numbers, dtype), dtype) for name, (numbers, dtype) in values.items()}
    places, end = {}, 0
    for name, (numbers, _) in converted.items():
        places[name] = end
        end += -(-max(numbers.nbytes, 1) // APART) * APART
    piece = np.zeros(end, dtype=np.uint8)
    for name, (numbers, _) in converted.items():
        piece[places[name] : places[name] + numbers.nbytes] = numbers.reshape(-1).view(np.uint8)
    memory: Any = wp.array(piece, dtype=wp.uint8, device=where)
    arrays = {}
    for name, (numbers, dtype) in converted.items():
        array: Any = wp.array(ptr=memory.ptr + places[name], dtype=dtype, shape=numbers.shape, device=where)
        array._ref = memory  # it lives as long as its parts
        arrays[name] = array
    return arrays


def _as(numbers: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """Numbers in the memory layout of a Warp type. Those of a struct already have its type."""
    if numbers.dtype.names is not None:
        return np.ascontiguousarray(numbers)
    return np.ascontiguousarray(numbers, wp.dtype_to_numpy(dtype))


PER_SAMPLE = ("friction", "release_stress", "contact_stiffness")
"""Parameters of every sample that are passed unchanged."""


def batch_of(
    kernel: TimeLoopKernel,
    model: Model,
    samples: Samples,
    sampling: Sampling,
    stepping: Stepping,
    numbers: Precision,
    where: Any,
) -> Any:
    """Parameters of each sample and the tables that they refer to."""
    mu = np.array([law.initial_shear_modulus for law in model.materials])[samples.material]
    lasting, stiffer = mu * samples.stiffness_factor, np.ones(len(samples))
    if model.relaxation:
        stiffer = np.array([branches.instantaneous for branches in model.relaxation])[samples.relaxation]
    mu = lasting * stiffer  # the modulus of waves, which include volume and hourglass patterns
    bulk = bulk_modulus(mu, samples.poisson)
    solids = np.zeros(len(samples), dtype=kernel.element.Solid.numpy_dtype())
    solids["scale"] = samples.stiffness_factor * stiffer
    solids["bulk"] = bulk
    stiff = model.hourglass if model.hourglass_form == "stiffness" else 0.0
    solids["hourglass"] = stiff * mu
    solids["shear_viscosity"] = samples.damping * lasting
    solids["bulk_viscosity"] = samples.damping * bulk if model.damping_kind == "full" else 0.0
    solids["hourglass_viscosity"] = stiff * samples.damping * mu
    solids["hourglass_impedance"] = 2.0 * (model.hourglass - stiff) * np.sqrt(mu)
    solids["mass_damping"] = samples.mass_damping
    rows = [law.parameters() for law in model.materials]
    table = np.zeros((len(rows), -(-max(len(row) for row in rows) // 4) * 4))  # four are loaded at once
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    moving = model.support.motions if isinstance(model.support, MovingSupport) else ()
    counts = {len(motion.position) for motion in model.motions + moving}
    if len(counts) != 1:
        raise ValueError(
            f"the motions of a model need equally many knots, with those of its support, got {sorted(counts)}"
        )
    motions = np.stack([motion.cubics for motion in model.motions + moving])
    batch = kernel.structs.Batch()
    batch.start, batch.safety, batch.floor = model.start, stepping.safety, stepping.floor
    batch.largest_step = min(stepping.largest_step, 1.0)
    batch.measure_every, batch.max_steps = stepping.measure_every, stepping.max_steps
    batch.ledger_every = sampling.ledger_every
    bar = model.support if isinstance(model.support, CharacteristicBar) else RIGID
    batch.impedance, batch.round_trip = min(bar.impedance, 1e300), min(bar.round_trip, 1e300)
    batch.support_moves = int(bool(moving))
    motion_row = len(model.motions) + np.minimum(np.arange(len(samples)), max(len(moving) - 1, 0))
    support = motion_row if moving else np.zeros(len(samples))
    limits = np.minimum([law.data_limit for law in model.materials], 1e30)
    batch.stop_past_data = int(model.past_data == "stop")
    real = numbers.real
    arrays = {
        "data_limit": (limits, real),
        "stray_energy": (STRAY_ENERGY * mu * model.mesh.volume, wp.float64),
        "solids": (solids, kernel.element.Solid),
        **{name: (getattr(samples, name), real) for name in PER_SAMPLE},
        "material": (samples.material, wp.int32),
        "branches": (_branch_table(model), real),
        "relaxation": (samples.relaxation, wp.int32),
        "rows": (table, real),
        "motion": (samples.motion, wp.int32),
        "support_motion": (support, wp.int32),
        "motion_rate": (np.array([1.0 / motion.step for motion in model.motions + moving]), wp.float64),
        "motion_table": (motions, wp.float64),
    }
    for name, array in in_one_copy(arrays, where).items():
        setattr(batch, name, array)
    return batch


def _branch_table(model: Model) -> FloatArray:
    """The rows of the relaxation, all with the length of the longest row; one number without relaxation."""
    if not model.relaxation:
        return np.zeros((1, 1))
    most = max(len(branches) for branches in model.relaxation)
    return np.stack([branches.row(most) for branches in model.relaxation])


def state_of(
    kernel: TimeLoopKernel,
    model: Model,
    numbers: Precision,
    where: Any,
    rows: int,
    lanes: int,
    on_chip: bool = False,
) -> Any:
    """Varying fields at rest: of `rows` simulations one after the other, or of `lanes` simulations side by
    side.

    State in the shared memory of a GPU is not allocated here.
    """
    mesh = model.mesh
    _, n_inner, first_boundary = node_order(mesh)
    n_boundary = mesh.n_nodes - n_inner
    state = kernel.structs.State()
    bar = isinstance(model.support, CharacteristicBar) and model.support.round_trip < np.inf
    remembers = any(contact_law(name).remembers_slip for name in (model.faces, model.side))
    required = {name for name, condition in (("bar_wave", bar), ("slip", remembers)) if condition}
    if kernel.memory > 0:
        required.add("memory")
    for name, n, dtype in (
        *((name, first_boundary + n_boundary, numbers.real) for name in ("u_r", "u_y", "v_r", "v_y")),
        *((name, 4 * mesh.n_elements + SPARE, numbers.real) for name in ("corner_r", "corner_y")),
        *((name, n_boundary, wp.float64) for name in ("push_lower", "push_upper", "carried")),
        ("control", CONTROL_SIZE, wp.float64),
        ("partials", Total.COUNT * WARPS * kernel.cluster, wp.float64),
        ("touched", n_boundary, wp.int32),
        ("slip", n_boundary, numbers.real),
        ("memory", kernel.memory * mesh.n_elements, numbers.real),
        ("bar_wave", 2 * BAR_HISTORY, wp.float64),
    ):
        if on_chip and name not in required:
            setattr(state, name, _no_room(dtype, where.alias))
            continue
        shape = (n, lanes) if lanes > 1 else (rows, n + SPARE)
        setattr(state, name, wp.zeros(shape, dtype=dtype, device=where))
    return state


@cache
def _no_room(dtype: Any, device: str) -> Any:
    """Placeholder of an array that the time loop never uses. To create one takes as long as a copy."""
    return wp.zeros((1, 1), dtype=dtype, device=device)


def output_of(
    kernel: TimeLoopKernel, mesh: Mesh, n: int, sampling: Sampling, nodes: Any, where: Any
) -> tuple[Any, Any]:
    """Arrays for the histories and the single array that contains them. They are NaN after the end of a
    simulation.
    """
    n_force, n_surface = len(sampling.force_times), len(sampling.surface_times)
    output = kernel.structs.Output()
    output.n_recorded = len(nodes)
    arrays = {
        "force_times": (sampling.force_times, wp.float64),
        "surface_times": (sampling.surface_times, wp.float64),
        "nodes": (padded(node_order(mesh)[0][nodes]), wp.int32),
    }
    for name, array in in_one_copy(arrays, where).items():
        setattr(output, name, array)
    shapes = {
        "force": (n, n_force, 2),
        "impulse": (n, n_force, 2),
        "position": (n, n_surface, len(nodes), 2),
        "energy": (n, n_surface, 9),
        "ending": (n, int(Ending.COUNT)),
    }
    size = sum(prod(shape) for shape in shapes.values())
    # Entries that the time loop does not reach remain NaN.
    whole: Any = wp.full(size, float("nan"), dtype=wp.float64, device=where)
    begin = 0
    for name, shape in shapes.items():
        place = whole.ptr + begin * wp.types.type_size_in_bytes(wp.float64)
        part: Any = wp.array(ptr=place, dtype=wp.float64, shape=shape, device=where)
        part._ref = whole  # it lives as long as its parts
        setattr(output, name, part)
        begin += prod(shape)
    return output, whole
