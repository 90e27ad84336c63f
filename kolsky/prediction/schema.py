"""The tables of TEST.toml: striker, pulse shaper, bars, flyer and specimen of a planned test."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.base.apparatus import LIFTING_LAW
from kolsky.schema import fields as f
from kolsky.schema.apparatus import BarSection
from kolsky.schema.fields import Section
from kolsky.schema.material import RelaxationSection
from kolsky.virtual import schema as v
from kolsky.virtual.schema import MaterialTable, SpecimenTable

Force = Annotated[float, BeforeValidator(f.physical("N", ">= 0", "a force"))]
Stiffness = Annotated[float, BeforeValidator(f.physical("N/m", "> 0", "a slope of force over compression"))]
Opening = Annotated[float, BeforeValidator(f.physical("m", ">= 0", "the opening over which a joint fails"))]

KINDS = {
    "none": (),
    "disc": ("diameter", "height", "shear_modulus"),
    "table": ("file",),
    "pulse": ("file", "speed"),
}
"""Kind of pulse shaper -> the keys that it needs."""


class PartTable(BarSection):
    """A uniform round part: a bar, a platen, a transducer."""

    youngs_modulus: f.Modulus = 190e9
    density: f.Density = 8048.0


class StrikerTable(PartTable):
    """[striker]: the striker of a planned test."""

    speed: f.Velocity
    """Speed at impact [m/s]."""


class ShaperTable(Section):
    """[shaper]: the pulse shaper between striker and incident bar."""

    kind: Literal["none", "disc", "table", "pulse"]
    """Kind of pulse shaper: none; a rubber disc that slides on the steel; a measured table; or a law from a
    measured pulse."""
    diameter: f.Length | None = None
    height: f.Length | None = None
    shear_modulus: f.Modulus | None = None
    """Shear modulus of the disc's rubber at the rate of the test [Pa]."""
    file: f.FileName | None = None
    """A table: compression (mm), force (N). A pulse: time (us), force (N) of the incident wave."""
    speed: f.Velocity | None = None
    """Speed of the striker in the test in which the pulse was measured [m/s]."""
    unloading: Stiffness | None = None
    """Slope of unloading. Default: what the pulse shows, or the steepest slope of the loading curve."""

    @model_validator(mode="after")
    def _what_the_kind_needs(self) -> "ShaperTable":
        needed = KINDS[self.kind]
        for key in ("diameter", "height", "shear_modulus", "file", "speed"):
            given = getattr(self, key) is not None
            if given != (key in needed):
                problem = "is missing" if key in needed else "has no effect"
                cure = "add it" if key in needed else "remove it"
                raise f.problem(f'{problem}; kind = "{self.kind}"', key=key, cure=cure)
        if self.kind == "none" and self.unloading is not None:
            raise f.problem('has no effect; kind = "none"', key="unloading", cure="remove it")
        return self


class JointTable(Section):
    """[joint]: the adhesive between incident bar and flyer."""

    strength: Force
    """Tension at which it begins to fail [N]."""
    opening: Opening = 0.0
    """Gap at which its force has decreased to zero [m]."""


class RunTable(Section):
    """[run]: how the test is integrated."""

    duration: f.PositiveTime = 4e-3
    """Last time since the striker touched [s]."""
    step: f.PositiveTime = 1e-7
    """Time step of the bars [s]."""
    mesh: v.Mesh = (16, 22)
    """Elements of the specimen across the radius and along the length."""
    tolerance: Force = 0.02
    """Largest change of a force between two passes of bars and specimen [N]."""
    passes: Annotated[int, Field(ge=2, le=200)] = 20


class HoldTable(Section):
    """[interface]: contact of the specimen with the platens. The law must allow separation."""

    faces: f.ContactLawName = LIFTING_LAW
    side: f.ContactLawName = LIFTING_LAW
    friction: f.Friction = 0.0

    @model_validator(mode="after")
    def _lifts(self) -> "HoldTable":
        from explicit.contact import CONTACT_LAWS

        if CONTACT_LAWS[self.faces].carries_tension:
            able = f.alternatives(name for name, law in CONTACT_LAWS.items() if not law.carries_tension)
            raise f.problem(
                "would hold the flyer permanently, but the specimen pushes it away after the arrest",
                key="faces",
                allowed=able,
            )
        return self


class TestFile(Section):
    """A whole test, in SI. Parts of flyer and transmission side are named tables in their order."""

    __test__ = False  # no test of pytest's

    format: Literal[1] = 1
    name: f.Name = "test"
    striker: StrikerTable
    shaper: ShaperTable
    incident: PartTable
    joint: JointTable
    flyer: dict[str, PartTable]
    """Parts of the flyer, from the incident bar to the specimen."""
    transmission: dict[str, PartTable]
    """Parts of the transmission side, from the specimen on."""
    sensor: f.Name | None = None
    """The part of [transmission] with the force transducer at its middle. Default: the first face."""
    specimen: SpecimenTable
    material: MaterialTable
    relaxation: RelaxationSection | None = None
    interface: HoldTable = HoldTable()
    run: RunTable = RunTable()

    @model_validator(mode="after")
    def _whole(self) -> "TestFile":
        for key in ("flyer", "transmission"):
            if not getattr(self, key):
                raise f.problem("has no part", key=key, cure=f"add a table such as [{key}.platen]")
        if self.sensor is not None and self.sensor not in self.transmission:
            allowed = f.alternatives(self.transmission)
            raise f.problem("is no part of [transmission]", key="sensor", allowed=allowed)
        return self
