r"""Largest stiffness of a law along any motion, for the stable step of every closed-form law.

The second variation of an isotropic energy along F + eps L F falls into a block N of the three stretches and
one of the shear in the plane (Ogden 1984, section 6.1); its largest value over |L|^2 is the larger of their
largest eigenvalues. That of the plane's block is taken exactly. That of N is bounded by the rows of
N + c 1 1^T with c >= 0, which is not below N: at rest, where N is 2 mu (1 - 1 1^T / 3), a c of 2 mu / 3 makes
the bound exact.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision


@dataclass(frozen=True)
class CurvatureFunctions:
    """Warp functions for the bound of a law's tangent."""

    in_plane: Any
    """``in_plane(rr, yy, ry, tt) -> (b_1, b_2)``: eigenvalues of the isochoric tensor in the plane [-]."""
    largest: Any
    """``largest((n11, n22, n33, G), n12, n13, n23, b_1, b_2, tau_2)``: the bound of Eq. (L.8) [Pa]."""
    as_tangent: Any
    """``as_tangent(largest, rr, yy, ry, tt)``: the shear modulus whose law elements would bound so [Pa]."""


@cache
def curvature_functions(precision: Precision) -> CurvatureFunctions:
    """Generate the functions."""
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, third = real(0.0), real(0.5), real(1.0), real(2.0), real(1.0 / 3.0)
    two_thirds = real(2.0 / 3.0)
    # Keeps the root's derivative a number where both eigenvalues are equal.
    nothing = real(1e-300 if precision.name == "fp64" else 1e-36)

    @wp.func
    def in_plane(rr: real, yy: real, ry: real, tt: real):
        apart = half * (rr - yy)
        larger = half * (rr + yy) + wp.sqrt(apart * apart + ry * ry + nothing)
        return larger, one / (larger * tt)  # det b = 1, without the difference of the root

    @wp.func
    def largest(diagonal: vec4, n12: real, n13: real, n23: real, b1: real, b2: real, tau2: real):
        shift = wp.max(-(n12 + n13 + n23) * third, zero)
        s12, s13, s23 = wp.abs(n12 + shift), wp.abs(n13 + shift), wp.abs(n23 + shift)
        rows = wp.max(diagonal[0] + s12 + s13, diagonal[1] + s12 + s23)
        rows = wp.max(rows, diagonal[2] + s13 + s23) + shift
        apart, cross = half * diagonal[3] * (b1 - b2), diagonal[3] * b2 - tau2
        shear = half * diagonal[3] * (b1 + b2) + wp.sqrt(apart * apart + cross * cross)
        return wp.max(wp.max(rows, shear), zero)

    @wp.func
    def as_tangent(most: real, rr: real, yy: real, ry: real, tt: real):
        # Elements take twice the tangent, or the multiple of `explicit.elements.bounds.shear_bound`.
        mean = (rr + yy + tt) * third
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        top = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        return most / wp.min(one + (mean + two_thirds * squared / mean) / top, two)

    return CurvatureFunctions(in_plane, largest, as_tangent)
