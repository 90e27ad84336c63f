"""Lanes of one simulation: what they do together, natively, and where its state lies.

On a GPU the lanes are the threads of one block. On the CPU `explicit.simd` translates the lanes to those of
SIMD registers.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.precision import Precision

BARRIER = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
"""
"""Lanes of one simulation meet here; a single lane (CPU) has nobody to wait for."""

# A GPU's block has a clerk, its last warp, which tends the clock while the others sweep the elements. Totals
# are handed to it warp by warp and added in one order.
_HAND_OVER = """
#if defined(__CUDA_ARCH__)
    #pragma unroll
    for (int offset = 16; offset > 0; offset >>= 1) {
        double other = __shfl_down_sync(0xffffffffu, x, offset);
        x = COMBINE;
    }
    if ((threadIdx.x & 31) == 0) parts.data[k * WARPS + (threadIdx.x >> 5)] = x;
#else
    parts.data[k] = x;
#endif
"""
_TAKE = """
#if defined(__CUDA_ARCH__)
    const int warp = threadIdx.x & 31;
    double x = warp < (blockDim.x >> 5) ? parts.data[k * WARPS + warp] : NOTHING;
    #pragma unroll
    for (int step = 16; step > 0; step >>= 1) {
        const double other = __shfl_xor_sync(0xffffffffu, x, step);
        x = COMBINE;
    }
    return x;
#else
    return parts.data[k];
#endif
"""
_SUM, _LARGER = "x + other", "x > other ? x : other"
_SEAT_TOTALS = """
    wp::vec_t<2, wp::float64> sums(0.0, 0.0);
#if defined(__CUDA_ARCH__)
    #pragma unroll 1
    for (int k = threadIdx.x & 31; k < n; k += 32) { sums[0] += first.data[k]; sums[1] += second.data[k]; }
    #pragma unroll
    for (int other = 16; other > 0; other >>= 1) {
        const double a = __shfl_xor_sync(0xffffffffu, sums[0], other);
        const double b = __shfl_xor_sync(0xffffffffu, sums[1], other);
        sums[0] += a;
        sums[1] += b;
    }
#else
    for (int k = 0; k < n; ++k) { sums[0] += first.data[k]; sums[1] += second.data[k]; }
#endif
    return sums;
"""
BLOCK = 384
"""Threads that share one simulation on a GPU; among them its registers are shared out."""
WARPS = BLOCK // 32
"""Warps of a block; the last one is the clerk."""


def _either(cuda: str, cpu: str) -> str:
    return f"\n#if defined(__CUDA_ARCH__)\n    {cuda}\n#else\n    {cpu}\n#endif\n"


@dataclass(frozen=True)
class LaneFunctions:
    """What lanes do together. On a GPU they are a block of warps, the last one the clerk; elsewhere a lane is
    all of them."""

    sync: Any
    """``sync()``: every lane waits for the others; their writes are visible after it."""
    empty_sum: Any
    """``empty_sum()``: where a sum over elements or nodes begins."""
    add_to: Any
    """``add_to(sum, x, k)``: the sum with the share of the k-th element or node."""
    walks: Any
    """``walks(lane)``: 1 for a lane that sweeps elements."""
    walkers: Any
    """``walkers()``: how many those are."""
    tends: Any
    """``tends(lane)``: 1 for a lane of the clerk."""
    alone: Any
    """``alone(lane)``: 1 for the lane of the clerk that writes what is written once."""
    put_total: Any
    """``put_total(parts, k, x)``: hand over the k-th total, of every lane's x."""
    put_largest: Any
    """``put_largest(parts, k, x)``: the same for the largest x."""
    get_total: Any
    """``get_total(parts, k)``: the k-th total."""
    get_largest: Any
    """``get_largest(parts, k)``: the k-th largest value."""
    seat_totals: Any
    """``seat_totals(first, second, n)``: sums of n numbers each, on every lane of the clerk."""
    all_read: Any
    """``all_read()``: the clerk's lanes have read what they are about to write."""
    from_the_end: Any
    """``from_the_end(lane)``: the seat of the boundary at which a walker begins: the last walkers have less
    of the interior."""
    clerk_first: Any
    """``clerk_first(lane)``: where a lane of the clerk begins a walk."""
    clerk_step: Any
    """``clerk_step()``: how far it goes on."""


@cache
def lane_functions() -> LaneFunctions:
    """Generate the lane functions.

    On the CPU `explicit.simd` gives them their meaning over packs; short sums are made one after the other
    there, in one order whatever the lanes are, so that forces keep their bits.
    """
    total = _HAND_OVER.replace("WARPS", str(WARPS)).replace("COMBINE", _SUM)
    largest = _HAND_OVER.replace("WARPS", str(WARPS)).replace("COMBINE", _LARGER)
    take_total = _TAKE.replace("WARPS", str(WARPS)).replace("COMBINE", _SUM).replace("NOTHING", "0.0")
    take_largest = _TAKE.replace("WARPS", str(WARPS)).replace("COMBINE", _LARGER).replace("NOTHING", "-1.0")
    parts_of: Any = wp.array(dtype=wp.float64)

    @wp.func_native(snippet=BARRIER)
    def sync(): ...

    @wp.func
    def empty_sum():
        return wp.float64(0.0)

    @wp.func
    def add_to(sofar: wp.float64, share: wp.float64, place: int):
        return sofar + share

    @wp.func_native(snippet=_either("return lane < blockDim.x - 32;", "return 1;"))
    def walks(lane: int) -> int: ...

    @wp.func_native(snippet=_either("return blockDim.x - 32;", "return 1;"))
    def walkers() -> int: ...

    @wp.func_native(snippet=_either("return lane >= blockDim.x - 32;", "return 1;"))
    def tends(lane: int) -> int: ...

    @wp.func_native(snippet=_either("return lane == blockDim.x - 32;", "return 1;"))
    def alone(lane: int) -> int: ...

    @wp.func_native(snippet=total)
    def put_total(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=largest)
    def put_largest(parts: parts_of, k: int, x: wp.float64): ...

    @wp.func_native(snippet=take_total)
    def get_total(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=take_largest)
    def get_largest(parts: parts_of, k: int) -> wp.float64: ...

    @wp.func_native(snippet=_SEAT_TOTALS)
    def seat_totals(first: parts_of, second: parts_of, n: int) -> wp.vec2d: ...

    @wp.func_native(snippet=_either("__syncwarp();", ""))
    def all_read(): ...

    @wp.func_native(snippet=_either("return blockDim.x - 33 - lane;", "return lane;"))
    def from_the_end(lane: int) -> int: ...

    @wp.func_native(snippet=_either("return lane & 31;", "return lane;"))
    def clerk_first(lane: int) -> int: ...

    @wp.func_native(snippet=_either("return 32;", "return 1;"))
    def clerk_step() -> int: ...

    return LaneFunctions(
        sync=sync, empty_sum=empty_sum, add_to=add_to, walks=walks, walkers=walkers, tends=tends, alone=alone,
        put_total=put_total, put_largest=put_largest, get_total=get_total, get_largest=get_largest,
        seat_totals=seat_totals, all_read=all_read,
        from_the_end=from_the_end, clerk_first=clerk_first, clerk_step=clerk_step,
    )  # fmt: skip


GROUP = 32
"""Elements or nodes whose constants lie side by side: those of a warp, or of a few packs."""
ON_CHIP_NODES, ON_CHIP_ELEMENTS, ON_CHIP_SEATS, ON_CHIP_CLOCK = 448, 384, 96, 208
"""Places in shared memory for the state of a simulation in fp64; in fp32 there are twice as many nodes and
elements. Together with what reductions need, they fill the 48 KiB a block gets without a request."""


_FIELD = """
    wp::array_t<TYPE> row;
    row.data = (TYPE*)((char*)fields.data + (long long)sample * fields.strides[0]);
    row.shape[0] = fields.shape[1];
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
    row.shape[0] = fields.shape[1];
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""
_ENTRY = """
    const char* group = (const char*)table.data + (long long)((e >> SHIFT) * (int)table.strides[0]);
    return ((const TYPE*)group + (e & (GROUP - 1)))[k * GROUP];
"""
_PLACES = """
#if defined(__CUDA_ARCH__)
    return PLACES;
#else
    return n;
#endif
"""


@dataclass(frozen=True)
class Rooms:
    """Where the state of a simulation lies."""

    field: Any
    """``field(fields, sample, offset)``: a simulation's row of an array of fields or corner forces; in shared
    memory at an offset in numbers, where the state is on the chip."""
    sums: Any
    """The same for sums of the boundary."""
    marks: Any
    """The same for its marks."""
    elements: int
    """Places for elements on the chip."""
    node_places: Any
    """``node_places(n)``: places for the nodes of a field, n or what the chip has."""
    corner_places: Any
    """``corner_places(n)``: places for corner forces of one corner, n or what the chip has."""


@cache
def rooms(precision: Precision, on_chip: bool) -> Rooms:
    """Generate the places of the state."""
    more = 8 // precision.dtype().itemsize
    nodes, elements = more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS
    return Rooms(
        field=_field(precision.real, 4 * nodes + 8 * elements + 2, on_chip),
        sums=_field(wp.float64, 3 * ON_CHIP_SEATS + ON_CHIP_CLOCK, on_chip),
        marks=_field(wp.int32, ON_CHIP_SEATS, on_chip),
        elements=elements,
        node_places=_places(nodes, on_chip),
        corner_places=_places(elements, on_chip),
    )


def _field(dtype: Any, room: int, on_chip: bool) -> Any:
    snippet = (_FIELD_ON_CHIP if on_chip else _FIELD).replace("TYPE", f"wp::{dtype.__name__}")

    @wp.func_native(snippet=snippet.replace("ROOM", str(room)))
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


def _places(count: int, on_chip: bool) -> Any:
    snippet = _PLACES.replace("PLACES", str(count)) if on_chip else "return n;"

    @wp.func_native(snippet=snippet)
    def places(n: int) -> int: ...

    return places


@cache
def entry_function(dtype: Any) -> Any:
    """Generate ``entry(table, k, e)``: the k-th constant of element or node e of a grouped table."""
    snippet = (
        _ENTRY.replace("TYPE", f"wp::{dtype.__name__}")
        .replace("GROUP", str(GROUP))
        .replace("SHIFT", str(GROUP.bit_length() - 1))
    )

    @wp.func_native(snippet=snippet)
    def entry(table: wp.array2d(dtype=dtype), k: int, e: int) -> dtype: ...

    return entry


_FOUR = """
    const TYPE* number = (const TYPE*)row.data + place;
    return wp::vec_t<4, TYPE>(number[0], number[1], number[2], number[3]);
"""
_FOUR_BACKWARD = """
    if (row.grad) for (int c = 0; c < 4; ++c) wp::atomic_add((TYPE*)row.grad + place + c, adj_ret[c]);
"""


@cache
def four_function(precision: Precision) -> Any:
    """Generate ``four(row, place)``: four numbers that follow each other in a row without gaps."""
    real, vec4 = precision.real, precision.vec4
    forward, backward = (text.replace("TYPE", f"wp::{real.__name__}") for text in (_FOUR, _FOUR_BACKWARD))

    @wp.func_native(snippet=forward, adj_snippet=backward)
    def four(row: wp.array(dtype=real), place: int) -> vec4: ...

    return four


def grouped(table: NDArray[Any]) -> NDArray[Any]:
    """A table as `entry` reads it: from shape [constants, n] to shape [groups, constants * GROUP]."""
    constants, n = table.shape
    groups = -(-n // GROUP)
    padded = np.pad(table, [(0, 0), (0, groups * GROUP - n)], mode="edge")
    split = padded.reshape(constants, groups, GROUP)
    return np.ascontiguousarray(split.transpose(1, 0, 2)).reshape(groups, constants * GROUP)


def fits(n_nodes: int, n_elements: int, n_seats: int, precision: Precision) -> bool:
    """Whether the state of one simulation fits into a GPU's shared memory."""
    more = 8 // precision.dtype().itemsize
    room = (more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS, ON_CHIP_SEATS)
    return n_nodes <= room[0] and n_elements <= room[1] and n_seats <= room[2]
