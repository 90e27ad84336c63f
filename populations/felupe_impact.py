"""An impact test on a bonded, damped cylinder by FElupe, as the truth of a synthetic shot.

FElupe is a separate program (https://felupe.readthedocs.io). Mesh, elements, kinematics and assembly are its.
The model has finite strain and is axisymmetric, with quadratic displacement and a linear pressure,
discontinuous between elements (Q2 / P1). The pressure is eliminated in each element. The time integration is
the generalised alpha method of Chung and Hulbert (1993). Both faces move with their platens. A node of the
side that would pass through a platen in a step is fixed on it from the end of this step on. The file shares
the specification of the shot and the flyer's path with the package, and no part of its solver.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import felupe as fem
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import SuperLU, splu

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.virtual.motion import Path1D
from kolsky.virtual.schema import Specification
from kolsky.virtual.truth import KNOT, Job, SurfaceHistory, Truth, TruthError

ELEMENTS = (36, 24)
"""Elements across the radius and along half the length."""
TIME_STEP = 0.25e-6
"""[s]."""
GRADING = 16.0
"""Largest over smallest element; the small ones lie at side and faces."""
RADIUS_AT_INFINITY = 0.9
"""Spectral radius of the generalised alpha method at infinite frequency [-]."""
SMALL = 1e-11
"""Largest increment of a displacement in the last iteration of a step [m]."""
LARGE = 1e-3
"""An increment of a displacement that shows divergence [m]."""
ITERATIONS = 25
"""Largest number of iterations of a step."""
STALE = 6
"""Number of iterations after which the factors of the tangent are computed again."""
HALVINGS = 5
"""Largest number of times that a step without convergence is halved."""
AXIAL, RADIAL = 0, 1
"""Components of position and displacement. FElupe's axis of revolution is its first."""
PLANE = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Components of a tensor in the plane."""
COMPONENTS = np.array([*PLANE, (2, 2)]).T
"""Components that are not always zero, shape [2, 5]."""


def slopes(law: str, given: dict[str, float]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """U' and U'' of an energy U(I1) of the isochoric deformation, scaled to the shear modulus 2 U'(3) = 1."""
    if law == "gent":
        lock = 3.0 + given["Jm"]
        return lambda I: 0.5 * given["Jm"] / (lock - I), lambda I: 0.5 * given["Jm"] / (lock - I) ** 2
    if law == "arruda_boyce":
        square = given["lambda_m"] ** 2
        series = [1 / 2, 2 / 20 / square, 33 / 1050 / square**2, 76 / 7000 / square**3]
        first = np.polynomial.Polynomial([*series, 2595 / 673750 / square**4])
    elif law == "yeoh":
        x = np.polynomial.Polynomial([-3.0, 1.0])
        first = given["C10"] + 2.0 * given["C20"] * x + 3.0 * given["C30"] * x**2
    elif law == "neo_hookean":
        first = np.polynomial.Polynomial([1.0])
    else:
        raise ValueError(f"FElupe makes no truth of {law}")
    first = first * (0.5 / first(3.0))
    return first, first.deriv()


@dataclass(frozen=True)
class Solid:
    """Stress of m U(I1) + K/2 (J - 1)^2 and of the viscous stress 2 eta dev D; eta = beta m mu_0."""

    first: Callable[..., Any]
    second: Callable[..., Any]
    """m U' and m U'' [Pa]."""
    bulk: float
    """K [Pa]."""
    viscosity: float
    """eta [Pa s]."""

    @classmethod
    def of(cls, quantities: Specification) -> "Solid":
        """The solid of a shot."""
        given = quantities.material
        first, second = slopes(given.law, given.parameters)
        mu, nu = given.stiffness_factor * given.shear_modulus, given.poisson
        return cls(
            lambda I: mu * first(I),
            lambda I: mu * second(I),
            2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)),
            given.damping * mu,
        )

    def stress(self, F: FloatArray, rate: FloatArray, pressure: FloatArray) -> FloatArray:
        """First Piola-Kirchhoff stress [Pa] of F, its rate and the mean stress.

        It is written in components, because this is the most frequent operation.
        """
        (a, b), (c, d), h = F[0, :2], F[1, :2], F[2, 2]
        plane = a * d - b * c
        J, across = plane * h, a**2 + b**2 + c**2 + d**2 + h**2
        Ta, Tb, Tc, Td, Th = d / plane, -c / plane, -b / plane, a / plane, 1.0 / h
        cut = J ** (-2.0 / 3.0)
        elastic = 2.0 * cut * self.first(cut * across)
        across = across / 3.0
        (ra, rb), (rc, rd), rh = rate[0, :2], rate[1, :2], rate[2, 2]
        along, out, hoop = ra * Ta + rb * Tb, rc * Tc + rd * Td, rh * Th
        twice = 2.0 * self.viscosity * J
        mean = J * pressure - twice * (along + out + hoop) / 3.0
        along, out, hoop = twice * along + mean, twice * out + mean, twice * hoop + mean
        shear = 0.5 * twice * (ra * Tc + rb * Td + rc * Ta + rd * Tb)
        P = np.zeros_like(F)
        P[0, 0] = elastic * (a - across * Ta) + along * Ta + shear * Tc
        P[0, 1] = elastic * (b - across * Tb) + along * Tb + shear * Td
        P[1, 0] = elastic * (c - across * Tc) + shear * Ta + out * Tc
        P[1, 1] = elastic * (d - across * Td) + shear * Tb + out * Td
        P[2, 2] = elastic * (h - across * Th) + hoop * Th
        return P

    def tangent(self, F: FloatArray, rate: FloatArray, pressure: FloatArray, speed: float) -> FloatArray:
        """Its derivative by F at a fixed pressure, if the rate of F is `speed` F plus a constant [Pa]."""
        state = _State.of(F, rate)
        T, J, L = state.T, state.J, state.L
        sigma = _plus(2.0 * self.viscosity * _deviator(L), pressure)
        found = np.zeros((3, 3, *F.shape))
        for k, l in COMPONENTS.T:
            dF = np.zeros_like(F)
            dF[k, l] = 1.0
            grown = T[k, l]
            dT = -T[:, None, l] * T[None, k, :]
            dslope = 2.0 * state.cut * (dF - (2.0 * F[k, l] * T + state.whole * dT) / 3.0)
            dslope -= 2.0 / 3.0 * grown * state.slope
            dL = np.zeros_like(F)
            dL[k] = speed * T[None, :, l][0]
            dL -= L[:, None, k] * T[None, :, l]
            dsigma = 2.0 * self.viscosity * _deviator(dL)
            found[:, :, k, l] = (
                self.second(state.I1) * state.slope[k, l] * state.slope
                + self.first(state.I1) * dslope
                + J * (_dot(grown * sigma + dsigma, T) + _dot(sigma, dT))
            )
        return found


class _State(NamedTuple):
    """Quantities of a deformation and its rate."""

    J: FloatArray
    T: FloatArray
    """Transpose of the inverse of F."""
    cut: FloatArray
    """J^(-2/3)."""
    whole: FloatArray
    """F : F."""
    I1: FloatArray
    """First invariant of the isochoric deformation."""
    slope: FloatArray
    """Its derivative by F."""
    L: FloatArray
    """Velocity gradient [1/s]."""

    @classmethod
    def of(cls, F: FloatArray, rate: FloatArray) -> "_State":
        plane = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        T = np.zeros_like(F)
        T[0, 0], T[1, 1], T[0, 1], T[1, 0] = (
            F[1, 1] / plane,
            F[0, 0] / plane,
            -F[1, 0] / plane,
            -F[0, 1] / plane,
        )
        T[2, 2] = 1.0 / F[2, 2]
        J = plane * F[2, 2]
        cut, whole = J ** (-2.0 / 3.0), np.einsum("ij...,ij...->...", F, F)
        slope = 2.0 * cut * (F - whole / 3.0 * T)
        return cls(J, T, cut, whole, cut * whole, slope, np.einsum("ik...,jk...->ij...", rate, T))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ik...,kj...->ij...", a, b))


def _plus(a: FloatArray, mean: FloatArray) -> FloatArray:
    """A tensor plus a multiple of the identity."""
    found = a.copy()
    for i in range(3):
        found[i, i] += mean
    return found


def _deviator(a: FloatArray) -> FloatArray:
    """Deviator of the symmetric part."""
    return _plus(0.5 * (a + a.swapaxes(0, 1)), -np.einsum("ii...->...", a) / 3.0)


def graded(length: float, n: int, grading: float = GRADING) -> FloatArray:
    """Corners of n elements whose sizes shrink geometrically towards the end [m]."""
    size = grading ** (-np.arange(n) / max(n - 1, 1))
    return np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()


def bilinear_mesh(z: FloatArray, r: FloatArray) -> fem.Mesh:
    """Mesh with these corners along the axis and across it [m]."""
    along, across = np.meshgrid(z, r, indexing="ij")
    corner = (r.size * np.arange(z.size - 1)[:, None] + np.arange(r.size - 1)).ravel()
    cells = np.column_stack([corner, corner + r.size, corner + r.size + 1, corner + 1])
    return fem.Mesh(np.column_stack([along.ravel(), across.ravel()]), cells, "quad")


class Cylinder:
    """The body and its forces."""

    def __init__(self, solid: Solid, radius: float, length: float, density: float, elements: tuple[int, int]):
        self.solid, self.length = solid, length
        half = graded(0.5 * length, elements[1])
        z = np.concatenate([0.5 * length - half[::-1], 0.5 * length + half[1:]])
        linear = bilinear_mesh(z, graded(radius, elements[0]))
        mesh = fem.mesh.convert(linear, order=2, calc_points=True, calc_midfaces=True)
        region = fem.RegionBiQuadraticQuad(mesh)
        self.motion = fem.FieldAxisymmetric(region, dim=2)
        self.field = fem.FieldContainer([self.motion])
        self.nodes = mesh.points
        self.mass = fem.SolidBody(fem.NeoHooke(1.0, 1.0), self.field, density=density).assemble.mass()
        near = 1e-9 * length
        side = np.flatnonzero(self.nodes[:, RADIAL] > radius - near)
        self.side = side[np.argsort(self.nodes[side, AXIAL])]
        """Nodes of the side, transmission platen first."""
        self.bottom = np.flatnonzero(self.nodes[:, AXIAL] < near)
        self.top = np.flatnonzero(self.nodes[:, AXIAL] > length - near)
        self.axis = np.flatnonzero(self.nodes[:, RADIAL] < near)
        # Linear functions of the element, and the projection of a function of its points on them.
        self.dV = region.dV
        turned = 2.0 * np.pi * self.motion.radius * region.dV
        local = region.quadrature.points
        self.linear = np.stack([np.ones(len(local)), *local.T])
        gram = np.einsum("aq,bq,qc->cab", self.linear, self.linear, turned)
        self.gram = np.linalg.inv(gram).transpose(1, 2, 0)
        self.project = np.einsum(
            "aq,abc,br,rc->qrc", self.linear, self.gram, self.linear, turned, optimize=True
        )
        # The gradient of a displacement at the points, and the forces of a stress, as matrices.
        shape = np.broadcast_to(region.h.reshape(*region.dhdX[:, 0].shape[:2], -1), region.dhdX[:, 0].shape)
        values = [region.dhdX[:, J] for _, J in PLANE] + [shape / self.motion.radius]
        columns = [2 * mesh.cells.T[:, None] + i for i, _ in PLANE] + [2 * mesh.cells.T[:, None] + RADIAL]
        rows = np.arange(5 * turned.size).reshape(5, 1, *turned.shape)
        index = [np.broadcast_to(one, (5, *shape.shape)).ravel() for one in (rows, np.stack(columns))]
        size = 5 * turned.size, self.nodes.size
        self.gradient = csr_matrix((np.stack(values).ravel(), index), shape=size)
        self.gathered = (self.gradient.T.multiply(np.tile(turned.ravel(), 5))).tocsr()

    def _rate(self, u: FloatArray) -> FloatArray:
        """Gradient of a displacement or velocity, shape [3, 3, points, elements]."""
        found = np.zeros((3, 3, *self.dV.shape))
        found[*COMPONENTS] = (self.gradient @ u).reshape(5, *self.dV.shape)
        return found

    def set_rate(self, speed: float, rest: FloatArray) -> None:
        """The velocity is `speed` [1/s] times the displacement, plus a rest [m/s]."""
        self.speed, self.constant = speed, _plus(self._rate(rest), np.array(-speed))

    def _strained(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Deformation gradient, its rate and the mean stress."""
        F = _plus(self._rate(u), np.array(1.0))
        dilatation = (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) * F[2, 2] - 1.0
        pressure = self.solid.bulk * np.einsum("qrc,rc->qc", self.project, dilatation)
        return F, self.speed * F + self.constant, pressure

    def forces(self, u: FloatArray) -> FloatArray:
        """Elastic and viscous forces [N] of a displacement, shape [2 n]."""
        return np.asarray(self.gathered @ self.solid.stress(*self._strained(u))[*COMPONENTS].ravel())

    def tangent(self, u: FloatArray) -> csr_matrix:
        """Their derivative [N/m]."""
        F, rate, pressure = self._strained(u)
        A = self.solid.tangent(F, rate, pressure, self.speed)
        form = fem.IntegralForm([A], v=self.field, u=self.field, dV=self.dV)
        values = form.integrate()[0]
        state = _State.of(F, rate)
        B = np.stack(
            [
                fem.IntegralForm([state.J * one[:, None] * state.T], v=self.field, dV=self.dV).integrate()[0]
                for one in self.linear
            ]
        )
        values += self.solid.bulk * np.einsum("paic,pqc,qbkc->aibkc", B, self.gram, B, optimize=True)
        return form.assemble(values=[values])


@dataclass(frozen=True)
class Flyer:
    """Motion of the flyer's platen."""

    path: Path1D

    def motion(self, t: float) -> tuple[float, float, float]:
        """Way [m], velocity [m/s] and acceleration [m/s^2] at a time since its start [s]."""
        h = 1e-9
        at = self.path.start + np.array([t, t - h, t + h])
        v = self.path.velocity(at)
        return float(self.path.displacement(at)[0]), float(v[0]), float((v[2] - v[1]) / (2.0 * h))


class _End(NamedTuple):
    """The end of a step."""

    u: FloatArray
    v: FloatArray
    a: FloatArray
    """Displacement, velocity and acceleration of the nodes."""
    time: float
    """Inner time of the step [s]."""
    transmitted: float
    incident: float
    """Forces of the transmission platen and of the flyer on the specimen then, compression-positive [N]."""


class NoConvergence(Exception):
    """The iteration of a step did not converge."""


class Impact:
    """The body in time."""

    def __init__(self, body: Cylinder, flyer: Flyer):
        self.body, self.flyer, self.t = body, flyer, 0.0
        self.u, self.v, self.a = np.zeros((3, body.nodes.size))
        rho = RADIUS_AT_INFINITY
        self.am, self.af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self.gamma = 0.5 - self.am + self.af
        self.beta = 0.25 * (1.0 - self.am + self.af) ** 2
        self.low, self.high = set(body.bottom.tolist()), set(body.top.tolist())
        """Nodes on either platen."""
        self.factors: tuple[float, IntArray, SuperLU] | None = None
        """Step and free unknowns of the factors of the tangent, and the factors."""
        self.count = {"steps": 0, "iterations": 0, "factorisations": 0, "landed": 0}

    def step(self, dt: float) -> _End:
        """One step."""
        fresh: dict[int, tuple[bool, float]] = {}
        while True:
            end = self._solve(dt, fresh)
            y, r = (self.body.nodes + end.u.reshape(-1, 2)).T
            level = self.body.length - self.flyer.motion(self.t + dt)[0]
            loose = [k for k in self.body.side.tolist() if k not in self.low | self.high | fresh.keys()]
            more = {k: (y[k] > level, r[k]) for k in loose if not 0.0 <= y[k] <= level}
            if not more:
                break
            fresh |= more
        self.u, self.v, self.a = end.u, end.v, end.a
        self.t += dt
        _, speed, acceleration = self.flyer.motion(self.t)
        for node, (upper, _) in fresh.items():
            (self.high if upper else self.low).add(node)
            self.v[2 * node + AXIAL], self.a[2 * node + AXIAL] = -speed * upper, -acceleration * upper
            self.v[2 * node + RADIAL] = self.a[2 * node + RADIAL] = 0.0
        self.count["steps"] += 1
        self.count["landed"] += len(fresh)
        return end

    def _ends(self, u: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Newmark's velocity and acceleration at the step's end."""
        a = (u - self.u - dt * self.v) / (self.beta * dt**2) - (0.5 / self.beta - 1.0) * self.a
        return self.v + dt * ((1.0 - self.gamma) * self.a + self.gamma * a), a

    def _held(self, dt: float, fresh: dict[int, tuple[bool, float]]) -> tuple[IntArray, _End]:
        """Unknowns that are held, and the end of the step as far as it is known."""
        body, (way, speed, acceleration) = self.body, self.flyer.motion(self.t + dt)
        u = self.u.copy()
        low, high = np.array(sorted(self.low)), np.array(sorted(self.high))
        u[2 * low + AXIAL] = -body.nodes[low, AXIAL]
        u[2 * high + AXIAL] = body.length - way - body.nodes[high, AXIAL]
        for node, (upper, radius) in fresh.items():
            u[2 * node + AXIAL] = (body.length - way) * upper - body.nodes[node, AXIAL]
            u[2 * node + RADIAL] = radius - body.nodes[node, RADIAL]
        v, a = self._ends(u, dt)
        v[2 * low + AXIAL] = a[2 * low + AXIAL] = 0.0
        v[2 * high + AXIAL], a[2 * high + AXIAL] = -speed, -acceleration
        still = np.concatenate([2 * low + RADIAL, 2 * high + RADIAL, 2 * body.axis + RADIAL])
        v[still] = a[still] = 0.0
        landed = np.array(sorted(fresh), int)
        held = [still, *(2 * nodes + AXIAL for nodes in (low, high, landed)), 2 * landed + RADIAL]
        return np.concatenate(held), _End(u, v, a, 0.0, 0.0, 0.0)

    def _solve(self, dt: float, fresh: dict[int, tuple[bool, float]]) -> _End:
        """The end of a step of which these nodes are held at its end."""
        am, af, body = self.am, self.af, self.body
        held, known = self._held(dt, fresh)
        loose = np.ones(self.u.size, bool)
        loose[held] = False
        free = np.flatnonzero(loose)
        # Velocity and acceleration at the inner point are these factors times the displacement there, and a
        # rest.
        c1, c2 = self.gamma / (self.beta * dt), (1.0 - am) / ((1.0 - af) * self.beta * dt**2)
        v, a = self._ends(-af / (1.0 - af) * self.u, dt)
        v_rest, a_rest = (1.0 - af) * v + af * self.v, (1.0 - am) * a + am * self.a
        w = self.u + (1.0 - af) * (dt * self.v + 0.5 * dt**2 * self.a)
        w[held] = (1.0 - af) * known.u[held] + af * self.u[held]
        v_rest[held] = (1.0 - af) * known.v[held] + af * self.v[held] - c1 * w[held]
        a_rest[held] = (1.0 - am) * known.a[held] + am * self.a[held] - c2 * w[held]
        body.set_rate(c1, v_rest)
        iterations = 0
        while True:
            residual = body.forces(w) + body.mass @ (c2 * w + a_rest)
            change = self._factors(w, dt, c2, free, iterations % STALE == STALE - 1).solve(residual[free])
            largest = float(np.abs(change).max())
            iterations += 1
            if not largest < LARGE or iterations == ITERATIONS:
                self.factors = None
                raise NoConvergence(f"at {1e6 * self.t:.2f} us: last change {largest:.2g} m")
            w[free] -= change
            if largest < SMALL:
                break
        self.count["iterations"] += iterations
        axial = residual[AXIAL::2]
        low, high = ({k for k, (upper, _) in fresh.items() if upper == side} for side in (False, True))
        pushed = axial[sorted(self.low | low)].sum(), -axial[sorted(self.high | high)].sum()
        u = known.u.copy()
        u[free] = self.u[free] + (w - self.u)[free] / (1.0 - af)
        v, a = self._ends(u, dt)
        v[held], a[held] = known.v[held], known.a[held]
        return _End(u, v, a, self.t + (1.0 - af) * dt, *map(float, pushed))

    def _factors(self, w: FloatArray, dt: float, inertia: float, free: IntArray, again: bool) -> SuperLU:
        """Triangular factors of the tangent, of an earlier step if they fit."""
        kept = self.factors
        if again or kept is None or kept[0] != dt or len(kept[1]) != len(free):
            whole = (self.body.tangent(w) + inertia * self.body.mass)[free][:, free]
            options = {"SymmetricMode": True}
            lu = splu(whole.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
            self.factors = kept = dt, free, lu
            self.count["factorisations"] += 1
        return kept[2]


@dataclass(frozen=True)
class History:
    """A simulated test. Times are from the flyer's start."""

    force_times: FloatArray
    """[s], shape [n]."""
    transmitted: FloatArray
    incident: FloatArray
    """Forces on the specimen, compression-positive [N], shape [n]."""
    times: FloatArray
    """[s], shape [m]."""
    side: FloatArray
    """Height and radius of the side's nodes at these times [m], shape [m, nodes, 2]."""
    count: dict[str, int]
    """Numbers of steps, iterations, factorisations, and nodes that landed on a platen."""

    def forces(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transmitted and incident force at times [s], linear between the steps [N], shape [n] each."""
        transmitted, incident = (
            np.interp(times, self.force_times, force) for force in (self.transmitted, self.incident)
        )
        return transmitted, incident

    def outline(self, times: FloatArray) -> FloatArray:
        """Height and radius of the side's nodes at times [s], linear between the steps [m]."""
        k = np.clip(np.searchsorted(self.times, times) - 1, 0, len(self.times) - 2)
        share = (times - self.times[k]) / (self.times[k + 1] - self.times[k])
        share = share[:, None, None]
        return np.asarray((1.0 - share) * self.side[k] + share * self.side[k + 1])


def simulate(body: Cylinder, flyer: Flyer, last: float, time_step: float = TIME_STEP) -> History:
    """Simulate an impact until a time [s].

    A step without convergence is halved. Raises NoConvergence if the halves do not converge either.
    """
    impact = Impact(body, flyer)
    place = body.nodes[body.side]
    times, side, ends = [0.0], [place], [(0.0, 0.0, 0.0)]

    def advance(dt: float, halvings: int) -> None:
        try:
            end = impact.step(dt)
        except NoConvergence:
            if halvings == 0:
                raise
            advance(0.5 * dt, halvings - 1)
            advance(0.5 * dt, halvings - 1)
            return
        times.append(impact.t)
        side.append(place + impact.u.reshape(-1, 2)[body.side])
        ends.append((end.time, end.transmitted, end.incident))

    while impact.t < last + time_step:  # the inner time of the last step is beyond `last`
        advance(time_step, HALVINGS)
    force_times, transmitted, incident = np.array(ends).T
    return History(force_times, transmitted, incident, np.array(times), np.array(side), impact.count)


def truth(quantities: Specification, elements: tuple[int, int] = ELEMENTS, step: float = TIME_STEP) -> Truth:
    """The truth of a shot with rigid, bonded platens and no relaxation.

    Raises ValueError if the shot has something else, TruthError if the simulation does not reach its end.
    """
    q = quantities
    other = {
        "relaxing": bool(q.relaxing),
        "material.mass_damping": q.material.mass_damping != 0.0,
        "transmission": q.transmission.support != "rigid",
        "interface": {q.interface.faces, q.interface.side} != {"bonded"},
        "imperfections.slip_friction": q.imperfections.slip_friction != 0.0,
        "imperfections.tilt": q.imperfections.tilt != 0.0,
        "imperfections.off_centre": q.imperfections.off_centre != 0.0,
    }
    if any(other.values()):
        raise ValueError(f"FElupe makes no truth with {', '.join(key for key, has in other.items() if has)}")
    job, solid = Job.of(q), Solid.of(q)
    body = Cylinder(solid, 0.5 * q.specimen.diameter, q.specimen.length, q.specimen.density, elements)
    try:
        with np.errstate(all="ignore"):  # an iterate past locking has NaN and is refused
            history = simulate(body, Flyer(job.path), job.last, step)
    except NoConvergence as error:
        raise TruthError(f"{q.name}: no convergence {error}") from None
    times = KNOT * np.arange(int(np.floor(job.last / KNOT * (1.0 + 1e-12))) + 1, dtype=np.float64)
    transmitted, incident = history.forces(times)
    seen, start = history.outline(np.maximum(job.frames, 0.0)), job.path.start
    return Truth(
        surface=SurfaceHistory(
            time=job.frames + start,
            r=seen[..., RADIAL],
            y=seen[..., AXIAL],
            displacement=job.path.displacement(job.frames + start),
            tilt=np.zeros(len(job.frames)),
        ),
        force_time=times + start,
        transmitted=transmitted,
        incident=incident,
        flyer_acceleration=np.gradient(job.path.velocity(times + start), KNOT),
        support_acceleration=np.zeros(len(times)),
        flyer_radius=0.5 * q.motion.flyer_diameter,
    )
