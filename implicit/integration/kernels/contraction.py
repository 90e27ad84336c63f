"""Element forces and stiffness on a GPU: a thread for each pair of points of each element.

`implicit.integration.contraction` does the same by BLAS, which is faster on a CPU.
"""

from functools import cache
from typing import Any

import warp as wp

f64 = wp.float64


@cache
def force_kernel(d: int, columns: int) -> Any:
    """``forces[m, k d]`` from P of the points; launched over (cells, nodes)."""
    components, D = int(d), int(columns)

    @wp.kernel(module="unique", enable_backward=False)
    def forces(
        E: wp.array4d(dtype=f64),
        volumes: wp.array2d(dtype=f64),
        P: wp.array3d(dtype=f64),
        out: wp.array2d(dtype=f64),
    ):
        c, a = wp.tid()
        for i in range(components):
            total = f64(0.0)
            for g in range(volumes.shape[1]):
                at_point = f64(0.0)
                for j in range(D):
                    at_point += E[c, g, a, j] * P[c, g, i * D + j]
                total += volumes[c, g] * at_point
            out[c, a * components + i] = total

    return forces


@cache
def stiffness_kernel(d: int, columns: int) -> Any:
    """``K[m, k d, k d]`` from A dV of the points; launched over (cells, nodes, nodes)."""
    components, D = int(d), int(columns)

    @wp.kernel(module="unique", enable_backward=False)
    def stiffness(
        E: wp.array4d(dtype=f64),
        A: wp.array4d(dtype=f64),
        out: wp.array3d(dtype=f64),
    ):
        c, a, b = wp.tid()
        for i in range(components):
            for k in range(components):
                total = f64(0.0)
                for g in range(E.shape[1]):
                    for j in range(D):
                        row = f64(0.0)
                        for l in range(D):
                            row += A[c, g, i * D + j, k * D + l] * E[c, g, b, l]
                        total += E[c, g, a, j] * row
                out[c, a * components + i, b * components + k] = total

    return stiffness
