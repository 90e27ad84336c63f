"""Penalty: springs instead of an exact constraint, normal and tangential, with Coulomb's bound."""

from typing import Any

import warp as wp

from explicit.contact.base import touch_struct
from explicit.precision import Precision


class Penalty:
    """A second formulation of Coulomb's law, to verify the kinematic one and to compare with other programs.

    The pressure is the stiffness k times the penetration, the shear stress k times an elastic slip s and at
    most f times the pressure, all per area of the undeformed surface. They are taken at the end of the step,
    so that no stiffness shortens the stable step: over the interval tau and the step h, with
    c = k h tau / density, the impulses per mass are

        normal  (target - v_y) c / (1 + c),   tangential  (v_r + s / h) c / (1 + c),

    for c towards infinity those of `coulomb`. What the springs hold is in the ledger's entries `impact` and
    `friction`, and comes back from there. The platen must be rigid or a bar whose impedance is far above
    k times the area times the step: it answers one step late.
    """

    name = "penalty"
    needs_friction = True
    needs_release_stress = False
    needs_stiffness = True
    carries_tension = False
    slides = True
    remembers_slip = True

    def kernel_function(self, precision: Precision) -> Any:
        """Warp twin; see `explicit.contact.base.ContactLaw`."""
        real, vec2 = precision.real, precision.vec2
        Touch = touch_struct(precision)
        zero, one = real(0.0), real(1.0)

        @wp.func
        def penalty(touch: Touch):
            velocity, slip = vec2(touch.v_r, touch.v_y), real(0.0)
            into = touch.normal * (touch.target - touch.v_y)
            if into > zero:
                rate = touch.stiffness * touch.interval / touch.density  # c / h
                share = rate / (one + rate * touch.step)
                push = into * touch.step * share
                bound = touch.friction * push
                hold = wp.clamp((touch.v_r * touch.step + touch.slip) * share, -bound, bound)
                velocity = vec2(touch.v_r - hold, touch.v_y + touch.normal * push)
                slip = hold / rate
            return velocity, touch.status, slip

        return penalty
