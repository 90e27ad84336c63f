"""Points of contact: areas, interpolation, forces shared among nodes."""

import numpy as np
import pytest

from kolsky.material.end_friction.compression import ContactPoints
from kolsky.material.end_friction.cylinder import HalfCylinder

MESH = HalfCylinder(4e-3, 3e-3, 3, 4)


def test_the_side_has_its_area_and_its_heights():
    points = ContactPoints.of(MESH, face=False)
    assert points.areas.sum() == pytest.approx(2.0 * np.pi * 4e-3 * 3e-3)
    r, z = points.at(MESH.nodes).T
    np.testing.assert_allclose(r, 4e-3)
    # Five Gauss points integrate the heights of a cylinder's side: its middle.
    assert points.areas @ z / points.areas.sum() == pytest.approx(1.5e-3)
    assert z.max() < 3e-3


def test_the_face_touches_at_its_nodes():
    side, both = ContactPoints.of(MESH, face=False), ContactPoints.of(MESH, face=True)
    n = side.areas.size
    np.testing.assert_allclose(both.at(MESH.nodes)[n:], MESH.nodes[MESH.face])


def test_forces_keep_their_sum_and_their_work():
    points, rng = ContactPoints.of(MESH, face=True), np.random.default_rng(2)
    force, moved = rng.standard_normal(points.areas.size), rng.standard_normal(len(MESH.nodes))
    nodal = points.shared(force)
    assert nodal.sum() == pytest.approx(force.sum())
    assert nodal @ moved == pytest.approx(force @ points.at(moved))
    first, second, product = points.pairs
    # A stiffness of one at every point, by pairs of nodes and by the interpolation twice.
    whole = np.zeros((len(MESH.nodes),) * 2)
    np.add.at(whole, (first, second), product)
    np.testing.assert_allclose(whole @ moved, points.shared(points.at(moved)), atol=1e-12)
