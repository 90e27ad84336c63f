"""Rough: no slip while pressed, free to lift off (Coulomb's law for an infinite coefficient)."""

from typing import Any

import warp as wp

from explicit.precision import Precision


class Rough:
    """A pressed node does not slide; a pulled node leaves."""

    name = "rough"
    needs_friction = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        zero = real(0.0)

        @wp.func
        def rough(v_r: real, v_y: real, target: real, normal: real, touched: int, friction: real):
            velocity = vec2(v_r, v_y)
            if normal * (v_y - target) < zero:
                velocity = vec2(zero, target)
            return velocity

        return rough
