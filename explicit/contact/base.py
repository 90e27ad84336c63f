"""The door for a contact law between a node and a rigid platen.

Contact is kinematic ("hard"): after the unconstrained update of a step each node on a platen is moved
onto it exactly, and the impulse that does so is the contact force. A law only decides which part of
the predicted velocity survives.
"""

from typing import Any, Protocol

from explicit.precision import Precision


class ContactLaw(Protocol):
    """What the solver needs of a contact law."""

    name: str
    """Name at the API."""
    needs_friction: bool
    """Whether the law reads the friction coefficient."""

    def kernel_function(self, precision: Precision) -> Any:
        """The Warp function of the law.

        ``resolve(v_r, v_y, target, normal, touched, friction) -> vec2`` takes the predicted velocity of
        a node [m/s], the axial velocity that puts it exactly on the platen at the end of the step, the
        platen's outward normal (+1 transmission, -1 flyer), whether the node has touched this platen
        before (0 or 1) and Coulomb's coefficient, and returns the admissible velocity. The node would
        pass through the platen where ``normal * (v_y - target) < 0``.
        """
        ...
