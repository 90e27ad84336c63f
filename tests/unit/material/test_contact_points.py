"""Points of contact: areas, interpolation, forces shared among nodes."""

import numpy as np
import pytest

from kolsky.material.end_friction.compression import ContactPoints
from kolsky.material.end_friction.cylinder import half_cylinder

MESH = half_cylinder(4e-3, 3e-3, 3, 4)


def test_the_side_has_its_area_and_its_heights():
    points = ContactPoints.of(MESH, face=False)
    assert points.areas.sum() == pytest.approx(2.0 * np.pi * 4e-3 * 3e-3)
    r, z = points.at(MESH.points).T
    np.testing.assert_allclose(r, 4e-3)
    # Five Gauss points integrate the heights of a cylinder's side: its middle.
    assert points.areas @ z / points.areas.sum() == pytest.approx(1.5e-3)
    assert z.max() < 3e-3


def test_the_face_touches_at_its_nodes():
    side, both = ContactPoints.of(MESH, face=False), ContactPoints.of(MESH, face=True)
    n, top = side.areas.size, MESH.nodes("top")
    np.testing.assert_allclose(both.at(MESH.points)[n:], MESH.points[top])
    # Rings between the middles of neighbouring nodes; the edge has half of the side's last spacing too.
    r, z = MESH.points[top, 0], MESH.points[MESH.nodes("right"), 1]
    assert both.areas[n + 1] == pytest.approx(2.0 * np.pi * r[1] * 0.5 * (r[2] - r[0]))
    edge = 2.0 * np.pi * r[-1] * 0.5 * (r[-1] - r[-2] + z[-1] - z[-2])
    assert both.areas[-1] == pytest.approx(edge)


def test_forces_keep_their_sum_and_their_work():
    points, rng = ContactPoints.of(MESH, face=True), np.random.default_rng(2)
    force, moved = rng.standard_normal(points.areas.size), rng.standard_normal(len(MESH.points))
    nodal = points.shared(force)
    assert nodal.sum() == pytest.approx(force.sum())
    assert nodal @ moved == pytest.approx(force @ points.at(moved))
    # A radial stiffness of one at every point, by elements and by the interpolation twice.
    blocks = np.tile([[1.0, 0.0], [0.0, 0.0]], (points.areas.size, 1, 1))
    elements = points.added(np.zeros((len(MESH.cells), 18, 18)), blocks)
    whole = np.zeros(len(MESH.points))
    np.add.at(whole, MESH.cells, np.einsum("eab,eb->ea", elements[:, 0::2, 0::2], moved[MESH.cells]))
    np.testing.assert_allclose(whole, points.shared(points.at(moved)), atol=1e-12)
    assert not elements[:, 1::2].any()
    assert not elements[:, :, 1::2].any()
