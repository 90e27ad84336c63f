"""Rough: no slip while pressed, free to lift off (Coulomb's law for an infinite coefficient)."""

from typing import Any

import warp as wp

from explicit.contact.base import touch_struct
from explicit.precision import Precision


class Rough:
    """A pressed node does not slide; a pulled node leaves."""

    name = "rough"
    needs_friction = False
    needs_release_stress = False
    needs_stiffness = False
    carries_tension = False
    slides = False
    remembers_slip = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def rough(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.normal * (touch.v_y - touch.target) < zero:
                velocity = vec2(zero, touch.target)
            return velocity, touch.status, touch.slip

        return rough
