"""Symmetric axisymmetric tensors (rr, yy, ry, tt) carried between the reference and the present."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision


@dataclass(frozen=True)
class TensorFunctions:
    """Push and pull by F = (f11, f12; f21, f22) in the plane and f33 around it."""

    push: Any
    """``push(A, f11, f12, f21, f22, f33)``: F A F^T."""
    pull: Any
    """``pull(A, f11, f12, f21, f22, f33)``: F^-1 A F^-T."""
    norm: Any
    """``norm(A)``: sqrt(A : A)."""


@cache
def tensor_functions(precision: Precision) -> TensorFunctions:
    """Generate the functions."""
    real, vec4 = precision.real, precision.vec4
    one, two = real(1.0), real(2.0)

    @wp.func
    def push(A: vec4, f11: real, f12: real, f21: real, f22: real, f33: real):
        rr = f11 * f11 * A[0] + two * f11 * f12 * A[2] + f12 * f12 * A[1]
        yy = f21 * f21 * A[0] + two * f21 * f22 * A[2] + f22 * f22 * A[1]
        ry = f11 * f21 * A[0] + (f11 * f22 + f12 * f21) * A[2] + f12 * f22 * A[1]
        return vec4(rr, yy, ry, f33 * f33 * A[3])

    @wp.func
    def pull(A: vec4, f11: real, f12: real, f21: real, f22: real, f33: real):
        per_area, per_hoop = one / (f11 * f22 - f12 * f21), one / f33
        return push(A, f22 * per_area, -f12 * per_area, -f21 * per_area, f11 * per_area, per_hoop)

    @wp.func
    def norm(A: vec4):
        return wp.sqrt(A[0] * A[0] + A[1] * A[1] + two * A[2] * A[2] + A[3] * A[3])

    return TensorFunctions(push, pull, norm)
