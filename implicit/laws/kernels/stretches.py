r"""Stress and tangent of W = sum_i w(lam_i) of the isochoric stretches in three dimensions.

With the eigenvectors N_i of C, n_i = F N_i / lam_i, tau_i = t_i - (t_1 + t_2 + t_3) / 3, t = lam w'(lam), and
K_ij = dtau_i / dln lam_j (Ogden 1984, section 6.1),

    P = sum_i tau_i / lam_i n_i N_i,
    A = sum_ij (K_ij - tau_i delta_ij) / (lam_i lam_j) n_i N_i n_j N_j + sum_(i /= j) B_ij,
    B_ij = g_ij n_i N_j n_i N_j + (b_j g_ij - tau_j) / (lam_i lam_j) n_i N_j n_j N_i,      (I.4)

where g_ij = (tau_i - tau_j) / (b_i - b_j) of b = lam^2, which is (K_ii - K_ij) / (2 b) where both are equal.
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.precision import precision
from implicit.laws.kernels.tensors import f64, mat33, mat99

SWEEPS = 10
"""Most sweeps of Jacobi's rotations; they converge quadratically, in 4 or 5."""
EQUAL = 1e-5
"""Relative difference of two eigenvalues below which g_ij is its limit: there both are exact to 1e-10."""


@wp.func
def eigenvectors(C: mat33):
    """Eigenvectors of a symmetric matrix in columns, by Jacobi's cyclic rotations."""
    V = wp.identity(n=3, dtype=f64)
    D = C
    sweep = int(0)
    while sweep < SWEEPS:
        for turn in range(3):
            p = wp.where(turn == 2, 1, 0)
            q = wp.where(turn == 0, 1, 2)
            off = D[p, q]
            if wp.abs(off) > f64(1e-300):
                theta = (D[q, q] - D[p, p]) / (f64(2.0) * off)
                t = wp.where(theta >= f64(0.0), f64(1.0), f64(-1.0)) / (
                    wp.abs(theta) + wp.sqrt(theta * theta + f64(1.0))
                )
                c = f64(1.0) / wp.sqrt(t * t + f64(1.0))
                s = t * c
                R = wp.identity(n=3, dtype=f64)
                R[p, p] = c
                R[q, q] = c
                R[p, q] = s
                R[q, p] = -s
                D = wp.transpose(R) * D * R
                V = V * R
        sweep += 1
    return V


@cache
def stretch_point_functions(law: type) -> tuple[Any, Any, Any]:
    """``(energy, stress, tangent)`` of ``(F, row)``; see `implicit.laws.kernels.invariants`."""
    slopes, stored = law.stretch_functions(precision("fp64"))  # type: ignore[attr-defined]
    third, ninth, half, equal = f64(1.0 / 3.0), f64(1.0 / 9.0), f64(0.5), f64(EQUAL)
    zero, one = f64(0.0), f64(1.0)

    @wp.func
    def principal(F: mat33):
        """Eigenvectors, b_i, and ln b_i of the isochoric tensor."""
        C = wp.transpose(F) * F
        V = eigenvectors(C)
        S = wp.transpose(V) * C * V
        b = wp.vec3d(S[0, 0], S[1, 1], S[2, 2])
        mean = (wp.log(b[0]) + wp.log(b[1]) + wp.log(b[2])) * third
        return V, b, wp.vec3d(wp.log(b[0]) - mean, wp.log(b[1]) - mean, wp.log(b[2]) - mean)

    @wp.func
    def energy(F: mat33, row: wp.array(dtype=f64)):
        _V, _b, l = principal(F)
        return stored(l[0], row) + stored(l[1], row) + stored(l[2], row)

    @wp.func
    def stress(F: mat33, row: wp.array(dtype=f64)):
        V, b, l = principal(F)
        t0, _h0 = slopes(l[0], row)
        t1, _h1 = slopes(l[1], row)
        t2, _h2 = slopes(l[2], row)
        mean = (t0 + t1 + t2) * third
        middle = wp.diag(wp.vec3d((t0 - mean) / b[0], (t1 - mean) / b[1], (t2 - mean) / b[2]))
        return F * V * middle * wp.transpose(V)

    @wp.func
    def tangent(F: mat33, row: wp.array(dtype=f64)):
        V, b, l = principal(F)
        t0, h0 = slopes(l[0], row)
        t1, h1 = slopes(l[1], row)
        t2, h2 = slopes(l[2], row)
        mean, ends = (t0 + t1 + t2) * third, (h0 + h1 + h2) * ninth
        tau = wp.vec3d(t0 - mean, t1 - mean, t2 - mean)
        h = wp.vec3d(h0, h1, h2)
        lam = wp.vec3d(wp.sqrt(b[0]), wp.sqrt(b[1]), wp.sqrt(b[2]))
        n = F * V * wp.diag(wp.vec3d(one / lam[0], one / lam[1], one / lam[2]))
        normal, same, swapped = mat33(), mat33(), mat33()
        for a in range(3):
            for c in range(3):
                K = ends - (h[a] + h[c]) * third
                if a == c:
                    normal[a, a] = (K + h[a] - tau[a]) / b[a]
                else:
                    normal[a, c] = K / (lam[a] * lam[c])
                    g = zero
                    apart, middle = b[a] - b[c], half * (b[a] + b[c])
                    if wp.abs(apart) > equal * middle:
                        g = (tau[a] - tau[c]) / apart
                    else:
                        g = half * (half * (h[a] + h[c])) / middle
                    same[a, c] = g
                    swapped[a, c] = (b[c] * g - tau[c]) / (lam[a] * lam[c])
        A = mat99()
        for m in range(9):
            i = m // 3
            r = m - 3 * i
            for o in range(m + 1):
                k = o // 3
                s = o - 3 * k
                value = f64(0.0)
                for a in range(3):
                    for c in range(3):
                        value += normal[a, c] * n[i, a] * V[r, a] * n[k, c] * V[s, c]
                        value += same[a, c] * n[i, a] * V[r, c] * n[k, a] * V[s, c]
                        value += swapped[a, c] * n[i, a] * V[r, c] * n[k, c] * V[s, a]
                A[m, o] = value
                A[o, m] = value
        return A

    return energy, stress, tangent
