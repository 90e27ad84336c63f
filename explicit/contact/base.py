"""The interface of a contact law between a node and a rigid platen.

Contact is kinematic ("hard") unless a law states otherwise. After the unconstrained update of a step, each
node that touches a platen is moved exactly onto it. The necessary impulse is the contact force. A law only
determines which part of the predicted velocity remains. There is no regularisation by a penalty or a velocity
threshold. A node sticks with velocity 0 or slides with full friction.
"""

from functools import cache
from typing import Any, Protocol

import warp as wp

from explicit.precision import Precision

FREE, TOUCHED, RELEASED = 0, 1, 2
"""Contact status of a node at its platen: not touched yet, touched, or permanently released."""


class ContactLaw(Protocol):
    """Interface of a contact law, with default values."""

    name: str
    """Name at the API."""
    needs_friction: bool = False
    """Whether the law reads the friction coefficient, `explicit.Samples.friction`."""
    needs_release_stress: bool = False
    """Whether the law reads the tensile stress at which a bond breaks, `explicit.Samples.release_stress`."""
    needs_stiffness: bool = False
    """Whether the law reads the stiffness of its springs, `explicit.Samples.contact_stiffness`."""
    carries_tension: bool = False
    """Whether the platen can pull a node."""
    slides: bool = False
    """Whether a node can slip along the platen while it is pressed on it."""
    remembers_slip: bool = False
    """Whether the law stores a slip of each node from step to step."""

    def kernel_function(self, precision: Precision) -> Any:
        """The Warp function of the law.

        ``resolve(touch) -> (velocity, status, slip)`` takes a `touch_struct` and returns the admissible
        velocity of the node [m/s], its status at the platen (`FREE`, `TOUCHED`, `RELEASED`; the solver sets
        `TOUCHED` for a node of the side) and its new slip [m]. The node would pass through the platen where
        ``normal * (v_y - target) < 0``. A velocity changed by dv is an impulse ``density * dv`` per area of
        the undeformed surface, a mean stress ``density * dv / interval``.
        """
        ...


@cache
def touch_struct(precision: Precision) -> Any:
    """Generate the struct with the contact data of a node, the argument of a law.

    ``v_r``, ``v_y``: predicted velocity [m/s]. ``target``: axial velocity that puts the node exactly on the
    platen at the end of the step [m/s]. ``normal``: the platen's outward normal, +1 transmission, -1 flyer.
    ``status``: `FREE`, `TOUCHED`, `RELEASED`. ``slip``: the slip that the law returned in the previous step;
    0 at first and after a step without contact [m]. ``friction``, ``release_stress`` [Pa], ``stiffness``
    [Pa/m]: the sample's parameters. ``density``: mass of the node over its undeformed contact area [kg/m^2].
    ``interval``: time over which the forces changed the velocity [s]; ``step``: time over which the velocity
    acts [s].
    """
    real = precision.real

    @wp.struct
    class Touch:
        v_r: real
        v_y: real
        target: real
        normal: real
        status: int
        slip: real
        friction: real
        release_stress: real
        stiffness: real
        density: real
        interval: real
        step: real

    return Touch
