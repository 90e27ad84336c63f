"""Elements that are folded over: corners turned inside out while their stress points are not."""

import numpy as np

from explicit.arrays import FloatArray
from explicit.mesh import Mesh


def corner_areas(mesh: Mesh, nodes: FloatArray) -> FloatArray:
    """Area that the sides of an element span at each corner, over the undeformed one [-].

    A simulation ends where a stress point is turned inside out. A corner can be so long before: the one-point
    element has no stress point there, and those of full integration lie inside.

    Parameters
    ----------
    mesh
        Their mesh.
    nodes
        Positions (r, y) [m], shape [..., n_nodes, 2].

    Returns
    -------
    ndarray
        Below 0 where a corner is turned inside out, shape [..., n_elements, 4].
    """
    return np.asarray(_spanned(mesh, nodes) / _spanned(mesh, mesh.nodes))


def _spanned(mesh: Mesh, nodes: FloatArray) -> FloatArray:
    corner = nodes[..., mesh.quads, :]
    ahead = np.roll(corner, -1, axis=-2) - corner
    behind = np.roll(corner, 1, axis=-2) - corner
    return np.asarray(ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0])
