"""SPEC.toml of an actuator: both readings of D1, meshes of files, refusals."""

from pathlib import Path

import numpy as np
import pytest
import pyvista

from kolsky.base.errors import InputError
from kolsky.base.units import UnitError
from kolsky.bodies.actuator_bending import schedule
from kolsky.bodies.actuator_model import Pneunet
from kolsky.bodies.actuator_reading import read_actuator, volume_reading
from kolsky.equilibrium.model import SelfContact

SPEC = """
pressures = ["0.1 bar", "0.4 bar"]
[geometry]
{geometry}
[material]
constants = {{ mu = "218 kPa" }}
D1 = "1.150 1/MPa"
density = "1.02 g/cm^3"
[gravity]
downward = {gravity}
"""
SMALL = 'chambers = 2\nelement = "hex8"'


def _spec(folder: Path, geometry: str = SMALL, gravity: str = "[0.0, 0.0, -9.81]", **more: str) -> Path:
    text = SPEC.format(geometry=geometry, gravity=gravity)
    for old, new in more.items():
        text = text.replace(old.replace("_", " "), new)
    path = folder / "spec.toml"
    path.write_text(text)
    return path


def test_the_unit_says_which_d1_is_meant() -> None:
    # U = (J - 1)^2 / D1 has U'' = 2 / D1; U = D1 (J - 1)^2 has U'' = 2 D1
    assert volume_reading("1.150 1/MPa") == pytest.approx(2e6 / 1.150)
    assert volume_reading("1.150 MPa") == pytest.approx(2.3e6)
    with pytest.raises(UnitError):
        volume_reading("1.150")
    with pytest.raises(UnitError, match="not > 0"):
        volume_reading("-1 1/MPa")


def test_what_is_declared_is_used(tmp_path: Path) -> None:
    read = read_actuator(_spec(tmp_path))
    assert read.actuator.solid.parameters() == pytest.approx([218e3, 2e6 / 1.150])
    assert read.actuator.density == pytest.approx(1020.0)
    assert read.shape == Pneunet(chambers=2, element="hex8")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"geometry": 'chambers = 2\nwall = "0 mm"'}, "geometry.wall"),
        ({"geometry": 'mesh = "a.vtu"\nwall = "2 mm"\nmesh_unit = "mm"'}, "has no effect with a mesh"),
        ({"gravity": "[0.0, 9.81, 0.0]"}, "half = false"),
        ({"geometry": 'channel = ["30 mm", "2 mm"]'}, "channel's width"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, wrong: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_actuator(_spec(tmp_path, **wrong))


def _vtu(path: Path, mesh, sets) -> None:
    k = mesh.cells.shape[1]
    cells = np.column_stack([np.full(len(mesh.cells), k), mesh.cells]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(mesh.cells), mesh.element.vtk), 1e3 * mesh.points)
    for name in sets:
        mask = np.zeros(len(mesh.points), dtype=np.uint8)
        mask[mesh.sets[name]] = 1
        grid.point_data[f"set:{name}"] = mask
    grid.save(path)


def test_a_vtu_file_is_the_same_body(tmp_path: Path) -> None:
    mesh = Pneunet(chambers=1, element="tet10").mesh
    _vtu(tmp_path / "finger.vtu", mesh, ["clamp", "mirror", "cavity", "tip", "origin"])
    read = read_actuator(_spec(tmp_path, 'mesh = "finger.vtu"\nmesh_unit = "mm"'))
    assert read.actuator.mesh.points == pytest.approx(mesh.points)
    assert read.actuator.mesh.kind == "tet10"
    assert np.array_equal(read.actuator.mesh.nodes("cavity"), mesh.nodes("cavity"))
    assert len(read.inputs) == 2
    _vtu(tmp_path / "finger.vtu", mesh, ["clamp", "cavity", "tip"])
    with pytest.raises(InputError, match="no set 'origin'"):
        read_actuator(_spec(tmp_path, 'mesh = "finger.vtu"\nmesh_unit = "mm"'))


TET = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
5
2 1 "clamp"
2 2 "cavity"
0 3 "tip"
0 4 "origin"
3 5 "body"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 10 0 0
3 0 10 0
4 0 0 10
$EndNodes
$Elements
5
1 2 2 1 1 1 3 4
2 2 2 2 2 2 3 4
3 15 2 3 3 2
4 15 2 4 4 1
5 4 2 5 5 1 2 3 4
$EndElements
"""


def test_a_gmsh_file_names_its_points(tmp_path: Path) -> None:
    (tmp_path / "tet.msh").write_text(TET)
    read = read_actuator(_spec(tmp_path, 'mesh = "tet.msh"\nmesh_unit = "mm"'))
    mesh = read.actuator.mesh
    assert mesh.points[1] == pytest.approx([10e-3, 0.0, 0.0])
    assert mesh.nodes("clamp").tolist() == [0, 2, 3]
    assert mesh.nodes("tip").tolist() == [1]
    assert mesh.nodes("origin").tolist() == [0]


def test_contact_and_path_are_declared(tmp_path: Path) -> None:
    path = _spec(tmp_path)
    path.write_text(path.read_text() + '[contact]\ndepth = "20 um"\n[path]\nfirst = "0.02 bar"\n')
    read = read_actuator(path)
    assert read.actuator.contacts == (SelfContact("gap_1_left", "gap_1_right", depth=20e-6),)
    assert read.declared.path is not None
    assert read.declared.path.first == pytest.approx(2e3)
    path.write_text(path.read_text().replace("chambers = 2", "chambers = 1"))
    with pytest.raises(InputError, match="gap_1_left"):
        read_actuator(path)
    path.write_text(path.read_text().replace('"0.02 bar"', '"0 bar"'))
    with pytest.raises(InputError, match=r"path\.first"):
        read_actuator(path)


def test_steps_pass_the_declared_pressures() -> None:
    steps, asked = schedule(np.array([0.3, 0.5, 0.76]))
    assert steps[asked] == pytest.approx([0.3, 0.5, 0.76])
    assert steps[0] == 0.0
    assert np.diff(steps).max() <= 0.76 / 8 + 1e-12
