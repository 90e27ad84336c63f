"""Lanes of one simulation: what they do together, natively.

On a GPU the lanes are the threads of one block. On the CPU `explicit.simd` translates the lanes to those of
SIMD registers.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

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
SMALL_BLOCK = 96
"""The same where there are more simulations than multiprocessors: four share one, and while the threads of
one wait for each other those of the others go on."""
SHARING = 4
"""How many those are."""
WARPS = BLOCK // 32
"""Most warps of a block; its last one is the clerk."""

_INSIDE = f"((signed)blockDim.x - (blockDim.x < {BLOCK} ? 32 : 96))"


def block_for(n_samples: int, device: Any, on_chip: bool) -> int:
    """Threads that a simulation of a batch gets on a Warp device."""
    return SMALL_BLOCK if device.is_cuda and on_chip and n_samples > device.sm_count else BLOCK


def _either(cuda: str, cpu: str) -> str:
    return f"\n#if defined(__CUDA_ARCH__)\n    {cuda}\n#else\n    {cpu}\n#endif\n"


@dataclass(frozen=True)
class LaneFunctions:
    """What lanes do together. On a GPU they are a block with a clerk; elsewhere a lane is all of them."""

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
    """``from_the_end(lane)``: the seat of the boundary at which a walker begins."""
    first_inside: Any
    """``first_inside(lane)``: the node of the interior at which a walker begins. A whole block keeps its last
    walkers for the boundary, where a node takes several times as long."""
    walkers_inside: Any
    """``walkers_inside()``: how far a walker goes on there."""
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
    take_largest = _TAKE.replace("WARPS", str(WARPS)).replace("COMBINE", _LARGER).replace("NOTHING", "-1e300")
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

    @wp.func_native(snippet=_either(f"return lane < {_INSIDE} ? lane : 0x40000000;", "return lane;"))
    def first_inside(lane: int) -> int: ...

    @wp.func_native(snippet=_either(f"return {_INSIDE};", "return 1;"))
    def walkers_inside() -> int: ...

    @wp.func_native(snippet=_either("return lane & 31;", "return lane;"))
    def clerk_first(lane: int) -> int: ...

    @wp.func_native(snippet=_either("return 32;", "return 1;"))
    def clerk_step() -> int: ...

    return LaneFunctions(
        sync=sync, empty_sum=empty_sum, add_to=add_to, walks=walks, walkers=walkers, tends=tends, alone=alone,
        put_total=put_total, put_largest=put_largest, get_total=get_total, get_largest=get_largest,
        seat_totals=seat_totals, all_read=all_read,
        from_the_end=from_the_end, first_inside=first_inside, walkers_inside=walkers_inside,
        clerk_first=clerk_first, clerk_step=clerk_step,
    )  # fmt: skip
