"""A stress point of Bergstrom and Boyce's network, Eq. (V.3), by elastic trial and implicit flow.

The point remembers C_v^-1 - 1. Over a step network B first follows F_bar elastically, to b_tr, and then flows
by D = gamma dt along its own stress: b_e = exp(-D N) b_tr exp(-D N), the exponential to second order. With
the network's tangent mu_B the flow lowers |tau| by 2 mu_B gamma dt, so that y = |tau| / |tau_tr| solves

    y + k y^m = 1,    k = 2 mu_B dt gamma(|tau_tr|) / |tau_tr|,

by Newton's iteration from (1 + k)^(-1/m), which lies above the root: it falls to it whatever k is.
"""

from dataclasses import dataclass
from functools import cache

import warp as wp

from explicit.elements.bounds import gradient_bounds_function
from explicit.elements.shared import isochoric_factor_function
from explicit.precision import Precision
from explicit.relaxation.base import PointFunctions
from explicit.relaxation.kernels.tensors import tensor_functions

NEWTON = 3
"""Newton's iterations: a step of an explicit run has k << 1, for which one would do."""
LARGEST_LOG = 60.0
"""Largest ln k that is told apart, which fp32 still holds: all stress is gone within a step long before."""


@dataclass(frozen=True)
class CreepKind:
    """One creeping network."""

    @property
    def index_of_rest(self) -> int:
        """A row is s / (1 + s), tau_hat, m, C, xi, 1 / (1 + s)."""
        return 5

    def point(self, law: type, precision: Precision, bound: str) -> PointFunctions:
        """See `explicit.relaxation.base.Relaxation`."""
        return _point(law, precision, bound)


@cache
def _point(law: type, precision: Precision, bound: str) -> PointFunctions:
    law_stress, law_tangent, law_energy = law.kernel_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, four = real(0.0), real(0.5), real(1.0), real(2.0), real(4.0)
    third, largest_log, newton = real(1.0 / 3.0), real(LARGEST_LOG), int(NEWTON)
    nothing = real(1e-30)
    isochoric_factor = isochoric_factor_function(precision)
    gradient_bounds = gradient_bounds_function(precision, bound)
    tensors = tensor_functions(precision)
    push, pull, norm = tensors.push, tensors.pull, tensors.norm

    @wp.func
    def flow(
        trial: vec4,
        stress: vec4,
        chain: real,
        stiff: real,
        dt: real,
        branches: wp.array(dtype=real),
    ):
        """Flow in a step, gamma dt."""
        amount = real(0.0)
        size = norm(stress)
        if size > nothing and dt > zero:
            # The tangent of a law W(I1) that does not stiffen, which is all the same in any direction.
            mean = (trial[0] + trial[1] + trial[3]) * third
            spread = vec4(trial[0] - mean, trial[1] - mean, trial[2], trial[3] - mean)
            m, twice = branches[2], two * mean * size / wp.max(norm(spread), nothing)
            crept = wp.max(chain - one, zero) + branches[4]
            k = wp.log(stiff * size / branches[1]) * m + wp.log(crept) * branches[3]
            k = wp.exp(wp.min(k + wp.log(twice * dt / size), largest_log))
            y = wp.exp(-wp.log(one + k) / m)
            for _i in range(newton):
                power = k * wp.exp(m * wp.log(y))
                y = y - (y + power - one) / (one + m * power / y)
            amount = (one - y) * size / twice
        return amount

    @wp.func
    def relax(
        weight: real,
        gradient_r: vec4,
        gradient_y: vec4,
        hoop: vec4,
        inverse_mass_r: vec4,
        inverse_mass_y: vec4,
        scale: real,
        row: wp.array(dtype=real),
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        first: int,
        stride: int,
        e: int,
        ur: vec4,
        uy: vec4,
        vr: vec4,
        vy: vec4,
        moved: real,
        interval: real,
        measure: int,
    ):
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        jacobian = one + dilatation
        f_r, f_y = vec4(), vec4()
        done, omega_squared = real(0.0), real(0.0)
        if wp.min(jacobian, one + plane) > zero:  # an element that turned inside out has ended the run
            f11, f22, f33 = one + h11, one + h22, one + h33
            iso, inverse = isochoric_factor(jacobian, dilatation)
            rr = iso * (f11 * f11 + h12 * h12)
            yy = iso * (f22 * f22 + h21 * h21)
            ry = iso * (f11 * h21 + h12 * f22)
            tt = iso * f33 * f33
            stiff, unit = scale * branches[0], vec4(one, one, zero, one)
            k = first * stride + e
            old = vec4(memory[k], memory[k + stride], memory[k + 2 * stride], memory[k + 3 * stride]) + unit
            chain = (old[0] + old[1]) / (old[0] * old[1] - old[2] * old[2]) + one / old[3]
            trial = push(old, f11, h12, h21, f22, f33) * iso
            stress = law_stress(trial[0], trial[1], trial[2], trial[3], row)
            amount = flow(trial, stress, wp.sqrt(chain * third), stiff, moved, branches)
            size = norm(stress)
            D = stress * (amount / wp.max(size, nothing))
            # exp(-D) to second order
            e11 = one - D[0] + half * (D[0] * D[0] + D[2] * D[2])
            e22 = one - D[1] + half * (D[1] * D[1] + D[2] * D[2])
            e12 = half * D[2] * (D[0] + D[1]) - D[2]
            elastic = push(trial, e11, e12, e12, e22, one - D[3] + half * D[3] * D[3])
            volume = wp.sqrt((elastic[0] * elastic[1] - elastic[2] * elastic[2]) * elastic[3])
            back, _inverse = isochoric_factor(volume, volume - one)
            elastic = elastic * back
            new = pull(elastic, f11, h12, h21, f22, f33) * (one / iso) - unit
            memory[k] = new[0]
            memory[k + stride] = new[1]
            memory[k + 2 * stride] = new[2]
            memory[k + 3 * stride] = new[3]
            after = law_stress(elastic[0], elastic[1], elastic[2], elastic[3], row)
            t = (after - law_stress(rr, yy, ry, tt, row)) * (weight * stiff)
            area = f33 * inverse
            b_r = (f22 * area) * gradient_r - (h21 * area) * gradient_y
            b_y = (f11 * area) * gradient_y - (h12 * area) * gradient_r
            c = hoop * ((one + plane) * inverse)
            # What the flow takes from the energy of the trial, less what the trial stored beyond the work of
            # the mean of the stresses before and after the step.
            d11, d22, d33 = wp.dot(vr, b_r), wp.dot(vy, b_y), wp.dot(vr, c)
            d12 = half * (wp.dot(vr, b_y) + wp.dot(vy, b_r))
            gone, both = stress - after, stress + after
            taken = both[0] * D[0] + both[1] * D[1] + two * both[2] * D[2] + both[3] * D[3]
            unpaid = gone[0] * d11 + gone[1] * d22 + two * gone[2] * d12 + gone[3] * d33
            done = half * weight * stiff * (taken - moved * unpaid)
            f_r = t[0] * b_r + t[2] * b_y + t[3] * c
            f_y = t[1] * b_y + t[2] * b_r
            if measure == 1:
                # As of a Prony series, and what network B is stiffer than the law's own bound has it.
                more = law_tangent(elastic[0], elastic[1], elastic[2], elastic[3], row)
                more = wp.max(more - law_tangent(rr, yy, ry, tt, row), zero) * (weight * stiff)
                radial, axial = gradient_bounds(inverse_mass_r, inverse_mass_y, b_r, b_y, c)
                omega_squared = four * (norm(t) + more) * wp.max(radial, axial)
        return f_r, f_y, done, omega_squared

    @wp.func
    def held(
        weight: real,
        gradient_r: vec4,
        gradient_y: vec4,
        hoop: vec4,
        scale: real,
        row: wp.array(dtype=real),
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        first: int,
        stride: int,
        e: int,
        ur: vec4,
        uy: vec4,
    ):
        """The energy of network B."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        k = first * stride + e
        old = vec4(memory[k], memory[k + stride], memory[k + 2 * stride], memory[k + 3 * stride])
        old = old + vec4(one, one, zero, one)
        b = push(old, one + h11, h12, h21, one + h22, one + h33) * iso
        return weight * scale * branches[0] * law_energy(b[0], b[1], b[2], b[3], row)

    return PointFunctions(relax, held, 4)
