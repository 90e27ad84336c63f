"""Structured meshes, their sets, and those of PyVista."""

import numpy as np
import pytest

from kolsky.equilibrium.elements import ELEMENTS
from kolsky.equilibrium.meshes import Mesh, box, cross, dog_bone, from_pyvista, rectangle


def area(mesh: Mesh) -> float:
    points, weights = mesh.element.rule(mesh.element.gauss)
    jacobian = np.einsum("cki,gkj->cgij", mesh.points[mesh.cells], mesh.element.gradients(points))
    return float((np.linalg.det(jacobian) * weights).sum())


def test_sides_of_a_box():
    mesh = box((2.0, 1.0, 3.0), (2, 1, 1), kind="hex8")
    assert (mesh.points[mesh.nodes("right"), 0] == 2.0).all()
    assert len(mesh.nodes("right")) == 4
    assert len(mesh.nodes("front")) == len(mesh.nodes("bottom")) == 6
    more = mesh.with_set("edge", lambda x: (x[:, 0] == 0.0) & (x[:, 1] == 0.0))
    assert len(more.nodes("edge")) == 2
    with pytest.raises(ValueError, match="has no set 'roof'"):
        mesh.nodes("roof")
    with pytest.raises(ValueError, match="would be empty"):
        mesh.with_set("none", lambda x: x[:, 0] > 9.0)


def test_a_cross_lacks_its_corners():
    mesh = cross((4.0, 4.0), (8, 8), (3, 3), kind="quad9")
    assert area(mesh) == pytest.approx(16.0 - 4 * 1.5**2)
    paper = cross((0.1, 0.1, 0.004), (40, 40, 2), (15, 15), kind="hex8")
    assert len(paper.cells) == 1400  # Schumacher and others 2020, Section V
    with pytest.raises(ValueError, match="corner must leave cells"):
        cross((1.0, 1.0), (4, 4), (2, 1), kind="quad4")


def test_a_dog_bone_has_its_waist():
    mesh = dog_bone((10.0, 4.0), (20, 4), waist=2.0, straight=4.0, kind="quad9")
    middle = mesh.points[np.abs(mesh.points[:, 0] - 5.0) < 1e-9, 1]
    ends = mesh.points[mesh.nodes("left"), 1]
    assert np.ptp(middle) == pytest.approx(2.0)
    assert np.ptp(ends) == pytest.approx(4.0)
    # width falls by a cosine over both ramps: the mean of 2 and 4
    assert area(mesh) == pytest.approx(4.0 * 2.0 + 6.0 * 3.0, rel=1e-3)
    for wrong in ({"waist": 5.0, "straight": 1.0}, {"waist": 1.0, "straight": 10.0}):
        with pytest.raises(ValueError, match="must be in"):
            dog_bone((10.0, 4.0), (4, 2), kind="quad4", **wrong)


@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_through_pyvista_and_back(name):
    pv = pytest.importorskip("pyvista")
    item = ELEMENTS[name]
    mesh = box((1.0, 2.0, 3.0)[: item.dimension], (2, 1, 1)[: item.dimension], kind=name)
    points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - item.dimension))])
    grid = pv.UnstructuredGrid({item.vtk: mesh.cells}, points)
    grid.point_data["set:left"] = np.isin(np.arange(len(points)), mesh.nodes("left"))
    again = from_pyvista(grid)
    np.testing.assert_array_equal(again.cells, mesh.cells)
    np.testing.assert_allclose(again.points, mesh.points)
    np.testing.assert_array_equal(again.nodes("left"), mesh.nodes("left"))
    size = np.asarray(grid.compute_cell_sizes()["Volume" if item.dimension == 3 else "Area"])
    if name not in ("hex27", "quad9"):  # VTK's own sizes of these are of their corners or missing
        assert size.sum() == pytest.approx(area(mesh), rel=1e-6)


def test_what_a_mesh_refuses():
    points, cells = np.zeros((4, 2)), np.array([[0, 1, 2, 3]])
    with pytest.raises(ValueError, match="have 9 points"):
        Mesh(points, cells, "quad9")
    with pytest.raises(ValueError, match=r"shape \[n, 3\]"):
        Mesh(points, np.array([[0, 1, 2, 3]]), "tet4")
    with pytest.raises(ValueError, match=r"in \[0, 3\]"):
        Mesh(points, cells + 1, "quad4")
    with pytest.raises(ValueError, match="finite"):
        Mesh(points * np.nan, cells, "quad4")
    with pytest.raises(ValueError, match="size must be > 0"):
        rectangle((1.0, 0.0), (1, 1))
    with pytest.raises(ValueError, match="needs 3 edge lengths"):
        box((1.0, 1.0), (1, 1))


def test_a_grid_of_two_types_is_refused():
    pv = pytest.importorskip("pyvista")
    cells = np.array([[0, 1, 2, 3]])
    mixed = pv.UnstructuredGrid(
        {9: cells, 5: np.array([[0, 1, 2]])}, np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    )
    with pytest.raises(ValueError, match="of one type"):
        from_pyvista(mixed)
