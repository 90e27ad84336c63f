"""From a SPEC.toml to an actuator with its directions of gravity and pressures."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from implicit.conditions import SelfContact
from implicit.laws.solid import Isotropic, Solid
from implicit.laws.volumetric import bulk
from implicit.meshes import Mesh, from_pyvista
from kolsky.actuator.geometry import Pneunet
from kolsky.actuator.model import Actuator
from kolsky.actuator.schema import ActuatorFile, ContactSection, GeometrySection
from kolsky.base.arrays import FloatArray
from kolsky.base.units import UnitError, quantity
from kolsky.readers.gmsh_volume import read_gmsh_volume
from kolsky.readers.vtu import read_vtu
from kolsky.shot.schema.reading import TomlFile, parse_toml
from kolsky.specimen.constants import COUPLED, POISSON, solid_of
from kolsky.specimen.reading import read_constants

NEEDED = ("clamp", "origin", "tip")
"""Sets that a mesh from a file must have, beside "cavity" or "cavity_1" and so on."""


@dataclass(frozen=True)
class ActuatorSpec:
    """A SPEC.toml that was read."""

    toml: TomlFile
    """The file."""
    declared: ActuatorFile
    """What it declares, in SI."""
    actuator: Actuator
    """The actuator."""
    shape: Pneunet | None
    """Its dimensions; None of a mesh from a file."""
    healed: Solid | None
    """The healed material, where its constants are declared."""
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
        """Pressures [Pa], rising, shape [n]."""
        return np.array(self.declared.pressures)


def read_actuator(path: Path, *, device: str = "cpu") -> ActuatorSpec:
    """Read a SPEC.toml of an actuator and its mesh, if it names one.

    Raises
    ------
    InputError
        If it declares anything unknown, incomplete or impossible, or a file cannot be read.
    """
    toml = parse_toml(Path(path))
    declared = toml.validated(ActuatorFile)
    inputs = {toml.path.name: toml.sha256}
    shape = None
    if declared.geometry.mesh is None:
        try:
            shape = pneunet_of(declared.geometry)
        except ValueError as error:
            raise toml.error("geometry", f"makes no actuator: {error}") from None
        mesh, cavities = shape.mesh, shape.cavities
    else:
        mesh = _mesh(toml, declared.geometry, inputs)
        cavities = tuple(sorted(name for name in mesh.sets if name.split("_")[0] == "cavity"))
        missing = [name for name in NEEDED if name not in mesh.sets] + ([] if cavities else ["cavity"])
        if missing:
            raise toml.error(
                "geometry.mesh",
                f"has no set {missing[0]!r}; it has {', '.join(sorted(mesh.sets)) or 'none'}",
                cure='name the points in Gmsh\'s physical groups, or point data "set:clamp" of a VTU file',
            )
    given = declared.material.constants
    solid = _solid(toml, declared, "material.constants", given, declared.material.D1)
    healed = None
    if declared.healed is not None:
        other = dict(declared.healed)
        d1 = other.pop("D1", declared.material.D1)
        healed = _solid(toml, declared, "healed", {**given, **other}, d1)
    contacts = contacts_of(mesh, declared.contact)
    if declared.contact is not None and not contacts:
        raise toml.error(
            "contact",
            'needs the walls that may touch, the sets "gap_1_left" and "gap_1_right" and so on of the mesh',
            cure="name them, take two chambers or more, or remove [contact]",
        )
    actuator = Actuator(
        mesh, cavities, solid, declared.material.density, declared.material.mixed, device, contacts
    )
    for name, g in declared.gravity.items():
        try:
            actuator.model(g)
        except ValueError as error:
            raise toml.error(f"gravity.{name}", f"cannot be used: {error}") from None
    return ActuatorSpec(toml, declared, actuator, shape, healed, inputs)


def pneunet_of(section: GeometrySection) -> Pneunet:
    """The dimensions that [geometry] declares."""
    given: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in section.model_dump(exclude={"mesh", "mesh_unit"}, exclude_none=True).items()
    }
    return Pneunet(**given)


def contacts_of(mesh: Mesh, section: ContactSection | None) -> tuple[SelfContact, ...]:
    """The contacts of the walls at the gaps of a mesh; none without a section."""
    found: list[SelfContact] = []
    while section is not None and f"gap_{len(found) + 1}_left" in mesh.sets:
        n = len(found) + 1
        found.append(
            SelfContact(f"gap_{n}_left", f"gap_{n}_right", penalty=section.penalty, depth=section.depth)
        )
    return tuple(found)


def volume_reading(d1: Any) -> float:
    """Bulk modulus K [Pa] of a written D1, by its unit.

    A compressibility is that of U = (J - 1)^2 / D1, K = 2 / D1 (Abaqus, and Table 1 of the paper); a modulus
    is that of U = D1 (J - 1)^2, K = 2 D1.

    Raises
    ------
    UnitError
        If it is neither.
    """
    try:
        value, modulus = quantity(d1, "1/Pa"), None
    except UnitError:
        modulus = quantity(d1, "Pa")
        value = modulus
    if value <= 0.0:
        raise UnitError(d1, "is not > 0", "1/Pa" if modulus is None else "Pa")
    return 2.0 / value if modulus is None else 2.0 * value


def _solid(toml: TomlFile, declared: ActuatorFile, key: str, given: dict[str, Any], d1: Any) -> Solid:
    law, poisson = declared.material.law, declared.material.poisson
    values = read_constants(toml, key, law, given)
    try:
        if poisson is not None:
            return solid_of(law, {**values, POISSON: poisson})
        if law == COUPLED:
            raise toml.error("material.D1", f"does not belong to {COUPLED}", cure="write poisson = 0.44")
        # only the bulk modulus is another: any Poisson's ratio makes the shear part
        made = solid_of(law, {**values, POISSON: 0.0})
        assert isinstance(made, Isotropic)
        return replace(made, volumetric=bulk(volume_reading(d1)))
    except UnitError as error:
        raise toml.error("material.D1", error.problem, cure='write "1.150 1/MPa" or "1.150 MPa"') from None
    except ValueError as error:
        raise toml.error(key, f"are not those of the law: {error}") from None


def _mesh(toml: TomlFile, section: GeometrySection, inputs: dict[str, str]) -> Mesh:
    assert section.mesh is not None  # asked for only then
    assert section.mesh_unit is not None  # the schema saw to it
    path = toml.path.parent / section.mesh
    if path.suffix.lower() == ".msh":
        raw = read_gmsh_volume(path)
        inputs[section.mesh] = raw.sha256
        return Mesh(section.mesh_unit * raw.points, raw.cells, raw.kind, raw.groups)
    grid, inputs[section.mesh] = read_vtu(path)
    try:
        made = from_pyvista(grid)
    except ValueError as error:
        raise toml.error("geometry.mesh", f"cannot be read: {error}", cure="save a VTU or MSH file") from None
    return replace(made, points=section.mesh_unit * made.points)
