"""Read SPEC.toml and its files: tests to be fitted, or to be simulated with noise."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile, read_toml
from kolsky.base.units import UnitError, quantity
from kolsky.bodies.errors_in_variables import Samples
from kolsky.bodies.specimen_constants import POISSON, Constants, constants_of
from kolsky.bodies.specimen_fit import SlowTest
from kolsky.bodies.specimen_model import AXES, TIGHT, BodyShape, SpecimenModel, shape_of
from kolsky.bodies.specimen_schema import SpecimenFile, TestSection
from kolsky.equilibrium.meshes import SIDES, Mesh
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.solution import Solution
from kolsky.readers.meshes import read_mesh
from kolsky.readers.table import read_table

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
        shape = shape_of(
            section,
            element=declared.numerics.element,
            density=material.density,
            body=None if section.mesh is None else _body(toml, f"tests.{name}", section, inputs),
        )
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
    return Specification(toml, declared, constants, models, samples, inputs)


def _body(toml: TomlFile, key: str, section: TestSection, inputs: dict[str, str]) -> Mesh:
    """The mesh of a test with its two ends as sets. A side's name means that side of the bounding box."""
    assert section.mesh is not None  # checked by the schema
    assert section.mesh_unit is not None
    raw = read_mesh(toml.path.parent / section.mesh, dimension=3)
    inputs[section.mesh] = raw.sha256
    points = section.mesh_unit * raw.points
    low, high = points.min(axis=0), points.max(axis=0)
    reach = TIGHT * float((high - low).max())
    sides = {
        name: np.flatnonzero(np.abs(points[:, axis] - end) <= reach)
        for axis, names in enumerate(SIDES)
        for name, end in zip(names, (low[axis], high[axis]), strict=True)
    }
    known = sides | raw.groups
    ends = {}
    for end, name in (("moving", section.moving), ("fixed", section.fixed)):
        if name not in known or len(known[name]) == 0:
            raise toml.error(
                f"{key}.{end}",
                f"names {name!r}, which is not a group of the mesh ({len(raw.cells)} cells, "
                f"{len(points)} points)",
                allowed=", ".join([*raw.groups, *sides]),
                cure="name a physical group of surfaces, or a side of the body's box",
            )
        ends[end] = known[name]
    if np.isin(ends["moving"], ends["fixed"]).any():
        raise toml.error(f"{key}.moving", f"shares points with {key}.fixed", cure="name two ends apart")
    sets = {"bond_x+": ends["moving"], "bond_x-": ends["fixed"]}
    mesh = Mesh(points, raw.cells, raw.kind, sets, raw.numbers)
    with toml.refusing(f"{key}.mesh", "has a bad cell", cure="mesh the body again"):
        geometry(mesh, kinematics="3d", thickness=1.0, gauss=None)
    return mesh


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
        if not solution.outcome.ok:
            raise ValueError(f"{name}: {solution.outcome.cause}; {solution.outcome.cure}")
        force = model.force(solution)
        if rng is not None:
            d = d + section.sigma_displacement * rng.standard_normal(d.shape)
            force = force + section.sigma_force * rng.standard_normal(force.shape)
        made[name] = Simulated(d, force, solution)
    return made
