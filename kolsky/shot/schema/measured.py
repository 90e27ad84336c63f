"""The tables of shot.toml about what was measured: [force], [frames], [flyer], [centre_line]."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.columns import LengthColumn, TimeColumn, VoltageColumn
from kolsky.shot.schema.layout import LayoutSection
from kolsky.shot.schema.section import Section


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
                    f"is said twice, in layout.{key} too",
                    key="voltage" if key == "unit" else "time",
                    cure=f"leave layout.{key} out",
                )
        return self


class IncidentForceSection(Section):
    """[incident_force]: the flyer's own transducer, behind a mass that moves with the flyer.

    What is left out is as in [force]: both are usually channels of one recorder.
    """

    voltage: VoltageColumn
    sensitivity: f.Sensitivity
    mass: f.Mass
    file: f.FileName | None = None
    layout: LayoutSection | None = None
    time: TimeColumn | None = None
    compression: Literal["positive", "negative"] | None = None
    full_scale: f.Voltage | None = None
    time_constant: f.PositiveTime | None = None
    baseline: f.Interval | None = None
    clock_offset: f.Time | None = None

    def completed(self, force: ForceSection) -> ForceSection:
        """The channel with what [force] says of the rest; another file has its own layout or time column."""
        given = {
            name: value
            for name in IncidentForceSection.model_fields
            if name != "mass" and (value := getattr(self, name)) is not None
        }
        rest = {} if self.file is None else {"layout": self.layout, "time": self.time}
        return force.model_copy(update={"bits": None, **rest, **given})


class FramesSection(Section):
    """[frames]: when the cameras took their pictures."""

    file: f.FileName
    frame: f.Name
    time: TimeColumn
    static: Annotated[int, Field(ge=3)]
    clock_offset: f.Time


class FlyerSection(Section):
    """[flyer]: the flyer's displacement frame by frame."""

    file: f.FileName
    frame: f.Name
    time: TimeColumn | None = None
    displacement: LengthColumn
    positive: Literal["toward specimen", "away from specimen"]
    sigma: f.Length


class CentreLineSection(Section):
    """[centre_line]: the specimen's outline frame by frame."""

    file: f.FileName
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
        if (self.sigma is None) == (self.sigma_column is None):
            raise f.problem(
                "is missing" if self.sigma is None else "is given twice, once as sigma_column",
                key="sigma",
                cure='give either sigma = "4 um" for all points or sigma_column with column and unit',
            )
        return self
