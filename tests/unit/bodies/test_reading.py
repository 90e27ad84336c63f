"""SPEC.toml: valid input, and every error message with its place and cure."""

import tomllib
from pathlib import Path

import meshio
import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.bodies.sheet_reading import read_field
from kolsky.bodies.specimen_constants import Constants, constants_of, law_curve, solid_of
from kolsky.bodies.specimen_fit import cross_table, expected, plan
from kolsky.bodies.specimen_reading import read_specification
from kolsky.material.reference_curve import curve_columns, curve_table

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
    with pytest.raises(InputError, match=r"(?s)line 4.*turns back: 1.5 mm"):
        _read(tmp_path, data="d,F\n1,0.1\n2,0.2\n1.5,0.15\n3,0.3\n")
    with pytest.raises(InputError, match=r"(?s)line 4.*turns back: -1.5 mm"):
        _read(tmp_path, data="d,F\n-1,-0.1\n-2,-0.2\n-1.5,-0.15\n-3,-0.3\n")
    with pytest.raises(InputError, match="opposite signs"):
        _read(tmp_path, data="d,F\n-1,0.1\n-2,0.2\n-2.5,0.25\n-3,0.3\n")
    with pytest.raises(InputError, match="at least 4"):
        _read(tmp_path, data="d,F\n1,0.1\n2,0.2\n")


BLOCK = """
[material]
law = "neo_hookean"
free = ["mu"]
poisson = 0.45
constants = { mu = "20 kPa" }

[numerics]
element = "hex8"

[tests.push]
shape = "block"
size = ["20 mm", "20 mm", "20 mm"]
elements = [4, 4, 4]
file = "pull.csv"
displacement = { column = "d", unit = "mm" }
force = { column = "F", unit = "N" }
sigma_force = "10 mN"
"""


def test_a_block_is_pushed_and_sheared(tmp_path: Path) -> None:
    pushed = _read(tmp_path, BLOCK, "d,F\n-1,-1\n-2,-2\n-3,-3\n-4,-4\n").models["push"]  # type: ignore[attr-defined]
    solid = NEO.solid(NEO.start)
    steps = np.array([[-2e-5], [2e-5]])
    force = pushed.force(pushed.simulate(solid, steps))
    assert force[0, 0] == pytest.approx(-force[1, 0], rel=1e-2)
    # Bonded ends stiffen a cube: between E A / L of a bar and the confined modulus.
    young, lateral = 2.0 * solid.shear_modulus * 1.45, 20e-3
    assert 1.0 < force[1, 0] / (young * lateral * 2e-5) < 0.55 / (0.1 * 1.45)
    sheared = _read(
        tmp_path, BLOCK.replace('"block"', '"block"\nload = "shear"'), "d,F\n1,1\n2,2\n3,3\n4,4\n"
    )
    model = sheared.models["push"]  # type: ignore[attr-defined]
    assert not model.shape.eighth
    across = model.force(model.simulate(solid, steps))[:, 0]
    # A cube bends as well, so it is softer than G A / L of simple shear; it is not softer than a third of it.
    assert 0.3 < across[1] / (solid.shear_modulus * lateral * 2e-5) < 1.0
    assert across[0] == pytest.approx(-across[1], rel=1e-6)
    answer = model.linearised(NEO, NEO.start, steps[1:])
    assert answer.force[0, 0] == pytest.approx(across[1], rel=1e-6)
    with pytest.raises(InputError, match=r"(?s)bond.*no effect on a \"block\""):
        _read(tmp_path, BLOCK.replace("elements", 'bond = "2 mm"\nelements'))
    with pytest.raises(InputError, match=r"(?s)load.*belongs to shape"):
        _read(tmp_path, STRIP.replace("elements", 'load = "shear"\nelements'))


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
    found = read_field(read_specification(tmp_path / "sheet.toml", device="cuda:0"))
    assert found.problem.sheet.device == "cuda:0"
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
        ('fixed = "right"', 'fixed = "right"\nheld = { skin = 3 }', r"field\.held is not a known key"),
        ('fixed = "right"', 'fixed = "right"\nheld = { skin = { E = "3 kPa" } }', r"skin.poisson"),
    ],
)
def test_sheet_refusals(tmp_path: Path, old: str, new: str, said: str) -> None:
    _field_folder(tmp_path)
    text = (tmp_path / "sheet.toml").read_text()
    (tmp_path / "sheet.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_field(read_specification(tmp_path / "sheet.toml"))


def test_a_held_region_is_one_without_free_constants(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    path = tmp_path / "sheet.toml"
    text = path.read_text()
    held = 'fixed = "right"\nheld = { skin = { E = "30 kPa", poisson = 0.2 } }'
    path.write_text(text.replace('fixed = "right"', held))
    section = read_specification(path).declared.field
    assert section is not None
    skin = section.regions["skin"]
    assert (skin.constants, skin.poisson, skin.free) == ({"E": "30 kPa"}, 0.2, [])
    path.write_text(path.read_text() + '[field.regions.skin]\nconstants = { E = "1 kPa" }\npoisson = 0.3\n')
    with pytest.raises(InputError, match=r"field\.held is not a known key"):
        read_specification(path)


def test_meshes_of_other_formats(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    mesh, spec = tmp_path / "mesh.msh", tmp_path / "sheet.toml"
    whole, own = meshio.read(mesh), read_field(read_specification(spec))
    ends = {f"set:{name}": (whole.points[:, 0] == x) * 1 for name, x in (("left", 0.0), ("right", 8.0))}
    flat = meshio.Mesh(whole.points, [("triangle", whole.get_cells_type("triangle"))], ends)
    flat.write(tmp_path / "mesh.vtu")
    mesh.write_text(mesh.read_text().replace("2.2 0 8", "4.1 0 8"))
    with pytest.raises(InputError, match="cannot be read as a mesh"):
        read_field(read_specification(spec))
    spec.write_text(spec.read_text().replace("mesh.msh", "mesh.vtu"))
    other = read_field(read_specification(spec))
    for name, points in own.problem.sheet.mesh.sets.items():
        np.testing.assert_array_equal(points, other.problem.sheet.mesh.sets[name])
    np.testing.assert_array_equal(own.problem.sheet.mesh.points, other.problem.sheet.mesh.points)


NEO = Constants("neo_hookean", {"mu": 2.0e4, "poisson": 0.45}, ("mu",))
MOONEY = Constants("mooney_rivlin", {"C10": 9e3, "C01": 4e3, "C11": 0.0, "poisson": 0.45}, ("C10", "C01"))


def test_curve_of_a_neo_hookean_law() -> None:
    curve = law_curve(NEO, np.array([[1e6]]), branch="tension", largest_strain=1.0)
    lam = 1.0 + curve.strain
    assert curve.strain[[0, -1]] == pytest.approx([0.0, 1.0])
    assert curve.stress == pytest.approx(2e4 * (lam - lam**-2))
    # sigma(mu) = 1 kPa moves every point by 1/20 of its stress.
    assert curve.sigma == pytest.approx(curve.stress / 20.0, rel=1e-4)


def test_curve_in_compression_and_of_the_coupled_law() -> None:
    coupled = Constants("neo_hookean_coupled", {"E": 5.8e4, "poisson": 0.45}, ("E",))
    curve = law_curve(coupled, np.full((1, 1), np.nan), branch="compression", largest_strain=0.5)
    lam = 1.0 - curve.strain
    assert lam[-1] == pytest.approx(0.5)
    assert curve.stress == pytest.approx(5.8e4 / 2.9 * (lam**-2 - lam))
    assert curve.modes.shape == (0, 41)
    assert 'relative_sigma = ""' in curve_table("law.csv", curve, compression=True)


def test_correlated_constants_move_a_curve_less() -> None:
    # T = 2 (lam - lam^-2)(C10 + C01 / lam): the variance is s^T C s with the slopes s.
    covariance = 1e4 * np.array([[4.0, -2.9], [-2.9, 2.25]])
    curve = law_curve(MOONEY, covariance, branch="tension", largest_strain=1.5)
    lam = 1.0 + curve.strain
    slopes = 2.0 * (lam - lam**-2) * np.stack([np.ones_like(lam), 1.0 / lam])
    variance = np.einsum("in,ij,jn->n", slopes, covariance, slopes)
    assert curve.sigma**2 == pytest.approx(variance, rel=1e-4, abs=1e-9)


def test_lines_for_a_shot() -> None:
    curve = law_curve(NEO, np.array([[1e6]]), branch="compression", largest_strain=0.5)
    lines = tomllib.loads(curve_table("law.csv", curve, compression=True))["curve"]
    assert (lines["branch"], lines["convention"]) == ("compression", "compression positive")
    assert lines["modes"] == {"prefix": "mode ", "unit": "Pa"}
    columns = curve_columns(curve)
    assert columns["mode 1: constants (Pa)"] == pytest.approx(0.05 * np.array(columns["nominal stress (Pa)"]))


def test_expected_deviations_add_information() -> None:
    # J^T J of two tests with one row of slope each constant: sigma of C10 is 1 / sqrt(sum J^2).
    whitened = {
        "a": np.array([[3.0, 0.0], [0.0, 1.0]]) * 1e-3,
        "b": np.array([[4.0, 0.0], [0.0, 1.0]]) * 1e-3,
    }
    forces = {"a": 2.0, "b": 5.0}
    one = expected(["a"], whitened, forces, MOONEY, ())
    assert one.relative == pytest.approx([1e3 / 3.0 / 9e3, 1e3 / 4e3])
    both = expected(["a", "b"], whitened, forces, MOONEY, ["C10"])
    assert both.relative == pytest.approx([1e3 / 5.0 / 9e3, 1e3 / np.sqrt(2.0) / 4e3])
    assert both.criterion == pytest.approx(both.relative[0])
    assert both.peak_force == 5.0
    # With nothing wanted: the geometric mean of the principal deviations.
    assert one.criterion == pytest.approx(np.sqrt(one.relative[0] * one.relative[1]))
    assert [c.tests for c in plan([["a"], ["a", "b"]], whitened, forces, MOONEY)] == [("a", "b"), ("a",)]


def test_a_test_that_does_not_tell_is_last() -> None:
    whitened = {"blind": np.array([[1.0, 0.0], [1.0, 0.0]]) * 1e-3, "seen": np.eye(2) * 1e-3}
    found = plan([["blind"], ["seen"]], whitened, {"blind": 1.0, "seen": 1.0}, MOONEY)
    assert [one.tests for one in found] == [("seen",), ("blind",)]
    # what it does see is known: 1 / (C10 sqrt(2) 1e-3)
    assert found[1].relative[0] == pytest.approx(1.0 / (MOONEY.start[0] * np.sqrt(2.0) * 1e-3))
    assert found[1].relative[1] == np.inf
    assert found[1].criterion == np.inf


def test_cross_table_has_a_row_a_fit() -> None:
    assert cross_table([], ["a", "b"]).shape == (0, 2)


def test_bulk_modulus_is_that_of_table_one() -> None:
    # D1 = 2 (C01 + C10)(1 + nu) / (3 (1 - 2 nu)), and K = 2 D1.
    values = {"C10": 3000.0, "C01": 1000.0, "C11": 200.0, "poisson": 0.4}
    d1 = 2.0 * 4000.0 * 1.4 / (3.0 * 0.2)
    solid = solid_of("mooney_rivlin", values)
    assert solid.parameters() == pytest.approx([3000.0, 1000.0, 200.0, 2.0 * d1])
    yeoh = solid_of("yeoh_d", {"C10": 4000.0, "C20": 5.0, "C30": 6.0, "D2": 7.0, "D3": 8.0, "poisson": 0.4})
    assert yeoh.parameters() == pytest.approx([4000.0, 5.0, 6.0, d1, 7.0, 8.0])
    coupled = solid_of("neo_hookean_coupled", {"E": 2.8e4, "poisson": 0.4})
    assert coupled.parameters() == pytest.approx([1e4, 2.8e4 * 0.4 / (1.4 * 0.2)])


def test_chain_carries_slopes_to_what_is_fitted() -> None:
    constants = Constants(
        "mooney_rivlin",
        {"C10": 3000.0, "C01": 1000.0, "C11": 200.0, "poisson": 0.4},
        ("C01", "C11", "poisson"),
    )
    # K = 4 (C10 + C01)(1 + nu) / (3 (1 - 2 nu)): 28/3 a unit of C01; by nu 4 (C10 + C01) / (1 - 2 nu)^2.
    expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [28.0 / 3.0, 0.0, 4e5]]
    assert constants.chain(constants.start) == pytest.approx(np.array(expected), rel=1e-7, abs=1e-5)


def test_chain_on_the_bound_of_a_constant() -> None:
    values = {"C10": 3000.0, "C01": 0.0, "C11": 0.0, "poisson": 0.0}
    constants = Constants("mooney_rivlin", values, ("C01", "C11", "poisson"))
    assert constants.chain(constants.start)[-1] == pytest.approx([4.0 / 3.0, 0.0, 1.2e4], rel=1e-4)


def test_bounds_keep_energies_positive() -> None:
    low, high = Constants(
        "mooney_rivlin", {"C10": 1.0, "C01": 1.0, "C11": 0.0, "poisson": 0.45}, ("C10", "C11", "poisson")
    ).bounds
    assert low.tolist() == [0.0, 0.0, 0.0]
    assert high.tolist() == [np.inf, np.inf, 0.4999]


def test_refusals_name_the_constant() -> None:
    with pytest.raises(ValueError, match="needs C01"):
        Constants("mooney_rivlin", {"C10": 1.0, "C11": 0.0, "poisson": 0.4}, ())
    with pytest.raises(ValueError, match="has no constant D2"):
        Constants("neo_hookean", {"mu": 1.0, "D2": 1.0, "poisson": 0.4}, ())
    with pytest.raises(ValueError, match="law must be one of"):
        constants_of("ogden")


def test_changes_of_the_map_to_the_energy() -> None:
    # mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu) (1 - 2 nu)), differentiated twice by hand
    E, nu = 3e4, 0.3
    found = Constants("neo_hookean_coupled", {"E": E, "poisson": nu}, ("E", "poisson")).chain_changes([E, nu])
    a, b = 1.0 + nu, 1.0 - 2.0 * nu
    mu = [[0.0, -0.5 / a**2], [-0.5 / a**2, E / a**3]]
    by_nu = (1.0 + 2.0 * nu**2) / (a * b) ** 2
    twice = E * (4.0 * nu / (a * b) ** 2 + 2.0 * (1.0 + 2.0 * nu**2) * (1.0 + 4.0 * nu) / (a * b) ** 3)
    lam = [[0.0, by_nu], [by_nu, twice]]
    np.testing.assert_allclose(found, [mu, lam], rtol=1e-4, atol=1e-9)
