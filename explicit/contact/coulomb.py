"""Coulomb friction: the tangential impulse is at most f times the normal impulse."""

from typing import Any

import warp as wp

from explicit.contact.base import touch_struct
from explicit.precision import Precision


class Coulomb:
    """A pressed node sticks until its tangential impulse exceeds f times the normal one."""

    name = "coulomb"
    needs_friction = True
    needs_release_stress = False
    needs_stiffness = False
    carries_tension = False
    slides = True
    remembers_slip = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def coulomb(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.normal * (touch.v_y - touch.target) < zero:
                # Impulses per unit mass: |target - v_y| normal, at most f times that tangential.
                slip = wp.max(wp.abs(touch.v_r) - touch.friction * wp.abs(touch.target - touch.v_y), zero)
                velocity = vec2(wp.sign(touch.v_r) * slip, touch.target)
            return velocity, touch.status, touch.slip

        return coulomb
