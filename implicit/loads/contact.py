r"""Frictionless contact of points with a rigid plane, by augmented Lagrange multipliers.

A point at the distance g above the plane is pushed out with max(0, lam - k g) (Simo and Laursen 1992). After
each equilibrium lam takes that value, until no point is deeper than the tolerance; the forces are then those
of an impenetrable plane, whatever the stiffness k.
"""

import numpy as np

from explicit.arrays import FloatArray, IntArray
from implicit.conditions import RigidPlane, unit
from implicit.model import Model

STIFFNESS = 500.0
"""Penalty of a point, in shear moduli times the mean spacing of the points in the body."""
HELD = 1e5
"""Factor of the stiffness with which points in contact are held where the solution is differentiated [-]."""


class PlaneContact:
    """The contact of one set with one plane."""

    def __init__(self, model: Model, plane: RigidPlane) -> None:
        if len(plane.normal) != model.dimension or len(plane.position) != model.dimension:
            raise ValueError(f"normal and position of {plane} must have {model.dimension} components")
        if plane.stiffness is not None and not plane.stiffness > 0.0:
            raise ValueError(f"stiffness must be > 0 N/m, got {plane.stiffness}")
        if not 0.0 < plane.tolerance < 1.0:
            raise ValueError(f"tolerance must be in (0, 1), got {plane.tolerance}")
        self.plane, self.model = plane, model
        self.normal = unit(plane.normal)
        self.nodes = model.mesh.nodes(plane.where)
        size = np.ptp(model.mesh.points, axis=0)
        self.depth = plane.tolerance * float(size.max())
        spacing = float(size.prod() / len(model.mesh.points)) ** (1.0 / model.dimension)
        across = spacing if model.kinematics == "3d" else _across(model)
        usual = STIFFNESS * model.solid.shear_modulus * across
        self.stiffness = usual if plane.stiffness is None else plane.stiffness
        self.cells = _cell_with(model.mesh.cells, self.nodes)

    def gaps(self, u: FloatArray, travel: float) -> FloatArray:
        """Distances of the points above the plane [m], shape [p]."""
        x = (self.model.mesh.points + u.reshape(-1, self.model.dimension))[self.nodes]
        return np.asarray((x - np.asarray(self.plane.position)) @ self.normal - travel)

    def pushes(self, u: FloatArray, travel: float, multipliers: FloatArray) -> FloatArray:
        """Forces on the points along the normal [N], shape [p]."""
        return np.maximum(0.0, multipliers - self.stiffness * self.gaps(u, travel))

    def forces(self, pushes: FloatArray) -> FloatArray:
        """Forces of all points [N], shape [n d]."""
        total = np.zeros(self.model.mesh.points.shape)
        np.add.at(total, self.nodes, pushes[:, None] * self.normal)
        return total.reshape(-1)

    def add_stiffness(self, elements: FloatArray, pushes: FloatArray, *, held: bool) -> None:
        """Add the stiffness of the points in contact to that of a cell of each, in place."""
        d = self.model.dimension
        block = self.stiffness * (HELD if held else 1.0) * np.outer(self.normal, self.normal)
        for node, cell in zip(self.nodes[pushes > 0.0], self.cells[pushes > 0.0], strict=True):
            at = d * int(np.flatnonzero(self.model.mesh.cells[cell] == node)[0])
            elements[cell, at : at + d, at : at + d] += block


def _across(model: Model) -> float:
    """Length of a point's share in the third direction [m]."""
    if model.kinematics == "axisymmetric":
        return float(np.pi * np.ptp(model.mesh.points[:, 0]))
    return model.thickness


def _cell_with(cells: IntArray, nodes: IntArray) -> IntArray:
    """A cell that has each point."""
    of = np.full(int(cells.max()) + 1, -1)
    of[cells.ravel()] = np.repeat(np.arange(len(cells)), cells.shape[1])
    if (of[nodes] < 0).any():
        raise ValueError("a point of the contact belongs to no cell")
    return np.asarray(of[nodes])
