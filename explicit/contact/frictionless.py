"""Frictionless: the platen only pushes along its normal."""

from typing import Any

import warp as wp

from explicit.precision import Precision


class Frictionless:
    """A pressed node slides freely."""

    name = "frictionless"
    needs_friction = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        zero = real(0.0)

        @wp.func
        def frictionless(v_r: real, v_y: real, target: real, normal: real, touched: int, friction: real):
            velocity = vec2(v_r, v_y)
            if normal * (v_y - target) < zero:
                velocity = vec2(v_r, target)
            return velocity

        return frictionless
