"""Bodies from mesh files of Gmsh and meshio, and their forces compared with those of FElupe."""

from pathlib import Path

import felupe
import meshio
import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.bodies.specimen_reading import read_specification, simulate_tests
from kolsky.readers.meshes import read_mesh

MESHES = Path(__file__).resolve().parents[2] / "data" / "meshes"
"""A box of 10 x 10 x 5 of quadratic tetrahedra with the groups "plate" and "punch", saved by Gmsh 4.15."""
SPEC = """
[material]
law = "neo_hookean"
free = ["mu"]
poisson = 0.4
constants = { mu = "20 kPa" }

[tests.press]
shape = "mesh"
mesh = "{mesh}"
mesh_unit = "mm"
moving = "{moving}"
fixed = "{fixed}"
axis = "{axis}"
frictionless = {frictionless}
file = "press.csv"
displacement = { column = "u", unit = "mm" }
force = { column = "f", unit = "N" }
sigma_force = "1 mN"
"""


def _spec(folder: Path, travel: float, **of: str) -> Path:
    text = SPEC
    for key, value in {"fixed": "plate", "moving": "punch", "axis": "z", "frictionless": "false"}.items():
        text = text.replace("{" + key + "}", of.get(key, value))
    (folder / "a.toml").write_text(text.replace("{mesh}", of["mesh"]))
    u = travel * np.arange(1, 5) / 4.0
    np.savetxt(folder / "press.csv", np.column_stack([u, u]), header="u,f", comments="", delimiter=",")
    return folder / "a.toml"


@pytest.mark.parametrize("name", ["gel_22.msh", "gel_41.msh", "gel.vtu"])
def test_a_body_is_that_of_its_file(name: str, tmp_path: Path) -> None:
    path = MESHES / name
    if name == "gel.vtu":
        own = read_mesh(MESHES / "gel_41.msh", dimension=3)
        masks = {f"set:{key}": np.isin(np.arange(len(own.points)), rows) for key, rows in own.groups.items()}
        made = meshio.Mesh(own.points, [("tetra10", own.cells)], {k: v.astype(int) for k, v in masks.items()})
        path = tmp_path / name
        made.write(path)
    body = read_mesh(path, dimension=3)
    assert body.kind == "tet10"
    assert set(body.groups) == {"plate", "punch"}
    assert (body.points[body.groups["punch"]][:, 2] == 5.0).all()
    assert (body.points[body.groups["plate"]][:, 2] == 0.0).all()
    corners = body.points[body.cells[:, :4]]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    assert volumes.sum() == pytest.approx(500.0)
    for middle, (a, b) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], start=4):
        # the order of VTK: each middle point lies between its two corners
        between = 0.5 * (body.points[body.cells[:, a]] + body.points[body.cells[:, b]])
        np.testing.assert_allclose(body.points[body.cells[:, middle]], between, atol=1e-9)


@pytest.mark.parametrize(
    ("axis", "travel", "frictionless"),
    [("z", -1.0, False), ("x", 1.5, False), ("z", -0.8, True)],
    ids=["compression", "shear", "indentation"],
)
def test_the_force_is_that_of_felupe(axis: str, travel: float, frictionless: bool, tmp_path: Path) -> None:
    whole = felupe.Cube(b=(10.0, 10.0, 5.0), n=(5, 5, 4))
    top = np.isclose(whole.points[:, 2], 5.0)
    if frictionless:  # a square punch on a part of the face
        top &= (np.abs(whole.points[:, :2] - 5.0) < 2.6).all(axis=1)
    masks = {"set:punch": top.astype(int), "set:plate": np.isclose(whole.points[:, 2], 0.0).astype(int)}
    meshio.Mesh(whole.points, [("hexahedron", whole.cells)], masks).write(tmp_path / "a.vtu")
    words = {"mesh": "a.vtu", "axis": axis, "frictionless": str(frictionless).lower()}
    found = simulate_tests(read_specification(_spec(tmp_path, travel, **words)))["press"]

    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(whole), dim=3)])
    mu, nu = 20e-3, 0.4  # N/mm2
    law = felupe.NeoHooke(mu=mu, bulk=2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)))
    body = felupe.SolidBody(law, field)
    along = "xyz".index(axis)
    held = tuple(other == along or not frictionless for other in range(3))
    sides = {
        "plate": felupe.Boundary(field[0], fz=0.0),
        "punch": felupe.Boundary(field[0], mask=top, skip=tuple(int(not one) for one in held)),
        "move": felupe.Boundary(field[0], mask=top, skip=tuple(int(k != along) for k in range(3))),
    }
    step = felupe.Step(items=[body], ramp={sides["move"]: travel * np.arange(1, 5) / 4.0}, boundaries=sides)
    forces = [
        float(felupe.tools.force(substep.x, substep.fun, sides["punch"])[along])
        for substep in step.generate(x0=field, tol=1e-10, verbose=0)
    ]
    np.testing.assert_allclose(found.force[:, 0], forces, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"moving": "pad"}, "names 'pad', which is not a group of the mesh"),
        ({"moving": "plate"}, "shares points with"),
        ({"mesh": "gel.stl"}, "ends in '.stl'"),
        ({"mesh": "cut.msh"}, "cannot be read as a mesh"),
        ({"mesh": "flat.vtu"}, "has no volume elements"),
    ],
)
def test_a_body_that_cannot_be_used_is_refused(change: dict[str, str], words: str, tmp_path: Path) -> None:
    whole = (MESHES / "gel_41.msh").read_text()
    (tmp_path / "gel.msh").write_text(whole)
    (tmp_path / "gel.stl").write_text(whole)
    (tmp_path / "cut.msh").write_text(whole[: len(whole) // 2])
    flat = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))])
    flat.write(tmp_path / "flat.vtu")
    with pytest.raises(InputError, match="Cure: ") as refused:
        read_specification(_spec(tmp_path, -1.0, **({"mesh": "gel.msh"} | change)))
    assert words in str(refused.value)


@pytest.mark.parametrize(("kind", "number"), [("vtu", 5), ("msh", 6)])
def test_a_bad_cell_has_the_number_of_the_file(kind: str, number: int, tmp_path: Path) -> None:
    # Elements 0 to 5 of the file, as ParaView counts; Gmsh counts from 1. Two triangles stand first, and the
    # last of four tetrahedra is inside out.
    corners = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
    points = np.concatenate([corners + 20 * k * np.eye(1, 3, dtype=int) for k in range(4)])
    tetra = np.arange(16).reshape(4, 4)
    tetra[3] = tetra[3][[1, 0, 2, 3]]
    cells = [("triangle", np.array([[0, 1, 2], [0, 1, 3]])), ("tetra", tetra)]
    tags = {"gmsh:physical": [np.ones(2, int), np.ones(4, int)]}
    tags["gmsh:geometrical"] = tags["gmsh:physical"]
    body = meshio.Mesh(points.astype(float), cells, cell_data=tags if kind == "msh" else {})
    body.write(
        tmp_path / f"a.{kind}", **({"file_format": "gmsh22", "binary": False} if kind == "msh" else {})
    )
    path = _spec(tmp_path, -1.0, mesh=f"a.{kind}", moving="front", fixed="back")
    with pytest.raises(
        InputError, match=rf"cell {number} of tet4, around \(62.5, 2.5, 2.5\) mm, is inside out"
    ):
        read_specification(path)


def _sphere(folder: Path, *lines: str, travel: float = -0.8) -> Path:
    """A SPEC of a sphere on a box of 10 x 10 x 5 mm of hexahedra, finest in the middle of its top face."""
    whole = felupe.Cube(b=(10.0, 10.0, 5.0), n=(7, 7, 4))
    points = whole.points.copy()
    away = points[:, :2] / 5.0 - 1.0
    points[:, :2] = 5.0 + 5.0 * np.sign(away) * np.abs(away) ** 1.5
    meshio.Mesh(points, [("hexahedron", whole.cells)]).write(folder / "a.vtu")
    path = _spec(folder, travel, mesh="a.vtu", moving="front", fixed="back")
    path.write_text(path.read_text().replace("frictionless = false", "\n".join(lines)))
    return path


def test_a_sphere_touches_the_outermost_points(tmp_path: Path) -> None:
    # A sphere of 1000 km touches all points as a flat lubricated plate does.
    model = read_specification(_sphere(tmp_path, 'sphere = "1000 km"')).models["press"]
    np.testing.assert_allclose(model.shape.apex, [5e-3, 5e-3, 5e-3], rtol=1e-12)
    assert model.shape.free_length == pytest.approx(5e-3)  # along the motion, not along x
    flat = simulate_tests(read_specification(_sphere(tmp_path, "frictionless = true")))["press"].force
    spec = read_specification(_sphere(tmp_path, 'sphere = "1000 km"'))
    np.testing.assert_allclose(simulate_tests(spec)["press"].force, flat, rtol=1e-4)


def test_the_slopes_of_a_sphere_are_those_of_its_force(tmp_path: Path) -> None:
    spec = read_specification(_sphere(tmp_path, 'sphere = "4 mm"'))
    model, mu = spec.models["press"], spec.constants.start
    at = np.array([[-0.4e-3], [-0.8e-3]])
    found = model.linearised(spec.constants, mu, at)
    assert (found.force < 0.0).all()
    # at a fixed Poisson's ratio all moduli are multiples of mu, and so is the force
    np.testing.assert_allclose(found.by_constants[..., 0] * mu[0], found.force, rtol=1e-5)
    solid, step = spec.constants.solid(mu), 1e-6
    more, less = (model.force(model.simulate(solid, at + side)) for side in (step, -step))
    # the points in contact are held within a millionth of the body, 1e-2 of the step
    np.testing.assert_allclose(found.by_displacement[:, :, 0], (more - less) / (2.0 * step), rtol=1e-2)


@pytest.mark.parametrize(
    ("lines", "travel", "words"),
    [
        (['sphere = "4 mm"'], 0.8, "draws the sphere away from the body"),
        (['sphere = "4 mm"', "frictionless = true"], -0.8, "slides without friction"),
    ],
)
def test_a_sphere_that_cannot_press_is_refused(
    lines: list[str], travel: float, words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="Cure: ") as refused:
        read_specification(_sphere(tmp_path, *lines, travel=travel))
    assert words in str(refused.value)


def test_a_side_of_the_box_is_an_end(tmp_path: Path) -> None:
    # A block of one law under a small pull between sliding ends would be uniform; with held ends its force
    # lies between that of a free and of a wholly constrained cross-section.
    (tmp_path / "gel.msh").write_text((MESHES / "gel_22.msh").read_text())
    path = _spec(tmp_path, 0.004, mesh="gel.msh", moving="front", fixed="back")
    force = simulate_tests(read_specification(path))["press"].force[-1, 0]
    mu, nu, area, strain = 20e3, 0.4, 1e-4, 0.004 / 5.0
    young = 2.0 * mu * (1.0 + nu)
    constrained = young * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    assert young < force / (area * strain) < constrained
