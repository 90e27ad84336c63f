"""The motion of a node: corner forces gathered, the velocity they would give it, and where it goes."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.grouped_tables import entries_function
from explicit.precision import Precision
from explicit.time_loop.structs import Structs

VALENCE = 4
"""Elements that meet at a node, at most."""


@dataclass(frozen=True)
class UpdateFunctions:
    """The update of a node; between its first and its second part the platens have their say."""

    free_velocity: Any
    """``free_velocity(body, corner_r, corner_y, v_r, v_y, n, tau, alpha) -> (old, free, mass)``: velocity
    before [m/s], velocity after an interval `tau` [s] without contact, and the node's mass [kg]."""
    move: Any
    """``move(u_r, u_y, v_r, v_y, n, new, step)``: node n goes on with the velocity `new` for a `step`."""
    kinetic: Any
    """``kinetic(mass, old, new)``: kinetic energy between two velocities [J]."""
    drag_loss: Any
    """``drag_loss(mass, old, new, tau, alpha)``: what mass-proportional damping took in an interval [J]."""


@cache
def update_functions(precision: Precision, structs: Structs) -> UpdateFunctions:
    """Generate the update."""
    real, vec2 = precision.real, precision.vec2
    Body = structs.Body
    numbers, corners_at = entries_function(real), entries_function(wp.int32)
    valence, half = int(VALENCE), real(0.5)

    @wp.func
    def free_velocity(
        body: Body,
        corner_r: wp.array(dtype=real),
        corner_y: wp.array(dtype=real),
        v_r: wp.array(dtype=real),
        v_y: wp.array(dtype=real),
        n: int,
        tau: real,
        alpha: real,
    ):
        f_r, f_y = real(0.0), real(0.0)
        corners, masses = corners_at(body.corners, 0, n), numbers(body.masses, 0, n)
        for c in range(valence):
            f_r += corner_r[corners[c]]
            f_y += corner_y[corners[c]]
        old = vec2(v_r[n], v_y[n])
        # Forces resist, so they enter with a minus; the drag of alpha acts on the old velocity. On the axis
        # the radial inverse mass is zero.
        push = vec2(f_r * masses[1], f_y * masses[2])
        return old, old - tau * (push + alpha * old), masses[0]

    @wp.func
    def move(
        u_r: wp.array(dtype=real),
        u_y: wp.array(dtype=real),
        v_r: wp.array(dtype=real),
        v_y: wp.array(dtype=real),
        n: int,
        new: vec2,
        step: real,
    ):
        v_r[n] = new[0]
        v_y[n] = new[1]
        u_r[n] = u_r[n] + step * new[0]
        u_y[n] = u_y[n] + step * new[1]

    @wp.func
    def kinetic(mass: real, old: vec2, new: vec2):
        return wp.float64(half * mass * wp.dot(old, new))

    @wp.func
    def drag_loss(mass: real, old: vec2, new: vec2, tau: real, alpha: real):
        return wp.float64(tau * alpha * mass * half * wp.dot(old, old + new))

    return UpdateFunctions(free_velocity, move, kinetic, drag_loss)
