"""Gradients and volumes of the Gauss points in the undeformed mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from explicit.arrays import FloatArray
from implicit.meshes import Mesh


@dataclass(frozen=True)
class Geometry:
    """What an element's integrals need of the undeformed mesh."""

    E: FloatArray
    """dN/dX [1/m]; in an axisymmetric model with N / R as a third column, shape [m, g, k, D]."""
    volumes: FloatArray
    """Volume of each Gauss point [m3], shape [m, g]."""
    values: FloatArray
    """Shape functions at the Gauss points [-], shape [g, k]."""
    points: FloatArray
    """The Gauss points in the element's coordinates [-], shape [g, d]."""

    @cached_property
    def T(self) -> FloatArray:
        """The gradients with the points of the element last [1/m], shape [m, g, D, k]."""
        return np.ascontiguousarray(np.swapaxes(self.E, 2, 3))

    @property
    def places(self) -> int:
        """Number of Gauss points of the mesh."""
        return int(self.volumes.size)


def geometry(mesh: Mesh, *, kinematics: str, thickness: float, gauss: int | None) -> Geometry:
    """Evaluate the gradients.

    Raises
    ------
    ValueError
        If an element is inside out, or a Gauss point lies on the axis of revolution.
    """
    element = mesh.element
    points, weights = element.rule(element.gauss if gauss is None else gauss)
    local, values = element.gradients(points), element.values(points)
    corners = mesh.points[mesh.cells]
    jacobian = np.einsum("mki,gkj->mgij", corners, local, optimize=True)
    determinant = np.linalg.det(jacobian)
    if (determinant <= 0.0).any():
        worst = int(np.argmin(determinant.min(axis=1)))
        raise ValueError(
            f"cell {worst} of {mesh.kind} is inside out or flat (det = {determinant[worst].min():.3g} m^d); "
            "check the order of its points"
        )
    E = np.matmul(local[None], np.linalg.inv(jacobian))
    volumes = determinant * weights
    if kinematics == "axisymmetric":
        radius = np.einsum("gk,mk->mg", values, corners[..., 0])
        if (radius <= 0.0).any():
            raise ValueError("a Gauss point lies on the axis of revolution")
        E = np.concatenate([E, (values[None] / radius[..., None])[..., None]], axis=-1)
        volumes = volumes * (2.0 * np.pi * radius)
    elif mesh.dimension == 2:
        volumes = volumes * thickness
    return Geometry(np.ascontiguousarray(E), np.ascontiguousarray(volumes), values, points)
