"""The contact laws. A new law is a class here or in a separate file, and an entry of `CONTACT_LAWS`."""

from typing import Any

import warp as wp

from explicit.contact.base import RELEASED, TOUCHED, ContactLaw, touch_struct
from explicit.precision import Precision


class Bonded(ContactLaw):
    """A node that has touched moves permanently with the platen."""

    name = "bonded"
    carries_tension = True

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def bonded(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.status == 1 or touch.normal * (touch.v_y - touch.target) < zero:
                velocity = vec2(zero, touch.target)
            return velocity, touch.status, touch.slip

        return bonded


class BondedRelease(ContactLaw):
    """A node that has touched moves with the platen until its tensile stress reaches the release stress.

    The contact stress is the normal impulse of the step over its interval and over the node's undeformed
    contact area. A bonded face does not slip, so its area remains undeformed and the stress is the true
    stress. After the release the node is `rough` and does not bond again. Soft, tacky specimens still stick
    to polished steel in compression, but do not transmit tension. Friction has little effect above f = 0.5
    (Mates et al. 2012). At the edge of a face the stress of the continuum is singular. The beginning of the
    release at the edge therefore depends on the mesh.
    """

    name = "bonded_release"
    needs_release_stress = True
    carries_tension = True

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
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


class Rough(ContactLaw):
    """A pressed node does not slide; a pulled node separates."""

    name = "rough"

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def rough(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.normal * (touch.v_y - touch.target) < zero:
                velocity = vec2(zero, touch.target)
            return velocity, touch.status, touch.slip

        return rough


class Coulomb(ContactLaw):
    """A pressed node sticks until its tangential impulse exceeds f times its normal impulse."""

    name = "coulomb"
    needs_friction = True
    slides = True

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def coulomb(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.normal * (touch.v_y - touch.target) < zero:
                # Impulses per unit mass: normal |target - v_y|, tangential at most f times the normal one.
                slip = wp.max(wp.abs(touch.v_r) - touch.friction * wp.abs(touch.target - touch.v_y), zero)
                velocity = vec2(wp.sign(touch.v_r) * slip, touch.target)
            return velocity, touch.status, touch.slip

        return coulomb


class Frictionless(ContactLaw):
    """A pressed node slides freely."""

    name = "frictionless"
    slides = True

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
        zero = real(0.0)

        @wp.func
        def frictionless(touch: Touch):
            velocity = vec2(touch.v_r, touch.v_y)
            if touch.normal * (touch.v_y - touch.target) < zero:
                velocity = vec2(touch.v_r, touch.target)
            return velocity, touch.status, touch.slip

        return frictionless


class Penalty(ContactLaw):
    """A second formulation of Coulomb's law, for verification of the kinematic one and comparison with other
    programs.

    The pressure is the stiffness k times the penetration. The shear stress is k times an elastic slip s and
    at most f times the pressure. Both are per area of the undeformed surface. They are evaluated at the end
    of the step; a high stiffness therefore does not shorten the stable step. Over the interval tau and the
    step h, with c = k h tau / density, the impulses per mass are

        normal  (target - v_y) c / (1 + c),   tangential  (v_r + s / h) c / (1 + c),

    For large c they are those of `coulomb`. The energy of the springs is part of the entries `impact` and
    `friction` of the energy balance and is returned there. The platen must be rigid, or a bar with an
    impedance far above k times the area times the step, because it responds one step late.
    """

    name = "penalty"
    needs_friction = True
    needs_stiffness = True
    slides = True
    remembers_slip = True

    def kernel_function(self, precision: Precision) -> Any:
        real, vec2, Touch = precision.real, precision.vec2, touch_struct(precision)
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
