"""Reference-configuration constants of the four-node quadrilateral at its 2 x 2 Gauss points.

Over a full turn (2 pi R dA) the integrands of the weak form, N R and its derivatives times the Jacobian,
are of degree 2 in each local coordinate; two points a direction integrate degree 3, so these sums are
exact on distorted elements and on the axis as well, where no point lies.
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from explicit.mesh import Mesh

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class GaussPoints:
    """Constants of the four points of every element, point 0 nearest to corner 0 and so on."""

    volume: FloatArray
    """Volume that each point stands for [m^3], shape [n_elements, 4 points]."""
    gradient_r: FloatArray
    """dN/dR of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    gradient_y: FloatArray
    """dN/dY of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    hoop: FloatArray
    """N/R of each corner [1/m], shape [n_elements, 4 points, 4 corners]."""
    interpolation: FloatArray
    """N of each corner [-], shape [4 points, 4 corners]."""


def gauss_points(mesh: Mesh) -> GaussPoints:
    """Evaluate the shape functions of every element at its Gauss points.

    Raises
    ------
    ValueError
        If an element has a non-positive Jacobian at a point; the message names it.
    """
    corners = mesh.nodes[mesh.quads]
    points = _CORNERS / np.sqrt(3.0)
    one_r = 1.0 + points[:, None, 0] * _CORNERS[None, :, 0]
    one_y = 1.0 + points[:, None, 1] * _CORNERS[None, :, 1]
    shape = 0.25 * one_r * one_y
    local = 0.25 * np.stack([_CORNERS[:, 0] * one_y, _CORNERS[:, 1] * one_r], axis=-1)
    jacobian = np.einsum("gai,eaj->egij", local, corners)
    det = np.linalg.det(jacobian)
    if (det <= 0.0).any():
        bad = int(np.argmax((det <= 0.0).any(axis=1)))
        raise ValueError(
            f"element {bad} has Jacobian {det[bad].min():.3g} <= 0: number its corners counter-clockwise"
        )
    slope = np.einsum("egij,gaj->egai", np.linalg.inv(jacobian), local)
    radius = np.einsum("ga,ea->eg", shape, corners[:, :, 0])
    return GaussPoints(
        volume=2.0 * np.pi * radius * det,
        gradient_r=slope[..., 0],
        gradient_y=slope[..., 1],
        hoop=shape[None] / radius[..., None],
        interpolation=shape,
    )
