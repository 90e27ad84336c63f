"""Bergstrom and Boyce's network: a second chain network that creeps, in parallel with the elastic one.

Network A is the material law. Network B is the same law times a ratio s, applied to the elastic part of F_bar
= F_e F_v. Its Kirchhoff stress is tau_B = s tau_W(b_e) with b_e = F_e F_e^T. Its flow is (Bergstrom and Boyce
1998, Eqs. 26-32, with the rate 1 / s separated from their product of constants)

    D_v = gamma N,   N = tau_B / |tau_B|,
    gamma = (1 / s) (lam_v - 1 + xi)^C (|tau_B| / tau_hat)^m,   lam_v = sqrt(tr b_v / 3),              (V.3)

with |.| the Frobenius norm. C is in [-1, 0]: the creep rate decreases with the creep of the chains. xi keeps
the first creep finite. The power of network B that is not stored is dissipated, |tau_B| gamma >= 0.

A stress point stores C_v^-1 - 1. Over a step network B first follows F_bar elastically, to b_tr, and then
flows by D = gamma dt along its own stress: b_e = exp(-D N) b_tr exp(-D N), the exponential to second order.
With the network's tangent mu_B the flow decreases |tau| by 2 mu_B gamma dt. Hence y = |tau| / |tau_tr| solves

    y + k y^m = 1,    k = 2 mu_B dt gamma(|tau_tr|) / |tau_tr|,

Newton's iteration solves it. It starts from (1 + k)^(-1/m), which is above the root.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from explicit.arrays import FloatArray
from explicit.elements.base import gradient_bounds_function, isochoric_factor_function
from explicit.precision import Precision
from explicit.relaxation.base import PointFunctions, tensor_functions
from explicit.relaxation.prony import checked_history, uniaxial_stress

NEWTON = 3
"""Number of Newton's iterations. A step of an explicit run has k << 1, for which one would be sufficient."""
LARGEST_LOG = 60.0
"""Upper limit of ln k, which fp32 can represent. All stress relaxes within one step already at a much smaller
k."""


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
    tiny = real(1e-30)
    isochoric_factor = isochoric_factor_function(precision)
    gradient_bounds = gradient_bounds_function(precision, bound)
    tensors = tensor_functions(precision)
    push, pull, norm = tensors.push, tensors.pull, tensors.norm

    @wp.func
    def flow(trial: vec4, stress: vec4, chain: real, stiff: real, dt: real, branches: wp.array(dtype=real)):
        """Flow in a step, gamma dt."""
        amount = real(0.0)
        size = norm(stress)
        if size > tiny and dt > zero:
            # The tangent of a law W(I1) without stiffening is the same in all directions.
            mean = (trial[0] + trial[1] + trial[3]) * third
            spread = vec4(trial[0] - mean, trial[1] - mean, trial[2], trial[3] - mean)
            m, twice = branches[2], two * mean * size / wp.max(norm(spread), tiny)
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
        work, omega_squared = real(0.0), real(0.0)
        if wp.min(jacobian, one + plane) > zero:  # an inverted element has ended the run
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
            amount = flow(trial, stress, wp.sqrt(chain * third), stiff, previous_step, branches)
            size = norm(stress)
            D = stress * (amount / wp.max(size, tiny))
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
            # The energy that the flow takes from the trial, minus the excess energy of the trial. The excess
            # is relative to the work of the mean of the stresses before and after the step.
            d11, d22, d33 = wp.dot(vr, b_r), wp.dot(vy, b_y), wp.dot(vr, c)
            d12 = half * (wp.dot(vr, b_y) + wp.dot(vy, b_r))
            drop, total = stress - after, stress + after
            loss = total[0] * D[0] + total[1] * D[1] + two * total[2] * D[2] + total[3] * D[3]
            unpaid = drop[0] * d11 + drop[1] * d22 + two * drop[2] * d12 + drop[3] * d33
            work = half * weight * stiff * (loss - previous_step * unpaid)
            f_r = t[0] * b_r + t[2] * b_y + t[3] * c
            f_y = t[1] * b_y + t[2] * b_r
            if measure == 1:
                # As in a Prony series, plus the excess of network B's stiffness over the law's bound.
                more = law_tangent(elastic[0], elastic[1], elastic[2], elastic[3], row)
                more = wp.max(more - law_tangent(rr, yy, ry, tt, row), zero) * (weight * stiff)
                radial, axial = gradient_bounds(inverse_mass_r, inverse_mass_y, b_r, b_y, c)
                omega_squared = four * (norm(t) + more) * wp.max(radial, axial)
        return f_r, f_y, work, omega_squared

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

    return PointFunctions(relax, branch_energy, 4)


_KNOTS = 401
"""Knots of the table of network B's stress: its error is below 1e-9 of the stress."""
_TOLERANCE = 1e-8
"""Relative error of the viscous stretch along a history."""


@dataclass(frozen=True)
class BergstromBoyce:
    """The creeping network."""

    ratio: float
    """Stiffness of network B over that of network A, s [-]."""
    resistance: float
    """Stress at which it flows at (lam_v - 1 + xi)^C per second, tau_hat [Pa]."""
    exponent: float = 4.0
    """Exponent of the stress m [-]."""
    chain_exponent: float = -1.0
    """Exponent of the creep of the chains, C [-]."""
    first_creep: float = 0.01
    """Stretch that keeps the first creep finite, xi [-]."""

    def __post_init__(self) -> None:
        for name, good, allowed in (
            ("ratio", 0.0 <= self.ratio < np.inf, ">= 0 and finite"),
            ("resistance", 0.0 < self.resistance < np.inf, "> 0 Pa and finite"),
            ("exponent", 1.0 <= self.exponent <= 50.0, "in [1, 50]"),
            ("chain_exponent", -1.0 <= self.chain_exponent <= 0.0, "in [-1, 0]"),
            ("first_creep", 0.0 < self.first_creep <= 1.0, "in (0, 1]"),
        ):
            if not good:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")

    @property
    def instantaneous(self) -> float:
        """Stiffness of both networks over that of network A, 1 + s [-]."""
        return 1.0 + self.ratio

    def __len__(self) -> int:
        """Number of networks: 1."""
        return 1

    def row(self, n_branches: int) -> FloatArray:
        """Kernel row: s / (1 + s), tau_hat, m, C, xi, 1 / (1 + s)."""
        share = self.ratio / self.instantaneous
        flow = (self.resistance, self.exponent, self.chain_exponent, self.first_creep)
        return np.array([share, *flow, 1.0 - share])

    @staticmethod
    def kind(n_branches: int) -> CreepKind:
        """See `explicit.relaxation.base.RateDependence`."""
        return CreepKind()

    def flow_rate(self, stress: ArrayLike, chain_stretch: ArrayLike) -> FloatArray:
        """gamma of Eq. (V.3) [1/s].

        ``stress``: frobenius norm of the deviatoric stress of network B [Pa]. ``chain_stretch``: lam_v [-].
        """
        crept = np.maximum(np.asarray(chain_stretch, dtype=float) - 1.0, 0.0) + self.first_creep
        return np.asarray(
            crept**self.chain_exponent * (np.asarray(stress, dtype=float) / self.resistance) ** self.exponent
        )


def bergstrom_boyce_stress(
    law: Any, network: BergstromBoyce, time: ArrayLike, stretch: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Nominal stress and viscous stretch along a uniaxial history of an incompressible specimen.

    Between the samples log(lam) is linear in time. The specimen was at rest before the first sample. The
    elastic stretch e = log(lam / lam_v) of network B is integrated implicitly, because the flow is stiff.

    Parameters
    ----------
    law
        Network A: an `explicit.materials.MaterialLaw`.
    network : BergstromBoyce
        Network B.
    time, stretch : array, shape [n]
        Times, not descending [s], and stretches [-]. A step of strain is two samples at one time.

    Returns
    -------
    tuple of array, shape [n]
        Nominal stress, tension-positive [Pa], and the viscous stretch lam_v along the load [-].

    Raises
    ------
    ValueError
        If the history is malformed, see `explicit.relaxation.prony_stress`, or the flow cannot be integrated.
    """
    t, lam = checked_history(time, stretch)
    total = np.log(lam)
    span = 1.01 * float(np.ptp(np.append(total, 0.0))) + 1e-6
    cauchy = _table(law, span)
    elastic, viscous = np.empty_like(t), 0.0  # log stretches
    elastic[0] = total[0]
    for first, last in _pieces(t):
        if first > 0:  # a step of strain is elastic
            elastic[first] = total[first] - viscous
        if last > first:
            piece = slice(first, last + 1)
            path = _creep(network, cauchy, t[piece], total[piece], total[first] - elastic[first])
            elastic[piece] = total[piece] - path
            viscous = float(path[-1])
    stress = uniaxial_stress(law, lam) + network.ratio * np.asarray(cauchy(elastic)) / lam
    return stress, np.exp(total - elastic)


def _table(law: Any, span: float) -> Callable[[Any], Any]:
    """Cauchy stress of the law over log stretch [Pa]."""
    knots = np.linspace(-span, span, _KNOTS)
    stretch = np.exp(knots)
    spline: Callable[[Any], Any] = CubicSpline(knots, uniaxial_stress(law, stretch) * stretch)
    return spline


def _pieces(time: FloatArray) -> list[tuple[int, int]]:
    """First and last sample of each time interval between steps of strain."""
    cuts = np.flatnonzero(np.diff(time) == 0.0)
    first = [0, *(cuts + 1).tolist()]
    last = [*cuts.tolist(), len(time) - 1]
    return list(zip(first, last, strict=True))


def _creep(
    network: BergstromBoyce, cauchy: Callable[[Any], Any], time: FloatArray, total: FloatArray, viscous: float
) -> FloatArray:
    """log lam_v at the samples of a piece, shape [n]."""
    ratio, root = network.ratio, np.sqrt(2.0 / 3.0)
    if ratio == 0.0:
        return np.full_like(time, viscous)

    lowest, highest = min(float(total.min()), viscous), max(float(total.max()), viscous)

    def rate(t: float, state: FloatArray) -> list[float]:
        v = min(max(float(state[0]), lowest), highest)  # only a trial value can be outside
        stress = ratio * float(cauchy(np.interp(t, time, total) - v))
        stretch = np.exp(v)
        chain = np.sqrt((stretch**2 + 2.0 / stretch) / 3.0)
        # in uniaxial stress |dev| = sqrt(2/3) |sigma|; the share of D_v along the load is the same
        return [root * float(network.flow_rate(root * abs(stress), chain)) * np.sign(stress)]

    solution = solve_ivp(
        rate,
        (time[0], time[-1]),
        [viscous],
        method="LSODA",
        t_eval=time,
        rtol=_TOLERANCE,
        atol=1e-10,
        max_step=float(np.diff(time).max()),
    )
    if not solution.success:
        raise ValueError(f"the flow of network B cannot be integrated along this history: {solution.message}")
    return np.asarray(solution.y[0])
