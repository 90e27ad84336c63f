"""The schema of shot.toml: its tables, in SI once they are read."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from kolsky.readers.table import Column
from kolsky.shotfiles import fields as f
from kolsky.shotfiles.bars import (
    BarsSection,
    GaugesSection,
    RecorderSection,
    WavesSection,
)
from kolsky.shotfiles.law import LawSection, one_baseline
from kolsky.shotfiles.layout import LayoutSection
from kolsky.shotfiles.pictures import CalibrationSection, DicSection, PicturesSection, ReportingSection
from kolsky.shotfiles.section import Section
from kolsky.shotfiles.surface import SurfaceSection
from kolsky.shotfiles.uncertainty import UncertaintySection


class ColumnSection(Section):
    """A column of a text file; once read, `unit` is the factor that leads to SI."""

    column: f.Name
    unit: float

    def as_column(self) -> Column:
        """What a reader needs to know."""
        return Column(name=self.column, factor=self.unit)


class TimeColumn(ColumnSection):
    """A column of times."""

    unit: f.TimeUnit


class LengthColumn(ColumnSection):
    """A column of lengths."""

    unit: f.LengthUnit


class VoltageColumn(ColumnSection):
    """A column of voltages."""

    unit: f.VoltageUnit


class StressColumn(ColumnSection):
    """A column of stresses."""

    unit: f.StressUnit


class RatioColumn(ColumnSection):
    """A column of plain ratios; the unit is "1" or "%"."""

    unit: f.RatioUnit


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


class ModeColumns(Section):
    """All columns whose names begin alike: each a standard uncertainty that moves all points together."""

    prefix: Annotated[str, Field(min_length=1)]
    unit: f.StressUnit


class CurveSection(Section):
    """[curve]: the quasi-static uniaxial curve."""

    file: f.FileName
    strain: RatioColumn
    stress: StressColumn
    convention: Literal["tension positive", "compression positive"]
    branch: Literal["compression", "tension"]
    relative_sigma: f.Share = 0.0
    sigma_floor: f.Stress = 0.0
    sigma: StressColumn | None = None
    modes: ModeColumns | None = None
    conditioned: f.FileName | None = None
    strain_rate: f.StrainRate | None = None

    @model_validator(mode="after")
    def _some_sigma(self) -> "CurveSection":
        columns = self.sigma is not None or self.modes is not None
        if "relative_sigma" not in self.model_fields_set and not columns:
            raise f.problem(
                "is missing",
                key="relative_sigma",
                cure='write the noise of the quasi-static test, e.g. "0.2 %"',
            )
        if self.relative_sigma == 0.0 and self.sigma_floor == 0.0 and not columns:
            raise f.problem(
                "is zero and so is sigma_floor, as if the curve had no uncertainty",
                key="relative_sigma",
                cure='write the noise of the quasi-static test, e.g. "0.2 %"',
            )
        return self


def chosen_baseline(curve: CurveSection | None, law: LawSection | None) -> CurveSection | LawSection:
    """[law] if it is there and is the baseline, else [curve]; `law.one_baseline` has seen both."""
    if law is not None and law.baseline:
        return law
    assert curve is not None  # the schema saw to it
    return curve


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


class ShotFile(Section):
    """A whole shot.toml, in SI: what the cameras saw is exported, in pictures, or both."""

    format: Literal[1]
    name: f.Name | None = None
    material: f.Name | None = None
    group: f.Name | None = None
    rig: f.Name | None = None
    specimen: SpecimenSection
    interface: InterfaceSection
    transmission: TransmissionSection
    force: ForceSection
    incident_force: IncidentForceSection | None = None
    frames: FramesSection
    flyer: FlyerSection | None = None
    centre_line: CentreLineSection | None = None
    surface: SurfaceSection | None = None
    pictures: PicturesSection | None = None
    calibration: CalibrationSection | None = None
    dic: DicSection | None = None
    reporting: ReportingSection | None = None
    bars: BarsSection | None = None
    recorders: dict[str, RecorderSection] = Field(default_factory=dict)
    gauges: GaugesSection | None = None
    waves: WavesSection | None = None
    uncertainty: UncertaintySection | None = None
    curve: CurveSection | None = None
    law: LawSection | None = None
    model: ModelSection
    window: WindowSection = WindowSection()

    @model_validator(mode="after")
    def _one_baseline(self) -> "ShotFile":
        one_baseline(self.curve, self.law)
        return self

    @property
    def baseline(self) -> CurveSection | LawSection:
        """What m refers to: [curve], or [law] where it is given and does not leave that to the curve."""
        return chosen_baseline(self.curve, self.law)

    @model_validator(mode="after")
    def _pictures_where_they_act(self) -> "ShotFile":
        for name in ("calibration", "dic", "reporting"):
            if self.pictures is None and getattr(self, name) is not None:
                raise f.problem(
                    "is given, but there are no [pictures], so it would have no effect",
                    key=name,
                    cure="remove the table, or add [pictures]",
                )
        return self

    def data_files(self) -> dict[str, str]:
        """The data files this shot names one by one: dotted key -> file name."""
        sections: dict[str, Any] = {
            "force": self.force,
            "incident_force": self.incident_force,
            "frames": self.frames,
            "flyer": self.flyer,
            "centre_line": self.centre_line,
            "pictures.camera_0": None if self.pictures is None else self.pictures.camera_0,
            "pictures.camera_1": None if self.pictures is None else self.pictures.camera_1,
            "calibration": self.calibration,
            "curve": self.curve,
        }
        return {
            f"{name}.file": section.file
            for name, section in sections.items()
            if section is not None and section.file is not None
        }


class ExportShotFile(ShotFile):
    """A shot with exports of a DIC program."""

    flyer: FlyerSection
    centre_line: CentreLineSection


class SurfaceShotFile(ShotFile):
    """A shot with the whole surface as a DIC program exports it."""

    surface: SurfaceSection

    @model_validator(mode="after")
    def _one_source_each(self) -> "SurfaceShotFile":
        if self.centre_line is not None:
            raise f.problem("is given, and so is [surface], which gives the outline too", key="centre_line")
        if (self.flyer is None) == (self.surface.flyer is None):
            raise f.problem(
                "is missing; [surface] has no flyer"
                if self.flyer is None
                else "is given twice: [surface.flyer]",
                key="flyer",
                cure="give [flyer] with a file of displacements, or [surface.flyer] with a pattern",
            )
        return self


class PictureShotFile(ShotFile):
    """A shot with pictures, to be correlated here."""

    pictures: PicturesSection
    calibration: CalibrationSection
    dic: DicSection


class FullShotFile(ExportShotFile, PictureShotFile):
    """A shot with both; the exports are identified from."""


def schema(content: dict[str, Any]) -> type[ShotFile]:
    """The schema that a file must satisfy: by whether it has pictures, exports, or both."""
    if "surface" in content:
        return SurfaceShotFile
    exports = any(name in content for name in ("flyer", "centre_line"))
    if "pictures" not in content:
        return ExportShotFile
    return FullShotFile if exports else PictureShotFile
