"""Motions: inertia by two implicit schemes, relaxation of the stress, and the march in time.

    backward Euler     v = (u - u0) / dt,              a = (v - v0) / dt                         (D.1)
    trapezoidal rule   v = v0 + dt/2 (a0 + a),         u = u0 + dt/2 (v0 + v)                    (D.2)

The first scheme is of first order and damps every motion that a step does not resolve. The second is of
second order without damping (Newmark's with beta = 1/4, gamma = 1/2). S is the second Piola-Kirchhoff stress
of the law with the constants of slow loading. With a Prony series, the stress is

    S_total = S + sum_i h_i,   h_i <- e^(-dt/tau_i) h_i + beta_i e^(-dt/(2 tau_i)) (S - S_before)    (D.3)

(Simo and Hughes 1998, Section 10.3, with beta_i relative to the law's stress). The volumetric and the
isochoric stress relax alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from kolsky.equilibrium.body import Body, BodyState
from kolsky.equilibrium.equations import Equations, State
from kolsky.equilibrium.linear.base import SingularError
from kolsky.equilibrium.model import Model
from kolsky.equilibrium.points import element_forces, geometry
from kolsky.equilibrium.solution import Outcome
from kolsky.equilibrium.solve import checked_steps

Scheme = Literal["backward_euler", "trapezoidal"]


@dataclass(frozen=True)
class Instant:
    """Displacement, velocity and acceleration of all components, each of shape [n d]."""

    u: FloatArray
    """Displacements [m]."""
    v: FloatArray
    """Velocities [m/s]."""
    a: FloatArray
    """Accelerations [m/s2]."""


def element_masses(model: Model, density: float | tuple[float, ...]) -> FloatArray:
    """Consistent mass of each element [kg], shape [m, k d, k d]; `density` as for `Gravity`."""
    if not np.all(np.asarray(density) > 0.0):
        raise ValueError(f"density must be > 0 kg/m3, got {density}")
    # products of shape functions have twice their degree
    gauss = (model.mesh.element.gauss if model.gauss is None else model.gauss) + 1
    g = geometry(model.mesh, kinematics=model.kinematics, thickness=model.thickness, gauss=gauss)
    each = np.broadcast_to(density, model.n_regions)[model.cell_regions]
    scalar = np.einsum("m,mg,ga,gb->mab", each, g.volumes, g.values, g.values, optimize=True)
    m, k, d = len(scalar), scalar.shape[1], model.dimension
    return np.einsum("mab,ij->maibj", scalar, np.eye(d)).reshape(m, k * d, k * d)


def factor(scheme: Scheme, dt: float) -> float:
    """A of a = A (u - u0) - b [1/s2]."""
    return (1.0 if scheme == "backward_euler" else 4.0) / dt**2


def following(scheme: Scheme, dt: float, before: Instant, u: FloatArray) -> Instant:
    """Velocity and acceleration at displacements u one step later, Eqs. (D.1) and (D.2)."""
    if scheme == "backward_euler":
        v = (u - before.u) / dt
        return Instant(u, v, (v - before.v) / dt)
    a = 4.0 / dt**2 * (u - before.u) - 4.0 / dt * before.v - before.a
    return Instant(u, before.v + 0.5 * dt * (before.a + a), a)


@dataclass(frozen=True)
class Prony:
    """A Prony series."""

    shares: tuple[float, ...]
    """beta_i: instantaneous stress over long-term stress, minus 1 [-], > 0."""
    times: tuple[float, ...]
    """tau_i [s], > 0."""

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.times) or not self.shares:
            raise ValueError("a Prony series has as many shares as times, at least one")
        if min(self.shares) <= 0.0 or min(self.times) <= 0.0:
            raise ValueError("shares and times of a Prony series must be > 0")


class Relaxing:
    """Forces and stiffness of the Prony series, added to those of a body step by step."""

    def __init__(self, body: Body, series: Prony, dt: float) -> None:
        model = body.model
        if model.kinematics != "3d" or body.points.mixed:
            raise ValueError('relaxation needs a three-dimensional model with volumetric = "displacement"')
        self.body, self.dt = body, dt
        tau, beta = np.array(series.times), np.array(series.shares)
        self.decay = np.exp(-dt / tau)
        self.gain = beta * np.exp(-0.5 * dt / tau)
        m, g = body.points.shape
        self.stress: FloatArray = np.zeros((m, g, 3, 3))
        self.parts = np.zeros((len(tau), m, g, 3, 3))

    def _deformation(self, u: FloatArray) -> FloatArray:
        model = self.body.model
        at = u.reshape(-1, 3)[model.mesh.cells]
        return np.eye(3) + np.einsum("mki,mgkj->mgij", at, self.body.points.geometry.E, optimize=True)

    def _known(self) -> FloatArray:
        """The terms of (D.3) that follow from the last step [Pa], shape [m, g, 3, 3]."""
        return np.tensordot(self.decay, self.parts, axes=1) - self.gain.sum() * self.stress

    def forces(self, state: BodyState) -> FloatArray:
        """Forces of each element in addition to those of the law [N], shape [m, k d]."""
        geometry = self.body.points.geometry
        added = np.matmul(self._deformation(state.u), self._known())
        m, g = geometry.volumes.shape
        weighted = added.reshape(m, g, 9) * geometry.volumes[..., None]
        known = element_forces(geometry.T, weighted).reshape(m, -1)
        return np.asarray(self.gain.sum() * state.points.forces + known)

    def stiffness(self, elastic: FloatArray) -> FloatArray:
        """Derivative of these forces [N/m], from the stiffness of the law, shape [m, k d, k d]."""
        E, volumes = self.body.points.geometry.E, self.body.points.geometry.volumes
        weighted = self._known() * volumes[..., None, None]
        scalar = np.einsum("mgai,mgij,mgbj->mab", E, weighted, E, optimize=True)
        m, k = scalar.shape[:2]
        geometric = np.einsum("mab,ij->maibj", scalar, np.eye(3)).reshape(m, 3 * k, 3 * k)
        return np.asarray(self.gain.sum() * elastic + geometric)

    def accept(self, state: BodyState) -> None:
        """Accept a state as the end of a step."""
        m, g = self.body.points.shape
        P = state.points.P.reshape(m, g, 3, 3)
        stress = np.asarray(np.linalg.solve(self._deformation(state.u), P), dtype=np.float64)
        change = stress - self.stress
        for i, (decay, gain) in enumerate(zip(self.decay, self.gain, strict=True)):
            self.parts[i] = decay * self.parts[i] + gain * change
        self.stress = stress


ITERATIONS = 30
"""Maximum number of iterations of a step."""


@dataclass(frozen=True)
class Motion:
    """A motion. Steps that were not reached are NaN, and the outcome gives the reason."""

    model: Model
    time: FloatArray
    """Times [s], the first 0, shape [n + 1]."""
    displacements: FloatArray
    """Displacements [m], shape [n + 1, n_points, d]."""
    forces: FloatArray
    """Forces of supports on the points [N], of the same shape: internal and inertial forces minus weight and
    pressure. They are 0 at the start."""
    outcome: Outcome
    reached: int
    """Number of times reached, the start included."""

    def mean_displacement(self, where: str) -> FloatArray:
        """Mean displacement of a set of points [m], shape [n + 1, d]."""
        return np.asarray(self.displacements[:, self.model.mesh.nodes(where)].mean(axis=1))

    def reaction(self, where: str) -> FloatArray:
        """Sum of `forces` over a set of points [N], shape [n + 1, d]."""
        return np.asarray(self.forces[:, self.model.mesh.nodes(where)].sum(axis=1))


def march(
    model: Model,
    histories: Mapping[str, ArrayLike] | None,
    dt: float,
    *,
    density: float | tuple[float, ...],
    scheme: Scheme = "backward_euler",
    prony: Prony | None = None,
    steps: int | None = None,
    start: FloatArray | None = None,
    start_histories: Mapping[str, float] | None = None,
    tolerance: float = 1e-8,
) -> Motion:
    """Step a model through time from rest.

    ``model``: the body with its supports and loads, without rigid planes. ``histories``: value of each
    history at the end of each step, shape [n]. ``dt``: length of a step [s]. ``density``: density at rest
    [kg/m3], one value for all regions or one for each. ``scheme``: "backward_euler" or "trapezoidal".
    ``prony``: relaxation of the stress. ``steps``: number of steps, for a model without histories. ``start``:
    displacements at the start [m], with zero velocity; None: undeformed. ``start_histories``: values of the
    histories at the start; None: those of the first step. ``tolerance``: largest residual as a share of the
    internal, external or inertial forces [-]. Raises ValueError if a history does not fit, if dt is not > 0,
    if the scheme is unknown, or if there is a rigid plane.
    """
    table = checked_steps(model, histories)
    n = len(next(iter(table.values()))) if table else (steps or 1)
    equations = Equations(model, model.parameters())
    if not dt > 0.0 or scheme not in get_args(Scheme):
        raise ValueError(f"dt must be > 0 s and scheme one of {get_args(Scheme)}, got {dt} and {scheme!r}")
    if equations.contacts:
        raise ValueError("a motion with a rigid plane is not offered: remove the contact")
    masses = element_masses(model, density)
    relaxing = None if prony is None else Relaxing(equations.body, prony, dt)
    at = [{name: float(values[k]) for name, values in table.items()} for k in range(n)]
    u = np.zeros(model.n_dofs) if start is None else np.asarray(start, dtype=float).reshape(-1)
    first = equations.evaluate(u, at[0] if start_histories is None else dict(start_histories))
    if relaxing is not None:
        relaxing.accept(first.body)
    push = equations.factors(masses).solve(-first.residual)
    found = [Instant(u, np.zeros_like(u), equations.expanded(push))]
    shape = (n + 1, *model.mesh.points.shape)
    forces = np.full(shape, np.nan)
    forces[0] = 0.0

    def relaxed(state: State) -> FloatArray | float:
        """Forces of the Prony series, for all components."""
        return 0.0 if relaxing is None else equations.body.pattern.vector(relaxing.forces(state.body))

    def step(before: Instant, at: dict[str, float]) -> tuple[Outcome, Instant, State]:
        """The end of a step, and its state."""
        u = equations.with_prescribed(before.u, at)
        for _ in range(ITERATIONS):
            state, now = equations.evaluate(u, at), following(scheme, dt, before, u)
            if state.inverted:
                return Outcome.INVERTED, now, state
            inertia = equations.reduced(equations.times(masses, now.a))
            residual = state.residual + inertia
            if relaxing is not None:
                residual = residual + equations.reduced(np.asarray(relaxed(state)))
            sizes = [float(np.linalg.norm(x)) for x in (state.body.forces, state.external, inertia)]
            if float(np.linalg.norm(residual)) <= max(tolerance * max(sizes), equations.floor):
                closed = Outcome.COMPLETED if equations.closed(state) else Outcome.PENETRATION
                return closed, now, state
            elements = equations.stiffness(state) + factor(scheme, dt) * masses
            if relaxing is not None:
                elements = elements + relaxing.stiffness(equations.body.stiffness(state.body))
            try:
                change = equations.factors(elements, state).solve(-residual)
            except SingularError:
                return Outcome.SINGULAR, now, state
            u = u + equations.expanded(change)
        return Outcome.NOT_CONVERGED, now, state

    outcome = Outcome.COMPLETED
    for k, values in enumerate(at, start=1):
        outcome, now, state = step(found[-1], values)
        if not outcome.ok:
            break
        total = state.body.forces + relaxed(state) + equations.times(masses, now.a) - state.carried
        forces[k] = total.reshape(shape[1:])
        if relaxing is not None:
            relaxing.accept(state.body)
        found.append(now)
    moved = np.full(shape, np.nan)
    moved[: len(found)] = np.reshape([one.u for one in found], (len(found), *shape[1:]))
    time = np.asarray(dt * np.arange(n + 1), dtype=np.float64)
    return Motion(model, time, moved, forces, outcome, len(found))
