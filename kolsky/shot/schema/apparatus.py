"""The tables of shot.toml about the test: [specimen], [interface], [transmission], [model], [window]."""

from dataclasses import dataclass
from typing import Literal

from pydantic import model_validator

from kolsky.base.apparatus import Interface
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section


class SpecimenSection(Section):
    """[specimen]: a right circular cylinder."""

    diameter: f.Length
    length: f.Length
    density: f.Density


@dataclass(frozen=True)
class ContactKey:
    """A number of [interface] that some contact laws read."""

    read_by: str
    """Field of `explicit.contact.ContactLaw` that says whether a law reads it."""
    example: str
    """A value as the shot file has it."""
    unit: str = ""
    """SI unit; empty for a plain number."""


CONTACT_KEYS = {
    "friction": ContactKey("needs_friction", "0.3"),
    "release_stress": ContactKey("needs_release_stress", '"50 kPa"', "Pa"),
    "contact_stiffness": ContactKey("needs_stiffness", '"1e13 Pa/m"', "Pa/m"),
}
"""Keys of [interface] beside the names of laws; each is a field of `kolsky.base.apparatus.Interface` too."""


def keys_read(*laws: str) -> list[str]:
    """The keys of [interface] that at least one of these contact laws reads."""
    from explicit.contact import CONTACT_LAWS

    return [
        name
        for name, key in CONTACT_KEYS.items()
        if any(getattr(CONTACT_LAWS[law], key.read_by) for law in laws)
    ]


class InterfaceSection(Section):
    """[interface]: how faces and side surface hold to the platens."""

    faces: f.ContactLawName
    side: f.ContactLawName
    friction: f.Friction | None = None
    release_stress: f.ReleaseStress | None = None
    contact_stiffness: f.ContactStiffness | None = None

    @model_validator(mode="after")
    def _numbers_where_they_act(self) -> "InterfaceSection":
        from explicit.contact import CONTACT_LAWS

        for name, key in CONTACT_KEYS.items():
            needing = [law for law in (self.faces, self.side) if name in keys_read(law)]
            given = getattr(self, name) is not None
            if needing and not given:
                raise f.problem(
                    f'is missing; the law "{needing[0]}" needs it',
                    key=name,
                    cure=f"add e.g. {name} = {key.example}",
                )
            if given and not needing:
                able = f.alternatives(law for law in CONTACT_LAWS if name in keys_read(law))
                raise f.problem(
                    f'is given, but neither "{self.faces}" on the faces nor "{self.side}" on the side reads '
                    "it, so it would have no effect",
                    key=name,
                    cure=f"remove it, or choose the law {able}",
                )
        return self

    def interface(self) -> Interface:
        """The interface for a simulation; a number that no law reads keeps its default."""
        given = {name: getattr(self, name) for name in CONTACT_KEYS}
        numbers = {name: value for name, value in given.items() if value is not None}
        return Interface(faces=self.faces, side=self.side, **numbers)


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
    transducer_depth: f.Length | None = None
    """Distance of the force transducer behind the platen's face, along the bar."""

    @model_validator(mode="after")
    def _transducer_on_the_bar(self) -> "TransmissionSection":
        depth, bar = self.transducer_depth, self.bar
        if depth is not None and self.support == "rigid":
            raise f.problem(
                'is given, but support = "rigid": nothing moves, and the force is the same everywhere',
                key="transducer_depth",
                cure='remove it, or write support = "bar"',
            )
        if depth is not None and bar is not None and not depth < 0.5 * bar.length:
            raise f.problem(
                "is not allowed",
                key="transducer_depth",
                allowed=f"below half the bar, {0.5 * bar.length:g} m",
            )
        return self

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
