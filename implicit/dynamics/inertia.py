r"""Inertia of a body, and two ways to step through time.

    backward Euler     v = (u - u0) / dt,              a = (v - v0) / dt                         (D.1)
    trapezoidal rule   v = v0 + dt/2 (a0 + a),         u = u0 + dt/2 (v0 + v)                    (D.2)

The first is of first order and damps every motion that a step does not resolve; the second is of second order
and damps nothing (Newmark's with beta = 1/4, gamma = 1/2). Both make a = A (u - u0) - b with what is known
in b.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from explicit.arrays import FloatArray
from implicit.integration.geometry import geometry
from implicit.model import Model

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


def element_masses(model: Model, density: float) -> FloatArray:
    """Consistent mass of each element [kg], shape [m, k d, k d].

    Raises
    ------
    ValueError
        If the density is not > 0.
    """
    if not density > 0.0:
        raise ValueError(f"density must be > 0 kg/m3, got {density}")
    # products of shape functions are of twice their degree
    gauss = (model.mesh.element.gauss if model.gauss is None else model.gauss) + 1
    g = geometry(model.mesh, kinematics=model.kinematics, thickness=model.thickness, gauss=gauss)
    scalar = density * np.einsum("mg,ga,gb->mab", g.volumes, g.values, g.values, optimize=True)
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
