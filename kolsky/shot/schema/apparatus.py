"""The tables of shot.toml about the test: [specimen], [interface], [transmission], [model], [window]."""

from typing import Literal

from pydantic import model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section


class SpecimenSection(Section):
    """[specimen]: a right circular cylinder."""

    diameter: f.Length
    length: f.Length
    density: f.Density


class InterfaceSection(Section):
    """[interface]: how faces and side surface hold to the platens."""

    faces: f.Law
    side: f.Law
    friction: f.Friction | None = None
    release_stress: f.ReleaseStress | None = None

    @model_validator(mode="after")
    def _friction_where_it_acts(self) -> "InterfaceSection":
        coulomb = "coulomb" in (self.faces, self.side)
        if coulomb and self.friction is None:
            raise f.problem(
                'is missing; the law "coulomb" needs it', key="friction", cure="add e.g. friction = 0.3"
            )
        if not coulomb and self.friction is not None:
            raise f.problem(
                'is given, but neither faces nor side is "coulomb", so it would have no effect',
                key="friction",
                cure='remove it, or choose the law "coulomb"',
            )
        return self

    @model_validator(mode="after")
    def _release_where_it_acts(self) -> "InterfaceSection":
        releasing = "bonded_release" in (self.faces, self.side)
        if releasing and self.release_stress is None:
            raise f.problem(
                'is missing; the law "bonded_release" needs it',
                key="release_stress",
                cure='add e.g. release_stress = "50 kPa"',
            )
        if not releasing and self.release_stress is not None:
            raise f.problem(
                'is given, but neither faces nor side is "bonded_release", so it would have no effect',
                key="release_stress",
                cure='remove it, or choose the law "bonded_release"',
            )
        return self


class BarSection(Section):
    """[transmission.bar]: a linear elastic bar."""

    diameter: f.Length
    length: f.Length
    youngs_modulus: f.Modulus
    density: f.Density
    poisson: f.Poisson = 0.29


class TransmissionSection(Section):
    """[transmission]: what stands behind the specimen."""

    support: Literal["rigid", "bar"]
    bar: BarSection | None = None

    @model_validator(mode="after")
    def _bar_where_it_acts(self) -> "TransmissionSection":
        if self.support == "bar" and self.bar is None:
            raise f.problem(
                'is missing; support = "bar" needs it',
                key="bar",
                cure="add a table [transmission.bar] with diameter, length, youngs_modulus, density",
            )
        if self.support == "rigid" and self.bar is not None:
            raise f.problem(
                'is given, but support = "rigid", so it would have no effect',
                key="bar",
                cure='remove the table, or write support = "bar"',
            )
        return self


class ModelSection(Section):
    """[model]: material constants that the curve does not give."""

    poisson: f.Poisson
    damping: f.Damping
    damping_kind: Literal["deviatoric", "full"]
    mass_damping: f.Rate = 0.0


class WindowSection(Section):
    """[window]: the time span that is simulated and compared."""

    start: f.Time | None = None
    end: f.Time | None = None

    @model_validator(mode="after")
    def _in_order(self) -> "WindowSection":
        if self.start is not None and self.end is not None and self.end <= self.start:
            raise f.problem(
                "is not allowed", key="end", allowed="later than window.start", cure="write start < end"
            )
        return self
