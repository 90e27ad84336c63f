"""The tables of shot.toml about the test: [specimen], [interface], [transmission], [window], and so on."""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field, model_validator

from kolsky.base.apparatus import Bar, ElasticBody, Interface
from kolsky.schema import fields as f
from kolsky.schema.fields import Section


class SpecimenSection(Section):
    """[specimen]: a right circular cylinder."""

    diameter: f.Length
    length: f.Length
    density: f.Density


@dataclass(frozen=True)
class ContactKey:
    """A number of [interface] that only some contact laws need."""

    read_by: str
    """Field of `explicit.contact.ContactLaw` that is true if a law needs it."""
    example: str
    """An example value as written in the shot file."""
    unit: str = ""
    """SI unit; empty for a plain number."""


CONTACT_KEYS = {
    "friction": ContactKey("needs_friction", "0.3"),
    "release_stress": ContactKey("needs_release_stress", '"50 kPa"', "Pa"),
    "contact_stiffness": ContactKey("needs_stiffness", '"1e13 Pa/m"', "Pa/m"),
}
"""Numeric keys of [interface]; each is also a field of `kolsky.base.apparatus.Interface`."""


def keys_read(*laws: str) -> list[str]:
    """The keys of [interface] that at least one of these contact laws reads."""
    from explicit.contact import CONTACT_LAWS

    return [
        name
        for name, key in CONTACT_KEYS.items()
        if any(getattr(CONTACT_LAWS[law], key.read_by) for law in laws)
    ]


class InterfaceSection(Section):
    """[interface]: contact of faces and side surface with the platens."""

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
                    f'is given, but the laws "{self.faces}" on the faces and "{self.side}" on the side do '
                    "not use it, so it would have no effect",
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


class PartSection(BarSection):
    """[transmission.parts.NAME] or [flyer_body.parts.NAME]: a uniform round part."""


def elastic_body(
    section: "TransmissionSection | FlyerBodySection", model: str, *, seen_at: float = 0.0
) -> ElasticBody:
    """The parts of a section, in their order, as input of a simulation."""
    parts = tuple(Bar(**part.model_dump()) for part in section.parts.values())
    return ElasticBody(
        model=model,
        parts=parts,
        element_size=(section.element_size or MESHED * min(part.diameter for part in parts))
        if model == "mesh"
        else 0.0,
        transducer_depth=section.transducer_depth or 0.0,
        seen_at=seen_at,
    )


MESHED = 1.0 / 6.0
"""Default of the largest element side, divided by the smallest diameter of a part [-]."""


def _check_inside(
    depth: float | None, length: float, what: str = "the parts' length", key: str = "transducer_depth"
) -> None:
    """Check that a position lies between the two ends of the parts."""
    if depth is not None and not depth < length:
        raise f.problem("is not allowed", key=key, allowed=f"below {what}, {length:g} m")


class TransmissionSection(Section):
    """[transmission]: the support behind the specimen."""

    support: Literal["rigid", "bar", "mesh"]
    bar: BarSection | None = None
    parts: dict[str, PartSection] = Field(default_factory=dict)
    """Platen, transducer and bar for support = "mesh", in order from the specimen."""
    element_size: f.Length | None = None
    """Largest side of their elements; default: a sixth of the smallest diameter."""
    transducer_depth: f.Length | None = None
    """Distance of the force transducer behind the platen's face, along the bar or the parts."""

    @model_validator(mode="after")
    def _keys_of_the_support(self) -> "TransmissionSection":
        support, other = f'support = "{self.support}"', "remove it, or write support = "
        if self.support == "rigid":
            why = f"{support}: nothing moves, and the force is the same everywhere"
            self.without(("transducer_depth",), why, f'{other}"bar"')
        if self.support == "bar":
            self.needs(
                "bar",
                support,
                "add a table [transmission.bar] with diameter, length, youngs_modulus, density",
            )
        else:
            self.without(("bar",), support, f'{other}"bar"')
        if self.bar is not None:
            _check_inside(self.transducer_depth, 0.5 * self.bar.length, "half the bar")
        if self.support != "mesh":
            self.without(("parts", "element_size"), support, f'{other}"mesh"')
            return self
        self.needs(
            "parts",
            support,
            "add tables [transmission.parts.platen], [transmission.parts.bar] with diameter, "
            "length, youngs_modulus, density, the specimen's side first",
        )
        _check_inside(self.transducer_depth, sum(p.length for p in self.parts.values()))
        return self


class FlyerBodySection(Section):
    """[flyer_body]: the flyer as an elastic body between the measured place and the specimen."""

    model: Literal["rigid", "bar", "mesh"]
    parts: dict[str, PartSection] = Field(default_factory=dict)
    """Its parts, in order from the specimen."""
    element_size: f.Length | None = None
    """Largest side of the elements of a mesh; default: a sixth of the smallest diameter."""
    transducer_depth: f.Length | None = None
    """Distance of the incident force's transducer behind the face."""
    seen_at: f.Length | None = None
    """Distance from the face to the place of measured displacement; default: the face."""

    @model_validator(mode="after")
    def _parts_where_they_act(self) -> "FlyerBodySection":
        if self.model == "rigid":
            keys = ("parts", "element_size", "transducer_depth", "seen_at")
            self.without(keys, 'model = "rigid": all of it moves as one', 'write model = "bar" or "mesh"')
            return self
        self.needs(
            "parts",
            f'model = "{self.model}"',
            "add tables [flyer_body.parts.platen] and so on with diameter, length, youngs_modulus, "
            "density, the specimen's side first",
        )
        if self.model == "bar":
            self.without(("element_size",), 'model = "bar" has no elements', 'write model = "mesh"')
        for key in ("transducer_depth", "seen_at"):
            _check_inside(getattr(self, key), sum(part.length for part in self.parts.values()), key=key)
        return self


class ModelSection(Section):
    """[model]: material constants that the curve does not give."""

    poisson: f.SpecimenPoisson
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


IDENTIFY_KEYS = (
    "poisson",
    "damping",
    "friction",
    "curve_scale",
    "specimen_diameter",
    "specimen_length",
    "specimen_density",
    "sensitivity",
    "clock_offset",
    "Z_offset",
    "y_offset",
)
"""Keys that `kolsky identify` propagates to its result, in the order of its report. `kolsky.shot.inputs`
describes these inputs."""
REDUCTION_KEYS = (
    "bar_wave_speed",
    "bar_modulus",
    "bar_density",
    "bar_diameter",
    "bar_poisson",
    "gauge_calibration",
    "gauge_distance",
    "specimen_diameter",
    "specimen_length",
    "specimen_density",
)
"""Keys that `kolsky waves` propagates to the results of a test between bars."""
_IDENTIFY_ONLY = {*IDENTIFY_KEYS, "length_in_pictures"} - {*REDUCTION_KEYS, "sensitivity"}


class UncertaintySection(Section):
    """[uncertainty]: standard uncertainties (k = 1); undeclared inputs are taken as exact."""

    bar_modulus: f.Uncertainty = 0.0
    bar_wave_speed: f.Uncertainty = 0.0
    bar_density: f.Uncertainty = 0.0
    bar_diameter: f.Uncertainty = 0.0
    bar_poisson: f.Deviation = 0.0
    bars_alike: bool = False
    gauge_calibration: f.Uncertainty = 0.0
    gauge_distance: f.LengthDeviation = 0.0
    specimen_diameter: f.Uncertainty = 0.0
    specimen_length: f.Uncertainty = 0.0
    specimen_density: f.Uncertainty = 0.0
    sensitivity: f.Uncertainty = 0.0
    mass: f.Uncertainty = 0.0
    poisson: f.Deviation = 0.0
    damping: f.TimeDeviation = 0.0
    friction: f.Friction = 0.0
    curve_scale: f.Uncertainty = 0.0
    clock_offset: f.TimeDeviation = 0.0
    Z_offset: f.LengthDeviation = 0.0
    y_offset: f.LengthDeviation = 0.0
    length_in_pictures: f.LengthDeviation = 0.0

    @model_validator(mode="after")
    def _one_stiffness(self) -> "UncertaintySection":
        if self.bar_modulus > 0.0 and self.bar_wave_speed > 0.0:
            raise f.problem(
                "is given in addition to bar_modulus; with the density each follows from the other",
                key="bar_wave_speed",
                cure="keep the one that was measured",
            )
        return self

    def for_waves(self) -> dict[str, float | bool]:
        """Uncertainties for the reduction of waves."""
        return self.model_dump(exclude=_IDENTIFY_ONLY)

    def for_identify(self) -> dict[str, float]:
        """Declared uncertainties of `IDENTIFY_KEYS`; undeclared keys are absent."""
        return {key: getattr(self, key) for key in IDENTIFY_KEYS if key in self.model_fields_set}
