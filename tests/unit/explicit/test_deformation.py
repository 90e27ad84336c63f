"""The deformation of elements from the positions of their nodes."""

import numpy as np
import pytest

import explicit
from explicit.mesh import deformation_gradient, element_geometry

MESH = explicit.cylinder(5e-3, 6e-3, n_radial=4, n_axial=5)


def test_a_uniform_stretch_is_found_in_every_element() -> None:
    nodes = np.stack([MESH.nodes * [1.2, 0.7], MESH.nodes])
    F = deformation_gradient(MESH, nodes)
    assert F.shape == (2, MESH.n_elements, 3, 3)
    np.testing.assert_allclose(F[0], np.broadcast_to(np.diag([1.2, 0.7, 1.2]), F[0].shape), atol=1e-13)
    np.testing.assert_allclose(F[1], np.broadcast_to(np.eye(3), F[1].shape), atol=1e-13)


def test_a_shear_along_the_axis() -> None:
    # y = Y + g R: the only other entry is dy/dR; round-off.
    nodes = MESH.nodes + np.outer(MESH.nodes[:, 0], [0.0, 0.3])
    expected = np.eye(3)
    expected[1, 0] = 0.3
    F = deformation_gradient(MESH, nodes)
    np.testing.assert_allclose(F, np.broadcast_to(expected, F.shape), atol=1e-13)


def test_changes_of_volume_add_up() -> None:
    rng = np.random.default_rng(1)
    nodes = MESH.nodes * (1.0 + 1e-3 * rng.standard_normal(MESH.nodes.shape))
    F = deformation_gradient(MESH, nodes)
    moved = explicit.Mesh(nodes, MESH.quads, MESH.lower_face, MESH.upper_face, MESH.side)
    # To first order the sum of (det F - 1) dV is the change of volume of the straight-sided body; the rest is
    # of second order in 1e-3.
    volume = element_geometry(MESH).volume
    change = float(((np.linalg.det(F) - 1.0) * volume).sum())
    factor = MESH.volume / volume.sum()  # elements may count a radian or a turn
    assert factor * change == pytest.approx(moved.volume - MESH.volume, abs=2e-5 * MESH.volume)


def test_other_nodes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"nodes must have shape \[..., 30, 2\]"):
        deformation_gradient(MESH, np.zeros((29, 2)))
