"""Lanes of one simulation: a barrier and two reductions, natively.

On the CPU a simulation has one lane, which waits for nobody and reduces nothing. On a GPU its lanes are
the threads of one block.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision

BARRIER = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
"""
"""Lanes of one simulation meet here; a single lane (CPU) has nobody to wait for."""

# Warp's tile reductions share one buffer between CPU threads, so lanes are reduced natively: within a
# warp by shuffles, then across warps in a fixed order. Every lane gets the result.
_REDUCTION = """
#if defined(__CUDA_ARCH__)
    __shared__ double partial[32];
    for (int offset = 16; offset > 0; offset >>= 1) {
        double other = __shfl_down_sync(0xffffffffu, x, offset);
        x = COMBINE;
    }
    if ((threadIdx.x & 31) == 0) partial[threadIdx.x >> 5] = x;
    __syncthreads();
    x = partial[0];
    for (int i = 1; i < (blockDim.x >> 5); ++i) { double other = partial[i]; x = COMBINE; }
    __syncthreads();
#endif
    return x;
"""
BLOCK_SUM = _REDUCTION.replace("COMBINE", "x + other")
"""Sum over the lanes of a simulation."""
BLOCK_LARGEST = _REDUCTION.replace("COMBINE", "x > other ? x : other")
"""Largest value over the lanes of a simulation."""


# On the CPU short sums are made one after the other, in one order whatever the lanes are, so that forces keep
# their bits; a GPU shares them out.
ORDERED_FIRST = """
#if defined(__CUDA_ARCH__)
    return lane;
#else
    return 0;
#endif
"""
ORDERED_STEP = """
#if defined(__CUDA_ARCH__)
    return blockDim.x;
#else
    return 1;
#endif
"""


@dataclass(frozen=True)
class LaneFunctions:
    """What lanes do together."""

    sync: Any
    """``sync()``: every lane waits for the others; their writes are visible after it."""
    total: Any
    """``total(x)``: sum over the lanes, the same bits on every lane."""
    largest: Any
    """``largest(x)``: largest value over the lanes."""
    empty_sum: Any
    """``empty_sum()``: where a sum over elements or nodes begins."""
    add_to: Any
    """``add_to(sum, x, k)``: the sum with the share of the k-th element or node."""
    ordered_first: Any
    """``ordered_first(lane)``: where a lane begins a short sum that is made in order."""
    ordered_step: Any
    """``ordered_step()``: how far it goes on."""
    ordered_total: Any
    """``ordered_total(x)``: the whole of such a sum, on every lane."""


@cache
def lane_functions() -> LaneFunctions:
    """Generate the lane functions."""

    @wp.func_native(snippet=BARRIER)
    def sync(): ...

    @wp.func_native(snippet=BLOCK_SUM)
    def total(x: wp.float64) -> wp.float64: ...

    @wp.func_native(snippet=BLOCK_LARGEST)
    def largest(x: wp.float64) -> wp.float64: ...

    @wp.func
    def empty_sum():
        return wp.float64(0.0)

    @wp.func
    def add_to(sofar: wp.float64, share: wp.float64, place: int):
        return sofar + share

    @wp.func_native(snippet=ORDERED_FIRST)
    def ordered_first(lane: int) -> int: ...

    @wp.func_native(snippet=ORDERED_STEP)
    def ordered_step() -> int: ...

    @wp.func_native(snippet=BLOCK_SUM)
    def ordered_total(x: wp.float64) -> wp.float64: ...

    return LaneFunctions(sync, total, largest, empty_sum, add_to, ordered_first, ordered_step, ordered_total)


ON_CHIP = 41_600
"""Bytes of a simulation's fields that a GPU's block keeps in shared memory, of 48 KiB without a request."""
ON_CHIP_SEATS = 3_072
"""Bytes of the boundary's sums there."""

_FIELD = """
    wp::array_t<REAL> row;
    row.data = (REAL*)((char*)fields.data + (long long)sample * fields.strides[0]);
    row.shape[0] = fields.shape[1];
    row.strides[0] = sizeof(REAL);
    row.ndim = 1;
#if defined(__CUDA_ARCH__)
    __shared__ REAL pool[ROOM / sizeof(REAL)];
    if (on_chip) row.data = pool + offset;
#endif
    return row;
"""


@cache
def field_function(precision: Precision, *, seats: bool = False) -> Any:
    """Generate ``f(fields, sample, on_chip, offset)``: a simulation's row of an array of the state.

    On a GPU it lies in shared memory, at an offset in numbers, where the mesh is small enough for that.
    """
    real = precision.real
    room = ON_CHIP_SEATS if seats else ON_CHIP
    snippet = _FIELD.replace("REAL", f"wp::{real.__name__}").replace("ROOM", str(room))

    @wp.func_native(snippet=snippet)
    def field(fields: wp.array2d(dtype=real), sample: int, on_chip: int, offset: int) -> wp.array(
        dtype=real
    ): ...

    return field


def fits_on_chip(n_nodes: int, n_elements: int, n_seats: int, size: int) -> bool:
    """Whether the fields of one simulation, in numbers of `size` bytes, fit into shared memory."""
    return (4 * n_nodes + 8 * n_elements) * size <= ON_CHIP and 3 * n_seats * 8 <= ON_CHIP_SEATS
