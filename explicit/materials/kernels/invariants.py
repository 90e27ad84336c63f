r"""The Warp functions of a law W(I1_bar, I2_bar), made from those of its derivatives.

Stress is Eq. (L.3). For the stable step the law bounds the second variation of its energy along straight
lines F + eps L F, which in the axes of b has a block for the stretches and one for the shear in the plane:

    N_ij = dtau_i / dln lam_j - tau_i delta_ij,     [G b_2, G b_2 - tau_2; G b_2 - tau_2, G b_1],     (L.8)

with G = (tau_1 - tau_2) / (b_1 - b_2) = 2 (W_1 + b_3 W_2). See `explicit.materials.kernels.curvature`.
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.materials.kernels.curvature import curvature_functions
from explicit.precision import Precision


@cache
def invariant_kernel_functions(law: type, precision: Precision) -> tuple[Any, Any, Any]:
    """Generate ``(stress, tangent, energy)`` of a class with ``invariant_functions``; see
    `explicit.materials.base.MaterialLaw.kernel_functions`."""
    slopes, curvatures, stored = law.invariant_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, one, two, three, four = real(0.0), real(1.0), real(2.0), real(3.0), real(4.0)
    third, ninth, ten_ninths, fifteen = real(1.0 / 3.0), real(1.0 / 9.0), real(10.0 / 9.0), real(15.0)
    shared = curvature_functions(precision)
    in_plane, as_tangent, largest_of = shared.in_plane, shared.as_tangent, shared.largest

    @wp.func
    def first_stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        W1, _W2 = slopes(three * (mean - one), zero, row)
        q = two * W1
        return vec4(q * (rr - mean), q * (yy - mean), q * ry, q * (tt - mean))

    @wp.func
    def both_stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        # The inverse of a tensor of determinant 1 is that of its cofactors.
        irr, iyy, iry, itt = yy * tt, rr * tt, -ry * tt, rr * yy - ry * ry
        inverse_mean = (irr + iyy + itt) * third
        W1, W2 = slopes(three * (mean - one), three * (inverse_mean - one), row)
        p, q = two * W1, two * W2
        return vec4(
            p * (rr - mean) - q * (irr - inverse_mean),
            p * (yy - mean) - q * (iyy - inverse_mean),
            p * ry - q * iry,
            p * (tt - mean) - q * (itt - inverse_mean),
        )

    @wp.func
    def tangent(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        b1, b2 = in_plane(rr, yy, ry, tt)
        b3 = tt
        i1, i2, i3 = b2 * b3, b1 * b3, b1 * b2
        first, second = b1 + b2 + b3, i1 + i2 + i3
        W1, W2 = slopes(first - three, second - three, row)
        W11, W12, W22 = curvatures(first - three, second - three, row)
        p1, p2, p3 = b1 - first * third, b2 - first * third, b3 - first * third
        q1, q2, q3 = i1 - second * third, i2 - second * third, i3 - second * third
        # d tau / d ln lam of Eq. (L.3) less tau on the diagonal.
        n11 = W1 * (ten_ninths * first - two * third * b1) + W2 * (two * ninth) * (fifteen * i1 - second)
        n22 = W1 * (ten_ninths * first - two * third * b2) + W2 * (two * ninth) * (fifteen * i2 - second)
        n33 = W1 * (ten_ninths * first - two * third * b3) + W2 * (two * ninth) * (fifteen * i3 - second)
        n11 += four * (W11 * p1 * p1 - two * W12 * p1 * q1 + W22 * q1 * q1)
        n22 += four * (W11 * p2 * p2 - two * W12 * p2 * q2 + W22 * q2 * q2)
        n33 += four * (W11 * p3 * p3 - two * W12 * p3 * q3 + W22 * q3 * q3)
        f1, f2 = two * ninth * first, two * ninth * second
        n12 = four * (W1 * (b3 * third - f1) + W2 * (i3 * third - f2))
        n13 = four * (W1 * (b2 * third - f1) + W2 * (i2 * third - f2))
        n23 = four * (W1 * (b1 * third - f1) + W2 * (i1 * third - f2))
        n12 += four * (W11 * p1 * p2 - W12 * (p1 * q2 + q1 * p2) + W22 * q1 * q2)
        n13 += four * (W11 * p1 * p3 - W12 * (p1 * q3 + q1 * p3) + W22 * q1 * q3)
        n23 += four * (W11 * p2 * p3 - W12 * (p2 * q3 + q2 * p3) + W22 * q2 * q3)
        shear = two * (W1 + b3 * W2)
        tau2 = two * (W1 * p2 - W2 * q2)
        most = largest_of(vec4(n11, n22, n33, shear), n12, n13, n23, b1, b2, tau2)
        return as_tangent(most, rr, yy, ry, tt)

    @wp.func
    def energy(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        second = (rr + yy) * tt + (rr * yy - ry * ry)
        return stored(rr + yy + tt - three, second - three, row)

    return (both_stress if law.SECOND_INVARIANT else first_stress), tangent, energy  # type: ignore[attr-defined]
