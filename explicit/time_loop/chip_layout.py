"""Layout of a simulation's state in the shared memories of several blocks of a GPU.

The blocks of a cluster read each other's shared memory: what lies at one place in all of them is `APART`
bytes from that of one block to that of the next. So a node's or a corner force's number, times its size, is
the whole way to it, and the time loop reads what is its neighbour's as it reads its own. The last block of a
cluster has the boundary and the books, the others a thread for every element and interior node.
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import IntArray
from explicit.precision import Precision
from explicit.time_loop.lanes import BLOCK, WARPS
from explicit.time_loop.slots import CONTROL_SIZE, Total
from explicit.time_loop.state_layout import StateLayout, row_function
from explicit.time_loop.structs import Structs, simulation_structs

APART = 1 << 24
"""Bytes from a place in the shared memory of one block of a cluster to the same in that of the next."""
BOUNDARY = 256
"""Most boundary nodes: the last block has room for them, and threads beside its books."""


def apart(precision: Precision) -> int:
    """Numbers from a place in one block's shared memory to the same in that of the next."""
    return APART // int(precision.dtype().itemsize)


def spread_nodes(nodes: IntArray, first_boundary: int, blocks: int, precision: Precision) -> IntArray:
    """Where nodes lie, by their place in `explicit.mesh_arguments.node_order`."""
    inner = nodes // BLOCK * apart(precision) + nodes % BLOCK
    return np.where(nodes < first_boundary, inner, (blocks - 1) * apart(precision) + nodes - first_boundary)


def spread_corners(element: IntArray, corner: IntArray, precision: Precision) -> IntArray:
    """Where the forces of elements' corners lie."""
    return np.asarray(element // BLOCK * apart(precision) + corner * BLOCK + element % BLOCK)


def fits_on_chips(n_elements: int, first_boundary: int, n_boundary: int, blocks: int) -> bool:
    """True if the state of a simulation fits into the shared memories of so many blocks."""
    return max(n_elements, first_boundary) <= (blocks - 1) * BLOCK and n_boundary <= BOUNDARY


_FIELD = """
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
    snippet = _FIELD.replace("TYPE", f"wp::{dtype.__name__}").replace("ROOM", str(room))

    @wp.func_native(snippet=snippet)
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


@cache
def layout_on_chips(precision: Precision, structs: Structs, cluster: int) -> StateLayout:
    """Generate the layout of the state for so many blocks."""
    n_control, n_partials = int(CONTROL_SIZE), int(Total.COUNT * WARPS)
    field = _first_field(precision.real, 4 * BLOCK + 2 * (4 * BLOCK + 1))
    sums = row_function(wp.float64, 3 * BOUNDARY + n_control + n_partials, True)
    marks = row_function(wp.int32, BOUNDARY, True)
    Body, State = structs.Body, structs.State
    simulation = simulation_structs(precision)
    Fields, Surface = simulation.Fields, simulation.Surface
    block, further, last = int(BLOCK), apart(precision), (cluster - 1) * apart(precision)
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
        mine, own = element(lane), lane % block
        fields.u_r[mine] = zero
        fields.u_y[mine] = zero
        fields.v_r[mine] = zero
        fields.v_y[mine] = zero
        if own < body.n_boundary:
            surface.touched[own] = body.at_rest[own]
        k = own
        while k < n_partials:
            partials[k] = ZERO
            k += block
        if own == 0:  # nodes where fewer than four elements meet gather nothing from here
            fields.corner_r[mine + 4 * block] = zero
            fields.corner_y[mine + 4 * block] = zero

    @wp.func
    def corner_stride(n: int):
        return block

    return StateLayout(
        field=field, sums=sums, remembered=row_function(precision.real, 0, False), fields=fields,
        surface=surface, at_rest=at_rest, node=node, element=element, corner_stride=corner_stride,
    )  # fmt: skip
