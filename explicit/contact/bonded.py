"""Bonded: no slip and no lift-off from the first touch on; carries tension."""

from typing import Any

import warp as wp

from explicit.contact.base import touch_struct
from explicit.precision import Precision


class Bonded:
    """A node that has touched moves with the platen for good."""

    name = "bonded"
    needs_friction = False
    needs_release_stress = False
    needs_stiffness = False
    carries_tension = True
    slides = False
    remembers_slip = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def bonded(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.status == 1 or touch.normal * (touch.v_y - touch.target) < zero:
                velocity = vec2(zero, touch.target)
            return velocity, touch.status, touch.slip

        return bonded
