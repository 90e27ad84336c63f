"""SPEC.toml: what is read, and every refusal with its place and cure."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.bodies.sheet_reading import read_field
from kolsky.bodies.specimen_reading import read_specification

STRIP = """
[material]
law = "neo_hookean"
free = ["mu"]
poisson = 0.45
constants = { mu = "20 kPa" }

[numerics]
element = "hex8"

[tests.pull]
size = ["80 mm", "20 mm", "4 mm"]
bond = "10 mm"
elements = [8, 4, 2]
file = "pull.csv"
displacement = { column = "d", unit = "mm" }
force = { column = "F", unit = "N" }
sigma_force = "10 mN"
"""
DATA = "d,F\n1,0.1\n2,0.19\n3,0.27\n4,0.34\n"


def _read(folder: Path, text: str = STRIP, data: str = DATA) -> object:
    (folder / "spec.toml").write_text(text)
    (folder / "pull.csv").write_text(data)
    return read_specification(folder / "spec.toml")


def test_units_and_samples(tmp_path: Path) -> None:
    spec = _read(tmp_path)
    test = spec.test("pull")  # type: ignore[attr-defined]
    assert test.samples.displacement[:, 0] == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3])
    assert test.samples.force[:, 0].tolist() == [0.1, 0.19, 0.27, 0.34]
    assert test.samples.sigma_force == pytest.approx(0.01)
    assert spec.constants.start == pytest.approx([2e4])  # type: ignore[attr-defined]
    assert test.model.shape.eighth
    assert set(spec.inputs) == {"spec.toml", "pull.csv"}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('law = "neo_hookean"', 'law = "nothing"', "law must be one of"),
        ('free = ["mu"]', 'free = ["nu"]', "which the law does not have"),
        ('mu = "20 kPa"', 'C10 = "20 kPa"', "mu"),
        ('mu = "20 kPa"', 'mu = "20 mm"', "kPa"),
        ('bond = "10 mm"', 'bond = "13 mm"', "between two elements"),
        ('bond = "10 mm"', 'bond = "40 mm"', "no free length"),
        ('file = "pull.csv"', "", "stroke"),
        ("elements = [8, 4, 2]", 'elements = [8, 4, 2]\narm = "5 mm"', "no effect"),
        ('displacement = { column = "d", unit = "mm" }', "", "displacement"),
        ("sigma_force", "sigma_forces", "sigma_force"),
        ("sigma_force", "gravity = [0.0, 0.0, -9.81]\nsigma_force", "density"),
    ],
)
def test_refusals(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in STRIP
    with pytest.raises(InputError, match=said):
        _read(tmp_path, STRIP.replace(old, new, 1))


def test_a_curve_that_turns_back_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"(?s)line 4.*does not rise"):
        _read(tmp_path, data="d,F\n1,0.1\n2,0.2\n1.5,0.15\n3,0.3\n")
    with pytest.raises(InputError, match="at least 4"):
        _read(tmp_path, data="d,F\n1,0.1\n2,0.2\n")


MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "left"
1 2 "right"
2 1 "skin"
$EndPhysicalNames
$Nodes
{n}
{nodes}
$EndNodes
$Elements
{m}
{elements}
$EndElements
"""
FIELD = """
[material]
law = "neo_hookean_coupled"
free = ["E", "poisson"]
poisson = 0.3
constants = { E = "30 kPa" }

[field]
mesh = "mesh.msh"
mesh_unit = "mm"
thickness = "1 mm"
kinematics = "plane_stress"
moving = "left"
fixed = "right"
frames = [2, 3]
sigma_force = "1 mN"

[field.points]
file = "points.csv"
x = { column = "x", unit = "mm" }
y = { column = "y", unit = "mm" }
ux = { column = "ux", unit = "mm" }
uy = { column = "uy", unit = "mm" }

[field.pad]
file = "pad.csv"
displacement = { column = "d", unit = "mm" }
force = { column = "F", unit = "mN" }
"""


def _field_folder(folder: Path) -> None:
    xs, ys = np.meshgrid(np.arange(9.0), np.arange(5.0), indexing="ij")
    number = np.arange(45).reshape(9, 5) + 1
    nodes = "\n".join(
        f"{k + 1} {x} {y} 0" for k, (x, y) in enumerate(zip(xs.ravel(), ys.ravel(), strict=True))
    )
    rows = [(1, 1, number[0, j], number[0, j + 1]) for j in range(4)]
    rows += [(1, 2, number[8, j], number[8, j + 1]) for j in range(4)]
    for i in range(8):
        for j in range(4):
            a, b, c, d = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
            rows += [(2, 1, a, b, c), (2, 1, a, c, d)]
    elements = "\n".join(
        f"{k + 1} {row[0]} 2 {row[1]} 0 {' '.join(map(str, row[2:]))}" for k, row in enumerate(rows)
    )
    text = MESH.format(n=45, nodes=nodes, m=len(rows), elements=elements)
    (folder / "mesh.msh").write_text(text)
    lines = ["frame,x,y,ux,uy"]
    rng = np.random.default_rng(3)
    for frame in (1, 2, 3):
        for x in np.arange(1.0, 7.01, 0.5):
            for y in np.arange(0.5, 3.51, 0.5):
                noise = 1e-4 * rng.standard_normal(2)
                lines.append(f"{frame},{x},{y},{-0.01 * frame * (8 - x) + noise[0]:.6f},{noise[1]:.6f}")
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    (folder / "pad.csv").write_text("frame,d,F\n1,-0.1,-3\n2,-0.2,-6\n3,-0.3,-9\n")
    (folder / "sheet.toml").write_text(FIELD)


def test_a_sheet_with_its_points(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    found = read_field(read_specification(tmp_path / "sheet.toml"))
    data, mesh = found.problem.data, found.problem.sheet.mesh
    assert mesh.points.max(axis=0) == pytest.approx([8e-3, 4e-3])
    assert len(mesh.cells) == 64
    assert data.pad == pytest.approx([-0.2e-3, -0.3e-3])
    assert data.force == pytest.approx([-6e-3, -9e-3])
    # Cells whose nodes lie strictly between the outermost points: x of 1 to 7, y of 1 to 3 mm.
    assert data.cells.sum() == 6 * 2 * 2
    assert data.sigma_displacement == pytest.approx(1e-7, rel=0.2)
    assert data.area == pytest.approx(0.25e-6)
    assert data.weight == pytest.approx(0.25e-6 * data.sigma_displacement**2 / 1e-6)
    middle = np.flatnonzero(np.abs(mesh.points - [4e-3, 2e-3]).sum(axis=1) < 1e-9)[0]
    assert data.displacements[1, middle, 0] == pytest.approx(-0.12e-3, abs=2e-7)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("frames = [2, 3]", "frames = [2, 4]", "frame 4"),
        ('moving = "left"', 'moving = "top"', "no group of curves"),
        ('mesh_unit = "mm"', 'mesh_unit = "m"', "no whole cell"),
        ('fixed = "right"', 'fixed = "right"\nregion = "bone"', "no group of surfaces"),
    ],
)
def test_sheet_refusals(tmp_path: Path, old: str, new: str, said: str) -> None:
    _field_folder(tmp_path)
    text = (tmp_path / "sheet.toml").read_text()
    (tmp_path / "sheet.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_field(read_specification(tmp_path / "sheet.toml"))


def test_meshes_of_other_formats_are_refused(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    mesh = tmp_path / "mesh.msh"
    mesh.write_text(mesh.read_text().replace("2.2 0 8", "4.1 0 8"))
    with pytest.raises(InputError, match="format 2"):
        read_field(read_specification(tmp_path / "sheet.toml"))
