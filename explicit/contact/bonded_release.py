"""Bonded until it is pulled too hard: no slip, tension up to a release stress, then rough for good."""

from typing import Any

import warp as wp

from explicit.contact.base import RELEASED, TOUCHED, touch_struct
from explicit.precision import Precision


class BondedRelease:
    """A node that has touched moves with the platen until its tensile stress reaches the release stress.

    The contact stress is the normal impulse of the step over its interval and over the undeformed area that
    the node stands for. A bonded face does not slip, so its area stays the undeformed one and the stress is
    the true one. From then on the node is `rough` and bonds no more: soft, tacky specimens slide on polished
    steel no more easily than they stick (friction hardly matters above f = 0.5, Mates et al. 2012), they only
    no longer pull. At the edge of a face the stress of the continuum is singular, so where the edge begins to
    let go depends on the mesh.
    """

    name = "bonded_release"
    needs_friction = False
    needs_release_stress = True
    needs_stiffness = False
    carries_tension = True
    slides = False
    remembers_slip = False

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero, touched, released = real(0.0), int(TOUCHED), int(RELEASED)

        @wp.func
        def bonded_release(touch: Touch):
            velocity, status = vec2(touch.v_r, touch.v_y), int(touch.status)
            away = touch.normal * (touch.v_y - touch.target)
            if away < zero:
                velocity = vec2(zero, touch.target)
            elif status == touched:
                if touch.density * away / touch.interval >= touch.release_stress:
                    status = released
                else:
                    velocity = vec2(zero, touch.target)
            return velocity, status, touch.slip

        return bonded_release
