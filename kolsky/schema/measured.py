"""The tables of shot.toml about measurements: [force], [frames], [flyer], [centre_line], [surface]."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from kolsky.readers.dic_export import LAYOUTS
from kolsky.schema import fields as f
from kolsky.schema.fields import (
    LayoutSection,
    LengthColumn,
    Section,
    TextLayoutSection,
    TimeColumn,
    VoltageColumn,
)


class ForceSection(Section):
    """[force]: the transmitted force on a scope channel."""

    file: f.FileName
    time: TimeColumn | None = None
    voltage: VoltageColumn
    layout: LayoutSection | None = None
    sensitivity: f.Sensitivity
    compression: Literal["positive", "negative"]
    full_scale: f.Voltage
    time_constant: f.PositiveTime | None = None
    bits: Annotated[int, Field(ge=4, le=32)] | None = None
    baseline: f.Interval
    clock_offset: f.Time

    @model_validator(mode="after")
    def _some_time(self) -> "ForceSection":
        if self.time is None and self.layout is None:
            raise f.problem(
                "is missing", key="time", cure='write time = { column = "Time (s)", unit = "s" }, or a layout'
            )
        for key in ("time", "time_unit", "unit"):
            if (
                self.layout is not None
                and getattr(self.layout, key) is not None
                and (key == "unit" or self.time is not None)
            ):
                raise f.problem(
                    f"is given twice, in layout.{key} too",
                    key="voltage" if key == "unit" else "time",
                    cure=f"leave layout.{key} out",
                )
        return self


class IncidentForceSection(Section):
    """[incident_force]: the transducer in the flyer, behind a mass that moves with the flyer.

    Defaults are the values of [force], because both are usually channels of one recorder.
    """

    voltage: VoltageColumn
    sensitivity: f.Sensitivity
    mass: f.Mass
    compared: bool = False
    """True if the incident force is compared with simulations, in addition to the transmitted force."""
    file: f.FileName | None = None
    layout: LayoutSection | None = None
    time: TimeColumn | None = None
    compression: Literal["positive", "negative"] | None = None
    full_scale: f.Voltage | None = None
    time_constant: f.PositiveTime | None = None
    baseline: f.Interval | None = None
    clock_offset: f.Time | None = None

    def completed(self, force: ForceSection) -> ForceSection:
        """The channel completed with values of [force].

        A channel in another file needs a separate layout or time column.
        """
        given = {
            name: value
            for name in IncidentForceSection.model_fields
            if name not in ("mass", "compared") and (value := getattr(self, name)) is not None
        }
        rest = {} if self.file is None else {"layout": self.layout, "time": self.time}
        return force.model_copy(update={"bits": None, **rest, **given})


class FramesSection(Section):
    """[frames]: the times of the pictures."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name
    time: TimeColumn
    static: Annotated[int, Field(ge=3)]
    clock_offset: f.Time


class FlyerSection(Section):
    """[flyer]: the flyer's displacement frame by frame."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name
    time: TimeColumn | None = None
    displacement: LengthColumn
    positive: Literal["toward specimen", "away from specimen"]
    sigma: f.Length


class CentreLineSection(Section):
    """[centre_line]: the specimen's outline frame by frame."""

    file: f.FileName
    layout: TextLayoutSection | None = None
    frame: f.Name
    time: TimeColumn | None = None
    y: LengthColumn
    Z: LengthColumn
    y_offset: f.Offset
    Z_offset: f.Offset
    sigma: f.Length | None = None
    sigma_column: LengthColumn | None = None

    @model_validator(mode="after")
    def _one_sigma(self) -> "CentreLineSection":
        self.exactly_one(
            ("sigma", "sigma_column"),
            'give either sigma = "4 um" for all points or sigma_column with column and unit',
        )
        return self


Axis = Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"]


def _place(values: object) -> tuple[float, float, float]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise f.problem("is not a place", cure='write three lengths, e.g. ["0 mm", "-3.2 mm", "0 mm"]')
    x, y, z = (f.length(text) for text in values)
    return x, y, z


def _program(name: object) -> str:
    if name not in LAYOUTS:
        raise f.problem("is not known", allowed="one of " + ", ".join(f'"{known}"' for known in LAYOUTS))
    return str(name)


class FlyerAreaSection(Section):
    """[surface.flyer]: the export of an area on the flyer."""

    pattern: f.FilePattern
    sigma: f.Length


class SurfaceSection(Section):
    """[surface]: the specimen's surface, one file per frame."""

    pattern: f.FilePattern
    program: Annotated[str, BeforeValidator(_program)]
    unit: Literal["m", "mm", "um", "µm", "in"] | None = None
    delimiter: str | None = None
    decimal: str | None = None
    y: Axis
    Z: Axis
    frame: Literal["declared", "cylinder"]
    origin: Annotated[tuple[float, float, float], BeforeValidator(_place)]
    half_width: f.Length
    sigma: f.Length
    flyer: FlyerAreaSection | None = None

    @model_validator(mode="after")
    def _two_axes(self) -> "SurfaceSection":
        if self.y[1] == self.Z[1]:
            raise f.problem(
                "is the axis of y too",
                key="Z",
                allowed=f"another axis than {self.y[1]}",
                cure="they are across",
            )
        return self
