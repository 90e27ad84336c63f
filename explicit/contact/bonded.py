"""Bonded: no slip and no lift-off from the first touch on; carries tension."""

from typing import Any

import warp as wp

from explicit.precision import Precision


class Bonded:
    """A node that has touched moves with the platen for good."""

    name = "bonded"
    needs_friction = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        zero = real(0.0)

        @wp.func
        def bonded(v_r: real, v_y: real, target: real, normal: real, touched: int, friction: real):
            velocity = vec2(v_r, v_y)
            if touched == 1 or normal * (v_y - target) < zero:
                velocity = vec2(zero, target)
            return velocity

        return bonded
