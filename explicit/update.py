"""The free motion of a node: corner forces gathered, and the velocity they would give it."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.places import entry_function
from explicit.precision import Precision
from explicit.structs import Structs

VALENCE = 4
"""Elements that meet at a node, at most."""


@dataclass(frozen=True)
class UpdateFunctions:
    """The update of a node before the platens have their say."""

    free_velocity: Any
    """``free_velocity(body, corner_r, corner_y, v_r, v_y, n, tau, alpha) -> (old, free, mass)``: velocity
    before [m/s], velocity after an interval `tau` [s] without contact, and the node's mass [kg]."""


@cache
def update_functions(precision: Precision, structs: Structs) -> UpdateFunctions:
    """Generate the update."""
    real, vec2 = precision.real, precision.vec2
    Body = structs.Body
    number, corner_at = entry_function(real), entry_function(wp.int32)
    valence = int(VALENCE)

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
        for c in range(valence):
            corner = corner_at(body.corners, c, n)
            f_r += corner_r[corner]
            f_y += corner_y[corner]
        old = vec2(v_r[n], v_y[n])
        # Forces resist, so they enter with a minus; the drag of alpha acts on the old velocity. On the axis
        # the radial inverse mass is zero.
        push = vec2(f_r * number(body.masses, 1, n), f_y * number(body.masses, 2, n))
        return old, old - tau * (push + alpha * old), number(body.masses, 0, n)

    return UpdateFunctions(free_velocity)
