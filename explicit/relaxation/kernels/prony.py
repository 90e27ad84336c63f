"""A stress point of a Prony series: Simo's convolution, Eq. (V.1), by recursion.

With g_i the share of the instantaneous stiffness and S the law's isochoric second Piola-Kirchhoff stress
at that stiffness, the branch stress is H_i = g_i S - q_i with dq_i/dt + q_i / tau_i = g_i S / tau_i. The q_i
live half a step before and after the positions, where the velocities are:

    q_i(n+1/2) = a q_i(n-1/2) + (1 - a) g_i S(n),
    a = (2 - x) / (2 + x),   x = (t(n+1/2) - t(n-1/2)) / tau_i,

a rule that is stable for any x and of second order; q_i(n) is their mean. No stress of the step before has
to be remembered. What is subtracted from the law's Kirchhoff stress is dev(F_bar q F_bar^T), and from the
work done on the branches that of q(n-1/2) over the step between the positions n - 1 and n.
"""

from dataclasses import dataclass
from functools import cache

import warp as wp

from explicit.elements.bounds import gradient_bounds_function
from explicit.elements.shared import isochoric_factor_function
from explicit.precision import Precision
from explicit.relaxation.base import PointFunctions
from explicit.relaxation.kernels.tensors import tensor_functions


@dataclass(frozen=True)
class PronyKind:
    """Prony series of as many branches."""

    n_branches: int

    @property
    def index_of_rest(self) -> int:
        """A row is g_1 .. g_n, tau_1 .. tau_n, 1 - sum g_i."""
        return 2 * self.n_branches

    def point(self, law: type, precision: Precision, bound: str) -> PointFunctions:
        """See `explicit.relaxation.base.Relaxation`."""
        return _point(law, precision, bound, self.n_branches)


@cache
def _point(law: type, precision: Precision, bound: str, n_branches: int) -> PointFunctions:
    law_stress, _tangent, law_energy = law.kernel_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, four = real(0.0), real(0.5), real(1.0), real(2.0), real(4.0)
    third = real(1.0 / 3.0)
    isochoric_factor = isochoric_factor_function(precision)
    gradient_bounds = gradient_bounds_function(precision, bound)
    tensors = tensor_functions(precision)
    push, pull, norm = tensors.push, tensors.pull, tensors.norm
    branches_of, rest = int(n_branches), int(2 * n_branches)

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
            S = pull(law_stress(rr, yy, ry, tt, row), f11, h12, h21, f22, f33) * (one / iso)
            before, after = vec4(), vec4()
            for i in range(branches_of):
                k = (first + 4 * i) * stride + e
                old = vec4(memory[k], memory[k + stride], memory[k + 2 * stride], memory[k + 3 * stride])
                x = interval / branches[branches_of + i]
                rise = two * x / (two + x)  # 1 - a
                new = old + rise * (branches[i] * S - old)
                memory[k] = new[0]
                memory[k + stride] = new[1]
                memory[k + 2 * stride] = new[2]
                memory[k + 3 * stride] = new[3]
                before += old
                after += new
            area = f33 * inverse
            b_r = (f22 * area) * gradient_r - (h21 * area) * gradient_y
            b_y = (f11 * area) * gradient_y - (h12 * area) * gradient_r
            c = hoop * ((one + plane) * inverse)
            # The work of q before over the step that led here, q : (C_bar(n) - C_bar(n-1)) / 2, in space: D
            # of its middle is D - (step / 2) L^T L, and z a third of the step's change of log J.
            l11, l12 = wp.dot(vr, b_r), wp.dot(vr, b_y)
            l21, l22 = wp.dot(vy, b_r), wp.dot(vy, b_y)
            l33 = wp.dot(vr, c)
            back = half * moved
            d11 = l11 - back * (l11 * l11 + l21 * l21)
            d22 = l22 - back * (l12 * l12 + l22 * l22)
            d33 = l33 - back * l33 * l33
            d12 = half * (l12 + l21) - back * (l11 * l12 + l21 * l22)
            growth = l11 + l22 + l33 + back * (l11 * l11 + l22 * l22 + l33 * l33 + two * l12 * l21)
            z = moved * third * growth
            t = push(before, f11, h12, h21, f22, f33) * (weight * scale * iso)
            work = t[0] * d11 + t[1] * d22 + two * t[2] * d12 + t[3] * d33
            done = (z + z * z) * (t[0] + t[1] + t[3]) - (one + two * z) * moved * work
            # What is subtracted at the positions.
            t = push(half * (before + after), f11, h12, h21, f22, f33) * (weight * scale * iso)
            mean = (t[0] + t[1] + t[3]) * third
            t11, t22, t33 = mean - t[0], mean - t[1], mean - t[3]
            f_r = t11 * b_r - t[2] * b_y + t33 * c
            f_y = t22 * b_y - t[2] * b_r
            if measure == 1:
                # The second variation of q : C_bar / 2 is at most 2 |t| |grad v|^2; the factor 2 beside it is
                # the most by which damping raises omega^2.
                radial, axial = gradient_bounds(inverse_mass_r, inverse_mass_y, b_r, b_y, c)
                omega_squared = four * norm(t) * wp.max(radial, axial)
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
        """The law's energy at the stiffness of the branches: what is done on them if nothing relaxes."""
        h11, h12 = wp.dot(ur, gradient_r), wp.dot(ur, gradient_y)
        h21, h22 = wp.dot(uy, gradient_r), wp.dot(uy, gradient_y)
        h33 = wp.dot(ur, hoop)
        plane = h11 + h22 + h11 * h22 - h12 * h21
        dilatation = plane * (one + h33) + h33
        f11, f22, f33 = one + h11, one + h22, one + h33
        iso, _inverse = isochoric_factor(one + dilatation, dilatation)
        rr = iso * (f11 * f11 + h12 * h12)
        yy = iso * (f22 * f22 + h21 * h21)
        ry, tt = iso * (f11 * h21 + h12 * f22), iso * f33 * f33
        return weight * scale * (one - branches[rest]) * law_energy(rr, yy, ry, tt, row)

    return PointFunctions(relax, held, 4 * n_branches)
