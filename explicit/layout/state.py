"""Layout of a simulation's state in memory, and the accessors of the time loop.

On a GPU the state is stored in the shared memory of one block, or of the blocks of a cluster, if it fits. The
blocks of a cluster read each other's shared memory. Equal positions in neighbouring blocks have a constant
distance in bytes. One index therefore addresses every node and corner force. The last block of a cluster
stores the boundary and the control record. The others have one thread for every element and interior node.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import IntArray
from explicit.layout.lanes import BLOCK, WARPS
from explicit.layout.structs import CONTROL_SIZE, Structs, Total, simulation_structs
from explicit.precision import Precision

ON_CHIP_NODES, ON_CHIP_ELEMENTS, ON_CHIP_BOUNDARY, ON_CHIP_CONTROL = 448, 384, 96, 272
"""Slots in shared memory for the state of a simulation in fp64. In fp32 there are twice as many for nodes and
elements. With the memory of the reductions they fill the default 48 KiB of a block."""


_FIELD = """
    wp::array_t<TYPE> row;
    row.data = (TYPE*)((char*)fields.data + (long long)sample * fields.strides[0]);
    row.shape[0] = 0; // nothing is counted from the end, so no subscript need be tested
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""
_FIELD_ON_CHIP = """
    wp::array_t<TYPE> row;
#if defined(__CUDA_ARCH__)
    __shared__ TYPE pool[ROOM];
    row.data = pool + offset;
#else
    row.data = (TYPE*)((char*)fields.data + (long long)sample * fields.strides[0]);
#endif
    row.shape[0] = 0; // nothing is counted from the end, so no subscript need be tested
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""
_STRIDE = """
#if defined(__CUDA_ARCH__)
    return COUNT;
#else
    return n;
#endif
"""


@dataclass(frozen=True)
class StateLayout:
    """Accessors of the state of a simulation."""

    field: Any
    """``field(rows, sample, offset)``: a simulation's row of an array of fields or corner forces. If the
    state is on the chip, the row is in shared memory at `offset` numbers."""
    sums: Any
    """``sums(rows, sample, offset)``: a simulation's row of boundary sums, of the control record or of
    partial sums. If the state is on the chip, the row is in shared memory at `offset` numbers."""
    remembered: Any
    """The same for the state variables of elements, which are too large for shared memory."""
    fields: Any
    """``fields(body, state, sample) -> Fields``: the nodes' and corners' rows of a simulation."""
    surface: Any
    """``surface(body, state, sample) -> Surface``: its boundary nodes' rows."""
    at_rest: Any
    """``at_rest(body, fields, surface, partials, lane)``: the state before the first step; every lane calls
    it."""
    node: Any
    """``node(body, n)``: index of a node in the rows of fields."""
    element: Any
    """``element(e)``: index of the forces of an element's first corner."""
    corner_stride: Any
    """``corner_stride(n)``: index distance between the forces of an element's successive corners."""


@cache
def state_layout(precision: Precision, structs: Structs, on_chip: bool, cluster: int = 1) -> StateLayout:
    """Generate the layout of the state."""
    more = 8 // precision.dtype().itemsize
    nodes, elements = more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS
    field = row_function(precision.real, 4 * nodes + 8 * elements + 2, on_chip)
    sums = row_function(wp.float64, 3 * ON_CHIP_BOUNDARY + ON_CHIP_CONTROL, on_chip)
    marks = row_function(wp.int32, ON_CHIP_BOUNDARY, on_chip)
    node_stride, corner_stride = _stride(nodes, on_chip), _stride(elements, on_chip)
    Body, State = structs.Body, structs.State
    simulation = simulation_structs(precision)
    Fields, Surface = simulation.Fields, simulation.Surface

    @wp.func
    def fields(body: Body, state: State, sample: int):
        nodes, corners = node_stride(body.n_nodes), 4 * corner_stride(body.n_elements) + 1
        return Fields(
            field(state.u_r, sample, 0),
            field(state.u_y, sample, nodes),
            field(state.v_r, sample, 2 * nodes),
            field(state.v_y, sample, 3 * nodes),
            field(state.corner_r, sample, 4 * nodes),
            field(state.corner_y, sample, 4 * nodes + corners),
        )

    @wp.func
    def surface(body: Body, state: State, sample: int):
        return Surface(
            marks(state.touched, sample, 0),
            sums(state.push_lower, sample, ON_CHIP_CONTROL),
            sums(state.push_upper, sample, ON_CHIP_CONTROL + body.n_boundary),
            sums(state.carried, sample, ON_CHIP_CONTROL + 2 * body.n_boundary),
        )

    zero, ZERO = precision.real(0.0), wp.float64(0.0)
    n_partials = int(Total.COUNT * WARPS * cluster)

    @wp.func
    def at_rest(
        body: Body, fields: Fields, surface: Surface, partials: wp.array(dtype=wp.float64), lane: int
    ):
        n = lane
        while n < body.n_nodes:
            fields.u_r[n] = zero
            fields.u_y[n] = zero
            fields.v_r[n] = zero
            fields.v_y[n] = zero
            n += wp.block_dim()
        b = lane
        while b < body.n_boundary:
            surface.touched[b] = body.at_rest[b]
            b += wp.block_dim()
        k = lane
        while k < n_partials:  # the control warp passes no bound
            partials[k] = ZERO
            k += wp.block_dim()
        if lane == 0:  # zeros for nodes where fewer than four elements meet
            beyond = 4 * corner_stride(body.n_elements)
            fields.corner_r[beyond] = zero
            fields.corner_y[beyond] = zero

    @wp.func
    def node(body: Body, n: int):
        return n

    @wp.func
    def element(e: int):
        return e

    return StateLayout(
        field=field, sums=sums, remembered=row_function(precision.real, 0, False), fields=fields,
        surface=surface, at_rest=at_rest, node=node, element=element, corner_stride=corner_stride,
    )  # fmt: skip


def on_chip_elements(precision: Precision) -> int:
    """Slots for elements in a GPU's shared memory."""
    return 8 // precision.dtype().itemsize * ON_CHIP_ELEMENTS


def row_function(dtype: Any, room: int, on_chip: bool) -> Any:
    """Generate ``row(rows, sample, offset)``: a simulation's row. On the chip it is in a pool of `room`
    numbers."""
    snippet = (_FIELD_ON_CHIP if on_chip else _FIELD).replace("TYPE", f"wp::{dtype.__name__}")

    @wp.func_native(snippet=snippet.replace("ROOM", str(room)))
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


def _stride(count: int, on_chip: bool) -> Any:
    snippet = _STRIDE.replace("COUNT", str(count)) if on_chip else "return n;"

    @wp.func_native(snippet=snippet)
    def stride(n: int) -> int: ...

    return stride


def fits(n_nodes: int, n_elements: int, n_boundary: int, precision: Precision) -> bool:
    """True if the state of one simulation fits into a GPU's shared memory."""
    more = 8 // precision.dtype().itemsize
    room = (more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS, ON_CHIP_BOUNDARY)
    return n_nodes <= room[0] and n_elements <= room[1] and n_boundary <= room[2]


BLOCK_DISTANCE = 1 << 24
"""Distance in bytes between equal positions in the shared memories of neighbouring blocks of a cluster."""
BOUNDARY = 256
"""Largest number of boundary nodes: the last block has memory and, in addition to its control warp, threads
for them."""


def numbers_between_blocks(precision: Precision) -> int:
    """Distance, in real numbers, between equal places in the shared memories of neighbouring blocks."""
    return BLOCK_DISTANCE // int(precision.dtype().itemsize)


def spread_nodes(nodes: IntArray, first_boundary: int, blocks: int, precision: Precision) -> IntArray:
    """Index of nodes in the state's rows from their place in `explicit.arguments.node_order`."""
    inner = nodes // BLOCK * numbers_between_blocks(precision) + nodes % BLOCK
    return np.where(
        nodes < first_boundary,
        inner,
        (blocks - 1) * numbers_between_blocks(precision) + nodes - first_boundary,
    )


def spread_corners(element: IntArray, corner: IntArray, precision: Precision) -> IntArray:
    """Index of the corner forces of elements in the state's rows."""
    return np.asarray(element // BLOCK * numbers_between_blocks(precision) + corner * BLOCK + element % BLOCK)


def fits_on_chips(n_elements: int, first_boundary: int, n_boundary: int, blocks: int) -> bool:
    """True if the state of a simulation fits into the shared memories of this many blocks."""
    return max(n_elements, first_boundary) <= (blocks - 1) * BLOCK and n_boundary <= BOUNDARY


_FIELD_ON_CHIPS = """
    wp::array_t<TYPE> row;
#if defined(__CUDA_ARCH__)
    __shared__ TYPE pool[ROOM];
    unsigned first;
    unsigned long long whole;
    asm("mapa.shared::cluster.u32 %0, %1, 0;" : "=r"(first) : "r"((unsigned)__cvta_generic_to_shared(pool)));
    asm("cvta.shared::cluster.u64 %0, %1;" : "=l"(whole) : "l"((unsigned long long)first));
    row.data = (TYPE*)whole + offset;
#endif
    row.shape[0] = 0; // nothing is counted from the end, so no subscript need be tested
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""


def _first_field(dtype: Any, room: int) -> Any:
    """Generate the accessor of a row of the fields that begins in the shared memory of the first block."""
    snippet = _FIELD_ON_CHIPS.replace("TYPE", f"wp::{dtype.__name__}").replace("ROOM", str(room))

    @wp.func_native(snippet=snippet)
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


@cache
def layout_on_chips(precision: Precision, structs: Structs, cluster: int) -> StateLayout:
    """Generate the layout of the state for this many blocks."""
    n_control, n_partials = int(CONTROL_SIZE), int(Total.COUNT * WARPS)
    field = _first_field(precision.real, 4 * BLOCK + 2 * (4 * BLOCK + 1))
    sums = row_function(wp.float64, 3 * BOUNDARY + n_control + n_partials, True)
    marks = row_function(wp.int32, BOUNDARY, True)
    Body, State = structs.Body, structs.State
    simulation = simulation_structs(precision)
    Fields, Surface = simulation.Fields, simulation.Surface
    block, further, last = (
        int(BLOCK),
        numbers_between_blocks(precision),
        (cluster - 1) * numbers_between_blocks(precision),
    )
    most = int(BOUNDARY)

    @wp.func
    def fields(body: Body, state: State, sample: int):
        return Fields(
            field(state.u_r, sample, 0),
            field(state.u_y, sample, block),
            field(state.v_r, sample, 2 * block),
            field(state.v_y, sample, 3 * block),
            field(state.corner_r, sample, 4 * block),
            field(state.corner_y, sample, 8 * block + 1),
        )

    @wp.func
    def surface(body: Body, state: State, sample: int):
        behind = n_control + n_partials
        return Surface(
            marks(state.touched, sample, 0),
            sums(state.push_lower, sample, behind),
            sums(state.push_upper, sample, behind + most),
            sums(state.carried, sample, behind + 2 * most),
        )

    @wp.func
    def element(e: int):
        return e // block * further + e % block

    @wp.func
    def node(body: Body, n: int):
        place = n // block * further + n % block
        if n >= body.first_boundary:
            place = last + n - body.first_boundary
        return place

    zero, ZERO = precision.real(0.0), wp.float64(0.0)

    @wp.func
    def at_rest(
        body: Body, fields: Fields, surface: Surface, partials: wp.array(dtype=wp.float64), lane: int
    ):
        mine, node = element(lane), lane % block
        fields.u_r[mine] = zero
        fields.u_y[mine] = zero
        fields.v_r[mine] = zero
        fields.v_y[mine] = zero
        if node < body.n_boundary:
            surface.touched[node] = body.at_rest[node]
        k = node
        while k < n_partials:
            partials[k] = ZERO
            k += block
        if node == 0:  # zeros for nodes where fewer than four elements meet
            fields.corner_r[mine + 4 * block] = zero
            fields.corner_y[mine + 4 * block] = zero

    @wp.func
    def corner_stride(n: int):
        return block

    return StateLayout(
        field=field, sums=sums, remembered=row_function(precision.real, 0, False), fields=fields,
        surface=surface, at_rest=at_rest, node=node, element=element, corner_stride=corner_stride,
    )  # fmt: skip
