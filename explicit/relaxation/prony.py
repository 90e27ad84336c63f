"""Finite-strain Prony series: quasi-linear viscoelasticity of the isochoric response.

With the isochoric second Piola-Kirchhoff stress S = DEV(2 dW/dC_bar) of the long-term law W, the Kirchhoff
stress is (Simo 1987; Simo and Hughes 1998, Section 10.3)

    tau = J U'(J) 1 + tau_W + sum_i dev(F_bar H_i F_bar^T),    dH_i/dt + H_i / tau_i = c_i dS/dt,      (V.1)

Hence H_i(t) = c_i int_0^t exp(-(t - s) / tau_i) dS(s). The volumetric response does not relax. Strengths c_i
are relative to the *long-term* law. A slow test measures this law:

    G(t) = G_inf [1 + sum_i c_i exp(-t / tau_i)].                                                      (V.2)

The Warp functions of a stress point use the law at its instantaneous stiffness and subtract dev(F_bar q
F_bar^T). g_i is the share of this stiffness, and H_i = g_i S - q_i, dq_i/dt + q_i / tau_i = g_i S / tau_i.
The q_i are defined half a step before and after the positions, at the times of the velocities:

    q_i(n+1/2) = a q_i(n-1/2) + (1 - a) g_i S(n),
    a = (2 - x) / (2 + x),   x = (t(n+1/2) - t(n-1/2)) / tau_i,

This rule is stable for any x and has second order. q_i(n) is the mean of both values.

`uniaxial_stress` is the NumPy twin for an incompressible specimen with stress-free sides, F = diag(lam,
lam^-1/2, lam^-1/2).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.elements.base import gradient_bounds_function, isochoric_factor_function
from explicit.precision import Precision
from explicit.relaxation.base import PointFunctions, tensor_functions


@dataclass(frozen=True)
class PronyKind:
    """Prony series with a given number of branches."""

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
    branches_of, long_term = int(n_branches), int(2 * n_branches)

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
        previous_step: real,
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
        balance, omega_squared = real(0.0), real(0.0)
        if wp.min(jacobian, one + plane) > zero:  # an inverted element has ended the run
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
            # The work of the previous q over the last step, q : (C_bar(n) - C_bar(n-1)) / 2, in the current
            # configuration. D at the middle of the step is D - (step / 2) L^T L; z is a third of the step's
            # change of log J.
            l11, l12 = wp.dot(vr, b_r), wp.dot(vr, b_y)
            l21, l22 = wp.dot(vy, b_r), wp.dot(vy, b_y)
            l33 = wp.dot(vr, c)
            back = half * previous_step
            d11 = l11 - back * (l11 * l11 + l21 * l21)
            d22 = l22 - back * (l12 * l12 + l22 * l22)
            d33 = l33 - back * l33 * l33
            d12 = half * (l12 + l21) - back * (l11 * l12 + l21 * l22)
            growth = l11 + l22 + l33 + back * (l11 * l11 + l22 * l22 + l33 * l33 + two * l12 * l21)
            z = previous_step * third * growth
            t = push(before, f11, h12, h21, f22, f33) * (weight * scale * iso)
            work = t[0] * d11 + t[1] * d22 + two * t[2] * d12 + t[3] * d33
            balance = (z + z * z) * (t[0] + t[1] + t[3]) - (one + two * z) * previous_step * work
            # The stress that is subtracted at the positions.
            t = push(half * (before + after), f11, h12, h21, f22, f33) * (weight * scale * iso)
            mean = (t[0] + t[1] + t[3]) * third
            t11, t22, t33 = mean - t[0], mean - t[1], mean - t[3]
            f_r = t11 * b_r - t[2] * b_y + t33 * c
            f_y = t22 * b_y - t[2] * b_r
            if measure == 1:
                # The second variation of q : C_bar / 2 is at most 2 |t| |grad v|^2. The other factor 2 is the
                # largest increase of omega^2 by damping.
                radial, axial = gradient_bounds(inverse_mass_r, inverse_mass_y, b_r, b_y, c)
                omega_squared = four * norm(t) * wp.max(radial, axial)
        return f_r, f_y, balance, omega_squared

    @wp.func
    def branch_energy(
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
        """The law's energy at the stiffness of the branches: the work done on them without relaxation."""
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
        return weight * scale * (one - branches[long_term]) * law_energy(rr, yy, ry, tt, row)

    return PointFunctions(relax, branch_energy, 4 * n_branches)


@dataclass(frozen=True)
class PronySeries:
    """Viscoelastic branches added to the long-term law."""

    strengths: tuple[float, ...]
    """Modulus of each branch over that of the long-term law, c_i [-]."""
    times: tuple[float, ...]
    """Relaxation time of each branch, tau_i [s]."""

    def __post_init__(self) -> None:
        if len(self.strengths) != len(self.times):
            raise ValueError(
                f"a Prony series needs one time for each strength, got {len(self.strengths)} strengths and "
                f"{len(self.times)} times"
            )
        for k, (strength, time) in enumerate(zip(self.strengths, self.times, strict=True)):
            if not 0.0 <= strength < np.inf:
                raise ValueError(f"strength {k} must be >= 0 and finite, got {strength}")
            if not 0.0 < time < np.inf:
                raise ValueError(f"relaxation time {k} must be > 0 s and finite, got {time}")

    def __len__(self) -> int:
        return len(self.times)

    @property
    def instantaneous(self) -> float:
        """G_0 / G_inf = 1 + sum c_i [-]."""
        return 1.0 + float(sum(self.strengths))

    @property
    def instantaneous_shares(self) -> FloatArray:
        """g_i = c_i G_inf / G_0, the input of several finite element programs [-], shape [n_branches]."""
        return np.asarray(self.strengths) / self.instantaneous

    def row(self, n_branches: int) -> FloatArray:
        """Kernel row: g_i, tau_i, 1 - sum g_i. Missing branches have g = 0."""
        g, times = np.zeros(n_branches), np.ones(n_branches)
        g[: len(self)], times[: len(self)] = self.instantaneous_shares, self.times
        return np.concatenate([g, times, [1.0 / self.instantaneous]])

    @staticmethod
    def kind(n_branches: int) -> PronyKind:
        """See `explicit.relaxation.base.RateDependence`."""
        return PronyKind(n_branches)

    def relaxation(self, time: ArrayLike) -> FloatArray:
        """G(t) / G_inf after a step of strain, Eq. (V.2) [-], shape of `time` [s]."""
        t = np.asarray(time, dtype=float)[..., None]
        decay = np.exp(-t / np.asarray(self.times))
        return np.asarray(1.0 + (np.asarray(self.strengths) * decay).sum(axis=-1))

    def storage(self, angular_frequency: ArrayLike) -> FloatArray:
        """G'(omega) / G_inf = 1 + sum c_i x^2 / (1 + x^2), x = omega tau_i [-], shape of omega [rad/s]."""
        x = np.asarray(angular_frequency, dtype=float)[..., None] * np.asarray(self.times)
        return np.asarray(1.0 + (np.asarray(self.strengths) * x**2 / (1.0 + x**2)).sum(axis=-1))

    def loss(self, angular_frequency: ArrayLike) -> FloatArray:
        """G''(omega) / G_inf = sum c_i x / (1 + x^2), x = omega tau_i [-], shape of omega [rad/s]."""
        x = np.asarray(angular_frequency, dtype=float)[..., None] * np.asarray(self.times)
        return np.asarray((np.asarray(self.strengths) * x / (1.0 + x**2)).sum(axis=-1))


def uniaxial_stress(law: Any, stretch: ArrayLike) -> FloatArray:
    """Nominal stress of the law without relaxation [Pa], tension-positive, shape of `stretch`."""
    lam = np.asarray(stretch, dtype=float)
    along, across = _deviators(law, lam)
    return np.asarray((along - across) / lam)


def prony_stress(law: Any, series: PronySeries, time: ArrayLike, stretch: ArrayLike) -> FloatArray:
    """Nominal stress along a history of stretch, Eq. (V.1).

    Between the samples the isochoric stress S of the law is assumed linear in time. The recursion of the
    branches is exact for this. The specimen was at rest, lam = 1, before the first sample. A step of strain
    is two samples at one time.

    Parameters
    ----------
    law
        The long-term law: an `explicit.materials.MaterialLaw`.
    series : PronySeries
        The branches.
    time : array, shape [n]
        Times, not descending [s].
    stretch : array, shape [n]
        Stretch at these times [-].

    Returns
    -------
    array, shape [n]
        Nominal stress, tension-positive [Pa].

    Raises
    ------
    ValueError
        If the shapes differ, a time descends, or a stretch is not > 0.
    """
    t, lam = checked_history(time, stretch)
    along, across = _deviators(law, lam)
    # Second Piola-Kirchhoff: F^-1 tau F^-T; one component along the load, two equal ones across it.
    S = np.stack([along / lam**2, across * lam])
    total = S.copy()
    for strength, relaxation_time in zip(series.strengths, series.times, strict=True):
        total += strength * _branch(t, S, relaxation_time)
    return np.asarray((lam**2 * total[0] - total[1] / lam) / lam)


def checked_history(time: ArrayLike, stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """A history as two float64 arrays. Raises ValueError as `prony_stress`."""
    t, lam = np.asarray(time, dtype=float), np.asarray(stretch, dtype=float)
    if t.ndim != 1 or t.shape != lam.shape or t.size == 0:
        raise ValueError(f"a history needs as many stretches as times, got shapes {lam.shape} and {t.shape}")
    if not np.isfinite(t).all() or (np.diff(t) < 0.0).any():
        k = int(np.argmax(~np.isfinite(t) | (np.diff(t, prepend=t[0]) < 0.0)))
        raise ValueError(f"times must be finite and not descend, got {t[k]} s at sample {k}")
    if not (np.isfinite(lam) & (lam > 0.0)).all():
        k = int(np.argmin(np.isfinite(lam) & (lam > 0.0)))
        raise ValueError(f"stretch must be > 0 and finite, got {lam[k]} at sample {k}")
    return t, lam


def _branch(time: FloatArray, S: FloatArray, relaxation_time: float) -> FloatArray:
    """int exp(-(t - s) / tau) dS(s) for piecewise linear S, shape of S."""
    step = np.diff(time)
    x = step / relaxation_time
    decay = np.exp(-x)
    # (1 - exp(-x)) / x without cancellation; 1 for a step of strain
    gain = np.where(x > 0.0, -np.expm1(-x) / np.where(x > 0.0, x, 1.0), 1.0)
    rise = np.diff(S, axis=1)
    out = np.empty_like(S)
    out[:, 0] = S[:, 0]  # a step from rest to the first sample
    for k in range(len(step)):
        out[:, k + 1] = decay[k] * out[:, k] + gain[k] * rise[:, k]
    return out


def _deviators(law: Any, lam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Isochoric Kirchhoff stress along and across the load [Pa]."""
    zero = np.zeros_like(lam)
    tau = np.asarray(law.stress(np.stack([1.0 / lam, lam**2, zero, 1.0 / lam], axis=-1)))
    return tau[..., 1], tau[..., 0]
