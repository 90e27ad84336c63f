"""Lanes of one simulation: a barrier and two reductions, natively.

On the CPU a simulation has one lane, which waits for nobody and reduces nothing. On a GPU its lanes are
the threads of one block.
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


@dataclass(frozen=True)
class LaneFunctions:
    """What lanes do together."""

    sync: Any
    """``sync()``: every lane waits for the others; their writes are visible after it."""
    total: Any
    """``total(x)``: sum over the lanes, the same bits on every lane."""
    largest: Any
    """``largest(x)``: largest value over the lanes."""


@cache
def lane_functions() -> LaneFunctions:
    """Generate the lane functions."""

    @wp.func_native(snippet=BARRIER)
    def sync(): ...

    @wp.func_native(snippet=BLOCK_SUM)
    def total(x: wp.float64) -> wp.float64: ...

    @wp.func_native(snippet=BLOCK_LARGEST)
    def largest(x: wp.float64) -> wp.float64: ...

    return LaneFunctions(sync, total, largest)
