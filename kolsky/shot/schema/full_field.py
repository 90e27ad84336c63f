"""dic.toml: a measurement by image correlation alone, without a shot around it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from kolsky.shot.schema import fields as f
from kolsky.shot.schema.pictures import CalibrationSection, RegionSection
from kolsky.shot.schema.section import Section


class PlainRegion(RegionSection):
    """A region of the reference picture; it has no frame of its own."""

    @model_validator(mode="after")
    def _in_the_reference(self) -> "PlainRegion":
        if "frame" in self.model_fields_set:
            raise f.problem(
                "has no effect here", key="frame", cure="remove it: regions are those of dic.reference"
            )
        return self


class MeasurementSection(Section):
    """[dic]: what is measured, and how."""

    kind: Literal["plane", "surface", "cylinder"]
    region: PlainRegion | None = None
    exclude: list[PlainRegion] = Field(default_factory=list)
    mask: f.FileName | None = None
    reference: Annotated[int, Field(ge=0)] = 0
    static: Annotated[int, Field(ge=1)] = 1
    noise: Annotated[float, Field(gt=0.0)] | None = None
    subset: f.Subset = 21
    step: Annotated[int, Field(ge=1, le=100)] = 5
    shape: Literal["rigid", "affine", "quadratic"] = "affine"
    stereo_shape: Literal["affine", "quadratic"] | None = None
    prefilter: f.Prefilter = 0.0
    strain_window: f.StrainWindow = 5
    strain_order: Annotated[int, Field(ge=1, le=2)] = 1
    scale: f.Length | None = None
    radius: f.Length | None = None
    interval: f.PositiveTime | None = None

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> "MeasurementSection":
        only = {"scale": ("plane",), "radius": ("cylinder",), "stereo_shape": ("surface", "cylinder")}
        for key, kinds in only.items():
            if getattr(self, key) is not None and self.kind not in kinds:
                raise f.problem(
                    f'has no effect on the kind "{self.kind}"',
                    key=key,
                    cure=f"remove it: it belongs to {f.alternatives(kinds)}",
                )
        return self


class MeasuredSeries(Section):
    """The pictures of one camera; without `crop_offset` they are those of the whole sensor."""

    file: f.FileName | None = None
    pattern: f.FilePattern | None = None
    files: Annotated[list[f.FileName], Field(min_length=1)] | None = None
    crop_offset: f.Pixel = (0.0, 0.0)

    @model_validator(mode="after")
    def _one_source(self) -> "MeasuredSeries":
        given = [key for key in ("file", "pattern", "files") if getattr(self, key) is not None]
        if len(given) != 1:
            raise f.problem(
                f"is given beside {given[0]}" if given else "is missing",
                key=given[1] if given else "file",
                cure='give one of file = "cam0.tif", pattern = "cam0/*.png" for numbered pictures, or '
                'files = ["a.png", "b.png"] in their order',
            )
        return self

    @property
    def source(self) -> tuple[str, str | list[str]]:
        """Key and value of where the pictures are."""
        key = next(key for key in ("file", "pattern", "files") if getattr(self, key) is not None)
        return key, getattr(self, key)


class MeasurementPictures(Section):
    """[pictures]: the series of one camera, or of two."""

    camera_0: MeasuredSeries
    camera_1: MeasuredSeries | None = None
    bits: Annotated[int, Field(ge=1, le=16)] | None = None


class ExtensometerSection(Section):
    """[extensometers.NAME]: a virtual extensometer between two places of the reference picture."""

    ends: Annotated[list[f.Pixel], Field(min_length=2, max_length=2)]
    window: f.StrainWindow = 3


class MeasurementFile(Section):
    """A whole dic.toml."""

    dic: MeasurementSection
    pictures: MeasurementPictures
    calibration: CalibrationSection | None = None
    extensometers: dict[str, ExtensometerSection] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _cameras_of_the_kind(self) -> "MeasurementFile":
        one = self.dic.kind == "plane"
        if one and self.pictures.camera_1 is not None:
            raise f.problem(
                "is given, but a plane is measured by one camera",
                key="pictures",
                cure='remove camera_1, or write kind = "surface"',
            )
        if not one and self.pictures.camera_1 is None:
            raise f.problem(
                "has no camera_1", key="pictures", cure='add it, or write kind = "plane" for one camera'
            )
        if one and self.calibration is not None:
            raise f.problem(
                "has no effect on a plane", key="calibration", cure="remove it; dic.scale gives lengths"
            )
        if not one and self.calibration is None:
            raise f.problem("is missing", key="calibration", cure='add it, e.g. file = "rig.xml"')
        return self
