"""Coulomb friction: the tangential impulse is at most f times the normal impulse."""

from typing import Any

import warp as wp

from explicit.precision import Precision


class Coulomb:
    """A pressed node sticks until its tangential impulse exceeds f times the normal one."""

    name = "coulomb"
    needs_friction = True

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        zero = real(0.0)

        @wp.func
        def coulomb(v_r: real, v_y: real, target: real, normal: real, touched: int, friction: real):
            velocity = vec2(v_r, v_y)
            if normal * (v_y - target) < zero:
                # Impulses per unit mass: |target - v_y| normal, at most f times that tangential.
                slip = wp.max(wp.abs(v_r) - friction * wp.abs(target - v_y), zero)
                velocity = vec2(wp.sign(v_r) * slip, target)
            return velocity

        return coulomb
