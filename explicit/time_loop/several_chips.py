"""A simulation in the shared memories of several blocks of a GPU, each with its part of the elements and nodes.

The blocks of a cluster read each other's shared memory: what lies at one place in all of them is `APART` bytes
from that of one block to that of the next. So a node's or a corner force's number, times its size, is the whole
way to it, and the time loop reads what is its neighbour's as it reads its own. The last block of a cluster has
the boundary and the books, the others a thread for every element and interior node.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import IntArray
from explicit.precision import Precision
from explicit.time_loop.lanes import ADDED, BLOCK, DOWN, LARGER, LARGEST, SUM, LaneFunctions, lane_functions
from explicit.time_loop.slots import CONTROL_SIZE, Control, Plan

APART = 1 << 24
"""Bytes from a place in the shared memory of one block of a cluster to the same in that of the next."""
BOUNDARY = 256
"""Most boundary nodes: those that the last block has room for and threads beside its books."""
BLOCK_WARPS = BLOCK // 32

_WAIT = """
    unsigned come;
    do {
        asm volatile(
            "{ .reg .pred all; "
            "mbarrier.try_wait.parity.relaxed.cluster.shared::cta.b64 all, [%1], %2; "
            "selp.u32 %0, 1, 0, all; }"
            : "=r"(come) : "r"(place), "r"(parity) : "memory");
    } while (!come);
    asm volatile("fence.acquire.sync_restrict::shared::cluster.cluster;" ::: "memory");
"""
_INIT = """asm volatile("mbarrier.init.shared::cta.b64 [%0], %1;" :: "r"(place), "r"(COUNT) : "memory");"""
_MEET = f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned long long barrier;
    __shared__ volatile unsigned phase;
    const unsigned place = (unsigned)__cvta_generic_to_shared(&barrier);
    if (whole) {{
        if (begins && threadIdx.x == 0) {{ {_INIT.replace("COUNT", "BLOCKS")} phase = 0; }}
        asm volatile("barrier.cluster.arrive.release.aligned;" ::: "memory");
        asm volatile("barrier.cluster.wait.acquire.aligned;" ::: "memory");
        return;
    }}
    const unsigned parity = phase;
    __syncthreads();
    if (threadIdx.x < BLOCKS) {{
        if (threadIdx.x == 0) phase = parity ^ 1;
        __syncwarp((1u << BLOCKS) - 1u);
        asm volatile(
            "{{ .reg .b32 there; "
            "fence.release.sync_restrict::shared::cta.cluster; "
            "mapa.shared::cluster.u32 there, %0, %1; "
            "mbarrier.arrive.relaxed.cluster.shared::cluster.b64 _, [there]; }}"
            :: "r"(place), "r"(threadIdx.x) : "memory");
    }}
    {_WAIT}
#endif
"""
"""What blocks tell each other lies in their shared memories alone, so that nothing need be written back to the
memory of all, nor what was read of it forgotten. A block's threads have written when they have met; then one for
every other block tells it so. `whole` is the barrier of the hardware, which does more and takes longer."""
_RECORD = f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned long long barrier;
    __shared__ volatile unsigned phase;
    const unsigned place = (unsigned)__cvta_generic_to_shared(&barrier);
    if (what == BEGIN) {{
        if (threadIdx.x == 0) {{ {_INIT.replace("COUNT", "1")} phase = 0; }}
    }} else if (what == TELL) {{
        __syncwarp();
        for (int k = threadIdx.x & 31; k < (BLOCKS - 1) * TOLD; k += 32) {{
            const int slot = k % TOLD, number = slot < SIZE ? PLANS + SIZE * (step & 1) + slot
                : slot == SIZE ? GOING : slot == SIZE + 1 ? LOWER_NEXT : LOWER_SPEED;
            asm volatile(
                "{{ .reg .b32 there, barrier; "
                "mapa.shared::cluster.u32 there, %0, %2; mapa.shared::cluster.u32 barrier, %1, %2; "
                "st.async.shared::cluster.mbarrier::complete_tx::bytes.f64 [there], %3, [barrier]; }}"
                :: "r"((unsigned)__cvta_generic_to_shared(control.data + number)), "r"(place), "r"(k / TOLD),
                "d"(control.data[number]) : "memory");
        }}
    }} else if (blockIdx.x % BLOCKS != BLOCKS - 1) {{
        const unsigned parity = phase;
        __syncthreads();
        if (threadIdx.x == 0) {{
            phase = parity ^ 1;
            asm volatile("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;"
                :: "r"(place), "r"(8 * TOLD) : "memory");
        }}
        {_WAIT}
    }}
#endif
"""
"""The last block sends the others what they need of its record, before they meet; then they listen."""
_BEGIN, _TELL, _LISTEN = range(3)
_READ = """double OTHER;
        asm volatile(
            "{ .reg .b32 there; mapa.shared::cluster.u32 there, %1, %2; ld.shared::cluster.f64 %0, [there]; }"
            : "=d"(OTHER) : "r"(PLACE), "r"(RANK) : "memory");"""
_INFORM = f"""
#if defined(__CUDA_ARCH__)
    if (blockIdx.x % BLOCKS != BLOCKS - 1 && (int)threadIdx.x >= first && threadIdx.x < {CONTROL_SIZE}) {{
        const unsigned place = (unsigned)__cvta_generic_to_shared(control.data + threadIdx.x);
        {_READ.replace("OTHER", "x").replace("PLACE", "place").replace("RANK", "BLOCKS - 1")}
        control.data[threadIdx.x] = x;
    }}
    __syncthreads();
#endif
"""
_HAND_OVER = """
#if defined(__CUDA_ARCH__)
    ACROSS
    if ((threadIdx.x & 31) == 0) parts.data[k * BLOCK_WARPS + (threadIdx.x >> 5)] = x;
#endif
"""
_TAKE = f"""
#if defined(__CUDA_ARCH__)
    const unsigned place = (unsigned)__cvta_generic_to_shared(parts.data + k * BLOCK_WARPS);
    double x = NOTHING;
    #pragma unroll
    for (int next = threadIdx.x & 31; next < BLOCKS * BLOCK_WARPS; next += 32) {{
        {_READ.replace("OTHER", "other").replace("PLACE", "place + next % BLOCK_WARPS * 8").replace("RANK", "next / BLOCK_WARPS")}
        x = COMBINE;
    }}
    ACROSS
    return x;
#else
    return 0.0;
#endif
"""


@cache
def lanes_of_chips(blocks: int) -> LaneFunctions:
    """The lane functions of so many blocks that have a simulation in their shared memories."""
    parts_of: Any = wp.array(dtype=wp.float64)

    def native(snippet: str, **names: str) -> str:
        for name, text in {**names, "BLOCKS": str(blocks), "BLOCK_WARPS": str(BLOCK_WARPS)}.items():
            snippet = snippet.replace(name, text)
        return snippet

    told = {
        "BEGIN": _BEGIN, "TELL": _TELL, "TOLD": Plan.SIZE + 3, "PLANS": Control.PLANS, "SIZE": Plan.SIZE,
        "GOING": Control.GOING, "LOWER_NEXT": Control.LOWER_NEXT, "LOWER_SPEED": Control.LOWER_SPEED,
    }  # fmt: skip

    @wp.func_native(snippet=native(_MEET))
    def meet(whole: int, begins: int): ...

    @wp.func_native(snippet=native(_RECORD, **{name: str(int(number)) for name, number in told.items()}))
    def record(what: int, control: parts_of, step: int): ...

    @wp.func
    def sync():
        meet(0, 0)

    @wp.func
    def enter(control: parts_of):
        record(_BEGIN, control, 0)
        meet(1, 1)

    @wp.func
    def leave():
        meet(1, 0)

    @wp.func
    def tell(control: parts_of, step: int):
        record(_TELL, control, step)

    @wp.func
    def listen(control: parts_of):
        record(_LISTEN, control, 0)

    @wp.func_native(snippet=native(_INFORM))
    def inform(control: parts_of, first: int): ...

    @wp.func_native(snippet=native(_HAND_OVER, ACROSS=DOWN))
    def put_total(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=native(_HAND_OVER, ACROSS=LARGEST))
    def put_largest(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=native(_TAKE, ACROSS=ADDED, COMBINE=SUM, NOTHING="0.0", ALONE="0"))
    def get_total(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=native(_TAKE, ACROSS=LARGEST, COMBINE=LARGER, NOTHING="-1e300"))
    def get_largest(parts: parts_of, k: int) -> wp.float64: ...

    return replace(
        lane_functions(blocks), sync=sync, enter=enter, leave=leave, tell=tell, listen=listen, inform=inform, put_total=put_total,
        put_largest=put_largest, get_total=get_total, get_largest=get_largest,
    )  # fmt: skip


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


def first_field(dtype: Any, room: int) -> Any:
    """Generate the accessor of a row of the fields that begins in the shared memory of the first block."""
    snippet = _FIELD.replace("TYPE", f"wp::{dtype.__name__}").replace("ROOM", str(room))

    @wp.func_native(snippet=snippet)
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


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
