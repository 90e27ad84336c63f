"""Warp functions of stress and tangent at a Gauss point, and the kernels over all Gauss points.

An element's gradients E[cell, point, node, column] are dN/dX_J. In an axisymmetric model, the third column is
N / R. The pairs (i, J) of a radial displacement then include the hoop stretch as (0, 2), and the pair (1, 2)
is empty. The products of P and A with E are therefore the same in every kinematics.

Laws of the invariants: with J = det F, G = F^-T, Q = I1 F - F C,

    g1 = J^(-2/3) (2 F - 2/3 I1 G),     g2 = J^(-4/3) (2 Q - 4/3 I2 G),                        (I.1)
    P = W_1 g1 + W_2 g2,                                                                        (I.2)
    A = W_11 g1 g1 + W_12 (g1 g2 + g2 g1) + W_22 g2 g2 + W_1 dg1/dF + W_2 dg2/dF.               (I.3)

Laws of the stretches: with the eigenvectors N_i of C, n_i = F N_i / lam_i, t = lam w'(lam), tau_i = t_i minus
the mean, and K_ij = dtau_i / dln lam_j (Ogden 1984, section 6.1),

    P = sum_i tau_i / lam_i n_i N_i,
    A = sum_ij (K_ij - tau_i delta_ij) / (lam_i lam_j) n_i N_i n_j N_j + sum_(i /= j) B_ij,
    B_ij = g_ij n_i N_j n_i N_j + (b_j g_ij - tau_j) / (lam_i lam_j) n_i N_j n_j N_i,      (I.4)

where g_ij = (tau_i - tau_j) / (b_i - b_j) with b = lam^2. Its limit for equal b is (K_ii - K_ij) / (2 b).
"""

from functools import cache
from typing import Any

import warp as wp

from explicit.precision import precision

f64 = wp.float64


@cache
def volumetric_functions(form: str, start: int) -> tuple[Any, Any]:
    """``(energy, slopes)`` of a form with constants from ``row[start]`` on: U(J), and U'(J), U''(J)."""
    at = int(start)
    half, one, two = f64(0.5), f64(1.0), f64(2.0)
    three, five, six = f64(3.0), f64(5.0), f64(6.0)

    @wp.func
    def quadratic_energy(J: f64, row: wp.array(dtype=f64)):
        return half * row[at] * (J - one) * (J - one)

    @wp.func
    def quadratic(J: f64, row: wp.array(dtype=f64)):
        return row[at] * (J - one), row[at]

    @wp.func
    def polynomial_energy(J: f64, row: wp.array(dtype=f64)):
        z = (J - one) * (J - one)
        return z * (row[at] + z * (row[at + 1] + z * row[at + 2]))

    @wp.func
    def polynomial(J: f64, row: wp.array(dtype=f64)):
        z = (J - one) * (J - one)
        slope = two * (J - one) * (row[at] + z * (two * row[at + 1] + z * three * row[at + 2]))
        return slope, two * (row[at] + z * (six * row[at + 1] + z * three * five * row[at + 2]))

    return {"quadratic": (quadratic_energy, quadratic), "polynomial": (polynomial_energy, polynomial)}[form]


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


EQUAL = 1e-5
"""Relative difference of two eigenvalues below which g_ij is its limit. Both are then exact to 1e-10."""


@cache
def stretch_point_functions(law: type) -> tuple[Any, Any, Any]:
    """``(energy, stress, tangent)`` of ``(F, row)``; see `kolsky.equilibrium.point_kernels`."""
    slopes, stored = law.stretch_functions(precision("fp64"))  # type: ignore[attr-defined]
    third, ninth, half, equal = f64(1.0 / 3.0), f64(1.0 / 9.0), f64(0.5), f64(EQUAL)
    zero, one = f64(0.0), f64(1.0)

    @wp.func
    def principal(F: mat33):
        """Eigenvectors, b_i, and ln b_i of the isochoric tensor."""
        V, b = wp.eig3(wp.transpose(F) * F)
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


@cache
def with_volume(isochoric: tuple[Any, Any, Any], form: str, start: int) -> tuple[Any, Any, Any]:
    """``(energy, stress, tangent)`` of W + U(J): P + U' dJ/dF, A + U'' dJ/dF dJ/dF + U' d2J/dF2."""
    isochoric_energy, isochoric_stress, isochoric_tangent = isochoric
    volume_energy, slopes = volumetric_functions(form, start)

    @wp.func
    def energy(F: mat33, row: wp.array(dtype=f64)):
        return isochoric_energy(F, row) + volume_energy(wp.determinant(F), row)

    @wp.func
    def stress(F: mat33, row: wp.array(dtype=f64)):
        pressure, _stiffness = slopes(wp.determinant(F), row)
        return isochoric_stress(F, row) + pressure * cofactor(F)

    @wp.func
    def tangent(F: mat33, row: wp.array(dtype=f64)):
        pressure, stiffness = slopes(wp.determinant(F), row)
        return add_pressure(isochoric_tangent(F, row), F, pressure, stiffness)

    return energy, stress, tangent


@wp.func
def add_pressure(A: mat99, F: mat33, pressure: f64, stiffness: f64):
    """A + stiffness dJ/dF dJ/dF + pressure d2J/dF2."""
    H = cofactor(F)
    quotient = pressure / wp.determinant(F)
    total = A
    for m in range(9):
        i = m // 3
        r = m - 3 * i
        for n in range(9):
            k = n // 3
            s = n - 3 * k
            total[m, n] = (
                total[m, n] + (stiffness + quotient) * H[i, r] * H[k, s] - quotient * H[i, s] * H[k, r]
            )
    return total


@cache
def compressible_neo_hookean() -> tuple[Any, Any, Any]:
    """``(energy, stress, tangent)`` of mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2 with row = (mu, lambda)."""
    half, two, three = f64(0.5), f64(2.0), f64(3.0)

    @wp.func
    def energy(F: mat33, row: wp.array(dtype=f64)):
        l = wp.log(wp.determinant(F))
        return half * row[0] * (wp.ddot(F, F) - three - two * l) + half * row[1] * l * l

    @wp.func
    def stress(F: mat33, row: wp.array(dtype=f64)):
        J = wp.determinant(F)
        return row[0] * F + ((row[1] * wp.log(J) - row[0]) / J) * cofactor(F)

    @wp.func
    def tangent(F: mat33, row: wp.array(dtype=f64)):
        J = wp.determinant(F)
        G = cofactor(F) / J
        A = mat99()
        for m in range(9):
            i = m // 3
            r = m - 3 * i
            for n in range(9):
                k = n // 3
                s = n - 3 * k
                A[m, n] = (row[0] - row[1] * wp.log(J)) * G[i, s] * G[k, r] + row[1] * G[i, r] * G[k, s]
            A[m, m] = A[m, m] + row[0]
        return A

    return energy, stress, tangent


KINEMATICS = {"3d": (3, 3), "plane_strain": (2, 2), "plane_stress": (2, 2), "axisymmetric": (2, 3)}
"""Displacement components d and gradient columns D of each kinematics."""
THICKNESS_STEPS = 60
"""Maximum number of iterations for the thickness stretch of plane stress."""


@cache
def deformation_function(kinematics: str) -> Any:
    """``F(u, cells, E, cell, point, thickness_stretch)`` as a 3 x 3 matrix."""
    d = int(KINEMATICS[kinematics][0])
    hoop, stretched = kinematics == "axisymmetric", kinematics == "plane_stress"

    @wp.func
    def deformation(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        c: int,
        g: int,
        thickness: f64,
    ):
        F = wp.identity(n=3, dtype=f64)
        if wp.static(stretched):
            F[2, 2] = thickness
        for a in range(cells.shape[1]):
            node = cells[c, a]
            if wp.static(hoop):
                F[2, 2] = F[2, 2] + u[node, 0] * E[c, g, a, 2]
            for i in range(wp.static(d)):
                for j in range(wp.static(d)):
                    F[i, j] = F[i, j] + u[node, i] * E[c, g, a, j]
        return F

    return deformation


@cache
def place_function(kinematics: str) -> Any:
    """Number in 0..8 of the pair of component ``m = i D + J``; -1 for the empty one."""
    columns, hoop = int(KINEMATICS[kinematics][1]), kinematics == "axisymmetric"

    @wp.func
    def place(m: int):
        i = m // wp.static(columns)
        j = m - wp.static(columns) * i
        value = 3 * i + j
        if wp.static(hoop) and j == 2:
            value = wp.where(i == 0, 8, -1)
        return value

    return place


@cache
def point_kernel(functions: tuple[Any, Any, Any], kinematics: str, *, mixed: bool, single: bool) -> Any:
    """P, A dV, dJ/dF, J and the energy density at every Gauss point. Launched over (cells, points).

    A is optionally written in single precision. In a mixed model, `pressure` [Pa] is the volumetric part of P
    and A. Otherwise it is not read. In plane stress, H replaces dJ/dF. H is A_iJ33 / A_3333, which gives the
    change of thickness.
    """
    energy_of, stress_of, tangent_of = functions
    deformation, place = deformation_function(kinematics), place_function(kinematics)
    d, columns = KINEMATICS[kinematics]
    size = int(d * columns)
    plane_stress = kinematics == "plane_stress"
    kind = wp.float32 if single else wp.float64
    zero, half, tiny = f64(0.0), f64(0.5), f64(1e-14)

    @wp.kernel(module="unique", enable_backward=False)
    def points(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        rows: wp.array2d(dtype=f64),
        pressure: wp.array2d(dtype=f64),
        volumes: wp.array2d(dtype=f64),
        thickness: wp.array2d(dtype=f64),
        want_tangent: int,
        P: wp.array3d(dtype=f64),
        A: wp.array4d(dtype=kind),
        H: wp.array3d(dtype=f64),
        J: wp.array2d(dtype=f64),
        W: wp.array2d(dtype=f64),
    ):
        c, g = wp.tid()
        row = rows[c]
        F = deformation(u, cells, E, c, g, thickness[c, g])
        if wp.static(plane_stress):
            stretch = F[2, 2]
            change = stretch
            step = int(0)
            while step < wp.static(THICKNESS_STEPS) and wp.abs(change) > tiny * stretch:
                F[2, 2] = stretch
                P33 = stress_of(F, row)
                A33 = tangent_of(F, row)
                for m in range(size):
                    H[c, g, m] = A33[place(m), 8] / A33[8, 8]
                change = wp.clamp(-P33[2, 2] / A33[8, 8], -half * stretch, stretch)
                stretch += change
                step += 1
            F[2, 2] = stretch
            thickness[c, g] = stretch
        volume = wp.determinant(F)
        J[c, g] = volume
        stress = stress_of(F, row)
        area = cofactor(F)
        W[c, g] = energy_of(F, row)
        if wp.static(mixed):
            stress += pressure[c, g] * area
            for m in range(size):
                at = place(m)
                H[c, g, m] = wp.where(at >= 0, area[wp.max(at, 0) // 3, wp.max(at, 0) % 3], zero)
        for m in range(size):
            at = place(m)
            P[c, g, m] = wp.where(at >= 0, stress[wp.max(at, 0) // 3, wp.max(at, 0) % 3], zero)
        if want_tangent == 1:
            whole = tangent_of(F, row)
            if wp.static(mixed):
                whole = add_pressure(whole, F, pressure[c, g], zero)
            for m in range(size):
                at = place(m)
                for n in range(size):
                    to = place(n)
                    value = f64(0.0)
                    if at >= 0 and to >= 0:
                        value = whole[at, to]
                        if wp.static(plane_stress):  # P_33 = 0 holds the thickness
                            value -= whole[at, 8] * whole[8, to] / whole[8, 8]
                    A[c, g, m, n] = kind(value * volumes[c, g])

    return points


@cache
def volume_kernel(kinematics: str) -> Any:
    """J at every Gauss point."""
    deformation = deformation_function(kinematics)
    one = f64(1.0)

    @wp.kernel(module="unique", enable_backward=False)
    def volumes(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        J: wp.array2d(dtype=f64),
    ):
        c, g = wp.tid()
        J[c, g] = wp.determinant(deformation(u, cells, E, c, g, one))

    return volumes


@cache
def stress_kernel(stress_of: Any, kinematics: str) -> Any:
    """P at every Gauss point, each with a separate row. The reverse mode of this kernel gives dP/drow."""
    deformation = deformation_function(kinematics)

    @wp.kernel(module="unique", enable_backward=False)
    def deformations(
        u: wp.array2d(dtype=f64),
        cells: wp.array2d(dtype=wp.int32),
        E: wp.array4d(dtype=f64),
        thickness: wp.array2d(dtype=f64),
        F: wp.array2d(dtype=mat33),
    ):
        c, g = wp.tid()
        F[c, g] = deformation(u, cells, E, c, g, thickness[c, g])

    @wp.kernel(module="unique")
    def stresses(F: wp.array(dtype=mat33), rows: wp.array2d(dtype=f64), P: wp.array2d(dtype=f64)):
        g = wp.tid()
        stress = stress_of(F[g], rows[g])
        for m in range(9):
            P[g, m] = stress[m // 3, m % 3]

    return deformations, stresses
