"""SPEC.toml of an actuator: geometry or mesh, material, gravity, pressures, and what is asked of it."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import ColumnSection, LengthColumn, Section, TextLayoutSection

Pressure = Annotated[float, BeforeValidator(f.physical("Pa", ">= 0", "a pressure"))]
Angle = Annotated[float, BeforeValidator(f.physical("rad", what="an angle"))]
Acceleration = Annotated[float, BeforeValidator(f.number)]
Count = Annotated[int, Field(ge=1, le=200)]
Vector = Annotated[list[Acceleration], Field(min_length=3, max_length=3)]


class PressureColumn(ColumnSection):
    """A column of pressures."""

    unit: f.StressUnit


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
        if extra:
            raise f.problem("has no effect beside a mesh", key=extra[0], cure="remove it")
        if self.mesh_unit is None:
            raise f.problem("is missing", key="mesh_unit", cure='write the unit of its points, e.g. "mm"')
        return self


class MaterialSection(Section):
    """[material]: a law with its constants, how it resists a change of volume, its density."""

    law: f.Name = "neo_hookean"
    constants: dict[str, Any]
    D1: Any = None
    poisson: f.Poisson | None = None
    density: f.Density
    mixed: bool = False

    @model_validator(mode="after")
    def _one_volume(self) -> "MaterialSection":
        if (self.D1 is None) == (self.poisson is None):
            raise f.problem(
                "or poisson must be given, one of the two",
                key="D1",
                cure='write D1 = "1.150 1/MPa" where U = (J - 1)^2 / D1, D1 = "1.150 MPa" where '
                "U = D1 (J - 1)^2",
            )
        return self


class ContactSection(Section):
    """[contact]: neighbouring chambers touch, by a penalty."""

    penalty: Annotated[float, Field(gt=0.0, le=1e6)] = 500.0
    depth: f.Length | None = None


class PathSection(Section):
    """[path]: the equilibria are followed by arc length, past limit points of the pressure."""

    first: Pressure
    steps: Annotated[int, Field(ge=1, le=5000)] = 200
    longest: Annotated[float, Field(ge=1.0, le=1000.0)] = 4.0

    @model_validator(mode="after")
    def _begins(self) -> "PathSection":
        if not self.first > 0.0:
            raise f.problem("must be > 0", key="first", cure='write the pressure of a small step, "0.02 bar"')
        return self


class PronySection(Section):
    """One term of [motion] prony: the stress at once over the slow one, less 1, and its time."""

    share: Annotated[float, Field(gt=0.0, le=100.0)]
    time: f.PositiveTime


class MotionSection(Section):
    """[motion]: the largest pressure raised in time, with inertia and damping."""

    ramp: f.PositiveTime
    hold: f.PositiveTime
    step: f.PositiveTime
    scheme: Literal["backward_euler", "trapezoidal"] = "backward_euler"
    prony: list[PronySection] = Field(default_factory=list)

    @model_validator(mode="after")
    def _several(self) -> "MotionSection":
        if not 4.0 <= (self.ramp + self.hold) / self.step <= 10_000.0:
            raise f.problem("makes too few or too many steps", key="step", allowed="4 to 10 000 steps in all")
        return self


class InvertSection(Section):
    """[invert]: the wanted bend, and the largest pressure."""

    angles: Annotated[list[Angle], Field(min_length=1)]
    most: Pressure
    tip: Annotated[list[f.Offset], Field(min_length=3, max_length=3)] | None = None


class ControlSection(Section):
    """[control]: the closed loop and the plant it is tried on."""

    angles: Annotated[list[Angle], Field(min_length=1)]
    hold: f.PositiveTime = 5.0
    rate: Annotated[float, Field(gt=0.0, le=10_000.0)] = 20.0
    gain: Annotated[float, Field(gt=0.0, le=2.0)] = 0.3
    most: Pressure
    modes: Annotated[int, Field(ge=1, le=60)] = 8
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] = 1e-3
    snapshots: Annotated[int, Field(ge=3, le=200)] = 13
    plant_stiffness: Annotated[float, Field(gt=0.0, le=10.0)] = 0.85
    delay: Annotated[int, Field(ge=0, le=50)] = 1
    lag: Annotated[float, BeforeValidator(f.physical("s", ">= 0"))] = 0.05
    noise: Annotated[float, BeforeValidator(f.physical("rad", ">= 0"))] = 0.0
    seed: Annotated[int, Field(ge=0)] = 1
    real_time: bool = False


class MarkersSection(Section):
    """[markers]: measured centroids of the markers, one row a direction, pressure and marker."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    x: LengthColumn
    z: LengthColumn
    gravity: f.Name = "gravity"
    pressure: PressureColumn
    marker: f.Name = "marker"
    sigma: f.LengthDeviation


class ActuatorFile(Section):
    """A whole SPEC.toml."""

    geometry: GeometrySection = Field(default_factory=GeometrySection)
    material: MaterialSection
    gravity: dict[str, Vector]
    pressures: Annotated[list[Pressure], Field(min_length=1)]
    healed: dict[str, Any] | None = None
    contact: ContactSection | None = None
    path: PathSection | None = None
    motion: MotionSection | None = None
    invert: InvertSection | None = None
    control: ControlSection | None = None
    markers: MarkersSection | None = None

    @model_validator(mode="after")
    def _rising(self) -> "ActuatorFile":
        if any(b <= a for a, b in zip(self.pressures[:-1], self.pressures[1:], strict=True)):
            raise f.problem("do not rise", key="pressures", cure="list them from small to large")
        if not self.gravity:
            raise f.problem("is empty", key="gravity", cure="write e.g. downward = [0.0, 0.0, -9.81]")
        return self
