"""Bounds for the stable step beside an element's volumetric part, whose bound is sharp (rank one).

Stiffness and damping of the rest are bounded by moduli times |grad v|^2, and this form over the corners'
masses is a sum of squares (b . v)^2 of a few vectors b. Its largest eigenvalue is that of their Gram matrix:
below the trace, and below the largest sum of a row's absolute values (Gershgorin), which is the eigenvalue
itself where an element is a rectangle far from the axis.
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision


@cache
def gradient_bounds_function(precision: Precision, bound: str) -> Any:
    """Generate ``f(w_r, w_y, b_r, b_y, c) -> (radial, axial)``: the most that |grad v|^2 can be of
    sum v^2 / w over the corners, in radial and in axial motion, which do not couple [1/(kg m^2)]; by the
    "trace" or by the "eigenvalue"."""
    real, vec4 = precision.real, precision.vec4

    @wp.func
    def traces(w_r: vec4, w_y: vec4, b_r: vec4, b_y: vec4, c: vec4):
        radial, axial = real(0.0), real(0.0)
        for a in range(4):
            gradient = b_r[a] * b_r[a] + b_y[a] * b_y[a]
            radial += w_r[a] * (gradient + c[a] * c[a])
            axial += w_y[a] * gradient
        return radial, axial

    @wp.func
    def rows(w_r: vec4, w_y: vec4, b_r: vec4, b_y: vec4, c: vec4):
        rr, yy, tt, ry, rt, yt = real(0.0), real(0.0), real(0.0), real(0.0), real(0.0), real(0.0)
        axial_rr, axial_yy, axial_ry = real(0.0), real(0.0), real(0.0)
        for a in range(4):
            rr += w_r[a] * b_r[a] * b_r[a]
            yy += w_r[a] * b_y[a] * b_y[a]
            tt += w_r[a] * c[a] * c[a]
            ry += w_r[a] * b_r[a] * b_y[a]
            rt += w_r[a] * b_r[a] * c[a]
            yt += w_r[a] * b_y[a] * c[a]
            axial_rr += w_y[a] * b_r[a] * b_r[a]
            axial_yy += w_y[a] * b_y[a] * b_y[a]
            axial_ry += w_y[a] * b_r[a] * b_y[a]
        ry, rt, yt = wp.abs(ry), wp.abs(rt), wp.abs(yt)
        radial = wp.max(wp.max(rr + ry + rt, yy + ry + yt), tt + rt + yt)
        axial = wp.max(axial_rr, axial_yy) + wp.abs(axial_ry)
        return wp.min(radial, rr + yy + tt), wp.min(axial, axial_rr + axial_yy)

    return {"trace": traces, "eigenvalue": rows}[bound]


@cache
def shear_bound_function(law_tangent: Any, precision: Precision) -> Any:
    """Generate ``f(rr, yy, ry, tt, row)``: the most that the second variation of U(I1_bar) can be of
    |grad v|^2 [Pa].

    It is 2U' [L b L + I1/3 tr L^2 - 4/3 tr L (dev b L) - 2/9 I1 tr^2 L] and a part with U''. The law bounds b
    and the latter; the rest, at its worst in tr L, comes here.
    """
    real = precision.real
    one, two, third, two_thirds = real(1.0), real(2.0), real(1.0 / 3.0), real(2.0 / 3.0)

    @wp.func
    def shear_bound(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        largest = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        factor = one + (mean + two_thirds * squared / mean) / largest
        return factor * law_tangent(rr, yy, ry, tt, row)

    return shear_bound
