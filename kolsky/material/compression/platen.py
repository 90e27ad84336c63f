r"""Contact of face and side with a flat rigid platen, point by point: no penetration, stick, Coulomb's law.

A point (`kolsky.material.compression.contact_points`) with the undeformed area :math:`A` that lies :math:`g`
inside the platen feels :math:`N = N_0 + k A g` if that is positive, with :math:`N_0` its force at the last
equilibrium (the augmented Lagrangian, one pass a step): what is left of the overclosure is that of one step.
Across, :math:`T = -k A (x - a)` from its anchor :math:`a`, at most :math:`f N` in size, where the anchor then
follows (return mapping; Wriggers, Computational Contact Mechanics, 2006, ch. 10). The penalty :math:`k` is
`STIFF` times the specimen's shear modulus over the smallest element.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kolsky.base.arrays import FloatArray
from kolsky.material.compression.contact_points import ContactPoints
from kolsky.material.compression.mesh import HalfCylinder

STIFF = 200.0
"""Penalty over shear modulus and smallest element [-]."""


@dataclass(frozen=True)
class Grip:
    """What each contact point remembers from the last equilibrium."""

    touching: NDArray[np.bool_]
    """True where a point lay on the platen, shape [n_contact]."""
    anchor: FloatArray
    """Radius at which its tangential force is zero [m], shape [n_contact]."""
    anchor_change: FloatArray
    """Derivatives of the anchors by the parameters, shape [n_contact, n_parameters]."""
    normal: FloatArray
    """Force pressing the point down [N], shape [n_contact]."""
    normal_change: FloatArray
    """Its derivatives by the parameters, shape [n_contact, n_parameters]."""


@dataclass(frozen=True)
class ContactForces:
    """Forces on the contact points and their derivatives."""

    normal: FloatArray
    """Force pressing the point down [N], >= 0, shape [n_contact]."""
    tangential: FloatArray
    """Radial force [N], shape [n_contact]."""
    stiffness: FloatArray
    """d(radial, axial force on the point) / d(r, z), row by row [N/m], shape [n_contact, 2, 2]."""
    by_anchor: FloatArray
    """d(radial force)/d(anchor) [N/m], shape [n_contact]."""
    by_normal: FloatArray
    """d(radial force)/d(normal force) [-], shape [n_contact]."""
    by_friction: FloatArray
    """d(radial force)/d(coefficient) [N], shape [n_contact]."""
    slipping: NDArray[np.bool_]
    """True where Coulomb's limit is reached, shape [n_contact]."""


@dataclass(frozen=True)
class Platen:
    """A platen that comes down on a body."""

    mesh: HalfCylinder
    """The body."""
    bonded: bool
    """True if the face is glued; then only the side can land, and sticks."""
    friction: float
    """Coulomb's coefficient [-]; infinity: no slip."""
    modulus: float
    """Shear modulus that the penalty is measured in [Pa]."""

    @cached_property
    def points(self) -> ContactPoints:
        """Points that can touch."""
        return ContactPoints.of(self.mesh, face=not self.bonded)

    @cached_property
    def penalty(self) -> FloatArray:
        """k A of each point [N/m], shape [n_contact]."""
        r, z = self.mesh.nodes.T
        smallest = min(np.diff(np.unique(r)).min(), np.diff(np.unique(z)).min()) * 2.0
        return np.asarray(STIFF * self.modulus / smallest * self.points.areas)

    def at_rest(self, n_parameters: int) -> Grip:
        """Before the platen moves: the face lies on it."""
        r, z = self.points.at(self.mesh.nodes).T
        nothing = np.zeros((r.size, n_parameters))
        touching = z >= self.mesh.height * (1.0 - 1e-9)
        return Grip(touching, r, nothing, np.zeros(r.size), nothing)

    def forces(self, x: FloatArray, level: float, grip: Grip) -> ContactForces:
        """Forces at the nodes' places x, shape [n_nodes, 2], under a platen at a height [m]."""
        r, z = self.points.at(x).T
        k = self.penalty
        normal = np.maximum(grip.normal + k * (z - level), 0.0)
        pressed = normal > 0.0
        trial = np.where(pressed & grip.touching, -k * (r - grip.anchor), 0.0)
        limit = self.friction * normal if np.isfinite(self.friction) else np.full(k.size, np.inf)
        slipping = np.abs(trial) > limit
        tangential = np.where(slipping, np.sign(trial) * np.where(slipping, limit, 0.0), trial)
        stuck = pressed & grip.touching & ~slipping
        stiffness = np.zeros((k.size, 2, 2))
        stiffness[:, 1, 1] = np.where(pressed, -k, 0.0)
        stiffness[:, 0, 0] = np.where(stuck, -k, 0.0)
        sign = np.where(slipping, np.sign(trial), 0.0)
        if np.isfinite(self.friction):
            stiffness[:, 0, 1] = np.where(pressed, sign * self.friction * k, 0.0)
        return ContactForces(
            normal,
            tangential,
            stiffness,
            np.where(stuck, k, 0.0),
            np.where(slipping, sign * self.friction, 0.0) if np.isfinite(self.friction) else 0.0 * sign,
            sign * normal,
            slipping & pressed,
        )

    def gripped(
        self,
        x: FloatArray,
        found: ContactForces,
        grip: Grip,
        moved: FloatArray,
        down: FloatArray,
        slid: FloatArray,
    ) -> Grip:
        """What the points remember of an equilibrium.

        `moved`, `down` and `slid` are the derivatives of the points' radii, heights and tangential forces by
        the parameters, shape [n_contact, n_parameters].
        """
        r, k = self.points.at(x)[:, 0], self.penalty
        touching = found.normal > 0.0
        pressing = np.where(touching[:, None], grip.normal_change + k[:, None] * down, 0.0)
        stuck = touching & grip.touching & ~found.slipping
        anchor = np.where(stuck, grip.anchor, r + found.tangential / k)
        change = np.where(stuck[:, None], grip.anchor_change, moved + slid / k[:, None])
        return Grip(touching, anchor, change, found.normal, pressing)
