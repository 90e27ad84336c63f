"""A whole shot.toml: its schema, and the file from text to SI values."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field, model_validator

from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile, parse_toml
from kolsky.schema import fields as f
from kolsky.schema.apparatus import (
    FlyerBodySection,
    InterfaceSection,
    ModelSection,
    SpecimenSection,
    TransmissionSection,
    UncertaintySection,
    WindowSection,
)
from kolsky.schema.bars import BarsSection, GaugesSection, RecorderSection, WavesSection
from kolsky.schema.fields import Section
from kolsky.schema.material import CurveSection, LawSection, RelaxationSection, chosen_baseline, one_baseline
from kolsky.schema.measured import (
    CentreLineSection,
    FlyerSection,
    ForceSection,
    FramesSection,
    IncidentForceSection,
    SurfaceSection,
)
from kolsky.schema.pictures import CalibrationSection, DicSection, PicturesSection, ReportingSection


class CommonTables(Section):
    """The tables of every shot for `identify`, in SI, independent of the measurement method."""

    format: Literal[1]
    name: f.Name | None = None
    material: f.Name | None = None
    group: f.Name | None = None
    rig: f.Name | None = None
    specimen: SpecimenSection
    interface: InterfaceSection
    curve: CurveSection | None = None
    law: LawSection | None = None
    model: ModelSection
    relaxation: RelaxationSection | None = None
    window: WindowSection = WindowSection()
    uncertainty: UncertaintySection | None = None

    @model_validator(mode="after")
    def _one_baseline(self) -> "CommonTables":
        one_baseline(self.curve, self.law)
        return self

    @property
    def baseline(self) -> CurveSection | LawSection:
        """The baseline to which m refers: [curve], or [law] if it is declared and is the baseline."""
        return chosen_baseline(self.curve, self.law)


class BarDrivenShotFile(CommonTables):
    """Tables for `identify` of a test with bars and gauges, see `kolsky.schema.bars`."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)


class ShotFile(CommonTables):
    """A whole shot.toml, in SI. Camera data are exports, pictures, or both."""

    transmission: TransmissionSection
    force: ForceSection
    incident_force: IncidentForceSection | None = None
    frames: FramesSection
    flyer: FlyerSection | None = None
    flyer_body: FlyerBodySection | None = None
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

    @model_validator(mode="after")
    def _incident_force_where_it_is_known(self) -> "ShotFile":
        force, body = self.incident_force, self.flyer_body
        if body is None or body.model == "rigid":
            return self
        depth, compared = body.transducer_depth, force is not None and force.compared
        if compared and depth is None:
            raise f.problem(
                "is missing; the incident force is compared, and what lies before its transducer is elastic",
                key="flyer_body.transducer_depth",
                cure='add it, or write model = "rigid": then incident_force.mass counts',
            )
        if depth is not None and not compared:
            raise f.problem(
                "is given, but the incident force is not compared, so it would have no effect",
                key="flyer_body.transducer_depth",
                cure="remove it, or add [incident_force] with compared = true",
            )
        return self

    @model_validator(mode="after")
    def _pictures_where_they_act(self) -> "ShotFile":
        if self.pictures is None:
            self.without(
                ("calibration", "dic", "reporting"),
                "there are no [pictures]",
                "remove the table, or add [pictures]",
            )
        return self

    def data_files(self) -> dict[str, str]:
        """The data files that this shot names individually: dotted key -> file name."""
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
    """A shot with exports of the whole surface from a DIC program."""

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
    """A shot with pictures, which kolsky correlates."""

    pictures: PicturesSection
    calibration: CalibrationSection
    dic: DicSection


class FullShotFile(ExportShotFile, PictureShotFile):
    """A shot with both; the exports are used for identification."""


def schema(content: dict[str, Any]) -> type[ShotFile]:
    """The schema of a file with pictures, with exports, or with both."""
    if "surface" in content:
        return SurfaceShotFile
    exports = any(name in content for name in ("flyer", "centre_line"))
    if "pictures" not in content:
        return ExportShotFile
    return FullShotFile if exports else PictureShotFile


@dataclass(frozen=True)
class ShotToml(TomlFile):
    """A valid shot file."""

    declared: ShotFile
    """Its declared values, in SI."""


Source = str | Path | TomlFile
"""A shot: its folder, its shot.toml, or the parsed shot file."""


def parsed(source: Source) -> TomlFile:
    """The parsed shot file of a folder. A parsed file is returned unchanged."""
    return source if isinstance(source, TomlFile) else parse_toml(find_shot_file(Path(source)))


def shot_toml(source: Source) -> ShotToml:
    """A whole shot file, validated. Several problems are raised as one `InputErrors`."""
    file = parsed(source)
    if isinstance(file, ShotToml):
        return file
    declared = file.validated(schema(file.content))
    return ShotToml(file.path, file.sha256, file.content, file.lines, declared)


def is_bar_driven(file: TomlFile) -> bool:
    """True if the gauges of bars measure motion and force of a shot, without cameras."""
    return bool({"gauges", "bars", "recorders"} & set(file.content)) and not {
        "flyer",
        "pictures",
        "frames",
    } & set(file.content)


SHOT_FILE = "shot.toml"


def find_shot_file(path: Path) -> Path:
    """The shot file of a folder, or the file itself."""
    if path.is_dir():
        if not (path / SHOT_FILE).exists():
            raise InputError(
                path,
                f"has no {SHOT_FILE}",
                cure=f"`kolsky new {path}` writes one to fill in, `kolsky new {path} --bars` one for a test "
                "between bars",
            )
        return path / SHOT_FILE
    if not path.exists():
        raise InputError(path, "there is no such folder or file", cure="give the folder of a shot")
    return path


def folder_of(folder_or_toml: str | Path) -> Path:
    """The folder of a shot, from its folder or its shot file."""
    path = Path(folder_or_toml)
    return path.parent if path.is_file() else path
