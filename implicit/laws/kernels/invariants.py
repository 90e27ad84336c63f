r"""Stress and tangent of W(I1_bar, I2_bar) in three dimensions, from the law's own derivatives.

With J = det F, G = F^-T, Q = I1 F - F C and the derivatives of the isochoric invariants by F,

    g1 = J^(-2/3) (2 F - 2/3 I1 G),     g2 = J^(-4/3) (2 Q - 4/3 I2 G),                        (I.1)
    P = W_1 g1 + W_2 g2,                                                                        (I.2)
    A = W_11 g1 g1 + W_12 (g1 g2 + g2 g1) + W_22 g2 g2 + W_1 dg1/dF + W_2 dg2/dF.               (I.3)
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.precision import precision
from implicit.laws.kernels.tensors import cofactor, f64, mat33, mat99


@cache
def invariant_point_functions(law: type) -> tuple[Any, Any, Any]:
    """``(energy, stress, tangent)`` of ``(F, row)``: the isochoric W, P (3 x 3) and A = dP/dF (9 x 9)."""
    slopes, curvatures, stored = law.invariant_functions(precision("fp64"))  # type: ignore[attr-defined]
    half, two, three, four = f64(0.5), f64(2.0), f64(3.0), f64(4.0)
    third = f64(1.0 / 3.0)

    @wp.func
    def invariants(F: mat33):
        C = wp.transpose(F) * F
        I1 = wp.trace(C)
        I2 = half * (I1 * I1 - wp.ddot(C, C))
        scale = wp.pow(wp.determinant(F), -two * third)
        return C, I1, I2, scale

    @wp.func
    def energy(F: mat33, row: wp.array(dtype=f64)):
        _C, I1, I2, scale = invariants(F)
        return stored(scale * I1 - three, scale * scale * I2 - three, row)

    @wp.func
    def stress(F: mat33, row: wp.array(dtype=f64)):
        C, I1, I2, scale = invariants(F)
        G = cofactor(F) / wp.determinant(F)
        W1, W2 = slopes(scale * I1 - three, scale * scale * I2 - three, row)
        first = scale * (two * F - (two * third * I1) * G)
        second = scale * scale * (two * (I1 * F - F * C) - (four * third * I2) * G)
        return W1 * first + W2 * second

    @wp.func
    def tangent(F: mat33, row: wp.array(dtype=f64)):
        C, I1, I2, scale = invariants(F)
        G = cofactor(F) / wp.determinant(F)
        B = F * wp.transpose(F)
        Q = I1 * F - F * C
        x, y = scale * I1 - three, scale * scale * I2 - three
        W1, W2 = slopes(x, y, row)
        W11, W12, W22 = curvatures(x, y, row)
        first = scale * (two * F - (two * third * I1) * G)
        second = scale * scale * (two * Q - (four * third * I2) * G)
        p, q = W1 * scale * two, W2 * scale * scale * two
        A = mat99()
        for m in range(9):
            i = m // 3
            r = m - 3 * i
            for n in range(m + 1):
                k = n // 3
                s = n - 3 * k
                GG, swapped = G[i, r] * G[k, s], G[i, s] * G[k, r]
                value = W11 * first[i, r] * first[k, s] + W22 * second[i, r] * second[k, s]
                value += W12 * (first[i, r] * second[k, s] + second[i, r] * first[k, s])
                value += (
                    p
                    * third
                    * (I1 * (two * third * GG + swapped) - two * (F[i, r] * G[k, s] + G[i, r] * F[k, s]))
                )
                value += q * (
                    two * F[k, s] * F[i, r]
                    - F[i, s] * F[k, r]
                    + two * third * I2 * (four * third * GG + swapped)
                    - four * third * (Q[i, r] * G[k, s] + G[i, r] * Q[k, s])
                )
                if i == k:
                    value -= q * C[s, r]
                if r == s:
                    value -= q * B[i, k]
                if i == k and r == s:
                    value += p + q * I1
                A[m, n] = value
                A[n, m] = value
        return A

    return energy, stress, tangent
