"""SPEC.toml of an actuator: its tables, and the actuator, gravity directions and pressures from them."""

from dataclasses import dataclass, replace
from itertools import count, pairwise, takewhile
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from kolsky.base.arrays import FloatArray
from kolsky.base.toml import TomlFile, read_toml
from kolsky.base.units import UnitError, quantity
from kolsky.bodies.actuator_model import TIGHT, Actuator, Part, Pneunet, outside
from kolsky.bodies.specimen_constants import COUPLED, POISSON, solid_of
from kolsky.bodies.specimen_reading import read_body, read_constants
from kolsky.equilibrium.loads import rim
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.model import Fixed, RigidSurface, SelfContact, unit
from kolsky.equilibrium.solid import Isotropic, Solid, bulk
from kolsky.schema import fields as f
from kolsky.schema.fields import LengthColumn, Section, StressColumn, TextLayoutSection

Pressure = Annotated[float, BeforeValidator(f.physical("Pa", ">= 0", "a pressure"))]
Gauge = Annotated[float, BeforeValidator(f.physical("Pa", what="a pressure over that outside"))]
"""Gauge pressure [Pa]; below 0 it is suction."""
Angle = Annotated[float, BeforeValidator(f.physical("rad", what="an angle"))]
Acceleration = Annotated[float, BeforeValidator(f.number)]
Count = Annotated[int, Field(ge=1, le=200)]
Vector = Annotated[list[Acceleration], Field(min_length=3, max_length=3)]


class GeometrySection(Section):
    """[geometry]: dimensions of a row of chambers, or the file of a mesh."""

    mesh: f.FileName | None = None
    mesh_unit: f.LengthUnit | None = None
    chambers: Count = 6
    wall: f.Length = 2.5e-3
    base: f.Length = 2.5e-3
    chamber: Annotated[list[f.Length], Field(min_length=3, max_length=3)] | None = None
    gap: f.Length = 2e-3
    channel: Annotated[list[f.Length], Field(min_length=2, max_length=2)] | None = None
    inlet: f.Length = 5e-3
    cell: f.Length = 4e-3
    through_wall: Annotated[int, Field(ge=1, le=8)] = 1
    element: Literal["hex27", "hex8", "tet10", "tet4"] = "hex27"
    half: bool = True
    separate: bool = False

    @model_validator(mode="after")
    def _one_of_them(self) -> "GeometrySection":
        if self.mesh is None:
            return self
        extra = sorted(self.model_fields_set - {"mesh", "mesh_unit"})
        f.reject(
            (bool(extra), "".join(extra[:1]), "has no effect with a mesh", "remove it"),
            (self.mesh_unit is None, "mesh_unit", "is missing", 'write the unit of its points, e.g. "mm"'),
        )
        return self


class ConstantsSection(Section):
    """Constants of a law, including its resistance to volume change."""

    constants: dict[str, Any]
    D1: Any = None
    poisson: f.Poisson | None = None

    @model_validator(mode="after")
    def _one_volume(self) -> "ConstantsSection":
        if (self.D1 is None) == (self.poisson is None):
            raise f.problem(
                "or poisson must be given, one of the two",
                key="D1",
                cure='write D1 = "1.150 1/MPa" where U = (J - 1)^2 / D1, D1 = "1.150 MPa" where '
                "U = D1 (J - 1)^2",
            )
        return self


class MaterialSection(ConstantsSection):
    """[material]: a law with its constants and its density."""

    law: f.Name = "neo_hookean"
    density: f.Density
    mixed: bool = False


class PartSection(ConstantsSection):
    """[part.NAME]: cells between two heights, or in the mesh set NAME, with other constants of the law."""

    height: Annotated[list[f.Offset], Field(min_length=2, max_length=2)] | None = None
    density: f.Density | None = None


class PlaneSection(Section):
    """[plane.NAME]: a rigid plane without friction."""

    point: Annotated[list[f.Offset], Field(min_length=3, max_length=3)]
    normal: Vector
    set: f.Name | None = None


class BlockedSection(Section):
    """[blocked]: a set of points that is fixed at its rest position."""

    set: f.Name = "end"
    axes: Annotated[tuple[Literal["x", "y", "z"], ...], Field(min_length=1, max_length=3)] = ("z",)


class ContactSection(Section):
    """[contact]: neighbouring chambers touch, by a penalty."""

    penalty: Annotated[float, Field(gt=0.0, le=1e6)] = 500.0
    depth: f.Length | None = None


class InvertSection(Section):
    """[invert]: the target bend, and the largest pressure."""

    angles: Annotated[list[Angle], Field(min_length=1)]
    most: Gauge
    tip: Annotated[list[f.Offset], Field(min_length=3, max_length=3)] | None = None


class ControlSection(Section):
    """[control]: the closed loop and its simulated plant."""

    angles: Annotated[list[Angle], Field(min_length=1)]
    hold: f.PositiveTime = 5.0
    rate: Annotated[float, Field(gt=0.0, le=10_000.0)] = 20.0
    gain: Annotated[float, Field(gt=0.0, le=2.0)] = 0.3
    most: Pressure
    modes: Annotated[int, Field(ge=1, le=60)] = 8
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] = 1e-3
    error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    snapshots: Annotated[int, Field(ge=3, le=200)] = 13
    plant_stiffness: Annotated[float, Field(gt=0.0, le=10.0)] = 0.85
    delay: Annotated[int, Field(ge=0, le=50)] = 1
    lag: Annotated[float, BeforeValidator(f.physical("s", ">= 0"))] = 0.05
    noise: Annotated[float, BeforeValidator(f.physical("rad", ">= 0"))] = 0.0
    seed: Annotated[int, Field(ge=0)] = 1
    real_time: bool = False


class MarkersSection(Section):
    """[markers]: measured centroids of the markers, one row per direction, pressure and marker."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    x: LengthColumn
    z: LengthColumn
    gravity: f.Name = "gravity"
    pressure: StressColumn
    marker: f.Name = "marker"
    sigma: f.LengthDeviation


class ActuatorFile(Section):
    """A whole SPEC.toml."""

    geometry: GeometrySection = Field(default_factory=GeometrySection)
    material: MaterialSection
    gravity: dict[str, Vector]
    pressures: Annotated[list[Gauge], Field(min_length=1)]
    healed: dict[str, Any] | None = None
    part: dict[str, PartSection] = Field(default_factory=dict)
    plane: dict[str, PlaneSection] = Field(default_factory=dict)
    blocked: BlockedSection | None = None
    contact: ContactSection | None = None
    invert: InvertSection | None = None
    control: ControlSection | None = None
    markers: MarkersSection | None = None

    @model_validator(mode="after")
    def _rising(self) -> "ActuatorFile":
        sizes = [abs(one) for one in self.pressures]
        both = min(self.pressures) < 0.0 < max(self.pressures)
        falling = any(b <= a for a, b in pairwise(sizes))
        blocked = self.blocked is not None and self.invert is not None
        f.reject(
            (falling, "pressures", "do not rise", "list them from small to large, as suction too"),
            (both, "pressures", "are of both signs", "simulate pressure and suction from two files"),
            (blocked, "invert", "has no effect on a blocked actuator", "remove one of them"),
            (not self.gravity, "gravity", "is empty", "write e.g. downward = [0.0, 0.0, -9.81]"),
        )
        return self


SIZES = (1e-3, 3.0)
"""Smallest and largest length of a soft actuator [m]. Published ones have some mm to 1 m. Larger ones of
silicone collapse under their weight. A unit error is a factor of ten or more."""
NEEDED = ("clamp", "origin", "tip")
"""Sets that a mesh from a file must have, in addition to "cavity" or "cavity_1" and so on."""


@dataclass(frozen=True)
class ActuatorSpec:
    """A SPEC.toml that was read."""

    toml: TomlFile
    declared: ActuatorFile
    """Its declared values, in SI."""
    actuator: Actuator
    healed: Solid | None
    inputs: dict[str, str]
    """SHA-256 of every file that was read, by name."""

    @property
    def name(self) -> str:
        """Name of the file without its ending."""
        return self.toml.path.stem

    @property
    def gravities(self) -> dict[str, FloatArray]:
        """Acceleration of free fall of each direction [m/s^2], shape [3]."""
        return {name: np.array(g) for name, g in self.declared.gravity.items()}

    @property
    def pressures(self) -> FloatArray:
        """Pressures [Pa], increasing, shape [n]."""
        return np.array(self.declared.pressures)


def read_actuator(path: Path, *, device: str = "cpu") -> ActuatorSpec:
    """Read a SPEC.toml of an actuator and its mesh, if it names one.

    Raises InputError if it declares anything unknown, incomplete or impossible, or if a file cannot be read.
    """
    toml, declared = read_toml(Path(path), ActuatorFile)
    inputs = {toml.path.name: toml.sha256}
    shape = None
    if declared.geometry.mesh is None:
        with toml.refusing("geometry", "makes no actuator"):
            shape = _pneunet_of(declared)
        _check_size(toml, max(shape.length, *shape.chamber))  # before a mesh of as many cells is made
        mesh, cavities = shape.mesh, shape.cavities
    else:
        file, unit_of_points = declared.geometry.mesh, declared.geometry.mesh_unit
        assert unit_of_points is not None  # checked by the schema
        mesh = read_body(toml, "geometry.mesh", file, unit_of_points, inputs)
        cavities = tuple(sorted(name for name in mesh.sets if name.split("_")[0] == "cavity"))
        missing = [name for name in NEEDED if name not in mesh.sets] + ([] if cavities else ["cavity"])
        if missing:
            raise toml.error(
                "geometry.mesh",
                f"has no set {missing[0]!r}; it has {', '.join(sorted(mesh.sets)) or 'none'}",
                cure='name the points in Gmsh\'s physical groups, or point data "set:clamp" of a VTU file',
            )
        _check_closed(toml, mesh, cavities)
        _check_size(toml, float(np.ptp(mesh.points, axis=0).max()))
    section = declared.material
    law, given = section.law, section.constants
    solid = _solid(toml, "material", law, section)
    healed = None
    if declared.healed is not None:
        other = dict(declared.healed)
        d1 = other.pop("D1", section.D1)
        changed = section.model_copy(update={"constants": {**given, **other}, "D1": d1})
        healed = _solid(toml, "healed", law, changed, key="healed")
    parts = tuple(_part(toml, declared, name, mesh, shape) for name in declared.part)
    mesh, world = _world(toml, declared, mesh, cavities)
    contacts = _contacts_of(mesh, declared.contact)
    if declared.contact is not None and not contacts:
        raise toml.error(
            "contact",
            'needs the walls that may touch, the sets "gap_1_left" and "gap_1_right" and so on of the mesh',
            cure="name them, take two chambers or more, or remove [contact]",
        )
    actuator = Actuator(mesh, cavities, solid, section.density, section.mixed, device, contacts, parts, world)
    for name, g in declared.gravity.items():
        with toml.refusing(f"gravity.{name}", "cannot be used"):
            actuator.model(g)
    return ActuatorSpec(toml, declared, actuator, healed, inputs)


def _check_size(toml: TomlFile, size: float) -> None:
    """Check that the longest side of the actuator is plausible."""
    if not SIZES[0] <= size <= SIZES[1]:
        raise toml.error(
            "geometry",
            f"makes an actuator that is {1e3 * size:.4g} mm long",
            allowed=f"{1e3 * SIZES[0]:g} mm to {SIZES[1]:g} m",
            cure="check mesh_unit, or the units of the dimensions",
        )


_OPENINGS = ("clamp", "mirror", "inlet")
"""Sets at which the surface of a cavity may end. The closure of the cavity at such a set moves no point of
the body."""


def _check_closed(toml: TomlFile, mesh: Mesh, cavities: tuple[str, ...]) -> None:
    """Check that a cavity's surface ends at `_OPENINGS`: the pressure on an open one has a resultant."""
    known = [name for name in _OPENINGS if name in mesh.sets]
    for name in cavities:
        with toml.refusing("geometry.mesh", "has no surface to load"):
            ends = rim(mesh, name)
        for opening in known:
            ends = ends[~np.isin(ends, mesh.nodes(opening)).all(axis=1)]
        if len(ends) == 0:
            continue
        low, high = (end(1e3 * mesh.points[ends.ravel()], axis=0) for end in (np.min, np.max))
        place = ", ".join(
            f"{axis} = {a:.4g}" if np.isclose(a, b) else f"{axis} = {a:.4g} to {b:.4g}"
            for axis, a, b in zip("xyz", low, high, strict=True)
        )
        raise toml.error(
            "geometry.mesh",
            f"has an open surface {name!r}: {len(ends)} of its edges belong to one loaded face only, at "
            f"{place} mm",
            allowed=f"a closed surface, or one that ends on the set {', '.join(known)}",
            cure='add the missing points to the set, or name the points of an opening that is held "inlet"',
        )


def _part(toml: TomlFile, declared: ActuatorFile, name: str, mesh: Mesh, shape: Pneunet | None) -> Part:
    """The cells and the material of [part.NAME]."""
    section, key = declared.part[name], f"part.{name}"
    if shape is None:
        if section.height is not None:
            raise toml.error(f"{key}.height", "has no effect with a mesh", cure=f"name a set {name!r} in it")
        if name not in mesh.sets:
            raise toml.error(
                key,
                f"is not a set of the mesh; it has {', '.join(sorted(mesh.sets))}",
                cure="name the points of its cells as a set, or the physical volume",
            )
        cells = np.flatnonzero(np.isin(mesh.cells, mesh.nodes(name)).all(axis=1))
    else:
        if section.height is None:
            raise toml.error(f"{key}.height", "is missing", cure='write height = ["0 mm", "0.5 mm"]')
        low, high = section.height
        middle = mesh.points[mesh.cells, 2].mean(axis=1)
        cells = np.flatnonzero((middle > low) & (middle < high))
    if len(cells) == 0:
        raise toml.error(key, "has no cell of the mesh", cure="write the lower height first, inside the body")
    density = declared.material.density if section.density is None else section.density
    return Part(name, _solid(toml, key, declared.material.law, section), density, cells)


def _world(
    toml: TomlFile, declared: ActuatorFile, mesh: Mesh, cavities: tuple[str, ...]
) -> tuple[Mesh, tuple[Fixed | RigidSurface, ...]]:
    """The fixed set of [blocked], the planes, and the mesh with their sets, named as their tables."""
    world: list[Fixed | RigidSurface] = []
    held: FloatArray | Any = np.zeros(0, dtype=np.int64)
    if declared.blocked is not None:
        with toml.refusing("blocked.set", "cannot be held"):
            held = mesh.nodes(declared.blocked.set)
        world.append(Fixed(declared.blocked.set, tuple("xyz".index(axis) for axis in declared.blocked.axes)))
    for name, section in declared.plane.items():
        if name in mesh.sets:
            raise toml.error(f"plane.{name}", "has the name of a set of the mesh", cure="take another name")
        with toml.refusing(f"plane.{name}.set", "cannot touch"):
            own = outside(mesh, (*cavities, "mirror")) if section.set is None else mesh.nodes(section.set)
            mesh = mesh.with_set(name, np.setdiff1d(own, held))
        with toml.refusing(f"plane.{name}.normal", "is no direction"):
            normal = unit(tuple(section.normal))
        depth = float(((np.asarray(section.point) - mesh.points[mesh.nodes(name)]) @ normal).max())
        if depth > TIGHT * float(np.ptp(mesh.points, axis=0).max()):
            raise toml.error(
                f"plane.{name}.point",
                f"lies {1e3 * depth:.4g} mm inside the actuator at rest",
                cure="move the plane out, or turn its normal towards the actuator",
            )
        world.append(RigidSurface(name, tuple(section.normal), tuple(section.point)))
    return mesh, tuple(world)


def _pneunet_of(declared: ActuatorFile) -> Pneunet:
    """The dimensions that [geometry] declares, with the heights of the parts."""
    section = declared.geometry
    heights = tuple(z for part in declared.part.values() for z in part.height or ())
    sizes: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in section.model_dump(exclude={"mesh", "mesh_unit"}, exclude_none=True).items()
    }
    return Pneunet(**sizes, heights=heights)


def _contacts_of(mesh: Mesh, section: ContactSection | None) -> tuple[SelfContact, ...]:
    """The contacts of the walls at the gaps of a mesh; empty without a section."""
    if section is None:
        return ()
    gaps = takewhile(lambda n: f"gap_{n}_left" in mesh.sets, count(1))
    penalty, depth = section.penalty, section.depth
    return tuple(SelfContact(f"gap_{n}_left", f"gap_{n}_right", penalty=penalty, depth=depth) for n in gaps)


def volume_reading(d1: Any) -> float:
    """Bulk modulus K [Pa] from a declared D1. Its unit defines its meaning. In 1/Pa it belongs to U = (J -
    1)^2 / D1, K = 2 / D1 (Abaqus, and Table 1 of the paper). In Pa it belongs to U = D1 (J - 1)^2, K = 2 D1.
    """
    try:
        value, modulus = quantity(d1, "1/Pa"), None
    except UnitError:
        modulus = quantity(d1, "Pa")
        value = modulus
    if value <= 0.0:
        raise UnitError(d1, "is not > 0", "1/Pa" if modulus is None else "Pa")
    return 2.0 / value if modulus is None else 2.0 * value


def _solid(
    toml: TomlFile, where: str, law: str, section: ConstantsSection, *, key: str | None = None
) -> Solid:
    """The material of a table. `key`: the key of its constants, if it is not `constants`."""
    key = f"{where}.constants" if key is None else key
    values = read_constants(toml, key, law, section.constants)
    try:
        if section.poisson is not None:
            return solid_of(law, {**values, POISSON: section.poisson})
        if law == COUPLED:
            raise toml.error(f"{where}.D1", f"does not belong to {COUPLED}", cure="write poisson = 0.44")
        # only the bulk modulus differs: any Poisson's ratio makes the shear part
        made = solid_of(law, {**values, POISSON: 0.0})
        assert isinstance(made, Isotropic)
        return replace(made, volumetric=bulk(volume_reading(section.D1)))
    except UnitError as error:
        raise toml.error(f"{where}.D1", error.problem, cure='write "1.150 1/MPa" or "1.150 MPa"') from None
    except ValueError as error:
        raise toml.error(key, f"are not those of the law: {error}") from None
