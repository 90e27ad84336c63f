"""SPEC.toml of slow tests of whole specimens: its tables, its files, and simulated tests with noise."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile, read_toml
from kolsky.base.units import UnitError, quantity
from kolsky.bodies.errors_in_variables import Samples
from kolsky.bodies.specimen_constants import POISSON, Constants, constants_of
from kolsky.bodies.specimen_fit import SlowTest
from kolsky.bodies.specimen_model import AXES, TIGHT, BodyShape, Shape, SpecimenModel
from kolsky.equilibrium.meshes import SIDES, Mesh
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.solution import Solution
from kolsky.readers.meshes import read_mesh
from kolsky.readers.table import read_table
from kolsky.schema import fields as f
from kolsky.schema.fields import ColumnSection, LengthColumn, Section, TextLayoutSection

ForceDeviation = Annotated[float, BeforeValidator(f.physical("N", "> 0", "a standard deviation"))]
Acceleration = Annotated[float, BeforeValidator(f.number)]


class ForceColumn(ColumnSection):
    """A column of forces."""

    unit: Annotated[float, BeforeValidator(f.factor("N"))]


class MaterialSection(Section):
    """[material]: a law, its constants, and the names of the fitted ones."""

    law: f.Name
    constants: dict[str, Any]
    poisson: f.Poisson
    free: Annotated[list[f.Name], Field(min_length=1)]
    density: f.Density | None = None

    @model_validator(mode="after")
    def _known(self) -> "MaterialSection":
        try:
            specs = constants_of(self.law)
        except ValueError as error:
            raise f.problem(f"is not known: {error}", key="law") from None
        names = [spec.name for spec in specs]
        for name in self.free:
            if name not in names:
                raise f.problem(
                    f"names {name!r}, which the law does not have", key="free", allowed=", ".join(names)
                )
        return self


class NumericsSection(Section):
    """[numerics]: the elements."""

    element: Literal["hex27", "hex8"] = "hex27"


class TestSection(Section):
    """[tests.NAME]: a specimen, its supports, and its measurements."""

    shape: Literal["strip", "dog_bone", "cross", "block", "mesh"] = "strip"
    load: Literal["axial", "shear"] = "axial"
    size: Annotated[list[f.Length], Field(min_length=3, max_length=3)] | None = None
    bond: f.Length | None = None
    elements: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=3, max_length=3)] | None = None
    mesh: f.FileName | None = None
    mesh_unit: f.LengthUnit | None = None
    moving: f.Name | None = None
    fixed: f.Name | None = None
    axis: Literal["x", "y", "z"] = "x"
    frictionless: bool = False
    sphere: f.Length | None = None
    arm: f.Length | None = None
    waist: f.Length | None = None
    straight: f.Length | None = None
    gravity: Annotated[list[Acceleration], Field(min_length=3, max_length=3)] | None = None
    file: f.FileName | None = None
    layout: TextLayoutSection | None = None
    displacement: LengthColumn | list[LengthColumn] | None = None
    force: ForceColumn | list[ForceColumn] | None = None
    samples: Annotated[int, Field(ge=4, le=400)] = 20
    stroke: f.Length | None = None
    sigma_force: ForceDeviation
    sigma_displacement: f.LengthDeviation = 0.0

    @model_validator(mode="after")
    def _of_the_shape(self) -> "TestSection":
        only = {"arm": "cross", "waist": "dog_bone", "straight": "dog_bone", "sphere": "mesh"}
        only |= dict.fromkeys(("mesh", "mesh_unit", "moving", "fixed"), "mesh")
        only |= dict.fromkeys(("size", "elements"), "no mesh")
        meshed, sheared = self.shape == "mesh", self.load == "shear"
        for key, shape in only.items():
            belongs = self.shape == shape or (shape == "no mesh" and not meshed)
            optional = key == "sphere" and belongs
            if not optional and (getattr(self, key) is not None) != belongs:
                problem = "is missing" if belongs else f'has no effect on a "{self.shape}"'
                home = "every other shape" if shape == "no mesh" else f'shape = "{shape}"'
                raise f.problem(problem, key=key, cure=f"it belongs to {home}")
        for key in ("displacement", "force") if self.file is not None else ():
            given = getattr(self, key) is not None
            wrong = given and len(self.columns(key)) != self.ends
            f.reject(
                (not given, key, "is missing", 'write e.g. { column = "force", unit = "N" }'),
                (wrong, key, f"must name {self.ends} column(s)", "a cross has one an axis"),
            )
        glued, slides = meshed or self.shape == "block", self.frictionless and self.sphere is not None
        planned = self.file is not None or self.stroke is not None
        f.reject(
            (not planned, "file", "is missing", 'add the file of the test, or stroke = "60 mm" to plan one'),
            (slides, "sphere", "slides without friction", "remove the key frictionless"),
            (self.bond is not None and glued, "bond", f'has no effect on a "{self.shape}"', "remove it"),
            (self.bond is None and not glued, "bond", "is missing", 'write e.g. "10 mm"'),
            (sheared and self.shape != "block", "load", 'is "shear"', 'it belongs to shape = "block"'),
        )
        if self.size is not None and self.bond is not None and 2.0 * self.bond >= self.size[0]:
            raise f.problem("leaves no free length", key="bond", allowed=f"below {0.5 * self.size[0]:g} m")
        return self

    @property
    def ends(self) -> int:
        """Number of independent moving ends: 2 for a cross, otherwise 1."""
        return 2 if self.shape == "cross" else 1

    def columns(self, key: str) -> list[ColumnSection]:
        """Columns of the displacement or the force, one for each end."""
        found = getattr(self, key)
        return found if isinstance(found, list) else [found]


class _FrameTable(Section):
    """A table with a column of frame numbers."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name = "frame"


class PointsSection(_FrameTable):
    """[field.points]: the measured displacements, one row per frame and point."""

    x: LengthColumn
    y: LengthColumn
    ux: LengthColumn
    uy: LengthColumn
    gate: Annotated[float, Field(gt=2.0, le=100.0)] = 6.0
    gated: bool = True


class PadSection(_FrameTable):
    """[field.pad]: displacement and force of the moving pad, one row per frame."""

    displacement: LengthColumn
    force: ForceColumn


class RegionSection(Section):
    """[field.regions.NAME]: another material of the sheet, with the same law and other constants."""

    constants: dict[str, Any]
    poisson: f.Poisson
    free: list[f.Name] = Field(default_factory=list)


Groups = Annotated[
    list[f.Name],
    Field(min_length=1),
    BeforeValidator(lambda given: [given] if isinstance(given, str) else given),
]
"""One group of a mesh, or a list of them."""


class FieldSection(Section):
    """[field]: a sheet pulled between two pads, its displacement field and the force on a pad."""

    mesh: f.FileName
    mesh_unit: f.LengthUnit
    thickness: f.Length
    kinematics: Literal["plane_stress", "plane_strain"]
    moving: Groups
    fixed: Groups
    axis: Literal["x", "y"] = "x"
    relative_to: Literal["fixed_pad", "camera"] = "fixed_pad"
    points: PointsSection
    pad: PadSection
    frames: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)]
    sigma_displacement: f.LengthDeviation | None = None
    sigma_force: ForceDeviation
    region: f.Name | None = None
    regions: dict[f.Name, RegionSection] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _with_held(cls, given: Any) -> Any:
        """`held = { NAME = { E = "30 kPa", poisson = 0.2 } }` is a region without free constants."""
        if not isinstance(given, dict) or not isinstance(given.get("held"), dict):
            return given
        held = {
            name: {
                "constants": {key: value for key, value in one.items() if key != POISSON},
                **{key: value for key, value in one.items() if key == POISSON},
            }
            for name, one in given["held"].items()
            if isinstance(one, dict)
        }
        if held.keys() != given["held"].keys() or held.keys() & given.get("regions", {}).keys():
            return given  # refused as an unknown key
        rest = {key: value for key, value in given.items() if key != "held"}
        return {**rest, "regions": {**given.get("regions", {}), **held}}


class FitSection(Section):
    """[fit]: the tests that are fitted together, and the number of starts."""

    together: dict[str, list[f.Name]] = Field(default_factory=dict)
    starts: Annotated[int, Field(ge=1, le=50)] = 1
    seed: Annotated[int, Field(ge=0)] = 1


class PlanSection(Section):
    """[plan]: the constants of interest, and the shapes to compare."""

    wanted: list[f.Name] = Field(default_factory=list)
    compare: Annotated[list[list[f.Name]], Field(min_length=1)] | None = None


class SpecimenFile(Section):
    """A whole SPEC.toml."""

    NEW: ClassVar[str] = "kolsky specimen new"
    material: MaterialSection
    numerics: NumericsSection = Field(default_factory=NumericsSection)
    tests: dict[str, TestSection] = Field(default_factory=dict)
    field: FieldSection | None = None
    fit: FitSection = Field(default_factory=FitSection)
    plan: PlanSection = Field(default_factory=PlanSection)

    @model_validator(mode="after")
    def _something_to_fit(self) -> "SpecimenFile":
        both = bool(self.tests) and self.field is not None
        nothing = not self.tests and self.field is None
        f.reject(
            (nothing, "tests", "is missing", "add [tests.NAME], or [field] for a sheet"),
            (both, "field", "is given beside [tests]", "fit each from a separate file"),
        )
        named = [("fit.together", names) for names in self.fit.together.values()]
        named += [("plan.compare", names) for names in self.plan.compare or []]
        for key, names in named:
            for name in names:
                if name not in self.tests:
                    raise f.problem(f"names {name!r}", key=key, allowed=", ".join(self.tests))
        for name, test in self.tests.items():
            if test.gravity is not None and self.material.density is None:
                raise f.problem("is missing", key="material.density", cure=f"[tests.{name}] has gravity")
        return self


FEWEST = 4
"""Samples that a test needs."""


@dataclass(frozen=True)
class Specification:
    """A SPEC.toml that was read."""

    toml: TomlFile
    declared: SpecimenFile
    """Its declared values, in SI."""
    constants: Constants
    """The law, its constants and the free ones."""
    models: dict[str, SpecimenModel]
    samples: dict[str, Samples]
    """Measurements of the tests with a file."""
    inputs: dict[str, str]
    """SHA-256 of every file that was read, by name."""
    device: str = "cpu"
    """Device of the element kernels."""

    @property
    def name(self) -> str:
        """Name of the file without its ending."""
        return self.toml.path.stem

    def test(self, name: str) -> SlowTest:
        """A test with its data. Raises InputError if it has no file."""
        if name not in self.samples:
            raise self.toml.error(
                f"tests.{name}", "has no data", cure="name its file, or `kolsky specimen simulate`"
            )
        return SlowTest(self.models[name], self.samples[name])

    def schedule(self, name: str) -> FloatArray:
        """Displacements of the ends at which a test is simulated [m], shape [n, ends]."""
        if name in self.samples:
            return self.samples[name].displacement
        section = self.declared.tests[name]
        assert section.stroke is not None  # checked by the schema
        way = self.models[name].shape.way
        one = way * section.stroke * np.arange(1, section.samples + 1) / section.samples
        return np.repeat(one[:, None], section.ends, axis=1)


def read_specification(path: Path, *, device: str = "cpu") -> Specification:
    """Read a SPEC.toml and the files of its tests.

    ``path``: the file. ``device``: device of the element kernels. Raises InputError if it declares anything
    unknown, incomplete or impossible, or if a file cannot be read.
    """
    if not Path(path).exists():
        cure = "correct its name; `kolsky specimen new FOLDER` writes a SPEC.toml to fill in"
        raise InputError(Path(path), "there is no such file", cure=cure)
    toml, declared = read_toml(Path(path), SpecimenFile)
    material = declared.material
    values = read_constants(toml, "material.constants", material.law, material.constants)
    with toml.refusing("material.constants", "are not those of the law"):
        constants = Constants(material.law, {**values, POISSON: material.poisson}, tuple(material.free))
    models, samples = {}, {}
    inputs = {toml.path.name: toml.sha256}
    for name, section in declared.tests.items():
        body = None if section.mesh is None else _body(toml, f"tests.{name}", section, inputs)
        shape = _shape_of(section, declared.numerics.element, material.density, body)
        models[name] = SpecimenModel(name, shape, device)
        if section.file is not None:
            samples[name], inputs[section.file] = _samples(toml, section)
        if section.mesh is not None:
            if isinstance(shape, BodyShape) and name in samples:
                _check_sphere(toml, f"tests.{name}", shape, samples[name])
            continue
        with toml.refusing(f"tests.{name}.elements", "make no mesh"):
            sets = shape.mesh.sets
        step = shape.size[0] / shape.elements[0]
        if abs(shape.bond / step - round(shape.bond / step)) > 1e-6 or "bond_x+" not in sets:
            raise toml.error(
                f"tests.{name}.bond",
                f"does not end between two elements, which are {1e3 * step:g} mm long",
                cure="choose elements so that the bond is a whole number of them",
            )
    return Specification(toml, declared, constants, models, samples, inputs, device)


def _shape_of(section: TestSection, element: str, density: float | None, body: Mesh | None) -> Shape:
    """The shape in the table of a test. `body`: its mesh with its two sets, if the table names a file."""
    weight: dict[str, Any] = {}
    if section.gravity is not None:
        weight = {"gravity": tuple(section.gravity), "density": density}
    if body is not None:
        x, y, z = np.ptp(body.points, axis=0).tolist()
        return BodyShape(
            section.shape, (x, y, z), 0.0, (1, 1, 1), element=body.kind, axis="xyz".index(section.axis),
            body=body, frictionless=section.frictionless, sphere=section.sphere, **weight,
        )  # fmt: skip
    assert section.size is not None  # checked by the schema
    assert section.elements is not None
    (x, y, z), (nx, ny, nz) = section.size, section.elements
    return Shape(
        section.shape, (x, y, z), section.bond or 0.0, (nx, ny, nz), section.arm, section.waist,
        section.straight, element, load=section.load, **weight,
    )  # fmt: skip


def read_body(toml: TomlFile, key: str, file: str, unit: float, inputs: dict[str, str]) -> Mesh:
    """Read a three-dimensional mesh and check its cells.

    ``key``: the key that names the file. ``unit``: unit of its points [m]. ``inputs``: gets the file's hash.
    Raises InputError if the file cannot be read or has a bad cell.
    """
    raw = read_mesh(toml.path.parent / file, dimension=3)
    inputs[file] = raw.sha256
    mesh = Mesh(unit * raw.points, raw.cells, raw.kind, raw.groups, raw.numbers)
    with toml.refusing(key, "has a bad cell", cure="mesh the body again"):
        geometry(mesh, kinematics="3d", thickness=1.0, gauss=None)
    return mesh


def _body(toml: TomlFile, key: str, section: TestSection, inputs: dict[str, str]) -> Mesh:
    """The mesh of a test with its two ends as sets. A side's name means that side of the bounding box."""
    assert section.mesh is not None  # checked by the schema
    assert section.mesh_unit is not None
    mesh = read_body(toml, f"{key}.mesh", section.mesh, section.mesh_unit, inputs)
    points = mesh.points
    low, high = points.min(axis=0), points.max(axis=0)
    reach = TIGHT * float((high - low).max())
    sides: dict[str, IntArray] = {
        name: np.flatnonzero(np.abs(points[:, axis] - end) <= reach)
        for axis, names in enumerate(SIDES)
        for name, end in zip(names, (low[axis], high[axis]), strict=True)
    }
    known, ends = {**sides, **mesh.sets}, []
    for end, name in (("moving", section.moving), ("fixed", section.fixed)):
        if name not in known or len(known[name]) == 0:
            raise toml.error(
                f"{key}.{end}",
                f"names {name!r}, which is not a group of the mesh ({len(mesh.cells)} cells, "
                f"{len(points)} points)",
                allowed=", ".join([*mesh.sets, *sides]),
                cure="name a physical group of surfaces, or a side of the body's box",
            )
        ends.append(known[name])
    moving, fixed = ends
    if np.isin(moving, fixed).any():
        raise toml.error(f"{key}.moving", f"shares points with {key}.fixed", cure="name two ends apart")
    return replace(mesh, sets={"bond_x+": moving, "bond_x-": fixed})


def _check_sphere(toml: TomlFile, key: str, shape: BodyShape, samples: Samples) -> None:
    """Reject a sphere that moves away from the body."""
    if shape.sphere is not None and shape.way * samples.displacement[-1, 0] < 0.0:
        sign = ">" if shape.way > 0.0 else "<"
        raise toml.error(
            f"{key}.displacement",
            "draws the sphere away from the body",
            allowed=f"displacement and force {sign} 0, the sign of a push along the axis towards the body",
            cure="change the sign of both columns",
        )


def read_constants(toml: TomlFile, key: str, law: str, given: dict[str, Any]) -> dict[str, float]:
    """A law's constants with their units, in SI.

    Poisson's ratio is not included.

    Raises InputError if one is missing, unknown or cannot be read.
    """
    specs = {spec.name: spec for spec in constants_of(law) if spec.name != POISSON}
    for name in specs:
        if name not in given:
            raise toml.error(f"{key}.{name}", "is missing", cure=f"{law} has {', '.join(specs)}")
    values: dict[str, float] = {}
    for name, value in given.items():
        if name not in specs:
            raise toml.error(f"{key}.{name}", f"is not a constant of {law}", allowed=", ".join(specs))
        if specs[name].unit == "1" and isinstance(value, int | float) and not isinstance(value, bool):
            values[name] = float(value)
            continue
        try:
            values[name] = quantity(value, specs[name].unit)
        except UnitError as error:
            raise toml.error(f"{key}.{name}", error.problem, cure=f'write {name} = "12.5 kPa"') from None
    return values


def _samples(toml: TomlFile, section: TestSection) -> tuple[Samples, str]:
    """Measured displacements and forces of a test, and the hash of their file."""
    assert section.file is not None
    path = toml.path.parent / section.file
    table = read_table(path, layout=None if section.layout is None else section.layout.as_layout())
    displacement = np.stack(
        [table.values(column.as_column()) for column in section.columns("displacement")], -1
    )
    force = np.stack([table.values(column.as_column()) for column in section.columns("force")], -1)
    if len(force) < FEWEST:
        raise InputError(
            path, f"has {len(force)} samples; it must be at least {FEWEST}", cure="export more of the test"
        )
    away = displacement * np.where(displacement[-1] < 0.0, -1.0, 1.0)
    back = np.flatnonzero((np.diff(away, axis=0) <= 0.0).any(axis=1))
    if back.size or (away[0] < 0.0).any():
        row = int(back[0]) + 1 if back.size else 0
        raise InputError(
            path,
            f"the displacement turns back: {1e3 * displacement[row, int(np.argmin(away[row]))]:g} mm",
            line=table.first_line + row,
            cure="keep one pull or one push from rest; first and last pull are two tests",
        )
    if np.sum(force * displacement) <= 0.0:
        raise InputError(
            path,
            "force and displacement have opposite signs",
            allowed="both are > 0 in a pull and < 0 in a push, or the other way round in both",
            cure="change the sign of one column",
        )
    return Samples(displacement, force, section.sigma_displacement, section.sigma_force), table.sha256


@dataclass(frozen=True)
class Simulated:
    """A simulated test."""

    displacement: FloatArray
    """Displacement of the ends, with noise if requested [m], shape [n, ends]."""
    force: FloatArray
    """Force on the ends, with noise if requested [N], shape [n, ends]."""
    solution: Solution
    """Equilibria at the true displacements."""

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Columns of its CSV file, which `[tests.NAME]` can name."""
        columns = {}
        for end in range(self.displacement.shape[1]):
            columns[f"displacement {AXES[end]} (mm)"] = 1e3 * self.displacement[:, end]
            columns[f"force {AXES[end]} (N)"] = self.force[:, end]
        return columns


def simulate_tests(spec: Specification, *, seed: int | None = None) -> dict[str, Simulated]:
    """Simulate every test of a specification with its declared constants.

    ``seed``: of the noise of displacements and forces; None: no noise.
    """
    rng = None if seed is None else np.random.default_rng(seed)
    solid = spec.constants.solid(spec.constants.start)
    made = {}
    for name, model in spec.models.items():
        section = spec.declared.tests[name]
        d = spec.schedule(name)
        solution = model.simulate(solid, d)
        solution.outcome.require(name)
        force = model.force(solution)
        if rng is not None:
            d = d + section.sigma_displacement * rng.standard_normal(d.shape)
            force = force + section.sigma_force * rng.standard_normal(force.shape)
        made[name] = Simulated(d, force, solution)
    return made
