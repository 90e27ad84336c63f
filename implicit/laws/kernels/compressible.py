r"""Stress and tangent with a volumetric part, and of the coupled neo-Hookean energy."""

from functools import cache
from typing import Any

import warp as wp

from implicit.laws.kernels.tensors import cofactor, f64, mat33, mat99
from implicit.laws.kernels.volumetric import volumetric_functions


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
