"""The deformation of every element of a mesh, from the positions of its nodes; for pictures and checks."""

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.geometry import element_geometry
from explicit.mesh import Mesh


def deformation_gradient(mesh: Mesh, nodes: ArrayLike) -> FloatArray:
    """Volume-averaged deformation gradient of each element, the one at the stress point of "one_point".

    Parameters
    ----------
    mesh
        The undeformed mesh.
    nodes
        Positions (r, y) of its nodes [m], shape [..., n_nodes, 2].

    Returns
    -------
    F
        In (r, y, hoop) [-], shape [..., n_elements, 3, 3].

    Raises
    ------
    ValueError
        If the nodes are not those of the mesh.
    """
    x = np.asarray(nodes, dtype=float)
    if x.shape[-2:] != (mesh.n_nodes, 2):
        raise ValueError(f"nodes must have shape [..., {mesh.n_nodes}, 2], got {list(x.shape)}")
    shape = element_geometry(mesh)
    corners = x[..., mesh.quads, :]
    F = np.zeros((*corners.shape[:-2], 3, 3))
    for column, gradient in enumerate((shape.gradient_r, shape.gradient_y)):
        F[..., :2, column] = np.einsum("...eai,ea->...ei", corners, gradient)
    F[..., 2, 2] = np.einsum("...ea,ea->...e", corners[..., 0], shape.hoop)
    return F
