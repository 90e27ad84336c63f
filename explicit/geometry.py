"""Constants of the one-point axisymmetric quadrilateral, integrated once per mesh.

The element is the uniform-strain quadrilateral of Flanagan and Belytschko (1981), carried to axial
symmetry with *volume-averaged* gradients: the deformation gradient of an element is the volume
average of the bilinear field's. It is exact for every homogeneous deformation, and its nodal forces
pass the patch test to round-off, also on the axis. All integrals are over a full turn (2 pi R dA).
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from explicit.arrays import FloatArray
from explicit.mesh import Mesh

_HOURGLASS = np.array([1.0, -1.0, 1.0, -1.0])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class ElementGeometry:
    """Reference-configuration constants of every element."""

    volume: FloatArray
    """Volume of the ring [m^3], shape [n_elements]."""
    gradient_r: FloatArray
    """Volume-averaged dN/dR of each corner [1/m], shape [n_elements, 4]."""
    gradient_y: FloatArray
    """Volume-averaged dN/dY of each corner [1/m], shape [n_elements, 4]."""
    hoop: FloatArray
    """Volume-averaged N/R of each corner [1/m], shape [n_elements, 4]."""
    gamma: FloatArray
    """Hourglass vector: orthogonal to every linear field, 1 on the pattern (1, -1, 1, -1) [-],
    shape [n_elements, 4]."""
    hourglass_r: FloatArray
    """Hourglass stiffness of radial motion per unit shear modulus [m], shape [n_elements]."""
    hourglass_y: FloatArray
    """Hourglass stiffness of axial motion per unit shear modulus [m], shape [n_elements]."""
    corner_volume: FloatArray
    """Row-sum share of the volume at each corner [m^3], shape [n_elements, 4]."""


_KNOWN: WeakKeyDictionary[Mesh, ElementGeometry] = WeakKeyDictionary()


def element_geometry(mesh: Mesh) -> ElementGeometry:
    """Integrate the element constants of a mesh with 3 x 3 Gauss points, once.

    Raises
    ------
    ValueError
        If an element has a non-positive Jacobian; the message names it.
    """
    if mesh not in _KNOWN:
        _KNOWN[mesh] = _integrate(mesh)
    return _KNOWN[mesh]


def _integrate(mesh: Mesh) -> ElementGeometry:
    points, weights = np.polynomial.legendre.leggauss(3)
    corners = mesh.nodes[mesh.quads]
    n = mesh.n_elements
    volume = np.zeros(n)
    gradient = np.zeros((n, 4, 2))
    hoop = np.zeros((n, 4))
    corner_volume = np.zeros((n, 4))
    pattern_r = np.zeros(n)
    pattern_y = np.zeros(n)
    for xi, w_xi in zip(points, weights, strict=True):
        for eta, w_eta in zip(points, weights, strict=True):
            shape = 0.25 * (1.0 + xi * _CORNERS[:, 0]) * (1.0 + eta * _CORNERS[:, 1])
            local = 0.25 * np.column_stack(
                [
                    _CORNERS[:, 0] * (1.0 + eta * _CORNERS[:, 1]),
                    _CORNERS[:, 1] * (1.0 + xi * _CORNERS[:, 0]),
                ]
            )
            jacobian = np.einsum("ai,eaj->eij", local, corners)
            det = np.linalg.det(jacobian)
            if (det <= 0.0).any():
                bad = int(np.argmax(det <= 0.0))
                raise ValueError(
                    f"element {bad} has Jacobian {det[bad]:.3g} <= 0: number its corners counter-clockwise"
                )
            slope = np.einsum("eij,aj->eai", np.linalg.inv(jacobian), local)
            radius = corners[:, :, 0] @ shape
            dv = 2.0 * np.pi * radius * det * w_xi * w_eta
            volume += dv
            gradient += slope * dv[:, None, None]
            hoop += shape / radius[:, None] * dv[:, None]
            corner_volume += shape * dv[:, None]
            # The bilinear field of the pattern (1, -1, 1, -1): its gradient energy is what one point misses.
            pattern = np.einsum("a,eai->ei", _HOURGLASS, slope)
            value = float(_HOURGLASS @ shape)
            squared = (pattern**2).sum(axis=1)
            pattern_y += squared * dv
            pattern_r += (squared + (value / radius) ** 2) * dv
    gradient /= volume[:, None, None]
    hoop /= volume[:, None]
    drift = np.einsum("a,eai->ei", _HOURGLASS, corners)
    gamma = 0.25 * (_HOURGLASS - np.einsum("ei,eai->ea", drift, gradient))
    return ElementGeometry(
        volume=volume,
        gradient_r=gradient[:, :, 0],
        gradient_y=gradient[:, :, 1],
        hoop=hoop,
        gamma=gamma,
        hourglass_r=pattern_r,
        hourglass_y=pattern_y,
        corner_volume=corner_volume,
    )
