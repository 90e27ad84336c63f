"""Warp types and small tensor functions."""

from typing import Any

import warp as wp

f64 = wp.float64
mat33 = wp.mat33d
mat99: Any = wp.types.matrix(shape=(9, 9), dtype=wp.float64)
"""dP/dF with the pairs (i, J) in rows and (k, L) in columns, row by row."""


@wp.func
def cofactor(F: mat33):
    """dJ/dF = J F^-T, which needs no division."""
    return mat33(
        F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1],
        F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2],
        F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0],
        F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2],
        F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0],
        F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1],
        F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1],
        F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2],
        F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0],
    )
